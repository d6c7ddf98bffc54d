//! The command `measure`, and `fuse --measure`.

use crate::support::random::Random;
use crate::support::{Desk, THESIS, number, wav};
use std::f64::consts::TAU;
use std::fs;

const RATE: f64 = 48_000.0;

/// Two converters in turn: offsets of +-0.01, gains of 1 +- 0.02; some noise.
fn capture(count: usize, hertz: f64) -> Vec<f32> {
    let mut random = Random(4);
    let at = |n: usize| {
        let sign = if n.is_multiple_of(2) { 1.0 } else { -1.0 };
        let noise = 1e-4 * (0..6).map(|_| random.sample()).sum::<f64>();
        (sign * 0.01 + 0.5 * (1.0 + 0.02 * sign) * (TAU * hertz / RATE * n as f64).cos() + noise) as f32
    };
    (0..count).map(at).collect()
}

fn db(ratio: f64) -> f64 {
    20.0 * ratio.log10()
}

#[test]
fn a_recording_is_measured() {
    let desk = Desk::with_spec(THESIS);
    wav::write(&desk, "x.wav", 1, 48_000, &capture(20_000, 4321.0));
    let found = desk.json(&["measure", "x.wav", "--interleaved", "2", "--json"]);
    assert!((number(&found, "/tones/0/frequency_hertz/value") - 4321.0).abs() < 0.01);
    assert!((number(&found, "/tones/0/level_dbfs") - db(0.5)).abs() < 0.01);
    // The offset at half the rate and the gain at 24000 - 4321, relative to an amplitude of 0.5.
    assert_eq!(number(&found, "/spurs/0/frequency_hertz"), 24_000.0);
    // (-1)^n a has the power a^2, a sine a^2 / 2.
    assert!((number(&found, "/spurs/0/level_dbc") - db(2f64.sqrt() * 0.01 / 0.5)).abs() < 0.05);
    assert_eq!(found["spurs"][0]["causes"][0]["kind"], "offset");
    assert!((number(&found, "/spurs/1/level_dbc") - db(0.02)).abs() < 0.05);
    assert!((number(&found, "/spurs/1/frequency_hertz") - 19_679.0).abs() < 0.01);
    assert_eq!(found["spurs"][1]["causes"][0]["kind"], "gain_or_skew");
    let spurs = 0.01f64.powi(2) + 0.5 * 0.01f64.powi(2);
    assert!((number(&found, "/sinad_db") - 10.0 * (0.125 / spurs).log10()).abs() < 0.05);
    assert!(number(&found, "/sfdr_without_interleaving_db") > 70.0);
    let report = desk.good(&["measure", "x.wav", "--interleaved", "2", "--tone", "4.32kHz"]);
    for part in ["SINAD", "ENOB, full scale", "noise density", "offset, 1/2 fs", "gain or skew, 1/2 fs - f"] {
        assert!(report.contains(part), "{part}: {report}");
    }
    // A single converter has no interleaving spurs: the same lines are unknown.
    let single = desk.json(&["measure", "x.wav", "--json"]);
    assert!(single["interleaving_db"].is_null());
    assert_eq!(single["spurs"][0]["causes"][0]["kind"], "unknown");
}

/// An exponential of negative frequency whose imaginary part is 1 % larger.
#[test]
fn a_complex_recording_is_measured() {
    let desk = Desk::with_spec(THESIS);
    let mut random = Random(4);
    let mut noisy = |x: f64| (x + 1e-5 * random.sample()) as f32;
    let pair = |n: usize| (0.5 * (-TAU * 0.17 * n as f64).cos(), 0.505 * (-TAU * 0.17 * n as f64).sin());
    let bytes = (0..8000).map(pair).flat_map(|(x, y)| [noisy(0.01 + x), noisy(y - 0.02)]);
    desk.write("x.cf32", bytes.flat_map(f32::to_le_bytes).collect::<Vec<u8>>());
    let args = ["measure", "x.cf32", "--format", "cf32", "--rate", "1MHz"];
    let found = desk.json(&[&args[..], &["--json"]].concat());
    let near = |path: &str, want: f64, tolerance: f64| {
        let got = number(&found, path);
        assert!((got - want).abs() < tolerance, "{path}: {got} instead of {want}");
    };
    near("/tones/0/frequency_hertz/value", -170_000.0, 0.01);
    near("/tones/0/amplitude/value", 0.5025, 1e-6);
    near("/offset/value", 0.01, 1e-6);
    near("/quadrature/offset/value", -0.02, 1e-6);
    near("/quadrature/imbalances/0/gain/value", 1.01, 3e-6);
    near("/quadrature/imbalances/0/phase_radians/value", 0.0, 3e-6);
    near("/quadrature/imbalances/0/image_rejection_db", db(2.01 / 0.01), 0.01);
    near("/spurs/0/frequency_hertz", 170_000.0, 0.01);
    assert_eq!(found["spurs"][0]["causes"][0]["kind"], "image");
    let report = desk.good(&[&args[..], &["--tone", "-170kHz", "--plot", "x.svg"]].concat());
    for part in ["-170000.0", "offset, imag.", "image rejection 46.06 dB", "image, -f"] {
        assert!(report.contains(part), "{part}: {report}");
    }
    assert!(fs::read_to_string(desk.path("x.svg")).unwrap().contains("\n-400\n"));
    let compared = [&args[..], &["--ref", "x.cf32"]].concat();
    desk.refused(1, &compared, &["x.cf32: complex samples", "--ref"]);
    wav::write(&desk, "x.wav", 1, 48_000, &capture(2000, 4321.0));
    desk.refused(1, &["measure", "x.wav", "--tone", "-4321Hz"], &["-4321", "above 0"]);
}

/// A bank's output against the target of `simulate`, as README says: no lag, and the SNR of the bank also
/// sample by sample.
#[test]
fn a_fused_recording_lies_on_the_time_axis_of_its_target() {
    let desk = Desk::with_spec(THESIS);
    desk.good(&["design", "spec.toml", "-o", "bank.json"]);
    let chirp = "chirp:0.01Hz..0.05Hz@4000s";
    desk.good(&["simulate", "spec.toml", "--source", chirp, "-o", "cap"]);
    desk.good(&["fuse", "bank.json", "cap/ch1.wav", "cap/ch2.wav", "-o", "y.wav"]);
    let found = desk.json(&["measure", "y.wav", "--ref", "cap/target.wav", "--json"]);
    let [aligned, plain] =
        ["/reference/snr_db", "/reference/snr_unaligned_db"].map(|figure| number(&found, figure));
    assert!(number(&found, "/reference/lag_samples/value").abs() < 0.01, "{found}");
    // The gain of this bank at 0 Hz is off by its gamma of 0.04 at most, which only the first takes out.
    assert!(aligned > 50.0 && (aligned - plain).abs() < 3.0, "{aligned} {plain}");
}

#[test]
fn a_recording_is_compared_with_a_reference() {
    let desk = Desk::with_spec(THESIS);
    let clean: Vec<f32> = (0..3000).map(|n| ((n * n) as f64 * 1e-4).sin() as f32).collect();
    // Seven samples late, half as large.
    let late: Vec<f32> = (0..3000).map(|n: usize| if n < 7 { 0.0 } else { 0.5 * clean[n - 7] }).collect();
    wav::write(&desk, "clean.wav", 1, 48_000, &clean);
    wav::write(&desk, "late.wav", 1, 48_000, &late);
    let found = desk.json(&["measure", "late.wav", "--ref", "clean.wav", "--json"]);
    assert!((number(&found, "/reference/lag_samples/value") - 7.0).abs() < 1e-6);
    assert!((number(&found, "/reference/gain/value") - 0.5).abs() < 1e-6);
    // Halves are exact, so there is no error, and no finite ratio to it.
    assert!(found["reference"]["snr_db"].is_null());
    assert_eq!(number(&found, "/reference/largest_error"), 0.0);
    assert!(number(&found, "/reference/snr_unaligned_db") < 10.0);
    assert!(found["sinad_db"].is_null());
    let report = desk.good(&["measure", "late.wav", "--ref", "clean.wav", "--plot", "e.svg"]);
    assert!(report.contains("lag") && report.contains("SNR, unaligned"), "{report}");
    assert!(fs::read_to_string(desk.path("e.svg")).unwrap().contains("error against clean.wav"));
    wav::write(&desk, "fast.wav", 1, 96_000, &clean);
    wav::write(&desk, "flat.wav", 1, 48_000, &[0.25; 3000]);
    for (reference, parts) in [
        ("fast.wav", &["fast.wav", "96000", "48000", "resample"][..]),
        ("flat.wav", &["late.wav against flat.wav", "constant"]),
    ] {
        desk.refused(1, &["measure", "late.wav", "--ref", reference], parts);
    }
    desk.refused(2, &["measure", "-", "--ref", "-"], &["`-` is given twice"]);
}

#[test]
fn clipping_and_hidden_spurs_are_said() {
    let desk = Desk::with_spec(THESIS);
    let loud: Vec<f32> = capture(6000, 4321.0).iter().map(|x| (3.0 * x).clamp(-1.0, 1.0)).collect();
    wav::write(&desk, "loud.wav", 1, 48_000, &loud);
    desk.warned(&["measure", "loud.wav"], &["limits of the range"]);
    // Floats beyond full scale did not clip there.
    let tall: Vec<f32> = capture(6000, 4321.0).iter().map(|x| 3.0 * x).collect();
    wav::write(&desk, "tall.wav", 1, 48_000, &tall);
    let said = desk.warned(&["measure", "tall.wav"], &[]);
    assert!(!said.contains("limits of the range"), "{said}");
    // A quarter of the rate: the image of two converters is the tone itself.
    wav::write(&desk, "quarter.wav", 1, 48_000, &capture(6000, 12_000.0));
    desk.warned(&["measure", "quarter.wav", "--interleaved", "2"], &["gain or skew, 1/2 fs - f"]);
}

/// Raw recordings have raw references, unless the name of one says its format.
#[test]
fn a_reference_has_the_format_of_the_recording() {
    let desk = Desk::with_spec(THESIS);
    let samples = capture(4000, 4321.0);
    let codes: Vec<u8> = samples.iter().flat_map(|x| ((x * 32768.0) as i16).to_le_bytes()).collect();
    desk.write("x.raw", &codes);
    desk.write("target.raw", &codes);
    let table = |scale: f32| samples.iter().fold(String::new(), |text, x| format!("{text}{}\n", x * scale));
    desk.write("x.csv", table(2.5));
    desk.write("target.csv", table(2.5));
    wav::write(&desk, "target.wav", 1, 48_000, &samples);
    let rate = ["--rate", "48kHz"];
    for (recording, target, how) in [
        ("x.raw", "target.raw", &["--format", "s16le"][..]),
        ("x.raw", "target.wav", &["--format", "s16le"]),
        ("x.csv", "target.csv", &["--full-scale", "2.5"]),
        ("x.csv", "target.wav", &["--full-scale", "2.5"]),
    ] {
        let found = desk.json(&[&["measure", recording, "--ref", target, "--json"], how, &rate].concat());
        let reference = &found["reference"];
        // 80 dB below the tone of 0.5; of equal samples the ratio is infinite, which JSON does not hold.
        let most = 1e-4 * 0.5_f64 / 2f64.sqrt();
        assert!(number(reference, "/error_rms") < most, "{recording} {target}: {reference}");
        assert!((number(reference, "/gain/value") - 1.0).abs() < 1e-4, "{recording} {target}: {reference}");
    }
}

/// Two channels 0.4 fast samples off their places: plain interleaving has the spurs of that skew, the bank
/// not.
#[test]
fn fuse_measures_before_and_after() {
    let desk = Desk::with_spec(THESIS);
    desk.good(&["design", "spec.toml", "-o", "b.json", "--taps", "40", "--latency", "20"]);
    let simulate = ["simulate", "b.json", "--source", "tones:0.35", "-o", "cap", "--samples", "8000"];
    desk.good(&simulate);
    let fuse = ["fuse", "b.json", "cap/ch1.wav", "cap/ch2.wav", "-o", "y.wav", "--measure"];
    let report = desk.good(&fuse);
    assert!(["interleaved", "SINAD", "fused"].iter().all(|part| report.contains(part)), "{report}");
    let found = desk.json(&[&fuse[..], &["--json", "--force"]].concat());
    let (before, after) =
        (number(&found, "/measure/before/sinad_db"), number(&found, "/measure/after/sinad_db"));
    assert!(after > before + 20.0, "{before} {after}");
    let tone = number(&found, "/measure/after/tones/0/frequency_hertz/value");
    assert!((tone - 0.35 / TAU * RATE).abs() < 0.1, "{tone}");
    for (input, output, parts) in
        [("-", "z.wav", &["--measure", "standard input"][..]), ("cap/ch2.wav", "-", &["--measure"])]
    {
        desk.refused(2, &["fuse", "b.json", "cap/ch1.wav", input, "-o", output, "--measure"], parts);
    }
    desk.refused(2, &[&fuse[..6], &["--tone", "9kHz"]].concat(), &["--measure"]);
    // Both over one axis: rings before and discs after, and one line in the legend for each cause.
    assert!(report.lines().any(|line| line.starts_with("worst of these")), "{report}");
    desk.good(&[&fuse[..], &["--force", "--plot", "both.svg"]].concat());
    let svg = String::from_utf8(desk.read("both.svg")).unwrap();
    for label in ["interleaved (rings)", "fused (discs)", "gain or skew", "SFDR"] {
        assert_eq!(svg.matches(label).count(), 1, "{label}");
    }
    let circles: Vec<&str> = svg.split("<circle").skip(1).filter_map(|rest| rest.split('>').next()).collect();
    let rings = circles.iter().filter(|circle| circle.contains("fill=\"none\"")).count();
    assert!(rings > 0 && circles.len() > rings, "{circles:?}");
    desk.refused(1, &[&fuse[..], &["--plot", "both.svg"]].concat(), &["both.svg", "exists", "--force"]);
    desk.refused(2, &[&fuse[..], &["--force", "--plot", "cap/ch1.wav"]].concat(), &["cap/ch1.wav"]);
    desk.refused(2, &[&fuse[..6], &["--plot", "z.svg"]].concat(), &["--measure"]);
    desk.refused(2, &[&fuse[..], &["--plot", "-"]].concat(), &["--plot -"]);
    assert!(!desk.path("z.wav").exists());
}
