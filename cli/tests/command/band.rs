//! The signal's band from a new user's first result to calibrated converters.

use crate::calibrate::design;
use crate::support::{Desk, THESIS, text};
use serde_json::Value;
use std::fs;
use std::path::Path;

/// The value at a pointer of a report.
fn number(report: &Value, pointer: &str) -> f64 {
    report.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("{pointer} in {report}"))
}

/// The first block of a language in README.md.
fn readme_block(language: &str) -> String {
    let readme =
        fs::read_to_string(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/..")).join("README.md")).unwrap();
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
    assert_eq!(promised.pointer("/figures/simple/0/way").unwrap(), "cubic-spline");
    let spline = number(&promised, "/figures/simple/0/snr_db");
    assert!((36.0..39.0).contains(&spline) && measured > spline + 95.0, "{spline}");
    assert!(number(&found, "/reference/lag_samples/value").abs() < 1e-6, "{found}");
}

/// Four converters of 12 bits with skews, unequal bandwidths, gains and 100 fs of jitter. `delays` in
/// nanoseconds, `cutoffs` in megahertz.
fn converters(delays: [f64; 4], cutoffs: [f64; 4]) -> String {
    let channel = |(delay, cutoff)| {
        format!(
            "[[channel]]\ndelay = \"{delay} ns\"\nfilter = {{ family = \"rc\", cutoff = \"{cutoff} MHz\" }}\n"
        )
    };
    let channels: String = delays.into_iter().zip(cutoffs).map(channel).collect();
    format!(
        "fast_rate = \"1 GS/s\"\nratio = 4\n[target]\nfilter = {{ family = \"rc\", cutoff = \"600 MHz\" }}\n\
         [signal]\nband = \"400 MHz\"\n{channels}[design]\nmethod = \"fir\"\ntaps = 48\n"
    )
}

/// Calibrated from one capture of tones that share no period, then tested with others.
#[test]
fn calibrated_interleaved_converters_have_small_spurs_up_to_the_end_of_the_band() {
    const TONES: &str = "37.1237MHz,161.3191MHz,211.7313MHz,333.3517MHz,388.9719MHz";
    let errors = "--gain-error 0.5%,-0.4%,0.3%,0 --offset 0.002,-0.001,0.0015,0 --bits 12 --jitter 100fs";
    let desk = Desk::with_spec(THESIS);
    fs::write(desk.path("nominal.toml"), converters([3.0, 2.0, 1.0, 0.0], [600.0; 4])).unwrap();
    let truth = converters([3.003, 1.9972, 1.0025, 0.0], [606.0, 595.0, 603.0, 600.0]);
    fs::write(desk.path("true.toml"), truth).unwrap();
    let capture = |source: &str, gain: &str, folder: &str| {
        let simulate = ["simulate", "true.toml", "--source", source, "--samples", "262144", "--gain", gain];
        let rest = ["--seed", "7", "-o", folder];
        desk.good(&simulate.into_iter().chain(errors.split(' ')).chain(rest).collect::<Vec<_>>());
        [1, 2, 3, 4].map(|channel| format!("{folder}/ch{channel}.wav"))
    };
    let with = |command: &[&str], files: &[String; 4], rest: &[&str]| {
        let files = files.iter().map(String::as_str);
        desk.good(&command.iter().copied().chain(files).chain(rest.iter().copied()).collect::<Vec<_>>());
    };
    let training = capture(&format!("tones:{TONES}"), "0.19", "training");
    let rest =
        ["-o", "measured.toml", "--reference", "4", "--tone", TONES, "--fit", "delay,gain,offset,cutoff"];
    with(&["calibrate", "nominal.toml"], &training, &rest);
    let tones = ["392.1MHz", "62.1MHz", "183.1MHz"];
    let is_slow = trials::is_slow("calibrated interleaved converters: uncertain delays and three tones");
    if !is_slow {
        // Values that are taken as exact.
        let measured = text(&desk.read("measured.toml"));
        desk.write("measured.toml", measured.split("[uncertainty]").next().unwrap_or_default());
    }
    design(&desk, "measured.toml");
    for tone in if is_slow { &tones[..] } else { &tones[..1] } {
        let files = capture(&format!("tones:{tone}"), "0.9", tone);
        with(&["fuse", "bank.json"], &files, &["-o", "fused.wav", "--force"]);
        let measure = ["measure", "fused.wav", "--interleaved", "4", "--skip", "200", "--tone", tone];
        let report = desk.json(&[&measure[..], &["--json"]].concat());
        let sfdr = number(&report, "/sfdr_db");
        println!("{tone}: SFDR {sfdr:.1} dB");
        assert!(sfdr > 95.0, "{tone}: {report}");
    }
}
