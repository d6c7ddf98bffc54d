//! Taps that are chosen for an SNR.

use crate::support::{Desk, THESIS, number, words};

#[test]
fn taps_are_chosen_for_an_snr() {
    let desk = Desk::with_spec(THESIS);
    let snr = |name: &str, flags: &[&str]| {
        let report = desk.json(&[&["design", "spec.toml", "-o", name, "--json"], flags].concat());
        (report["taps"].as_u64().unwrap(), number(&report, "/figures/snr/total_db"))
    };
    let (taps, reached) = snr("snr.json", &["--method", "h2", "--snr", "21"]);
    assert!((21.0..22.4).contains(&reached), "{taps} taps, {reached} dB");
    let fewer = format!("{}", taps - 1);
    assert!(snr("fewer.json", &["--method", "h2", "--taps", &fewer]).1 < 21.0);
    // The spec in the bank is the wish; the taps are there, and the report says that their number was
    // chosen.
    let bank = desk.read_json("snr.json");
    let design = &bank["spec"]["design"];
    assert!(bank["method"] == "h2" && design["taps"].is_null(), "{design}");
    assert_eq!(design["target_snr_db"], 21.0);
    assert_eq!(bank["channels"][0]["taps"].as_array().map(Vec::len), Some(taps as usize));
    let text = desk.good(&words("design spec.toml -o again.json --method h2 --snr 21 --verbose"));
    assert!(text.contains("(chosen; set `taps` to change it)"), "{text}");
    let far = words("design spec.toml -o no.json --method h2 --snr 90");
    desk.refused(1, &far, &["out of reach", "more than"]);
}
