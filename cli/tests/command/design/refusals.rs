//! What is wrong with a spec or with a flag is refused where it stands, with the reason and the remedy.

use crate::support::{Desk, THESIS};

/// Designs a changed spec and wants it refused.
fn bad_spec(desk: &Desk, from: &str, to: &str, parts: &[&str]) {
    assert!(THESIS.contains(from));
    desk.write("bad.toml", THESIS.replacen(from, to, 1));
    desk.refused(1, &["design", "bad.toml", "-o", "out.json"], parts);
}

#[test]
fn a_wrong_spec_is_answered_with_place_reason_and_remedy() {
    let desk = Desk::with_spec(THESIS);
    desk.write("bad.toml", "");
    bad_spec(
        &desk,
        "latency",
        "latncy",
        &["bad.toml:3:1", "unknown key \"latncy\"", "did you mean \"latency\"?"],
    );
    bad_spec(&desk, "[1.0, 1.0, 0.25]", "[1.0, -1.0, 0.25]", &["bad.toml", "unstable", "left half plane"]);
    bad_spec(&desk, "num = [0.25]", "num = [1.0, 0.0, 0.25]", &["bad.toml:5:", "strictly proper", "rc"]);
    bad_spec(&desk, "delay = 1.2", "delay = -1.2", &["bad.toml:7:", "-1.2 s", "cannot be negative"]);
    bad_spec(&desk, "ratio = 2", "ratio = 0", &["bad.toml:2:", "1 to 1024"]);
    bad_spec(&desk, "taps = 22", "taps = 0", &["bad.toml:12:", "1 to 65536"]);
    bad_spec(&desk, "taps = 22\n", "taps = 22\ntarget_snr_db = 60\n", &["bad.toml:13:", "keep one of them"]);
    bad_spec(
        &desk,
        "taps = 22\n",
        "target_snr_db = 300\n",
        &["an SNR of 300.0 dB is out of reach", "latency 10"],
    );
    bad_spec(&desk, "taps = 22\n", "target_sfdr_db = -1\n", &["target_sfdr_db", "0 to 300 dB"]);
    bad_spec(&desk, "\"fir\"\ntaps = 22", "\"h2\"\ntaps = 4000", &["at most 2048 samples"]);
    bad_spec(&desk, "delay = 1.2", "delay = 1.2\nbits = 40", &["bits", "1 to 32"]);
    bad_spec(&desk, "delay = 1.2", "delay = 1.2\njitter = 3", &["jitter", "check its unit"]);
    bad_spec(&desk, "\"fir\"", "\"fri\"", &["bad.toml:11:", "did you mean \"fir\"?"]);
    bad_spec(&desk, "fast_period = 1.0", "fast_period = nan", &["bad.toml:1:"]);
    bad_spec(&desk, "fast_period = 1.0", "fast_period = 1.0\nfast_rate = 1.0", &["fast_period", "fast_rate"]);
    bad_spec(&desk, "ratio = 2", "ratio = ", &["bad.toml:2:"]);
    bad_spec(&desk, "\"fir\"\ntaps = 22", "\"sinc\"\n[[channel]]\ndelay = 0.1", &["N = M", "3 channels"]);
}

#[test]
fn what_is_wrong_with_a_flag_names_the_flag() {
    let desk = Desk::with_spec(THESIS);
    desk.write("list.toml", THESIS.replace("taps = 22", "taps = 2\nbits = [8, 8]"));
    desk.write("iir.toml", THESIS.replace("\"fir\"\ntaps = 22", "\"iir\""));
    for (spec, flags, starts, says) in [
        ("spec.toml", &["--taps", "0"][..], "--taps: 0 taps", "1 to 65536"),
        ("spec.toml", &["--taps", "16000"], "--taps: 32000 taps in all", "at most 8192"),
        ("iir.toml", &["--taps", "8"], "--taps: taps has no meaning for the method iir", "fir"),
        ("spec.toml", &["--gamma-margin=-1"], "--gamma-margin: -1", "zero or more"),
        ("spec.toml", &["--bits", "1"], "--bits: 1 bits", "2 to 32"),
        ("spec.toml", &["--bits", "8,8"], "--bits: 2 entries", "each of the 22 taps"),
        ("list.toml", &["--taps", "3"], "--taps: 2 entries", "each of the 3 taps"),
        ("spec.toml", &["--bits", "8", "--fraction-bits=-300"], "--fraction-bits: -300 bits", "-256 to 256"),
        ("spec.toml", &["--fraction-bits", "4"], "--fraction-bits: the key bits is missing", "bits = 16"),
        (
            "spec.toml",
            &["--bits", "8", "--method", "h2"],
            "--bits: bits has no meaning for the method h2",
            "fir",
        ),
        ("iir.toml", &["--snr", "90"], "--snr: target_snr_db has no meaning for the method iir", "fir or h2"),
        ("spec.toml", &["--snr=-1"], "--snr: -1 dB", "0 to 300 dB"),
        ("iir.toml", &["--order", "100000"], "--order: 100000 states", "0 to 65536"),
        ("iir.toml", &["--reduction-loss-db=-1"], "--reduction-loss-db: -1 dB", "0 to 400 dB"),
        ("spec.toml", &["--latency", "100000"], "--latency: 100000 fast samples", "at most 65536"),
    ] {
        let args = [&["design", spec, "-o", "b.json"], flags].concat();
        let message = desk.refused(1, &args, &[says]);
        assert!(message.starts_with(&format!("hybank: {starts}")), "{message}");
        assert!(!message.contains(".toml"), "the file is not to blame: {message}");
    }
    // What is wrong with the file is shown there all the same.
    desk.write("margin.toml", THESIS.replace("taps = 22", "taps = 22\ngamma_margin = -1"));
    let args = ["design", "margin.toml", "-o", "b.json", "--bits", "8"];
    desk.refused(1, &args, &["margin.toml:13:16: design.gamma_margin: -1", "zero or more"]);
}

#[test]
fn orders_that_mean_nothing_are_refused() {
    let desk = Desk::with_spec(THESIS);
    for (line, parts) in [
        (
            "order = 4",
            [
                "design.order",
                "order has no meaning for the method fir; remove it or choose the method iir or h2",
            ],
        ),
        ("reduction_loss_db = 1", ["design.reduction_loss_db", "has no meaning for the method fir"]),
        ("order = -1", ["design.order", "zero or more"]),
        ("order = 2.5", ["design.order", "whole number"]),
        ("order = 100000", ["design.order", "0 to 65536"]),
        ("reduction_loss_db = -0.5", ["design.reduction_loss_db", "0 to 400 dB"]),
        ("reduction_loss_db = nan", ["design.reduction_loss_db", "NaN dB is out of range"]),
        (
            "order = 4\nreduction_loss_db = 1",
            ["both order and reduction_loss_db are given", "keep one of them"],
        ),
        ("ordre = 4", ["ordre", "did you mean \"order\"?"]),
    ] {
        bad_spec(&desk, "taps = 22", &format!("taps = 22\n{line}"), &parts);
    }
    let design = ["design", "spec.toml", "-o", "x.json"];
    desk.refused(1, &[&design[..], &["--order", "3"]].concat(), &["order has no meaning for the method fir"]);
    let iir = [&design[..], &["--method", "iir"]].concat();
    desk.refused(1, &[&iir[..], &["--order", "100000"]].concat(), &["100000 states", "0 to 65536"]);
    desk.refused(1, &[&iir[..], &["--reduction-loss-db=-1"]].concat(), &["-1 dB", "0 to 400 dB"]);
    desk.refused(2, &[&iir[..], &["--order", "x"]].concat(), &["--order"]);
    desk.refused(
        2,
        &[&iir[..], &["--order", "3", "--reduction-loss-db", "1"]].concat(),
        &["cannot be used with"],
    );
}

#[test]
fn bits_that_make_no_sense_are_refused() {
    let desk = Desk::with_spec(THESIS);
    let design = |more: &[&'static str]| [&["design", "spec.toml", "-o", "b.json"], more].concat();
    desk.refused(1, &design(&["--bits", "1"]), &["2 to 32 bits"]);
    desk.refused(1, &design(&["--bits", "8,8"]), &["22 taps"]);
    desk.refused(1, &design(&["--fraction-bits", "4"]), &["bits is missing"]);
    desk.refused(1, &design(&["--bits", "8", "--method", "h2"]), &["bits", "fir"]);
    desk.refused(2, &design(&["--bits", "eight"]), &["eight"]);
}

/// A bank that is hardly better than silence, or leaves hardly any of the signal, is written only if asked
/// for.
#[test]
fn banks_of_no_use_are_refused() {
    let desk = Desk::empty();
    let spec = |latency: usize| {
        format!(
            "fast_period = 1.0\nratio = 2\nlatency = {latency}\n[target]\n\
             filter = {{ family = \"butterworth\", order = 2, cutoff = 0.45 }}\n[[channel]]\ndelay = 1.4\n\
             [[channel]]\ndelay = 0.6\n[signal]\nband = 0.45\n[design]\nmethod = \"fir\"\ntaps = 2\n"
        )
    };
    for (latency, reason) in [(0, "% of that of zero output"), (1, "the SNR of the signal is 3.")] {
        desk.write("spec.toml", spec(latency));
        let parts = ["spec.toml", "of no use, so it is not written", reason, "--force writes it"];
        desk.refused(1, &["design", "spec.toml", "-o", "b.json"], &parts);
        let output = desk.run(&["design", "spec.toml", "-o", "b.json", "--force"], b"");
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success() && said.contains(reason), "{said}");
        std::fs::remove_file(desk.path("b.json")).unwrap();
    }
}
