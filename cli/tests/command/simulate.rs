//! The commands `simulate` and `demo`: virtual captures, fused again and compared with the target.

use crate::support::{Desk, THESIS, floats, number, wav, words};
use serde_json::Value;
use std::fs;
use std::path::Path;

pub(crate) fn recording(path: &Path) -> Vec<f64> {
    wav::read(path).1.into_iter().map(f64::from).collect()
}

#[test]
fn every_source_is_captured_and_fused() {
    let desk = Desk::with_spec(THESIS);
    desk.good(&["design", "spec.toml", "-o", "bank.json"]);
    // Worst-case gain 0.04 for white spectra; these live where the bank is much better.
    for (source, least) in [("step@20.3", 55.0), ("tones:0.3,0.8", 45.0), ("chirp:0.01Hz..0.05Hz@300s", 50.0)]
    {
        let simulate = format!("simulate bank.json --source {source} -o cap --force --json --samples 400");
        let captured = desk.json(&words(&simulate));
        assert_eq!((&captured["frames"], &captured["latency"]), (&Value::from(200), &Value::from(10)));
        assert_eq!(captured["files"].as_array().unwrap().len(), 3);
        desk.good(&["fuse", "bank.json", "cap/ch1.wav", "cap/ch2.wav", "-o", "y.wav", "--force"]);
        let (spec, fused) = wav::read(&desk.path("y.wav"));
        assert_eq!((spec.sample_rate, fused.len()), (48_000, 400));
        let snr = wav::snr_db(&fused, &wav::samples(&desk, "cap/target.wav"), 60);
        assert!(snr > least, "{source}: {snr:.1} dB");
    }
    let again = ["simulate", "bank.json", "--source", "step@0.3", "-o", "cap"];
    desk.refused(1, &again, &["cap/ch1.wav", "file exists", "--force"]);
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
    for (k, x) in recording(&desk.path("cap/ch1.wav")).iter().enumerate() {
        let expected = gain * (omega * (2.0 * k as f64 - 1.2) + phase).sin();
        assert!((x - expected).abs() < 1e-6, "{k}: {x} instead of {expected}");
    }
    desk.refused(1, &["simulate", "spec.toml", "--source", "none.wav", "-o", "c2"], &["none.wav"]);
}

/// Response of 0.25 / (s + 0.5)^2 to e^{j w t}.
fn exponential(omega: f64, t: f64) -> [f64; 2] {
    let (gain, phase) = (0.25 / (omega * omega + 0.25), omega * t - 2.0 * (omega / 0.5).atan());
    [gain * phase.cos(), gain * phase.sin()]
}

#[test]
fn complex_captures_have_their_closed_form_and_fuse_to_the_complex_target() {
    let desk = Desk::with_spec(THESIS);
    desk.good(&["design", "spec.toml", "-o", "bank.json"]);
    let simulate = ["simulate", "bank.json", "--source", "ctones:0.3,-0.8", "--samples", "400", "-o", "cap"];
    let report = desk.report(&simulate);
    assert_eq!((&report["is_complex"], &report["slow_rate"]), (&Value::from(true), &Value::from(24_000)));
    assert_eq!(report["files"][0], "cap/ch1.sigmf-meta");
    assert_eq!(desk.read_json("cap/ch1.sigmf-meta")["global"]["core:datatype"], "cf32_le");
    for (name, delay, period) in [("ch1", 1.2, 2.0), ("ch2", 0.6, 2.0), ("target", 0.0, 1.0)] {
        let samples = floats(&desk.read(&format!("cap/{name}.sigmf-data")));
        for (k, sample) in samples.chunks_exact(2).enumerate() {
            let (re, im) = (f64::from(sample[0]), f64::from(sample[1]));
            let t = k as f64 * period - delay;
            let (a, b) = (exponential(0.3, t), exponential(-0.8, t));
            let far = (re - a[0] - b[0]).hypot(im - a[1] - b[1]);
            assert!(far < 2e-7, "{name}[{k}]: {far:e}");
        }
    }
    let fuse = ["fuse", "bank.json", "cap/ch1.sigmf-meta", "cap/ch2.sigmf-meta", "-o", "y.sigmf-meta"];
    desk.good(&fuse);
    let parts = |name: &str| floats(&desk.read(name));
    let snr = wav::snr_db(&parts("y.sigmf-data"), &parts("cap/target.sigmf-data"), 120);
    assert!(snr > 45.0, "{snr:.1} dB");
    // Raw samples are the same numbers.
    desk.report(&[&simulate[..7], &["cap", "--to", "raw"]].concat());
    assert_eq!(desk.read("cap/ch2.cf32"), desk.read("cap/ch2.sigmf-data"));
    desk.refused(2, &[&simulate[..], &["--to", "wav"]].concat(), &["WAV files hold no complex samples"]);
}

/// WAV cannot state such rates.
#[test]
fn captures_at_gigahertz_are_sigmf_recordings() {
    let filter = r#"filter = { family = "butterworth", order = 3, cutoff = "2 GHz" }"#;
    let channels = "[[channel]]\ndelay = \"60 ps\"\n[[channel]]\ndelay = 0";
    let desk = Desk::with_spec(&format!(
        "fast_rate = \"10 GS/s\"\nratio = 2\nlatency = 4\n[target]\n{filter}\n{channels}"
    ));
    let args = ["simulate", "spec.toml", "--source", "tones:1MHz", "-o", "cap"];
    desk.refused(1, &args, &["do not fit a WAV header", "--to sigmf"]);
    desk.report(&[&args[..], &["--to", "sigmf"]].concat());
    assert_eq!(desk.read_json("cap/target.sigmf-meta")["global"]["core:sample_rate"], 1e10);
    assert_eq!(desk.read_json("cap/ch1.sigmf-meta")["global"]["core:datatype"], "rf32_le");
}

/// Two captures of a speech recording with the wanted signal, made elsewhere in the frequency domain.
#[test]
fn captures_made_elsewhere_are_fused() {
    let (Some(captures), Some(speech)) =
        (trials::data("captures/speech-2x"), trials::data("audio/Front_Center.wav"))
    else {
        return;
    };
    let desk = Desk::with_spec(THESIS);
    let at = |name: &str| captures.join(name).to_string_lossy().into_owned();
    desk.good(&["design", &at("spec.toml"), "-o", "bank.json"]);
    desk.good(&["fuse", "bank.json", &at("ch1.wav"), &at("ch2.wav"), "-o", "y.wav", "--keep-latency"]);
    let target = wav::read(&captures.join("target.wav")).1;
    let snr = wav::snr_db(&wav::samples(&desk, "y.wav"), &target, 200);
    assert!(snr >= 65.0, "{snr:.2} dB");
    let source = speech.to_string_lossy().into_owned();
    desk.good(&["simulate", "bank.json", "--source", &source, "-o", "cap"]);
    // Their target is late by the latency of their bank; the recording is periodic.
    for (name, late) in [("ch1.wav", 0), ("ch2.wav", 0), ("target.wav", 12)] {
        let (ours, theirs) = (recording(&desk.path("cap").join(name)), recording(&captures.join(name)));
        let worst = ours.iter().zip(&theirs[late..]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-6 && ours.len().abs_diff(theirs.len()) <= 2, "{name}: {worst:e}");
    }
}

#[test]
fn the_demo_shows_the_order_of_the_methods() {
    let desk = Desk::with_spec(THESIS);
    let report = desk.json(&["demo", "-o", "shown", "--json"]);
    let snr = |k: usize, part: &str| number(&report, &format!("/contenders/{k}/{part}/snr_db"));
    let [in_band, step] = ["in_band", "step"].map(|part| move |k| snr(k, part));
    // With the band of the signal, and for any input.
    assert!((0..2).all(|k| in_band(k) > 105.0 && step(k) > 78.0), "{report}");
    assert!(in_band(2) > 66.0 && step(2) > 59.0, "{report}");
    assert!((3..5).all(|k| in_band(k) < 40.0) && in_band(6) < 20.0, "{report}");
    // The best of the other methods, as SciPy's `CubicSpline` has it from the same files.
    assert!((in_band(5) - 39.7).abs() < 0.1, "{report}");
    for file in
        ["ch1.wav", "ch2.wav", "target.wav", "fused-fir.wav", "fused-iir.wav", "step.svg", "error.svg"]
    {
        assert!(fs::metadata(desk.path("shown").join(file)).unwrap().len() > 1000, "{file}");
    }
    desk.refused(1, &["demo", "-o", "shown"], &["shown", "--force"]);
}
