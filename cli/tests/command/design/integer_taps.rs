//! Taps of few bits, by `bits`, `fraction_bits` and their flags.

use crate::support::{Desk, THESIS, number, words};
use serde_json::Value;

#[test]
fn integer_taps_are_designed_proven_and_run() {
    let desk = Desk::with_spec(THESIS);
    let report = desk.json(&["design", "--prove", "spec.toml", "-o", "bank.json", "--bits", "6", "--json"]);
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
    let report = desk.json(&["design", "--prove", "fixed.toml", "-o", "fixed.json", "--json"]);
    assert_eq!(number(&report, "/words/fraction_bits"), 9.0);
    desk.good(&["verify", "fixed.json"]);
    // Another method has no use for them.
    desk.good(&["design", "fixed.toml", "-o", "iir.json", "--method", "iir"]);
}

#[test]
fn a_scale_at_which_all_integer_taps_are_zero_is_refused() {
    let desk = Desk::with_spec(THESIS);
    let design = words("design spec.toml -o b.json --taps 4 --latency 2 --bits 1,1,1,2");
    let coarse = [&design[..], &["--fraction-bits", "-2"]].concat();
    desk.refused(1, &coarse, &["the integer taps are zero"]);
    // Left out, a scale is found at which a tap helps.
    desk.good(&design);
}

/// Plain interleaving of delays 0 and 1: the mean squares of real and of integer taps are rounding.
#[test]
fn interleaving_without_any_error_loses_nothing_and_leaves_nothing_open() {
    let text = "fast_period = 1.0\nratio = 2\nlatency = 3\nchannel = [{ delay = 0 }, { delay = 1 }]\n\
                target = { filter = { family = \"butterworth\", order = 2, cutoff = 0.1 } }\n\
                design = { method = \"fir\", taps = 8 }\n";
    let desk = Desk::with_spec(text);
    let report = desk.json(&["design", "--prove", "spec.toml", "-o", "b.json", "--loss-db", "0.1", "--json"]);
    assert_eq!(number(&report, "/words/choice/snr_loss_db"), 0.0);
    assert!(desk.read_json("b.json")["proof"].is_object(), "{report}");
}

/// README's converters, of 12 bits.
const TWELVE_BITS: &str = "fast_rate = \"48 kS/s\"\nratio = 2\nlatency = 12\n\
    target = { filter = { family = \"butterworth\", order = 4, cutoff = \"9 kHz\" } }\n\
    channel = [{ delay = \"25 us\", bits = 12 }, { delay = \"12.5 us\", bits = 12 }]\n\
    signal = { band = \"14 kHz\" }\ndesign = { method = \"fir\", taps = 24 }\n";

fn snr(report: &Value) -> f64 {
    number(report, "/figures/snr/total_db")
}

#[test]
fn bits_are_chosen_for_a_loss() {
    let desk = Desk::with_spec(TWELVE_BITS);
    let design = |name: &str, flags: &str| {
        let line = format!("design --prove spec.toml -o {name} --json --force{flags}");
        desk.json(&words(&line))
    };
    let real = design("real.json", "");
    let losses =
        if trials::is_slow("bits for small and large losses") { &[0.1, 0.03, 0.5][..] } else { &[0.1] };
    for loss in losses.iter().copied() {
        let report = design("chosen.json", &format!(" --loss-db {loss}"));
        let (bank, stated) = (desk.read_json("chosen.json"), number(&report, "/words/choice/snr_loss_db"));
        // What is stated is of the whole spectrum that the bank is designed for, the floor outside the band
        // included; the figure that users read loses no more.
        let lost = snr(&real) - snr(&report);
        assert!(stated <= loss && lost <= stated + 0.01, "{lost} {report}");
        let bits = &bank["fixed_point"]["bits"];
        let most = match bits.as_array() {
            Some(list) => list.iter().map(|bits| bits.as_u64().unwrap()).max().unwrap(),
            None => bits.as_u64().unwrap(),
        };
        // The spec in the bank is the wish.
        let asked = &bank["spec"]["design"];
        assert!(asked["bits"].is_null() && asked["loss_db"] == loss, "{asked}");
        assert!(desk.good(&["verify", "chosen.json"]).contains("integers of"));
        // One bit fewer loses more, chosen or not.
        let fewer = (most - 1).to_string();
        let flags = ["design", "spec.toml", "-o", "no.json", "--bits", &fewer];
        let wanted = loss.to_string();
        desk.refused(1, &[&flags[..], &["--loss-db", &wanted]].concat(), &["dB of SNR or more", &wanted]);
        assert!(snr(&real) - snr(&design("fewer.json", &format!(" --bits {fewer}"))) > loss);
        // The same bank again, by its own bits or within them.
        let again = design("again.json", &format!(" --loss-db {loss} --bits {most}"));
        assert_eq!(again["words"]["choice"], report["words"]["choice"]);
    }
    let text = desk.good(&["design", "spec.toml", "-o", "t.json", "--loss-db", "0.1"]);
    assert!(text.contains("dB of the SNR of the real taps lost, 0.1 allowed"), "{text}");
}

#[test]
fn wishes_that_make_no_sense_are_refused() {
    let desk = Desk::with_spec(TWELVE_BITS);
    for (flags, parts) in [
        (&["--loss-db", "0"][..], ["--loss-db: 0 dB", "above 0"]),
        (&["--loss-db", "0.1", "--method", "iir"], ["loss_db", "fir"]),
        (&["--loss-db", "nan"], ["--loss-db", "dB"]),
    ] {
        desk.refused(1, &[&["design", "spec.toml", "-o", "no.json"][..], flags].concat(), &parts);
    }
    desk.write("bad.toml", TWELVE_BITS.replace("taps = 24", "taps = 24, loss_db = 0.1, fraction_bits = 3"));
    desk.refused(1, &["design", "bad.toml", "-o", "no.json"], &["bad.toml:", "the loss decides"]);
}

/// Their mean square grows with the bits that are taken away, and a rounded tap is no part of the aim.
#[test]
fn least_squares_taps_are_integers_too() {
    let desk = Desk::with_spec(THESIS);
    let design = |name: &str, flags: &[&str]| {
        let own =
            ["design", "spec.toml", "-o", name, "--json", "--method", "h2", "--taps", "22", "--no-proof"];
        desk.json(&[&own[..], flags].concat())
    };
    let rms = |report: &Value| number(report, "/rms_error");
    let real = rms(&design("real.json", &[]));
    let [few, many] = ["8", "14"].map(|bits| rms(&design(&format!("{bits}.json"), &["--bits", bits])));
    assert!(real < many && many < few && many < 1.01 * real, "{real} {many} {few}");
    let chosen = design("loss.json", &["--loss-db", "0.1"]);
    assert!(rms(&chosen) / real < 10_f64.powf(0.1 / 20.0) * (1.0 + 1e-3), "{chosen}");
    desk.good(&["export", "8.json", "-o", "core.v", "--input-bits", "12"]);
}
