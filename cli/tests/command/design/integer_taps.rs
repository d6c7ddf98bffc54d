//! Taps of few bits, by `bits`, `fraction_bits` and their flags.

use crate::support::{Desk, THESIS, number};

#[test]
fn integer_taps_are_designed_proven_and_run() {
    let desk = Desk::with_spec(THESIS);
    let report = desk.json(&["design", "spec.toml", "-o", "bank.json", "--bits", "6", "--json"]);
    let bank = desk.read_json("bank.json");
    let step = (-number(&report, "/words/fraction_bits")).exp2();
    for (channel, integers) in
        bank["channels"].as_array().unwrap().iter().zip(bank["fixed_point"]["integers"].as_array().unwrap())
    {
        let (taps, integers) = (channel["taps"].as_array().unwrap(), integers.as_array().unwrap());
        assert_eq!((taps.len(), integers.len()), (22, 22));
        for (tap, integer) in taps.iter().zip(integers) {
            let integer = integer.as_i64().unwrap();
            assert!((-32..32).contains(&integer));
            assert_eq!(tap.as_f64().unwrap(), integer as f64 * step);
        }
    }
    // The golden gamma of the real taps is 0.0399320; rounding costs 1.6 dB.
    assert!(number(&report, "/gamma/upper") < 0.0399320 * 1.001);
    assert!((number(&report, "/gamma/lower") - 0.0399320).abs() < 1e-7);
    let losses = report["words"]["words"].as_array().unwrap();
    assert_eq!(losses.len(), 5);
    assert!(number(&losses[2], "/rounded_loss_db") > 1.0 && number(&losses[2], "/loss_db") < 0.01);
    let proven = desk.json(&["verify", "bank.json", "--json"]);
    assert!(number(&proven, "/upper") <= number(&report, "/gamma/upper") * (1.0 + 1e-6));
    assert!(desk.good(&["verify", "bank.json"]).contains("integers of 6 bits"));
    assert!(desk.good(&["analyze", "bank.json"]).contains("gamma"));

    // A list of bits, a scale, and a spec that says so.
    let list = (0..22).map(|n| if n < 11 { "10" } else { "4" }).collect::<Vec<_>>().join(",");
    desk.good(&["design", "spec.toml", "-o", "list.json", "--bits", &list, "--fraction-bits", "8"]);
    let toml = THESIS.replace("taps = 22", "taps = 22\nbits = 10\nfraction_bits = 9");
    desk.write("fixed.toml", toml);
    let report = desk.json(&["design", "fixed.toml", "-o", "fixed.json", "--json"]);
    assert_eq!(number(&report, "/words/fraction_bits"), 9.0);
    desk.good(&["verify", "fixed.json"]);
    // Another method has no use for them.
    desk.good(&["design", "fixed.toml", "-o", "iir.json", "--method", "iir"]);
}

#[test]
fn a_scale_at_which_all_integer_taps_are_zero_is_refused() {
    let desk = Desk::with_spec(THESIS);
    let design =
        ["design", "spec.toml", "-o", "b.json", "--taps", "4", "--latency", "2", "--bits", "1,1,1,2"];
    let coarse = [&design[..], &["--fraction-bits", "-2"]].concat();
    desk.refused(1, &coarse, &["all integer taps are zero"]);
    // Left out, a scale is found at which a tap helps.
    desk.good(&design);
}

#[test]
fn a_bank_without_any_error_loses_nothing_by_integers() {
    let desk = Desk::with_spec(THESIS);
    let exact = "fast_period = 1.0\nratio = 1\nlatency = 0\nchannel = [{ delay = 0 }]\n\
                 target = { filter = { num = [0.25], den = [1.0, 1.0, 0.25] } }\n\
                 design = { method = \"fir\", taps = 1, bits = 4 }\n";
    desk.write("exact.toml", exact);
    let report = desk.json(&["design", "exact.toml", "-o", "b.json", "--json"]);
    assert_eq!(number(&report, "/gamma/norm"), 0.0);
    assert_eq!(number(&report, "/words/loss_db"), 0.0);
    assert!(
        desk.good(&["design", "exact.toml", "-o", "b.json", "--force", "--verbose"])
            .contains("gamma is 0.0000 dB above")
    );
}
