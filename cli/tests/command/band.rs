//! The signal's band in a new user's first result.

use crate::calibrate::design;
use crate::support::{Desk, repository};
use serde_json::Value;
use std::fs;

/// The value at a pointer of a report.
fn number(report: &Value, pointer: &str) -> f64 {
    report.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("{pointer} in {report}"))
}

/// The first block of a language in README.md.
fn readme_block(language: &str) -> String {
    let readme = fs::read_to_string(repository("README.md")).unwrap();
    let start = readme.find(&format!("```{language}\n")).unwrap() + language.len() + 4;
    let end = readme[start..].find("```").unwrap();
    readme[start..start + end].to_owned()
}

/// README's spec and its commands, whose blocks run in `docs.rs` too: the promise, what is measured, and the
/// spline.
#[test]
fn the_first_result_keeps_its_promise_and_beats_the_spline() {
    let desk = Desk::with_spec(&readme_block("toml"));
    design(&desk, "spec.toml");
    let promised = desk.json(&["analyze", "bank.json", "--json"]);
    desk.good(&["simulate", "bank.json", "--source", "chirp:50Hz..13kHz@1s", "-o", "captures"]);
    desk.good(&["fuse", "bank.json", "captures/ch1.wav", "captures/ch2.wav", "-o", "fused.wav"]);
    let found = desk.json(&["measure", "fused.wav", "--ref", "captures/target.wav", "--json"]);
    let (snr, measured) =
        (number(&promised, "/figures/snr/total_db"), number(&found, "/reference/snr_unaligned_db"));
    assert!(snr > 138.0 && measured > 135.0, "{snr} {measured}");
    assert_eq!(promised.pointer("/figures/usual_ways/0/way").unwrap(), "cubic-spline");
    let spline = number(&promised, "/figures/usual_ways/0/snr_db");
    assert!((36.0..39.0).contains(&spline) && measured > spline + 95.0, "{spline}");
    assert!(number(&found, "/reference/lag_samples/value").abs() < 1e-6, "{found}");
}
