//! `calibrate`: captures of virtual converters to a spec, to a bank, to a fused recording without spurs.

use crate::support::random::Random;
use crate::support::{Desk, number, text, wav, words};
use hybank::analog::StrictlyProper;
use hybank::design::DesignOptions;
use hybank::spec::Spec;
use hybank::units::RadiansPerFastPeriod;
use std::f64::consts::TAU;

/// Four interleaved 250 MS/s converters with nominal delays.
const NOMINAL: &str = r#"# four converters
fast_rate = 1.0e9          # Hz
ratio = 4
latency = 16

[target]
filter = { family = "butterworth", order = 4, cutoff = 250.0e6 }

[[channel]]
delay = 3.0e-9
[[channel]]
delay = 2.0e-9             # the second one
[[channel]]
delay = 1.0e-9
[[channel]]
delay = 0.0

[design]
method = "iir"
"#;

/// The true converters: skews of 1 % of the fast period, gains of 1 %, offsets of 5 steps of 12 bits.
const SKEWS: [f64; 4] = [0.01, -0.008, 0.009, 0.0];
const GAINS: [f64; 4] = [1.01, 0.992, 0.99, 1.0];
const OFFSETS: [f64; 4] = [5.0, -4.0, 3.0, -5.0];
const STEP: f64 = 1.0 / 2048.0;

/// What 12-bit converters deliver of tones (hertz) of the given amplitude each, one row per channel.
fn captured(tones: &[f64], amplitude: f64, frames: usize, dice: &mut Random) -> Vec<Vec<f32>> {
    let spec = Spec::from_toml(NOMINAL, "spec.toml").unwrap();
    let filter = StrictlyProper::new(&spec.target, spec.fast_period).unwrap();
    let one = |i: usize, dice: &mut Random| {
        let delay = spec.channels[i].delay / spec.fast_period + SKEWS[i];
        let sample = |k: usize, dice: &mut Random| {
            let wave = |(t, f): (usize, &f64)| {
                let w = TAU * f * spec.fast_period.0;
                let response = filter.response(RadiansPerFastPeriod(w));
                let turns = (f * spec.fast_period.0 * 4.0 * k as f64).fract();
                response.norm() * (TAU * turns + response.arg() - w * delay + t as f64).cos()
            };
            let x = amplitude * tones.iter().enumerate().map(wave).sum::<f64>();
            // Thermal noise of half a step.
            let noise = STEP * (dice.sample() + dice.sample()) / 2.0;
            let code = ((GAINS[i] * x + noise) / STEP + OFFSETS[i]).round().clamp(-2048.0, 2047.0);
            (code * STEP) as f32
        };
        (0..frames).map(|k| sample(k, dice)).collect::<Vec<f32>>()
    };
    (0..4).map(|i| one(i, dice)).collect()
}

fn write(desk: &Desk, prefix: &str, channels: &[Vec<f32>]) -> Vec<String> {
    let names: Vec<String> = (1..=channels.len()).map(|i| format!("{prefix}{i}.wav")).collect();
    for (name, samples) in names.iter().zip(channels) {
        wav::write(desk, name, 1, 250_000_000, samples);
    }
    names
}

fn with<'a>(head: &[&'a str], names: &'a [String], tail: &[&'a str]) -> Vec<&'a str> {
    head.iter().copied().chain(names.iter().map(String::as_str)).chain(tail.iter().copied()).collect()
}

/// `bank.json` for a spec, without the search for its proof.
pub(crate) fn design(desk: &Desk, spec: &str) {
    write_bank(desk, &read_spec(desk, spec));
}

pub(crate) fn read_spec(desk: &Desk, name: &str) -> Spec {
    Spec::from_toml(&String::from_utf8(desk.read(name)).unwrap(), name).unwrap()
}

/// The bank of a spec, without a proof, as `bank.json`.
pub(crate) fn write_bank(desk: &Desk, spec: &Spec) {
    let bank = hybank::design::design(spec, &DesignOptions::without_proof()).unwrap().bank;
    desk.write("bank.json", bank.to_json().unwrap());
}

#[test]
fn the_spec_keeps_what_was_not_measured() {
    let (desk, mut dice) = (Desk::with_spec(NOMINAL), Random(2));
    let names = write(&desk, "t", &captured(&[61.3e6], 0.9, 4096, &mut dice));
    let to_stdout = with(&["calibrate", "spec.toml"], &names, &["-o", "-", "--tone", "61.3MHz"]);
    let spec = text(&desk.piped(&to_stdout, &[]));
    assert!(spec.starts_with("# four converters\nfast_rate = 1.0e9          # Hz\n"), "{spec}");
    assert!(spec.contains("e-9             # the second one\n"), "{spec}");
    let read = Spec::from_toml(&spec, "measured.toml").unwrap();
    let uncertainty = read.uncertainty.unwrap();
    assert_eq!((uncertainty.reference, uncertainty.delays(4)[0].0), (Some(1), 0.0));
    assert!(uncertainty.delays(4)[1].0 > 1e-15 && uncertainty.offsets(4)[0] > 1e-7);
    // Relative to channel 1, which keeps its nominal values. Channel 4 would then come 10 ps before 0, so
    // all delays and the latency are a fast period longer.
    assert!((read.channels[1].delay.0 - (3.0 + SKEWS[1] - SKEWS[0]) * 1e-9).abs() < 1e-12, "{spec}");
    assert_eq!(read.latency, Some(17));
    assert!((read.channels[1].gain - GAINS[1] / GAINS[0]).abs() < 1e-3);
    // The second calibration starts from the first and finds the same.
    desk.write("measured.toml", &spec);
    let again = desk.json(&with(&["calibrate", "measured.toml"], &names, &["-o", "again.toml", "--json"]));
    assert_eq!(again["tones"][0]["zone"], 1, "{again}");
    assert!((number(&again, "/channels/1/delay/value") - read.channels[1].delay.0).abs() < 1e-14, "{again}");
}

#[test]
fn the_spec_keeps_measured_filters_by_their_files() {
    let (desk, mut dice) = (Desk::with_spec(NOMINAL), Random(7));
    let spec = Spec::from_toml(NOMINAL, "spec.toml").unwrap();
    let filter = StrictlyProper::new(&spec.target, spec.fast_period).unwrap();
    let row = |f: f64| {
        let response = filter.response(RadiansPerFastPeriod(TAU * f * 1e-9));
        format!("{f},{},{}\n", 20.0 * response.norm().log10(), response.arg().to_degrees())
    };
    for folder in ["lab", "out"] {
        std::fs::create_dir(desk.path(folder)).unwrap();
    }
    let rows: String = (1..=200).map(|k| row(5e6 * f64::from(k))).collect();
    desk.write("lab/bode.csv", format!("frequency (Hz), gain (dB), phase (deg)\n{rows}"));
    let measured = r#"filter = { response = "bode.csv", order = 4 } # by lab 2"#;
    desk.write("lab/spec.toml", NOMINAL.replace("delay = 0.0", &format!("delay = 0.0\n{measured}")));
    let names = write(&desk, "t", &captured(&[161.3e6], 0.9, 4096, &mut dice));
    let calibrated = |from: &str, to: &str| {
        desk.warned(&with(&["calibrate", from, "-o", to], &names, &[]), &["4 poles fitted"]);
    };
    calibrated("lab/spec.toml", "lab/m.toml");
    let beside = text(&desk.read("lab/m.toml"));
    assert!(beside.contains(measured) && beside.contains("fast_rate = 1.0e9          # Hz"), "{beside}");
    // In another folder the file is still found.
    calibrated("lab/spec.toml", "out/m.toml");
    assert!(text(&desk.read("out/m.toml")).contains(r#"lab/bode.csv", order = 4 }"#));
    calibrated("out/m.toml", "out/n.toml");
}

#[test]
fn held_out_captures_and_one_file_of_all_converters_are_checked() {
    let (desk, mut dice) = (Desk::with_spec(NOMINAL), Random(3));
    let first = captured(&[161.3e6], 0.9, 8192, &mut dice);
    let second = captured(&[83.9e6], 0.9, 8192, &mut dice);
    for (name, channels) in [("one.wav", &first), ("two.wav", &second)] {
        let turns: Vec<f32> = (0..4 * 8192).map(|n| channels[n % 4][n / 4]).collect();
        wav::write(&desk, name, 1, 1_000_000_000, &turns);
    }
    let calibrate = "calibrate spec.toml one.wav --interleaved 4 -o m.toml --json --check two.wav";
    let report = desk.json(&words(calibrate));
    assert!(report["check"]["agrees"] == true && report["tones"][0]["zone"] == 2, "{report}");
    let shown = desk.good(&["calibrate", "spec.toml", "one.wav", "--interleaved", "4", "-o", "n.toml"]);
    let parts = ["relative to channel 1", "the cut-offs were not fitted"];
    assert!(parts.iter().all(|part| shown.contains(part)), "{shown}");
}

/// The taps of least squares are the default of converters that take turns, and what a circuit takes.
#[test]
fn a_calibrated_spec_without_a_design_makes_least_squares_taps() {
    let (open, mut dice) = (NOMINAL.replace("[design]\nmethod = \"iir\"\n", ""), Random(3));
    let desk = Desk::with_spec(&open);
    write_codes(&desk, "z.txt", &captured(&[161.3e6], 0.9, 8192, &mut dice));
    let codes = ["z.txt", "--interleaved", "4", "--full-scale", "12bits", "-o", "m.toml"];
    desk.report(&[&["calibrate", "spec.toml"], &codes[..]].concat());
    let text = String::from_utf8(desk.read("m.toml")).unwrap();
    assert!(text.contains("# the second one") && text.contains("method = \"h2\""), "{text}");
    let report = desk.report(&["design", "m.toml", "-o", "bank.json", "--bits", "14", "--no-proof"]);
    assert!(report["method"] == "h2" && report["taps"].is_number(), "{report}");
    desk.good(&["export", "bank.json", "-o", "core.v", "--input-bits", "12"]);
    // What the spec asks for stays.
    desk.write("spec.toml", NOMINAL);
    desk.report(&[&["calibrate", "spec.toml"], &codes[..]].concat());
    assert!(String::from_utf8(desk.read("m.toml")).unwrap().contains("method = \"iir\""));
}

/// One file in which the converters take turns, as their codes, one per line.
fn write_codes(desk: &Desk, name: &str, channels: &[Vec<f32>]) {
    let turns = (0..4 * channels[0].len()).map(|n| f64::from(channels[n % 4][n / 4]) / STEP);
    desk.write(name, turns.fold(String::new(), |text, code| format!("{text}{code}\n")));
}

/// Bits of the converter for its codes in a table, and `fit` of the spec in place of the option.
#[test]
fn bits_of_codes_and_what_the_spec_fits() {
    let (desk, mut dice) = (Desk::with_spec(NOMINAL), Random(8));
    write_codes(&desk, "z.txt", &captured(&[61.3e6], 0.9, 4096, &mut dice));
    let calibrated = |spec: &str, more: &[&str]| {
        let how = ["z.txt", "--interleaved", "4", "-o", "m.toml", "--json", "--force", "--tone", "61.3MHz"];
        desk.json(&[&["calibrate", spec], &how[..], more].concat())
    };
    let bits = calibrated("spec.toml", &["--full-scale", "12bits"]);
    assert!((number(&bits, "/channels/1/offset/value") + 4.0 * STEP).abs() < 0.1 * STEP, "{bits}");
    desk.write("fit.toml", format!("full_scale = \"12bits\"\nfit = [\"gain\"]\n{NOMINAL}"));
    let gains = calibrated("fit.toml", &[]);
    let told = calibrated("spec.toml", &["--full-scale", "12bits", "--fit", "gain"]);
    assert_eq!(gains["channels"], told["channels"]);
    assert!(gains["channels"][1]["delay"].is_null() && gains["channels"][1]["offset"].is_null(), "{gains}");
    assert!(!calibrated("fit.toml", &["--fit", "delay"])["channels"][1]["delay"].is_null());
    assert!(text(&desk.read("m.toml")).contains("fit = [\"gain\"]\n"));
    let refused = |more: &[&str], code: i32, parts: &[&str]| {
        let how = ["calibrate", "spec.toml", "z.txt", "--interleaved", "4", "-o", "x.toml"];
        desk.refused(code, &[&how[..], more].concat(), parts);
    };
    refused(&["--full-scale", "12bits", "--fit", "cutoff,cutoff:1"], 1, &["--fit", "keep one of them"]);
    // The lines that are there are named where a tone is missing.
    let missing = ["no tone found near 62300000 Hz", "the only line of the record appears at 613"];
    refused(&["--full-scale", "12bits", "--tone", "62.3MHz"], 1, &missing);
}

/// Codes from 0 on that are read as signed ones are beyond these, which the error says.
#[test]
fn offset_binary_codes_are_named() {
    let (desk, mut dice) = (Desk::with_spec(NOMINAL), Random(9));
    let mut codes = captured(&[61.3e6], 0.9, 4096, &mut dice);
    codes.iter_mut().flatten().for_each(|x| *x += 1.0);
    write_codes(&desk, "z.txt", &codes);
    let run = |scale: &[&str]| {
        let how = ["calibrate", "spec.toml", "z.txt", "--interleaved", "4", "-o", "m.toml", "--force"];
        let done = desk.run(&[&how[..], scale].concat(), b"");
        (done.status.code(), text(&done.stderr))
    };
    let (_, shown) = run(&["--full-scale", "12bits"]);
    assert!(shown.contains("codes that count from 0 are u12bits"), "{shown}");
    assert_eq!(run(&["--full-scale", "u12bits"]), (Some(0), String::new()));
}

/// What the captures contradict is not written unless asked for.
#[test]
fn values_that_the_captures_contradict_are_not_written() {
    let (desk, mut dice) = (Desk::with_spec(NOMINAL), Random(6));
    let names = write(&desk, "t", &captured(&[61.3e6, 161.3e6, 231.7e6], 0.3, 4096, &mut dice));
    let other = "[[channel]]\nfilter = { family = \"butterworth\", order = 4, cutoff = 200e6 }\ndelay = 0.0";
    desk.write("wrong.toml", NOMINAL.replace("[[channel]]\ndelay = 0.0", other));
    let run = |tail: &[&str]| {
        let head = ["calibrate", "wrong.toml", "-o", "m.toml", "--tone", "61.3MHz,161.3MHz,231.7MHz"];
        let done = desk.run(&with(&head, &names, tail), b"");
        (done.status.code(), text(&done.stderr))
    };
    let (code, shown) = run(&[]);
    assert!(code == Some(1) && !desk.path("m.toml").exists(), "{shown}");
    let explanation = "delay,gain,offset,cutoff together have a misfit of";
    let refusal = ["contradict the spec", "times as much as their noise", "--force", "--fit takes that list"];
    assert!(refusal.iter().chain([&explanation]).all(|part| shown.contains(part)), "{shown}");
    let (code, shown) = run(&["--force"]);
    assert!(code == Some(0) && desk.path("m.toml").exists() && shown.contains(explanation), "{shown}");
    // The fit that is named agrees.
    let (code, shown) = run(&["--force", "--fit", "delay,gain,offset,cutoff:1"]);
    assert_eq!((code, shown.as_str()), (Some(0), ""));
    assert!(text(&desk.read("m.toml")).contains("cutoff = 25"), "{}", text(&desk.read("m.toml")));
    let (code, shown) = run(&["--force", "--fit", "delay,cutoff:2"]);
    assert!(code == Some(1) && shown.contains("channel 1 has no stage 2"), "{shown}");
    let (code, shown) = run(&["--fit", "delay,cutof"]);
    assert!(code == Some(2) && shown.contains("cutoff:2 for the second stage"), "{shown}");
}

/// `fuse` and `stream` say when captures are in the wrong order, given twice, or late.
#[test]
fn runs_warn_of_captures_that_contradict_the_spec() {
    let (desk, mut dice) = (Desk::with_spec(NOMINAL), Random(5));
    design(&desk, "spec.toml");
    let names = write(&desk, "t", &captured(&[17.3e6, 43.9e6, 61.3e6, 89.1e6], 0.22, 4096, &mut dice));
    let warned = |order: [usize; 4]| {
        let names: Vec<String> = order.map(|i| names[i].clone()).to_vec();
        desk.warned(&with(&["fuse", "bank.json", "-o", "y.wav", "--force"], &names, &[]), &[])
    };
    assert_eq!(warned([0, 1, 2, 3]), "");
    assert!(warned([0, 2, 1, 3]).contains("those of the channels 1, 3, 2, 4"));
    assert!(warned([0, 1, 1, 3]).contains("channels 2 and 3 hold the same samples"));
    let late = NOMINAL.replace("delay = 2.0e-9", "delay = 2.1e-9");
    desk.write("late.toml", late);
    design(&desk, "late.toml");
    let (warning, said) = (warned([0, 1, 2, 3]), "the delay of channel 2");
    assert!(warning.contains("the delay of channel 2 relative to channel 1"), "{warning}");
    assert!(warning.contains("hybank calibrate"), "{warning}");
    let inputs: Vec<&str> = names.iter().flat_map(|name| ["--input", name]).collect();
    let stream = words("stream bank.json --format wav --output-format f32le -o y.raw");
    let stream = [stream, inputs].concat();
    let output = desk.run(&[&stream[..], &["--json"]].concat(), &[]);
    assert_eq!(text(&output.stderr).matches(said).count(), 1, "{output:?}");
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(report["warnings"][0].as_str().unwrap().contains(said), "{report}");
    let output = desk.run(&[&stream[..], &["--force", "--strict"]].concat(), &[]);
    let message = text(&output.stderr);
    assert!(output.status.code() == Some(1) && message.contains("because of --strict"), "{message}");
}
