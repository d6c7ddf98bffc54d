//! `hybank analyze` over boxes of errors.

use crate::support::{Desk, THESIS, text};
use serde_json::Value;

fn desk() -> Desk {
    let desk = Desk::with_spec(THESIS);
    desk.good(&["design", "spec.toml", "-o", "bank.json"]);
    desk
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value}"))
}

/// The table of the documentation; the reference is exact unless there is none.
#[test]
fn the_worst_case_has_two_ends() {
    let desk = desk();
    let all =
        desk.json(&["analyze", "bank.json", "--delay-box", "0.1samples", "--reference", "none", "--json"]);
    let case = &all["worst_case"];
    let (lower, upper) = (number(&case["lower"]), number(&case["upper"]));
    assert!((lower / 0.0478338 - 1.0).abs() < 1e-3 && upper <= 1.0101 * lower, "{case}");
    assert_eq!(case["point"]["delays"].as_array().unwrap().len(), 2);
    let one = desk.json(&["analyze", "bank.json", "--delay-box", "0.1samples", "--json"]);
    assert_eq!(one["worst_case"]["errors"]["delays"], serde_json::json!([0.0, 0.1]));
    assert!(number(&one["worst_case"]["upper"]) < lower);
    assert!(number(&all["worst_case"]["floor"]["common_shift"]) > 0.0256);
    assert_eq!(number(&one["worst_case"]["floor"]["common_shift"]), 0.0);
}

#[test]
fn the_affordable_part_is_within_the_loss() {
    let desk = desk();
    let found = desk.json(&["analyze", "bank.json", "--delay-box", "0.1s", "--accuracy", "2%", "--json"]);
    let affordable = &found["worst_case"]["affordable"];
    let factor = number(&affordable["factor"]);
    assert!(factor > 0.05 && factor < 1.0 && number(&affordable["loss"]) == 0.02, "{affordable}");
    let delay = format!("{}", number(&affordable["errors"]["delays"][1]));
    let there = desk.json(&["analyze", "bank.json", "--delay-box", &delay, "--json"]);
    assert!(number(&there["worst_case"]["lower"]) <= 1.02 * number(&there["gamma"]), "{there}");
}

#[test]
fn a_sweep_is_a_table_or_a_picture() {
    let desk = desk();
    desk.good(&["analyze", "bank.json", "--delay-box", "0.1", "--reference", "none", "--sweep", "s.csv"]);
    let table = String::from_utf8(desk.read("s.csv")).unwrap();
    let lines: Vec<&str> = table.lines().collect();
    assert_eq!((lines.len(), lines[0].split(',').count()), (42, 4), "{table}");
    // The middle row is the bank with its own delays.
    let gamma = number(&desk.json(&["analyze", "bank.json", "--json"])["gamma"]);
    for cell in lines[21].split(',').skip(1) {
        assert!((cell.parse::<f64>().unwrap() / gamma - 1.0).abs() < 1e-9, "{cell}");
    }
    desk.good(&["analyze", "bank.json", "--delay-box", "0.1", "--sweep", "s.svg"]);
    assert!(String::from_utf8(desk.read("s.svg")).unwrap().starts_with("<svg"));
    desk.refused(
        1,
        &["analyze", "bank.json", "--delay-box", "0.1", "--sweep", "s.svg"],
        &["s.svg", "--force"],
    );
    desk.refused(
        1,
        &["analyze", "bank.json", "--delay-box", "0.1", "--sweep", "bank.json", "--force"],
        &["bank.json"],
    );
}

#[test]
fn flags_that_do_not_fit_are_refused() {
    let desk = desk();
    let refused =
        |args: &[&str], words: &[&str]| desk.refused(2, &[&["analyze", "bank.json"], args].concat(), words);
    refused(&["--delay-box", "1,2,3"], &["--delay-box", "3 values", "2 channels"]);
    refused(&["--delay-box", "10 parsecs"], &["parsecs", "10ps"]);
    refused(&["--delay-box=-1ps"], &["half-width"]);
    refused(&["--gain-box", "60%"], &["50%"]);
    refused(&["--delay-box", "1ps", "--reference", "3"], &["--reference 3", "2 channels"]);
    refused(&["--delay-box", "1ps", "--reference", "first"], &["none"]);
    refused(&["--accuracy", "1%"], &["--accuracy", "--delay-box"]);
    refused(&["--sweep", "x.csv"], &["--sweep", "--delay-box"]);
    refused(&["--delay-box", "1ps", "--delay-error", "0,0"], &["--delay-error"]);
    refused(&["--delay-error", "0,1 parsec"], &["parsec", "10ps"]);
}

#[test]
fn errors_of_delays_have_units() {
    let desk = desk();
    let gamma = |errors: &str| {
        desk.json(&["analyze", "bank.json", "--delay-error", errors, "--json"])["gamma"].clone()
    };
    let in_seconds = gamma("1e-3,-2e-3");
    assert_eq!(gamma("1ms,-2ms"), in_seconds);
    assert_ne!(gamma("0,0"), in_seconds);
}

/// Two delays that doubles do not resolve: the bound is unknown, not zero.
#[test]
fn an_unknown_noncausal_bound_is_called_unknown() {
    let desk = desk();
    let output = desk.run(&["analyze", "bank.json", "--delay-error", "0,0.6000000000001"], &[]);
    assert!(output.status.success(), "{output:?}");
    let line = text(&output.stdout).lines().find(|line| line.starts_with("noncausal")).unwrap().to_owned();
    assert!(line.contains("unknown") && !line.contains("0.0000"), "{line}");
    let json = desk.json(&["analyze", "bank.json", "--delay-error", "0,0.6000000000001", "--json"]);
    assert_eq!(json["noncausal"], Value::Null);
}

/// A gamma of 4e-10 is printed with its digits, not as 0.000000000.
#[test]
fn tiny_numbers_have_digits() {
    let spec = THESIS.replace("num = [0.25], den = [1.0, 1.0, 0.25]", TINY);
    assert_ne!(spec, THESIS);
    let desk = Desk::with_spec(&spec);
    desk.good(&["design", "spec.toml", "-o", "bank.json"]);
    let told = desk.good(&["analyze", "bank.json", "--delay-box", "1e-9samples"]);
    for line in ["gamma", "noncausal", "rms error", "worst case", "floor"] {
        let found = told.lines().find(|text| text.starts_with(line)).unwrap();
        assert!(found.contains("e-10 "), "{found}");
    }
}

/// A filter of eight poles far below the fast rate.
const TINY: &str = "family = \"chebyshev1\", order = 8, cutoff = 0.05, ripple_db = 0.5";
