//! What the user meant: units, implausible specs, the scale of gamma, specs to begin with.

use crate::support::{Desk, number, text};

/// Two audio converters; the words in braces are replaced.
const AUDIO: &str = "\
fast_rate = 48000.0
ratio = 2
latency = 12
[target]
filter = { family = \"butterworth\", order = 4, cutoff = 9000.0 }
[[channel]]
delay = 25e-6
[[channel]]
delay = 12.5e-6
[design]
method = \"fir\"
taps = 24
";

fn designed(desk: &Desk, spec: &str, flags: &[&str]) -> (Option<i32>, String) {
    desk.write("spec.toml", spec);
    let args = [&["design", "spec.toml", "-o", "b.json", "--force"][..], flags].concat();
    let output = desk.run(&args, &[]);
    (output.status.code(), text(&output.stderr))
}

/// Each of these once gave exit code 0 and a proud report.
#[test]
fn slips_are_warned_of_and_refused_with_strict() {
    let audio = AUDIO.replace("latency = 12", "latency = 6").replace("taps = 24", "taps = 12");
    let desk = Desk::with_spec(&audio);
    let thesis = "{ num = [0.25], den = [1.0, 1.0, 0.25] }";
    let family = "{ family = \"butterworth\", order = 4, cutoff = 9000.0 }";
    for (spec, part) in [
        (audio.replace("9000.0", "9.0"), "write the unit, as in cutoff = \"9 kHz\""),
        (audio.replace("9000.0", "9e6"), "above the output's Nyquist frequency 24 kHz"),
        (audio.replace(family, thesis), "look normalised to one sample"),
        (audio.replace("= 25e-6", "= 12.501e-6"), "channels 1 and 2 sample 4.8e-5 fast periods apart"),
        (audio.replace("= 25e-6", "= 250e-6"), "more than the ratio 2"),
        (audio.replace("= 25e-6", "= 12.6e-6"), "noise gain"),
    ] {
        let (code, message) = designed(&desk, &spec, &[]);
        assert!(code == Some(0) && message.contains(part), "{part}: {code:?} {message}");
        let before = desk.read("b.json");
        let (code, message) = designed(&desk, &spec, &["--strict"]);
        assert!(code == Some(1) && message.contains("--strict"), "{part}: {code:?} {message}");
        assert!(desk.read("b.json") == before, "{part}");
    }
    assert_eq!(designed(&desk, &audio, &["--strict"]), (Some(0), String::new()));
}

#[test]
fn gamma_has_a_scale_and_the_spec_is_echoed() {
    let desk = Desk::with_spec(AUDIO);
    let report = desk.json(&["design", "spec.toml", "-o", "b.json", "--json"]);
    assert_eq!(
        report["understood"],
        "48 kS/s from 2 x 24 kS/s; target -3 dB at 9 kHz (0.37 of Nyquist); delays 1.2, 0.6 samples; \
         latency 12 samples = 250 us"
    );
    let (zero, plain) = (number(&report, "/scale/zero_output"), number(&report, "/scale/interleaving"));
    assert!(number(&report, "/gamma/norm") < 0.1 * plain && plain < zero, "{report}");
    assert!((zero - 1.0).abs() < 1e-3, "the target has unit gain: {report}");
}

#[test]
fn every_spec_to_begin_with_is_designed_as_it_is() {
    let desk = Desk::with_spec(AUDIO);
    let is_all = trials::is_slow("proven designs of all specs to begin with");
    for example in ["ti-adc", "audio-2x", "sensor-array", "oversampled", "thesis"] {
        desk.good(&["init", "--example", example, "-o", "new.toml", "--force"]);
        let text = String::from_utf8(desk.read("new.toml")).unwrap();
        assert!(text.starts_with('#') && text.contains("[[channel]]"), "{example}: {text}");
        assert_eq!(desk.good(&["init", "--example", example]), text);
        // They are those of filters/, whose designs are tested without proofs.
        if is_all || example == "audio-2x" {
            desk.good(&["design", "new.toml", "-o", "new.json", "--force", "--strict"]);
        }
    }
    desk.refused(1, &["init", "-o", "new.toml"], &["new.toml", "exists", "--force"]);
    desk.refused(2, &["init", "--example", "adc"], &["ti-adc"]);
}

#[test]
fn help_has_the_reference_of_specs() {
    let desk = Desk::with_spec(AUDIO);
    let reference = desk.good(&["help", "spec"]);
    for key in ["fast_rate", "delay_samples", "butterworth", "gamma_margin", "cascade"] {
        assert!(reference.contains(key), "{key}");
    }
    assert_eq!(desk.good(&["help", "design"]), desk.good(&["design", "--help"]));
    desk.refused(2, &["help", "dezign"], &["dezign", "spec, init, design"]);
}

/// The curve that must be in a picture is there, and no number is missing.
#[test]
fn a_bank_is_drawn_in_nine_pictures() {
    let desk = Desk::with_spec(AUDIO);
    for flags in [&[][..], &["--method", "iir"]] {
        let spec = if flags.is_empty() { AUDIO.to_owned() } else { AUDIO.replace("taps = 24\n", "") };
        assert_eq!(designed(&desk, &spec, flags), (Some(0), String::new()));
        let files = desk.good(&["plot", "b.json", "-o", "pictures", "--force"]);
        assert_eq!(files.lines().count(), 9);
        assert!(files.starts_with("pictures/tones.svg\n"), "{files}");
        for (name, words) in [
            ("tones", &["largest image", "error of gain and phase", "input frequency, kHz"][..]),
            ("front-ends", &["target", "channel 2", "kHz", "half the output rate"]),
            ("front-ends", &["half the rate of a converter"]),
            ("filters", &["channel 1", "channel 2", "dB"]),
            ("analysis", &["target", "channel 2", "kHz"]),
            ("phase", &["channel 1", "rad"]),
            ("group-delay", &["fast samples"]),
            ("impulse-responses", &["channel 2"]),
            ("error", &["upper bound", "lower bound", "modulo the slow rate"]),
            ("delay-error", &["gamma", "error of the delay"]),
        ] {
            let picture = String::from_utf8(desk.read(&format!("pictures/{name}.svg"))).unwrap();
            assert!(picture.starts_with("<svg") && !picture.contains("NaN"), "{name}");
            assert!(words.iter().all(|word| picture.contains(word)), "{name}: {words:?}");
        }
    }
    desk.refused(1, &["plot", "b.json", "-o", "pictures"], &["exists", "--force"]);
    let spectrum = ["measure", "x.wav", "--plot", "spectrum.png"];
    desk.refused(2, &spectrum, &["spectrum.png", "written as SVG", "name it spectrum.svg"]);
}

/// A response table of a Butterworth filter of order 4, by its definition.
fn bode(cutoff: f64, delay: f64) -> String {
    let mut text = "frequency (kHz), gain (dB), phase (deg)\n".to_owned();
    for k in 1..=120 {
        let f = 300.0 * f64::from(k);
        let x = f / cutoff;
        // (1 - x^2)^2 - (a b) x^2 .. multiplied out: two sections with the damping 2 cos(pi/8) and 2 cos(3
        // pi/8).
        let phase = |angle: f64| (2.0 * angle.cos() * x).atan2(1.0 - x * x);
        let pi = std::f64::consts::PI;
        let lag = phase(pi / 8.0) + phase(3.0 * pi / 8.0) + 2.0 * pi * f * delay;
        text += &format!("{:e},{:e},{:e}\n", f / 1e3, -10.0 * (1.0 + x.powi(8)).log10(), -lag.to_degrees());
    }
    text
}

/// A front end that is measured gives the bank that the filter itself gives; the bank stands alone.
#[test]
fn a_measured_front_end_is_modelled() {
    let desk = Desk::with_spec(AUDIO);
    let exact = desk.report(&["design", "--prove", "spec.toml", "-o", "exact.json"]);
    std::fs::create_dir(desk.path("sub")).unwrap();
    desk.write("sub/bode.csv", bode(9000.0, 0.0));
    let family = "{ family = \"butterworth\", order = 4, cutoff = 9000.0 }";
    let measured = AUDIO.replace(family, "{ response = \"bode.csv\", order = 4 }");
    desk.write("sub/spec.toml", &measured);
    let parts = ["bode.csv: 4 poles fitted to 120 frequencies", "300 Hz to 36 kHz; error at most"];
    desk.warned(&["design", "--prove", "sub/spec.toml", "-o", "b.json"], &parts);
    let bank = desk.read_json("b.json");
    let gamma = |value: f64, other: f64| (value / other - 1.0).abs();
    assert!(gamma(number(&bank, "/gamma/norm"), number(&exact, "/gamma/norm")) < 1e-6, "{bank}");
    assert!(bank["spec"]["target"]["filter"]["a"].is_array() && bank["spec"]["uncertainty"].is_null());
    std::fs::remove_dir_all(desk.path("sub")).unwrap();
    desk.good(&["verify", "b.json"]);
}

/// What the model misses is an error of the gains.
#[test]
fn the_error_of_a_model_is_carried_into_the_uncertainty() {
    let desk = Desk::with_spec(AUDIO);
    desk.write("bode.csv", bode(9000.0, 0.0));
    let family = "{ family = \"butterworth\", order = 4, cutoff = 9000.0 }";
    let spec = AUDIO
        .replace(family, "{ response = \"bode.csv\", order = 3 }")
        .replace("method = \"fir\"\ntaps = 24", "method = \"iir\"");
    desk.write("spec.toml", spec);
    let echo = desk.warned(&["design", "spec.toml", "-o", "b.json"], &[]);
    let said = echo.split("at most ").nth(1).and_then(|rest| rest.split(' ').next()).unwrap();
    let said: f64 = said.parse().unwrap();
    let carried = number(&desk.read_json("b.json"), "/spec/uncertainty/gain/1");
    let decibels = 20.0 * (1.0 + carried).log10();
    assert!(said > 0.01 && (decibels / said - 1.0).abs() < 0.01, "{echo}: {decibels}");
    for (filter, parts) in [
        ("{ response = \"none.csv\", order = 3 }", &["none.csv", "target.filter"][..]),
        ("{ response = \"bode.csv\" }", &["target.filter", "the key order is missing"]),
        ("{ touchstone = \"bode.csv\", order = 3 }", &["bode.csv", ".s1p or .s2p"]),
        ("{ response = \"bode.csv\", order = 3, num = [1.0] }", &["both response and num are given"]),
        ("{ response = \"late.csv\", order = 4 }", &["late.csv", "deembed", "without a delay of 400"]),
    ] {
        desk.write("late.csv", bode(9000.0, 400e-6));
        desk.write("bad.toml", AUDIO.replace(family, filter));
        desk.refused(1, &["design", "bad.toml", "-o", "bad.json"], parts);
    }
    let filter = "{ response = \"late.csv\", order = 4, deembed = \"400 us\" }";
    desk.write("late.toml", AUDIO.replace(family, filter));
    // The measurement that a spec names is an input, too.
    let before = desk.read("late.csv");
    let output = desk.run(&["design", "late.toml", "-o", "./late.csv", "--force"], &[]);
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    assert!(text(&output.stderr).contains("./late.csv: it is also the input"), "{output:?}");
    assert_eq!(desk.read("late.csv"), before);
    desk.warned(&["design", "late.toml", "-o", "late.json"], &[]);
}
