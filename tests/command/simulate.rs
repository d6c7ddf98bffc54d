//! The commands `simulate` and `demo`: virtual captures, fused again and compared with the target.

use crate::support::{Desk, THESIS, number, wav};
use serde_json::Value;
use std::fs;
use std::path::Path;

/// Sample rate and samples.
fn recording(path: &Path) -> (u32, Vec<f64>) {
    let (spec, samples) = wav::read(path);
    (spec.sample_rate, samples.into_iter().map(f64::from).collect())
}

/// 20 log10 of target over error, over samples `skip` .. end - `skip`.
fn snr_db(got: &[f64], target: &[f64], skip: usize) -> f64 {
    assert_eq!(got.len(), target.len());
    let judged = skip..target.len() - skip;
    let signal: f64 = judged.clone().map(|n| target[n].powi(2)).sum();
    let error: f64 = judged.map(|n| (got[n] - target[n]).powi(2)).sum();
    10.0 * (signal / error).log10()
}

#[test]
fn every_source_is_captured_and_fused() {
    let desk = Desk::with_spec(THESIS);
    desk.good(&["design", "spec.toml", "-o", "bank.json"]);
    // Worst-case gain 0.04 for white spectra; these live where the bank is much better.
    for (source, least) in [("step@20.3", 55.0), ("tones:0.3,0.8", 45.0), ("chirp:0.01Hz..0.05Hz@300s", 50.0)]
    {
        let captured = desk.json(&[
            "simulate",
            "bank.json",
            "--source",
            source,
            "-o",
            "cap",
            "--force",
            "--json",
            "--samples",
            "400",
        ]);
        assert_eq!((&captured["frames"], &captured["latency"]), (&Value::from(200), &Value::from(10)));
        assert_eq!(captured["files"].as_array().unwrap().len(), 3);
        let args =
            ["fuse", "bank.json", "cap/ch1.wav", "cap/ch2.wav", "-o", "y.wav", "--keep-latency", "--force"];
        desk.good(&args);
        let ((rate, fused), (_, target)) =
            (recording(&desk.path("y.wav")), recording(&desk.path("cap/target.wav")));
        assert_eq!((rate, fused.len()), (48_000, 400));
        let snr = snr_db(&fused, &target, 60);
        assert!(snr > least, "{source}: {snr:.1} dB");
    }
    desk.refused(
        1,
        &["simulate", "bank.json", "--source", "step@0.3", "-o", "cap"],
        &["cap/ch1.wav", "file exists", "--force"],
    );
}

#[test]
fn a_simulated_step_is_the_closed_form() {
    let desk = Desk::with_spec(THESIS);
    desk.good(&["simulate", "spec.toml", "--source", "step@0.3", "-o", "cap", "--gain", "0.5"]);
    // Step response of 0.25 / (s + 0.5)^2.
    let step = |t: f64| if t < 0.0 { 0.0 } else { 1.0 - (1.0 + 0.5 * t) * (-0.5 * t).exp() };
    for (name, delay, period) in [("ch1", 1.2, 2.0), ("ch2", 0.6, 2.0), ("target", 10.0, 1.0)] {
        let (_, samples) = recording(&desk.path(&format!("cap/{name}.wav")));
        for (k, x) in samples.iter().enumerate() {
            let expected = 0.5 * step(k as f64 * period - delay - 0.3);
            assert!((x - expected).abs() < 1e-7, "{name}[{k}]: {x} instead of {expected}");
        }
    }
}

#[test]
fn a_recording_is_a_source() {
    let desk = Desk::with_spec(THESIS);
    // A whole number of periods, so that the periodic continuation is the tone itself.
    let omega = std::f64::consts::TAU * 30.0 / 800.0;
    let tone: Vec<f32> = (0..800).map(|n| (omega * n as f64).sin() as f32).collect();
    wav::write(&desk, "tone.wav", 1, 8_000, &tone);
    let report = desk.json(&["simulate", "spec.toml", "--source", "tone.wav", "-o", "cap", "--json"]);
    assert_eq!(report["frames"], 400);
    // The response of 0.25 / (j w + 0.5)^2 has gain 0.25 / (w^2 + 0.25).
    let (gain, phase) = (0.25 / (omega * omega + 0.25), -2.0 * (omega / 0.5).atan());
    let (_, samples) = recording(&desk.path("cap/ch1.wav"));
    for (k, x) in samples.iter().enumerate() {
        let expected = gain * (omega * (2.0 * k as f64 - 1.2) + phase).sin();
        assert!((x - expected).abs() < 1e-6, "{k}: {x} instead of {expected}");
    }
    desk.refused(1, &["simulate", "spec.toml", "--source", "none.wav", "-o", "c2"], &["none.wav"]);
}

/// [`THESIS`] with the gains and offsets of two converters.
fn imperfect(gains: [f64; 2], offsets: [f64; 2]) -> String {
    let channel = |delay: &str, i: usize| {
        format!("delay = {delay}\ngain = {:?}\noffset = {:?}\n", gains[i], offsets[i])
    };
    THESIS.replace("delay = 1.2\n", &channel("1.2", 0)).replace("delay = 0.6\n", &channel("0.6", 1))
}

#[test]
fn gains_and_offsets_of_converters_are_undone() {
    let desk = Desk::with_spec(THESIS);
    desk.write("real.toml", imperfect([1.01, -0.97], [0.02, -0.011]));
    desk.good(&["design", "spec.toml", "-o", "ideal.json"]);
    desk.good(&["design", "real.toml", "-o", "real.json"]);
    desk.good(&["verify", "real.json"]);
    let simulate = |spec: &str, folder: &str| {
        desk.good(&["simulate", spec, "--source", "tones:0.3,0.8", "-o", folder, "--samples", "4000"]);
    };
    simulate("spec.toml", "ideal");
    simulate("real.json", "real");
    let capture = |folder: &str, name: &str| recording(&desk.path(folder).join(name)).1;
    for (name, gain, offset) in
        [("ch1.wav", 1.01, 0.02), ("ch2.wav", -0.97, -0.011), ("target.wav", 1.0, 0.0)]
    {
        for (real, ideal) in capture("real", name).iter().zip(capture("ideal", name)) {
            assert!((real - (gain * ideal + offset)).abs() < 1e-6, "{name}: {real} {ideal}");
        }
    }
    let snr = |bank: &str, folder: &str| {
        let [first, second] = ["ch1.wav", "ch2.wav"].map(|name| format!("{folder}/{name}"));
        desk.good(&["fuse", bank, &first, &second, "-o", "y.wav", "--keep-latency", "--force"]);
        snr_db(&capture("", "y.wav"), &capture(folder, "target.wav"), 60)
    };
    let [ideal, real, unaware] = [("ideal.json", "ideal"), ("real.json", "real"), ("ideal.json", "real")]
        .map(|(bank, folder)| snr(bank, folder));
    assert!((ideal - real).abs() < 0.1 && ideal > 45.0, "{ideal:.2} dB, {real:.2} dB");
    assert!(unaware < 10.0, "{unaware:.2} dB");
}

/// Converters without a signal deliver their offsets. The output is silence from the first sample to the last
/// one of the flush, and where samples are missing.
#[test]
fn converters_without_a_signal_give_silence() {
    let desk = Desk::with_spec(&imperfect([1.0, 1.0], [0.01, -0.3]));
    desk.good(&["design", "spec.toml", "-o", "bank.json"]);
    desk.good(&["simulate", "bank.json", "--source", "tones:1", "-o", "cap", "--gain", "0"]);
    let (rate, mut first) = recording(&desk.path("cap/ch1.wav"));
    assert!(first.iter().all(|&x| (x - 0.01).abs() < 1e-9), "{first:?}");
    first[40] = f64::NAN;
    first[0] = f64::NAN;
    let lossy: Vec<f32> = first.iter().map(|&x| x as f32).collect();
    wav::write(&desk, "lossy.wav", 1, rate, &lossy);
    for more in
        [&[][..], &["--keep-latency"], &["--gaps", "hold"], &["--gaps", "zero"], &["--algorithm", "fast-fir"]]
    {
        let args =
            [&["fuse", "bank.json", "lossy.wav", "cap/ch2.wav", "-o", "y.wav", "--force"], more].concat();
        // The missing samples are told.
        assert!(desk.run(&args, &[]).status.success());
        let fused = recording(&desk.path("y.wav")).1;
        assert!(fused.len() == 200 && fused.iter().all(|&y| y == 0.0), "{more:?}: {fused:?}");
    }
    desk.good(&[
        "stream",
        "bank.json",
        "--input",
        "cap/ch1.wav",
        "--input",
        "cap/ch2.wav",
        "--format",
        "wav",
        "--flush",
        "-o",
        "live.wav",
    ]);
    assert!(recording(&desk.path("live.wav")).1.iter().all(|&y| y == 0.0));
}

/// Two captures of a speech recording with the wanted signal, made elsewhere in the frequency domain.
#[test]
fn captures_made_elsewhere_are_fused() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data");
    let (captures, speech) = (data.join("captures/speech-2x"), data.join("audio/Front_Center.wav"));
    if !captures.is_dir() || !speech.is_file() {
        println!("skipped: no data in {}", data.display());
        return;
    }
    let desk = Desk::with_spec(THESIS);
    let at = |name: &str| captures.join(name).to_string_lossy().into_owned();
    desk.good(&["design", &at("spec.toml"), "-o", "bank.json"]);
    desk.good(&["fuse", "bank.json", &at("ch1.wav"), &at("ch2.wav"), "-o", "y.wav", "--keep-latency"]);
    let (fused, target) = (recording(&desk.path("y.wav")).1, recording(&captures.join("target.wav")).1);
    let snr = snr_db(&fused, &target, 200);
    assert!(snr >= 65.0, "{snr:.2} dB");
    let source = speech.to_string_lossy().into_owned();
    desk.good(&["simulate", "bank.json", "--source", &source, "-o", "cap"]);
    for name in ["ch1.wav", "ch2.wav", "target.wav"] {
        let (ours, theirs) = (recording(&desk.path("cap").join(name)).1, recording(&captures.join(name)).1);
        let worst = ours.iter().zip(&theirs).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-6 && ours.len().abs_diff(theirs.len()) <= 2, "{name}: {worst:e}");
    }
}

#[test]
fn the_demo_shows_the_order_of_the_methods() {
    let desk = Desk::with_spec(THESIS);
    let report = desk.json(&["demo", "-o", "shown", "--json"]);
    let snr = |k: usize| number(&report, &format!("/contenders/{k}/snr_db"));
    assert!(snr(0) > 66.0 && snr(1) > 66.0, "{report}");
    assert!((2..5).all(|k| snr(k) < 40.0), "{report}");
    for file in
        ["ch1.wav", "ch2.wav", "target.wav", "fused-fir.wav", "fused-iir.wav", "step.svg", "error.svg"]
    {
        assert!(fs::metadata(desk.path("shown").join(file)).unwrap().len() > 1000, "{file}");
    }
    desk.refused(1, &["demo", "-o", "shown"], &["shown", "--force"]);
}
