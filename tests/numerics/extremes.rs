//! Numbers far beyond what any converter has, in every numeric key of specs and banks: an answer, or a
//! message that names the key or the filter; never the words of a decomposition.

use crate::support::random::Random;
use hybank::bank::Bank;
use hybank::design::{DesignError, DesignOptions, ProofSearch, analyze, design};
use hybank::spec::{DesignOverrides, Spec};
use serde_json::Value;
use trials::rounds;

const EXTREMES: [f64; 14] =
    [0.0, -0.0, 5e-324, 1e-300, 1e-155, -1e-155, 1e-30, 1e30, 1e100, 1e155, -1e155, 1e200, 1e300, -1e308];

/// Specs with every form of a filter and every table.
const SPECS: [&str; 6] = [
    r#"{"fast_period": 1, "ratio": 2, "latency": 4, "target": {"filter": {"num": [0.25], "den": [1, 1, 0.25]}},
        "channel": [{"delay": 1.2, "noise": 1e-4, "gain": 1.1, "offset": 0.1}, {"delay": 0.6, "jitter": 1e-3}],
        "design": {"method": "fir", "taps": 8}}"#,
    r#"{"fast_period": 2e-5, "ratio": 2, "latency": 4, "target": {"filter": {"zeros": [[-9e5, 0]], "poles": [[-6e4, 1e4], [-6e4, -1e4]], "gain": 4000}},
        "channel": [{"delay": 2.4e-5}, {"delay": 1.2e-5}], "design": {"method": "iir", "order": 4}}"#,
    r#"{"fast_period": 1, "ratio": 2, "latency": 4, "target": {"filter": {"a": [[-1, 0.5], [0, -2]], "b": [[0], [1]], "c": [[1, 0]]}},
        "channel": [{"delay": 1.2}, {"delay": 0.6, "filter": {"a": [[-1]], "b": [[1]], "c": [[1]]}}], "design": {"method": "h2"}}"#,
    r#"{"fast_rate": 48000, "ratio": 2, "latency": 4, "target": {"filter": {"family": "elliptic", "order": 3, "cutoff": 9000, "ripple_db": 1, "attenuation_db": 40}},
        "channel": [{"delay": 2.5e-5}, {"delay": 1.25e-5, "filter": {"family": "rc", "cutoff": 1e4}}],
        "signal": {"band": 8000, "floor_db": 60, "rms": 0.25}, "design": {"method": "h2", "taps": 8}}"#,
    r#"{"fast_rate": 48000, "ratio": 2, "latency": 4, "target": {"filter": {"family": "butterworth", "order": 2, "band": [1000, 9000]}},
        "channel": [{"delay": 2.5e-5}, {"delay": 1.25e-5}], "signal": {"filter": {"num": [1e4], "den": [1, 5e4]}},
        "uncertainty": {"gain": 0.01, "cutoff": 0.01}, "design": {"method": "fir", "taps": 6}}"#,
    r#"{"fast_period": 1, "ratio": 2, "latency": 4, "target": {"filter": {"cascade": [{"num": [1], "den": [1, 1]}, {"family": "rc", "cutoff": 0.2}]}},
        "channel": [{"delay_samples": 1.2}, {"delay_samples": 0.6}], "design": {"method": "fir", "taps": 8, "bits": 8, "fraction_bits": 6, "gamma_margin": 0.01}}"#,
];

/// The paths of all numbers in a document.
fn leaves(value: &Value, path: &str) -> Vec<String> {
    match value {
        Value::Number(_) => vec![path.to_owned()],
        Value::Array(items) => {
            items.iter().enumerate().flat_map(|(i, item)| leaves(item, &format!("{path}/{i}"))).collect()
        }
        Value::Object(members) => {
            members.iter().flat_map(|(key, item)| leaves(item, &format!("{path}/{key}"))).collect()
        }
        _ => Vec::new(),
    }
}

/// What a decomposition says, in which no user can find the number.
fn is_raw(message: &str) -> bool {
    let words = ["holds a value that is not finite", "did not converge", "iteration", "NaN", "inf "];
    words.iter().any(|word| message.contains(word))
}

/// Designs without a proof, for so long at most as such small designs take.
fn designed(spec: &Value) -> Result<Bank, String> {
    let no_files = |_: &_| Err("no files".to_owned());
    let spec = Spec::from_data(spec, "spec", DesignOverrides::default(), &no_files);
    let spec = spec.map_err(|error| error.to_string())?;
    let options = DesignOptions { proof: ProofSearch::Skip, ..DesignOptions::default() };
    match design(&spec, &options) {
        Ok(found) => Ok(found.bank),
        Err(error @ (DesignError::Lti(_) | DesignError::Linalg(_))) => {
            Err(format!("raw: {error}, iteration"))
        }
        Err(error) => Err(error.to_string()),
    }
}

#[test]
fn extreme_numbers_of_specs_are_refused_by_their_key() {
    let (mut answers, mut refusals) = (0, 0);
    // Else every other one, in turns.
    let step = if trials::is_slow("every extreme number in every key of a spec") { 1 } else { 2 };
    for text in SPECS {
        let spec: Value = serde_json::from_str(text).unwrap();
        designed(&spec).unwrap();
        for (number, path) in leaves(&spec, "").into_iter().enumerate() {
            for extreme in EXTREMES.into_iter().skip(number % step).step_by(step) {
                let mut changed = spec.clone();
                *changed.pointer_mut(&path).unwrap() = extreme.into();
                match designed(&changed) {
                    Ok(bank) => {
                        answers += 1;
                        assert_eq!(bank.check(), Ok(()), "{path} = {extreme:e}");
                    }
                    Err(message) => {
                        refusals += 1;
                        assert!(!is_raw(&message), "{path} = {extreme:e}: {message}\n{text}");
                    }
                }
            }
        }
    }
    println!("{answers} answers, {refusals} refusals");
    assert!(answers > 30 && refusals > 300, "{answers} {refusals}");
}

#[test]
fn extreme_numbers_of_banks_are_refused_by_their_key() {
    let (mut answers, mut refusals, mut dice) = (0, 0, Random(155));
    for text in [SPECS[0], SPECS[1], SPECS[5]] {
        let bank = designed(&serde_json::from_str(text).unwrap()).unwrap();
        let bank: Value = serde_json::from_str(&bank.to_json().unwrap()).unwrap();
        let paths = leaves(&bank, "");
        for _ in 0..rounds(200) {
            let (path, extreme) = (&paths[dice.below(paths.len())], EXTREMES[dice.below(EXTREMES.len())]);
            let mut changed = bank.clone();
            *changed.pointer_mut(path).unwrap() = extreme.into();
            let read = Bank::from_json(&changed.to_string(), "bank").map_err(|error| error.to_string());
            let judged = read.and_then(|bank| analyze(&bank, &[]).map_err(|error| error.to_string()));
            match judged {
                Ok(judged) => {
                    answers += 1;
                    assert!(judged.gamma.is_finite(), "{path} = {extreme:e}");
                }
                Err(message) => {
                    refusals += 1;
                    assert!(!is_raw(&message), "{path} = {extreme:e}: {message}");
                }
            }
        }
    }
    println!("{answers} answers, {refusals} refusals");
    assert!(answers > 50 && refusals > 50, "{answers} {refusals}");
}
