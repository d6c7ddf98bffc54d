//! `hybank verify` as a user runs it, and random mutations of bank files: none may pass.
//!
//! A mutation is any change of the text after which it no longer says the same: another number, key, text or
//! structure. Changes of layout, and of digits beyond the precision of a double, are none.
//! `HYBANK_CAMPAIGN=50` makes 50 times as many.

use crate::support::random::Random;
use crate::support::{Desk, THESIS, repository};
use hybank::bank::{Bank, check_digest};
use hybank::design::{DesignOptions, design, prove};
use hybank::spec::Spec;
use hybank::verify::verify;
use serde_json::Value;
use std::fs;
use std::ops::Range;
use std::path::PathBuf;

/// The thesis example with little latency and few taps.
fn hurried() -> String {
    THESIS.replace("latency = 10", "latency = 1").replace("taps = 22", "taps = 12")
}

fn designed(method: &str) -> Bank {
    let text = match method {
        "fir" => hurried(),
        "reduced" => hurried().replace("\"fir\"\ntaps = 12", "\"iir\"\norder = 1"),
        _ => hurried().replace("\"fir\"\ntaps = 12", &format!("\"{method}\"")),
    };
    let design = design(&Spec::from_toml(&text, "spec.toml").unwrap(), &DesignOptions::default()).unwrap();
    assert!(design.proof.is_ok(), "{:?}", design.proof);
    design.bank
}

/// Texts of bank files: two made here, and those of `filters/`.
fn files() -> Vec<(String, String)> {
    let made =
        ["fir", "iir", "reduced"].map(|method| (method.to_owned(), designed(method).to_json().unwrap()));
    let folder = repository("filters");
    let mut ready: Vec<PathBuf> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    ready.retain(|path| path.extension().is_some_and(|extension| extension == "json"));
    ready.sort();
    let named = |path: PathBuf| (path.display().to_string(), fs::read_to_string(&path).unwrap());
    made.into_iter().chain(ready.into_iter().map(named)).collect()
}

/// What the command does with a file that has a digest and a certificate.
fn accepted(text: &str) -> Result<(), String> {
    let bank = Bank::from_json(text, "b.json").map_err(|error| error.to_string())?;
    match check_digest(text, "b.json") {
        Ok(true) => {}
        Ok(false) => return Err("no digest".into()),
        Err(error) => return Err(error.to_string()),
    }
    verify(&bank).map(drop).map_err(|error| error.to_string())
}

/// Places of the numbers of a text: start and end.
fn numbers(text: &str) -> Vec<(usize, usize)> {
    let bytes = text.as_bytes();
    let part = |i: usize| matches!(bytes[i], b'0'..=b'9' | b'.' | b'-' | b'+' | b'e');
    let starts =
        |i: usize| (bytes[i].is_ascii_digit() || bytes[i] == b'-') && matches!(bytes[i - 1], b' ' | b'[');
    let end = |i: usize| (i..bytes.len()).find(|&k| !part(k)).unwrap_or(bytes.len());
    (1..bytes.len()).filter(|&i| starts(i)).map(|i| (i, end(i))).collect()
}

fn replaced(text: &str, place: Range<usize>, by: &str) -> String {
    format!("{}{by}{}", &text[..place.start], &text[place.end..])
}

fn mutated(text: &str, dice: &mut Random) -> String {
    let numbers = numbers(text);
    let at = dice.of(&numbers);
    let old = &text[at.0..at.1];
    match dice.below(8) {
        // One digit of one number.
        0..=2 => {
            let digits: Vec<usize> = (at.0..at.1).filter(|&i| text.as_bytes()[i].is_ascii_digit()).collect();
            let place = dice.of(&digits);
            replaced(text, place..place + 1, &dice.below(10).to_string())
        }
        // Another number, or none.
        3 => {
            let value: f64 = old.parse().unwrap();
            let near =
                [value * (1.0 + 1e-15), value * (1.0 - 1e-9), -value, value + 1e-12, 2.0 * value, 0.0, 1.0];
            replaced(text, at.0..at.1, &format!("{:?}", dice.of(&near)))
        }
        4 => replaced(text, at.0..at.1, dice.of(&["null", "true", "\"x\"", "[]", "1e999", "-1"])),
        // Two numbers exchanged.
        5 => {
            let other = dice.of(&numbers);
            let (first, second) = if at < other { (at, other) } else { (other, at) };
            let later = replaced(text, second.0..second.1, &text[first.0..first.1]);
            if first == second {
                later
            } else {
                replaced(&later, first.0..first.1, &text[second.0..second.1])
            }
        }
        // A list loses or doubles an entry.
        6 => match dice.below(2) {
            0 => replaced(text, at.0..at.1, &format!("{old}, {old}")),
            _ => replaced(text, at.0..(at.1 + 2).min(text.len()), ""),
        },
        // Any character.
        _ => {
            let place = dice.below(text.len() - 1);
            let put = ["", "0", "9", "-", ".", "a", "\"", "]", "}", ","];
            replaced(text, place..place + 1, dice.of(&put))
        }
    }
}

/// Whether two texts say the same, numbers compared as doubles to the bit.
fn same(a: &Value, b: &Value) -> bool {
    match (a, b) {
        (Value::Number(x), Value::Number(y)) => x.as_f64().map(f64::to_bits) == y.as_f64().map(f64::to_bits),
        (Value::Array(x), Value::Array(y)) => x.len() == y.len() && x.iter().zip(y).all(|(x, y)| same(x, y)),
        (Value::Object(x), Value::Object(y)) => {
            x.len() == y.len()
                && x.iter().all(|(key, value)| y.get(key).is_some_and(|other| same(value, other)))
        }
        _ => a == b,
    }
}

fn says_the_same(original: &Value, text: &str) -> bool {
    serde_json::from_str(text).is_ok_and(|other| same(original, &other))
}

#[test]
fn every_mutation_of_a_bank_file_is_refused() {
    let count = trials::rounds(400);
    let files: Vec<(String, String, Value)> = files()
        .into_iter()
        .map(|(name, text)| {
            accepted(&text).unwrap_or_else(|error| panic!("{name}: {error}"));
            let value = serde_json::from_str(&text).unwrap();
            (name, text, value)
        })
        .collect();
    let mut dice = Random(2026);
    let (mut refused, mut unchanged) = (0, 0);
    while refused < count {
        let (name, text, value) = &files[dice.below(files.len())];
        let mutation = mutated(text, &mut dice);
        if says_the_same(value, &mutation) {
            unchanged += 1;
            continue;
        }
        let error = accepted(&mutation).expect_err(&format!("{name}: a mutation passed:\n{mutation}"));
        assert!(error.len() > 10, "{error}");
        refused += 1;
    }
    println!("{refused} mutations refused, {unchanged} changes change nothing");
}

/// A bank without digest and proof is proven afresh, to the same ends.
#[test]
fn a_bank_made_elsewhere_is_proven_afresh() {
    let is_slow = trials::is_slow("banks of more than 32 states, proven afresh");
    for (name, text) in files() {
        let bank = Bank::from_json(&text, &name).unwrap();
        let states = bank.proof.as_ref().map_or(0, |proof| proof.upper.factor.len());
        if states > 32 && !is_slow {
            continue;
        }
        let known = verify(&bank).unwrap();
        let bare = Bank { proof: None, ..bank };
        let (_, found) = prove(&bare).unwrap();
        assert!((found.upper / known.upper - 1.0).abs() < 1e-6, "{name}");
    }
}

/// A folder with the bank of [`hurried`], designed by the program.
fn desk() -> Desk {
    let desk = Desk::with_spec(&hurried());
    desk.warned(&["design", "--prove", "spec.toml", "-o", "bank.json"], &[]);
    desk
}

fn pretty(value: &Value) -> String {
    serde_json::to_string_pretty(value).unwrap()
}

#[test]
fn a_designed_bank_verifies() {
    let desk = desk();
    let out = desk.good(&["verify", "bank.json"]);
    for part in ["proven, gamma in [0.0694", "from the file", "digest     matches"] {
        assert!(out.contains(part), "{part} in {out}");
    }
    let report = desk.json(&["verify", "bank.json", "--json"]);
    let bank = desk.read_json("bank.json");
    let norm = bank["gamma"]["norm"].as_f64().unwrap();
    assert!(report["attained"].as_f64() <= Some(norm) && report["upper"].as_f64() >= Some(norm), "{report}");
    assert_eq!(report["upper"], bank["gamma"]["upper"]);
    assert_eq!((&report["digest"], &report["certificate_in_file"]), (&Value::Bool(true), &Value::Bool(true)));
    assert!(desk.good(&["verify", "--help"]).contains("Examples:"));
    // Another layout of the same content is the same bank.
    desk.write("loose.json", pretty(&bank));
    assert!(desk.good(&["verify", "loose.json"]).contains("digest     matches"));
    let mut altered = bank;
    altered["latency"] = 2.into();
    altered["spec"]["latency"] = 2.into();
    desk.write("altered.json", pretty(&altered));
    desk.refused(1, &["verify", "altered.json"], &["altered.json: digest: ", "altered"]);
}

#[test]
fn a_bank_without_proof_is_proven_afresh_by_the_verb() {
    let desk = desk();
    let mut bank = desk.read_json("bank.json");
    (bank["proof"], bank["digest"], bank["gamma"]) = (Value::Null, Value::Null, Value::Null);
    desk.write("bare.json", pretty(&bank));
    let out = desk.good(&["verify", "bare.json", "--search"]);
    assert!(out.contains("found now") && out.contains("the file has none"), "{out}");
    let report = desk.json(&["verify", "bare.json", "--search", "--json"]);
    let known = desk.json(&["verify", "bank.json", "--json"]);
    let upper = |report: &Value| report["upper"].as_f64().unwrap();
    assert!((upper(&report) / upper(&known) - 1.0).abs() < 1e-6, "{report} {known}");
    // It is analysed as before.
    assert!(desk.good(&["analyze", "bare.json"]).contains("worst-case gain"));
}
