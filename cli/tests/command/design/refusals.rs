//! What is wrong with a spec or with a flag is refused where it stands, with the reason and the remedy.

use crate::support::{Desk, THESIS};

/// The rules and their words are tested where specs are read.
#[test]
fn a_wrong_spec_is_answered_with_place_reason_and_remedy() {
    let desk = Desk::with_spec(&THESIS.replacen("latency", "latncy", 1));
    let parts = ["spec.toml:3:1", "unknown key \"latncy\"", "did you mean \"latency\"?"];
    desk.refused(1, &["design", "spec.toml", "-o", "out.json"], &parts);
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
            "--bits: bits has no meaning for the method h2 without taps",
            "h2 with taps",
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
        desk.warned(&["design", "spec.toml", "-o", "b.json", "--force"], &[reason]);
        std::fs::remove_file(desk.path("b.json")).unwrap();
    }
}
