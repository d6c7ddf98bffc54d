//! Errors of virtual converters in `simulate`: noise, jitter, bits, delays, gains, offsets and cut-offs.

use super::simulate::recording;
use crate::support::{Desk, THESIS, number, wav};
use serde_json::Value;

/// Cut-offs off by their errors are those of a spec that says so; with `fit` of one stage, of that stage.
#[test]
fn errors_of_cut_offs_are_those_of_other_front_ends() {
    let desk = Desk::empty();
    let cascade = |first: &str, second: &str| {
        let stage = |cutoff: &str| format!("{{ family = \"rc\", cutoff = \"{cutoff}\" }}");
        format!("filter = {{ cascade = [{}, {}] }}\n", stage(first), stage(second))
    };
    let spec = |head: &str, second: String| {
        format!(
            "fast_rate = \"48 kHz\"\nratio = 2\n{head}[target]\n{}[[channel]]\ndelay = \"3 us\"\n\
             [[channel]]\ndelay = 0\n{second}",
            cascade("8 kHz", "20 kHz")
        )
    };
    let fit = "fit = [\"delay\", \"cutoff:2\"]\n";
    desk.write("nominal.toml", spec("", String::new()));
    desk.write("both.toml", spec("", cascade("8.08 kHz", "20.2 kHz")));
    desk.write("fit.toml", spec(fit, String::new()));
    desk.write("second.toml", spec("", cascade("8 kHz", "20.2 kHz")));
    desk.write("single.toml", spec(fit, "filter = { family = \"rc\", cutoff = 8000 }\n".to_owned()));
    let captured = |spec: &str, more: &[&str]| {
        let args = ["simulate", spec, "--source", "tones:7.1kHz", "--samples", "400", "-o", "cap"];
        desk.report(&[&args[..], more].concat());
        ["ch1.wav", "ch2.wav", "target.wav"].map(|name| recording(&desk.path("cap").join(name)))
    };
    let error = ["--cutoff-error", "0,1%"];
    let nominal = captured("nominal.toml", &[]);
    for (given, truth) in [("nominal.toml", "both.toml"), ("fit.toml", "second.toml")] {
        let (found, want) = (captured(given, &error), captured(truth, &[]));
        let differs = |a: &[f64], b: &[f64]| a.iter().zip(b).any(|(a, b)| (a - b).abs() > 1e-7);
        assert!(!differs(&found[1], &want[1]) && differs(&found[1], &nominal[1]), "{given}");
        assert!(found[0] == nominal[0] && found[2] == nominal[2], "{given}");
    }
    let args = ["simulate", "single.toml", "--source", "tones:7kHz", "-o", "new"];
    desk.refused(1, &[&args[..], &error].concat(), &["--cutoff-error", "cutoff:2", "no such stage"]);
    let wide = [&args[..], &["--cutoff-error", "0.6"]].concat();
    desk.refused(1, &wide, &["--cutoff-error: 0.6", "-0.5 to 0.5"]);
}

#[test]
fn clipped_samples_are_counted_and_reported() {
    let desk = Desk::with_spec(THESIS);
    let args = ["simulate", "spec.toml", "--source", "step@0", "-o", "cap", "--gain", "2", "--bits", "8"];
    let output = desk.run(&[&args[..], &["--json", "--force"]].concat(), &[]);
    assert!(output.status.success());
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    // The step response reaches one half after 3.4 and never leaves it.
    let most = number(&report, "/converters/0/clipped");
    assert!(most > 95.0 && most < 100.0, "{report}");
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(message.contains("cap/ch1.wav") && message.contains("clipped at full scale"), "{message}");
    assert!(recording(&desk.path("cap/ch1.wav")).iter().all(|&x| x <= 127.0 / 128.0));
}

#[test]
fn errors_out_of_range_are_refused_by_name() {
    let desk = Desk::with_spec(THESIS);
    for (code, more, parts) in [
        (1, ["--noise", "2"], ["--noise: 2 of full scale", "from 0 to 1"]),
        (1, ["--noise", "nan"], ["--noise: NaN", "from 0 to 1"]),
        (1, ["--bits", "1"], ["--bits", "2 to 24 bits"]),
        (1, ["--bits", "32"], ["--bits", "2 to 24 bits"]),
        (1, ["--jitter", "0.2"], ["--jitter: 2e-1 s are 2e-1 fast periods", "check the unit"]),
        (1, ["--jitter", "-1ms"], ["--jitter: -1e-3 s", "check the unit"]),
        (2, ["--jitter", "1kHz"], ["--jitter", "a time such as 10ps"]),
        (1, ["--drift", "1e6"], ["--drift: 1000000 ppm", "at most 100000 ppm"]),
        (1, ["--delay-error", "1e9,0"], ["--delay-error: 1000000000 s", "check its unit"]),
        (1, ["--gain-error", "0,500%"], ["--gain-error: 5", "0.01 is one per cent"]),
        (1, ["--offset", "5"], ["--offset: 5 of full scale", "5 / 2048"]),
        (1, ["--offset", "0,0,0"], ["--offset: 3 values", "2 channels"]),
        (2, ["--seed", "x"], ["--seed", "x"]),
    ] {
        let args = [&["simulate", "spec.toml", "--source", "step@1", "-o", "cap"], &more[..]].concat();
        desk.refused(code, &args, &parts);
    }
    // A recording at a hundred times the fast rate.
    let bank = THESIS.replace("fast_period = 1.0", "fast_rate = 100.0");
    desk.write("slow.toml", bank);
    wav::write(&desk, "fine.wav", 1, 10_000, &[0.5; 1000]);
    let args = ["simulate", "slow.toml", "--source", "fine.wav", "-o", "cap", "--jitter", "1ms"];
    desk.refused(1, &args, &["--jitter: samples may be", "resample the recording"]);
}
