//! Taps that are chosen: for an SNR, or because the spec leaves them open.

use crate::support::{Desk, THESIS, number};

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
    assert_eq!(
        (&bank["method"], &design["taps"], design["target_snr_db"].as_f64()),
        (&"h2".into(), &serde_json::Value::Null, Some(21.0))
    );
    assert_eq!(bank["channels"][0]["taps"].as_array().map(Vec::len), Some(taps as usize));
    let text =
        desk.good(&["design", "spec.toml", "-o", "again.json", "--method", "h2", "--snr", "21", "--verbose"]);
    assert!(text.contains("(chosen; set `taps` to change it)"), "{text}");
    desk.refused(
        1,
        &["design", "spec.toml", "-o", "no.json", "--method", "h2", "--snr", "90"],
        &["out of reach", "more than"],
    );
}

#[test]
fn taps_are_chosen_for_images() {
    let band = THESIS.replace("[target]", "[signal]\nband = 0.3\n\n[target]");
    let desk = Desk::with_spec(&band);
    let image = |name: &str, flags: &[&str]| {
        let all = [&["design", "spec.toml", "-o", name, "--method", "h2", "--json"], flags].concat();
        let report = desk.json(&all);
        (report["taps"].as_u64().unwrap(), number(&report, "/figures/image/db"))
    };
    let (taps, reached) = image("sfdr.json", &["--sfdr", "60"]);
    let fewer = format!("{}", taps - 1);
    assert!(
        reached <= -60.0 && image("fewer.json", &["--taps", &fewer]).1 > -60.0,
        "{taps} taps, {reached} dB"
    );
    desk.refused(2, &["design", "spec.toml", "-o", "no.json", "--snr", "60", "--sfdr", "60"], &["--sfdr"]);
}

#[test]
fn taps_may_be_left_out() {
    let desk = Desk::with_spec(&THESIS.replace("taps = 22\n", ""));
    let chosen = desk.json(&["design", "spec.toml", "-o", "open.json", "--json"]);
    let many = desk.json(&["design", "spec.toml", "-o", "many.json", "--taps", "60", "--json"]);
    let taps = chosen["taps"].as_u64().unwrap();
    let loss = number(&many, "/figures/snr/total_db") - number(&chosen, "/figures/snr/total_db");
    assert!((6..40).contains(&taps) && loss < 0.2, "{taps} taps, {loss} dB");
    desk.good(&["verify", "open.json"]);
}
