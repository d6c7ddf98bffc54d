//! Converters with rates of their own, from the spec to the fused recording, as a user runs it.

use crate::lost::places;
use crate::support::{Desk, bytes, text, wav, words};
use serde_json::Value;

/// 24 kHz and 16 kHz into 48 kHz; frames of 6 samples from 3 and 2.
const SPEC: &str = r#"
name = "two rates"
fast_rate = 48000
latency = 22

[target]
filter = { family = "butterworth", order = 4, cutoff = 14000 }

[[channel]]
delay_samples = 0.3
rate = "24 kHz"

[[channel]]
delay_samples = 1.1
rate = "16 kHz"
gain = 1.05
offset = 0.01

[signal]
band = "13 kHz"

[design]
method = "h2"
taps = 72
noise = 3e-4
"#;
const SOURCE: &str = "tones:0.9kHz,4.3kHz,8.9kHz,12.1kHz";
const CAPTURES: [&str; 2] = ["cap/ch1.wav", "cap/ch2.wav"];
const DIRECT: [&str; 2] = ["--algorithm", "direct"];
const WAIT: usize = 4;

fn desk() -> Desk {
    let desk = Desk::with_spec(SPEC);
    desk.good(&["design", "spec.toml", "-o", "bank.json", "--json"]);
    desk
}

/// Captures of `samples` fast samples in the folder `cap`.
fn captured(desk: &Desk, more: &[&str]) {
    let args =
        ["simulate", "spec.toml", "--source", SOURCE, "--gain", "0.2", "-o", "cap", "--force", "--json"];
    desk.good(&[&args[..], more].concat());
}

/// Fuses two recordings; the report.
fn fused(desk: &Desk, [first, second]: [&str; 2], output: &str, more: &[&str]) -> Value {
    desk.report(&[&["fuse", "bank.json", first, second, "-o", output], more].concat())
}

fn level(samples: &[f32]) -> f64 {
    (samples.iter().map(|&x| f64::from(x).powi(2)).sum::<f64>() / samples.len() as f64).sqrt()
}

#[test]
fn the_promised_snr_is_measured() {
    let desk = Desk::with_spec(SPEC);
    let promised = desk.report(&["design", "spec.toml", "-o", "bank.json"]);
    let noise_db = promised["figures"]["snr"]["noise_db"].as_f64().unwrap();
    let signal_db = promised["figures"]["snr"]["signal_db"].as_f64().unwrap();
    assert!(signal_db > noise_db + 10.0, "{promised}");
    captured(&desk, &["--samples", "96000", "--noise", "3e-4"]);
    let rates: Vec<u32> =
        ["ch1", "ch2", "target"].map(|n| wav::read(&desk.path(&format!("cap/{n}.wav"))).0.sample_rate).into();
    assert_eq!(rates, [24_000, 16_000, 48_000]);
    let lengths = ["ch1", "ch2", "target"].map(|n| wav::samples(&desk, &format!("cap/{n}.wav")).len());
    assert_eq!(lengths, [48_000, 32_000, 96_000]);
    desk.report(&["fuse", "bank.json", "cap/ch1.wav", "cap/ch2.wav", "-o", "fused.wav"]);
    let measured = desk.json(&["measure", "fused.wav", "--ref", "cap/target.wav", "--json"]);
    // The promise is for a signal of 0.25 rms at the target.
    let expected = noise_db + 20.0 * (level(&wav::samples(&desk, "cap/target.wav")) / 0.25).log10();
    let snr = measured["reference"]["snr_db"].as_f64().unwrap_or_else(|| panic!("{measured}"));
    assert!((snr - expected).abs() < 0.3, "{snr} instead of {expected}: {measured}");
    desk.good(&["report", "bank.json", "cap/ch1.wav", "cap/ch2.wav", "-o", "page.html"]);
    let align = ["align", "spec.toml", "cap/ch1.wav", "cap/ch2.wav", "-o", "aligned.toml"];
    desk.refused(1, &align, &["spec.toml", "all channels need one rate"]);
    let page = text(&desk.read("page.html"));
    assert!(page.contains("interleaved as if they were taken in turn, and fused by the bank"));
}

/// A stream of interleaved frames, of one file or pipe per converter, and `fuse` give the same bits.
#[test]
fn streams_have_the_bits_of_files() {
    let desk = desk();
    captured(&desk, &["--samples", "3000"]);
    fused(&desk, CAPTURES, "late.wav", &["--keep-latency", "--algorithm", "direct"]);
    let late = wav::samples(&desk, "late.wav");
    let [a, b] = CAPTURES.map(|name| wav::samples(&desk, name));
    let frames: Vec<f32> = a.chunks(3).zip(b.chunks(2)).flat_map(|(a, b)| [a, b].concat()).collect();
    let streamed = desk.piped(&["stream", "bank.json", "--format", "f32le"], &bytes(&frames));
    assert_eq!(streamed, bytes(&late[..a.len() * 2]));
    desk.write("a.raw", bytes(&a));
    desk.write("b.raw", bytes(&b));
    let inputs = ["stream", "bank.json", "--format", "f32le", "--input", "a.raw", "--input", "b.raw"];
    assert_eq!(desk.piped(&inputs, &[]), streamed);
    // One file of whole frames.
    wav::write(&desk, "frames.wav", 5, 8000, &frames);
    let again = ["fuse", "bank.json", "frames.wav", "-o", "again.wav", "--keep-latency"];
    desk.report(&[&again[..], &DIRECT].concat());
    assert_eq!(wav::samples(&desk, "again.wav"), late);
    // The output of `fuse` lies on the time axis of the converters: the wait is no part of what is dropped.
    let report = fused(&desk, CAPTURES, "fused.wav", &DIRECT);
    assert_eq!(report["latency_dropped"], 22 - WAIT);
    assert_eq!(wav::samples(&desk, "fused.wav")[..2900], late[22 - WAIT..][..2900]);
}

/// The shortest recording counts, in whole frames.
#[test]
fn recordings_of_unequal_length_are_cut_to_whole_frames() {
    let desk = desk();
    captured(&desk, &["--samples", "3000"]);
    let [a, b] = CAPTURES.map(|name| wav::samples(&desk, name));
    wav::write(&desk, "a.wav", 1, 24_000, &a[..1000]);
    wav::write(&desk, "b.wav", 1, 16_000, &b[..601]);
    let longer = [("a.wav", 100), ("b.wav", 1)]
        .map(|(file, count)| format!("{file}: longer than the shortest channel, {count} samples"));
    desk.warned(&["fuse", "bank.json", "a.wav", "b.wav", "-o", "out.wav"], &[&longer[0], &longer[1]]);
    assert_eq!(wav::samples(&desk, "out.wav").len(), 300 * 6);
    let longest = fused(&desk, ["a.wav", "b.wav"], "long.wav", &["--longest", "--gaps"]);
    assert_eq!(longest["samples"], 334 * 6);
    // 334 frames need 1002 and 668 samples.
    assert_eq!(longest["gaps"]["missing"], 2 + 67, "{longest}");
}

/// Any number of samples may be lost; they count for their converter.
#[test]
fn lost_samples_count_for_their_converter() {
    let desk = desk();
    captured(&desk, &["--samples", "6000"]);
    let [a, b] = CAPTURES.map(|name| wav::samples(&desk, name));
    let (mut nan, mut left_out) = (a.clone(), a.clone());
    nan[100..107].fill(f32::NAN);
    left_out.drain(100..107);
    wav::write(&desk, "nan.wav", 1, 24_000, &nan);
    wav::write(&desk, "out.wav", 1, 24_000, &left_out);
    wav::write(&desk, "b.wav", 1, 16_000, &b);
    let lines = "{\"channel\": 1, \"sample_start\": 0, \"global_index\": 0}\n{\"channel\": 1, \"sample_start\": 100, \"global_index\": 107}\n{\"channel\": 2, \"first\": 40, \"length\": 3}\n";
    desk.write("lost.jsonl", lines);
    desk.write("invalid.jsonl", lines.lines().last().unwrap());
    let fuse = |a: &str, lost: &str, output: &str| {
        fused(&desk, [a, "b.wav"], output, &["--lost", lost, "--gaps", "--mask", "mask"])
    };
    let marked = fuse("nan.wav", "invalid.jsonl", "one.wav");
    let mask = desk.read("mask");
    let cut = fuse("out.wav", "lost.jsonl", "two.wav");
    for report in [&marked, &cut] {
        assert_eq!(report["gaps"]["count"], 2, "{report}");
        let mut list = places(&report["gaps"]);
        list.sort_unstable();
        assert_eq!(list, [[1, 100, 7], [2, 40, 3]]);
    }
    let [one, two] = ["one.wav", "two.wav"].map(|name| wav::samples(&desk, name));
    assert_eq!(one[..5900], two[..5900]);
    // What no lost sample touches is as if none had been lost.
    wav::write(&desk, "a.wav", 1, 24_000, &a);
    fused(&desk, ["a.wav", "b.wav"], "whole.wav", &DIRECT);
    let whole = wav::samples(&desk, "whole.wav");
    let differs: Vec<usize> = (0..5900).filter(|&n| one[n] != whole[n]).collect();
    assert!(!differs.is_empty() && differs.iter().all(|&n| mask[n] > 0));
}

#[test]
fn recordings_must_have_the_rates_of_their_converters() {
    let desk = desk();
    captured(&desk, &["--samples", "600"]);
    for (code, inputs, parts) in [
        (1, "cap/ch2.wav cap/ch1.wav", &["ch2.wav", "16000 Hz", "24000 Hz", "in the order"][..]),
        (1, "cap/ch1.wav", &["converters with rates of their own"]),
        (2, "cap/ch1.wav --interleaved 2", &["rates of their own"]),
    ] {
        desk.refused(code, &words(&format!("fuse bank.json -o x.wav {inputs}")), parts);
    }
}

/// Delays, gains and offsets per converter, from recordings at their own rates.
#[test]
fn converters_of_unequal_rates_are_calibrated_by_tones() {
    let desk = Desk::with_spec(SPEC);
    let errors = words("--delay-error 0,0.05samples --gain-error 0,2% --noise 1e-4 --samples 96000");
    let source = "tones:1.1kHz,2.3kHz,9.7kHz";
    let simulate = ["simulate", "spec.toml", "--source", source, "--gain", "0.2", "-o", "cap", "--json"];
    desk.good(&[&simulate[..], &errors[..]].concat());
    let calibrate = ["calibrate", "spec.toml", "cap/ch1.wav", "cap/ch2.wav", "-o", "measured.toml"];
    let report = desk.report(&[&calibrate[..], &["--tone", "1.1kHz,2.3kHz,9.7kHz"]].concat());
    let channels = report["channels"].as_array().unwrap();
    assert_eq!(channels.len(), 2, "{report}");
    let near = |key: &str, want: f64, most: f64| {
        let found = &channels[1][key];
        let (value, half) = (found["value"].as_f64().unwrap(), found["half_width"].as_f64().unwrap());
        // Three standard deviations, and intervals that say something.
        assert!((value - want).abs() < 1.6 * half && half < most, "{key}: {found}, {want}");
    };
    near("delay_samples", 1.15, 2e-3);
    near("gain", 1.05 * 1.02, 2e-3);
    near("offset", 0.01, 1e-4);
    let written = text(&desk.read("measured.toml"));
    assert!(written.contains("rate = \"16 kHz\""), "{written}");
    assert_eq!(written.contains("# "), SPEC.contains("# "), "{written}");
    // Found tones, and the misfit of a right model.
    let found = desk.report(&["calibrate", "spec.toml", "cap/ch1.wav", "cap/ch2.wav", "-o", "found.toml"]);
    assert!(found["misfit"].as_f64().unwrap() < 2.0, "{found}");
    assert_eq!(found["tones"].as_array().unwrap().len(), 3, "{found}");
    let blind = "calibrate spec.toml cap/ch1.wav cap/ch2.wav --blind -o x.toml";
    desk.refused(1, &words(blind), &["by tones"]);
}

/// Errors of one converter are one number on the command line.
#[test]
fn worst_cases_take_one_error_per_converter() {
    let spec = SPEC.replace("method = \"h2\"\ntaps = 72\nnoise = 3e-4", "method = \"fir\"\ntaps = 18");
    let desk = Desk::with_spec(&spec);
    desk.report(&["design", "spec.toml", "-o", "bank.json"]);
    let plain = desk.json(&["analyze", "bank.json", "--json"]);
    let moved = desk.json(&["analyze", "bank.json", "--delay-error", "0,4e-7", "--json"]);
    let (at, without) = (&moved["with_errors"]["snr_db"], &plain["figures"]["snr"]["total_db"]);
    assert!(at.as_f64().unwrap() < without.as_f64().unwrap(), "{plain} {moved}");
    desk.refused(1, &["analyze", "bank.json", "--delay-error", "0,0,0,1e-9,1e-9"], &["2"]);
}

/// Converters that sample later than their frame begins: the design is that of delays two fast periods
/// larger, and the output lies on the time axis.
#[test]
fn negative_delays_count_from_a_later_instant() {
    let desk = Desk::new();
    let spec = |delays: [f64; 2]| {
        let channel = |delay: f64| format!("[[channel]]\ndelay_samples = {delay}\nbits = 16\n");
        format!(
            "fast_rate = 48000\nratio = 2\nlatency = 24\n[target]\nfilter = {{ family = \"butterworth\", order = 4, \
             cutoff = 14000 }}\n[signal]\nband = 18000\n{}{}[design]\nmethod = \"h2\"\ntaps = 40\n",
            channel(delays[0]),
            channel(delays[1])
        )
    };
    let taps = |name: &str| {
        let bank: Value = serde_json::from_slice(&desk.read(&format!("{name}.json"))).unwrap();
        let channels = bank["channels"].as_array().unwrap().iter();
        let taps = channels.flat_map(|one| one["taps"].as_array().unwrap());
        taps.map(|tap| tap.as_f64().unwrap()).collect::<Vec<f64>>()
    };
    for (name, delays) in [("late", [-1.5, -0.75]), ("early", [0.5, 1.25])] {
        desk.write(&format!("{name}.toml"), spec(delays));
        let (toml, json) = (format!("{name}.toml"), format!("{name}.json"));
        let said = desk.run(&["design", &toml, "-o", &json], &[]);
        let expected = "a delay is negative, so all count as 2 fast periods later; the latency includes them";
        assert_eq!(text(&said.stderr).contains(expected), name == "late", "{said:?}");
        let tones = "tones:440Hz,3.1kHz,7.3kHz,11.9kHz,16.1kHz";
        desk.good(&["simulate", &json, "--source", tones, "--samples", "8000", "-o", name]);
        let [one, two] = ["ch1", "ch2"].map(|file| format!("{name}/{file}.wav"));
        desk.report(&["fuse", &json, &one, &two, "-o", "out.wav"]);
        let wanted = wav::samples(&desk, &format!("{name}/target.wav"));
        let snr = wav::snr_db(&wav::samples(&desk, "out.wav"), &wanted, 200);
        assert!(snr > 70.0, "{name}: {snr}");
    }
    // Delays in seconds are rounded.
    let (late, early) = (taps("late"), taps("early"));
    assert_eq!((late.len(), early.len()), (80, 80));
    assert!(late.iter().zip(&early).all(|(a, b)| (a - b).abs() < 1e-9), "{late:?} {early:?}");
}
