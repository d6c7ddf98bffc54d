//! `hybank analyze` over boxes of errors.

use crate::calibrate::design;
use crate::support::{Desk, THESIS};
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
fn the_worst_case_has_a_bound_and_is_attained() {
    let desk = desk();
    let all =
        desk.json(&["analyze", "bank.json", "--delay-box", "0.1samples", "--reference", "none", "--json"]);
    let case = &all["worst_case"];
    let (attained, upper) = (number(&case["attained"]), number(&case["upper"]));
    assert!((attained / 0.0478338 - 1.0).abs() < 1e-3 && upper > attained, "{case}");
    assert_eq!(case["point"]["delays"].as_array().unwrap().len(), 2);
    // Small boxes have a close bound.
    for width in ["0.001samples", "0.01samples"] {
        let all = desk.json(&["analyze", "bank.json", "--delay-box", width, "--reference", "none", "--json"]);
        let [attained, upper] = ["attained", "upper"].map(|key| number(&all["worst_case"][key]));
        assert!(upper > attained && upper <= 1.5 * attained, "{width}: {attained} {upper}");
    }
    let one = desk.json(&["analyze", "bank.json", "--delay-box", "0.1samples", "--json"]);
    assert_eq!(one["worst_case"]["errors"]["delays"], serde_json::json!([0.0, 0.1]));
    assert!(number(&one["worst_case"]["upper"]) < upper);
}

/// The figures with other delays are those of a bank whose spec has them.
#[test]
fn figures_with_errors_are_computed_there() {
    let desk = desk();
    let found = desk.json(&["analyze", "bank.json", "--delay-error", "0.01,-0.02", "--json"]);
    let mut bank: Value = serde_json::from_slice(&desk.read("bank.json")).unwrap();
    for (channel, delay) in [(0, 1.21), (1, 0.58)] {
        bank["spec"]["channel"][channel]["delay"] = delay.into();
        bank["channels"][channel]["delay"] = delay.into();
    }
    bank.as_object_mut().unwrap().retain(|key, _| key != "digest" && key != "proof" && key != "gamma");
    desk.write("moved.json", bank.to_string());
    let moved = desk.json(&["analyze", "moved.json", "--json"]);
    let (at, there) = (&found["with_errors"], &moved["figures"]);
    assert!((number(&at["snr_db"]) - number(&there["snr"]["total_db"])).abs() < 1e-6, "{at} {there}");
    assert!((number(&at["image_db"]) - number(&there["image"]["db"])).abs() < 1e-6, "{at} {there}");
    assert!(number(&at["image_db"]) > number(&found["figures"]["image"]["db"]), "{found}");
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

/// A gamma of 4e-10 is printed with its digits, not as 0.000000000.
#[test]
fn tiny_numbers_have_digits() {
    let spec = THESIS.replace("num = [0.25], den = [1.0, 1.0, 0.25]", TINY);
    assert_ne!(spec, THESIS);
    let desk = Desk::with_spec(&spec);
    design(&desk, "spec.toml");
    let told = desk.good(&["analyze", "bank.json", "--delay-box", "1e-9samples"]);
    for line in ["gamma", "noncausal", "rms error", "worst case", "attained"] {
        let found = told.lines().find(|text| text.starts_with(line)).unwrap();
        assert!(found.contains("e-10 "), "{found}");
    }
}

/// A filter of eight poles far below the fast rate.
const TINY: &str = "family = \"chebyshev1\", order = 8, cutoff = 0.05, ripple_db = 0.5";
