//! `align`: recorders that were started by hand, with clocks of their own.
//!
//! `HYBANK_SLOW=1` takes the whole grid of signals, clocks and starts, and prints its table.

use crate::support::random::Random;
use crate::support::{Desk, number, wav};
use serde_json::Value;
use std::f64::consts::TAU;

/// Two recorders of 48 kHz, ratio 1.
const SPEC: &str = r#"
fast_rate = 48000.0
ratio = 1
latency = 16
target = { filter = { family = "butterworth", order = 4, cutoff = 8000.0 } }
[[channel]]
delay_samples = 0.0
filter = { family = "butterworth", order = 4, cutoff = 16000.0 }
[[channel]]
delay_samples = 0.5
filter = { family = "butterworth", order = 4, cutoff = 16000.0 }
[design]
method = "fir"
taps = 32
"#;
const RATE: f64 = 48_000.0;

/// What both recorders hear, at 48 kHz.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Event {
    Noise,
    Music,
    Speech,
}

/// The second recorder relative to the first one, which has a clock that is right.
#[derive(Debug, Clone, Copy)]
struct Case {
    event: Event,
    seconds: f64,
    ppm: f64,
    /// Seconds by which the second one began later; below 0 for earlier.
    late: f64,
}

impl Event {
    /// `None` where its recordings are not there.
    fn samples(self, count: usize, dice: &mut Random) -> Option<Vec<f32>> {
        match self {
            Self::Noise => Some(noise(count, dice)),
            Self::Music => Some(music(count, dice)),
            Self::Speech => speech(count, dice),
        }
    }
}

/// Noise up to about 5 kHz whose level changes.
fn noise(count: usize, dice: &mut Random) -> Vec<f32> {
    let (mut y, mut z) = (0.0, 0.0);
    let sample = |k: usize| {
        y = 0.5 * y + 0.5 * dice.sample();
        z = 0.5 * z + 0.5 * y;
        (0.5 * z * (1.2 + (TAU * 1.3 * k as f64 / RATE).sin())) as f32
    };
    (0..count).map(sample).collect()
}

/// Plucked notes of a scale, at random times.
fn music(count: usize, dice: &mut Random) -> Vec<f32> {
    let mut samples = vec![0.0; count];
    for _ in 0..count / 6000 {
        let begin = (dice.part() * count as f64) as usize;
        let pitch = 110.0 * 2f64.powf((24.0 * dice.part()).floor() / 12.0);
        for (k, slot) in samples[begin..].iter_mut().take(40_000).enumerate() {
            let t = k as f64 / RATE;
            let wave = |n: i32| (TAU * pitch * f64::from(n) * t).sin() * (-2.0 * f64::from(n) * t).exp();
            *slot += 0.1 * (1..8).map(|n| wave(n) / f64::from(n)).sum::<f64>();
        }
    }
    samples.into_iter().map(|x| x as f32).collect()
}

/// Words with pauses: recordings of speech, forwards and backwards, slower and faster.
fn speech(count: usize, dice: &mut Random) -> Option<Vec<f32>> {
    let words = ["audio/Front_Center.wav", "audio/Rear_Left.wav"];
    let words: Vec<Vec<f64>> =
        words.iter().map(|name| Some(word(&trials::data(name)?))).collect::<Option<_>>()?;
    let mut samples = Vec::with_capacity(count);
    while samples.len() < count {
        let (word, speed) = (&words[usize::from(dice.part() < 0.5)], 0.8 + 0.5 * dice.part());
        let is_backwards = dice.part() < 0.5;
        let length = ((word.len() - 2) as f64 / speed) as usize;
        samples.extend((0..length).map(|k| {
            let at = speed * if is_backwards { length - 1 - k } else { k } as f64;
            let (whole, part) = (at as usize, at.fract());
            (word[whole] * (1.0 - part) + word[whole + 1] * part) as f32
        }));
        samples.extend(vec![0.0; (0.3 * RATE * dice.part()) as usize]);
    }
    samples.truncate(count);
    Some(samples)
}

fn word(path: &std::path::Path) -> Vec<f64> {
    let mut reader = hound::WavReader::open(path).unwrap();
    reader.samples::<i16>().map(|x| f64::from(x.unwrap()) / 32768.0).collect()
}

/// A desk with the spec, and what both recorders deliver of an event: `a.wav` and `b.wav`.
fn desk(case: Case, noise: &str, samples: &[f32]) -> Desk {
    let desk = Desk::with_spec(SPEC);
    wav::write(&desk, "event.wav", 1, 48_000, samples);
    let (drift, count) = (format!("0,{}", case.ppm), samples.len().to_string());
    let heard = ["simulate", "spec.toml", "--source", "event.wav", "--samples", &count, "-o", "cap"];
    desk.good(&[&heard[..], &["--drift", &drift, "--noise", noise, "--delay-error", "0,7.3us"]].concat());
    let [a, b] = ["cap/ch1.wav", "cap/ch2.wav"].map(|name| wav::samples(&desk, name));
    let late = (case.late.abs() * RATE) as usize;
    let (first, second) = if case.late > 0.0 { (0, late) } else { (late, 0) };
    wav::write(&desk, "a.wav", 1, 48_000, &a[first..]);
    wav::write(&desk, "b.wav", 1, 48_000, &b[second..]);
    desk
}

const ALIGN: [&str; 8] = ["align", "spec.toml", "a.wav", "b.wav", "-o", "aligned.toml", "--trim", "cut"];

/// The report on the recordings of a case; `None` without its recordings.
fn aligned(case: Case, dice: &mut Random) -> Option<Value> {
    let samples = case.event.samples((case.seconds * RATE) as usize, dice)?;
    Some(desk(case, "1e-3", &samples).report(&ALIGN))
}

#[test]
fn drifts_are_found_within_their_intervals() {
    let is_sweep = trials::is_slow("the grid of signals, clocks and starts of two recorders");
    let case = |event, seconds, ppm, late| Case { event, seconds, ppm, late };
    let mut cases = vec![
        case(Event::Noise, 2.0, 20.0, 0.31),
        case(Event::Music, 9.0, -100.0, 4.0),
        case(Event::Speech, 8.0, 1.0, -2.0),
    ];
    if is_sweep {
        let events = [Event::Noise, Event::Music, Event::Speech];
        let all = |late: f64| {
            [1.0, 3.0, 10.0, 30.0, 100.0, -100.0]
                .into_iter()
                .flat_map(move |ppm| events.map(|event| case(event, late.abs() + 12.0, ppm, late)))
        };
        cases = [0.0, 0.1, -1.0, 10.0].into_iter().flat_map(all).collect();
    }
    let mut dice = Random(91);
    for case in cases {
        let Some(report) = aligned(case, &mut dice) else { continue };
        let Case { event, ppm, late, .. } = case;
        let [drift, half] =
            ["value", "half_width"].map(|of| number(&report, &format!("/channels/1/drift_ppm/{of}")));
        println!("| {event:?} | {ppm} | {late} | {drift:.3} +- {half:.3} |");
        // Of three standard deviations.
        assert!((drift - ppm).abs() < 1.5 * half, "{case:?} {report}");
    }
}

#[test]
fn a_spec_of_the_recordings_gives_their_bank() {
    let mut dice = Random(92);
    let case = Case { event: Event::Noise, seconds: 2.0, ppm: 0.0, late: 0.5 };
    let samples = case.event.samples(96_000, &mut dice).unwrap();
    let desk = desk(case, "1e-3", &samples);
    // Opposite polarity, another gain, an offset: as integers of 16 bits.
    let spec = hound::WavSpec {
        channels: 1,
        sample_rate: 48_000,
        bits_per_sample: 16,
        sample_format: hound::SampleFormat::Int,
    };
    let mut writer = hound::WavWriter::create(desk.path("c.wav"), spec).unwrap();
    for x in wav::samples(&desk, "b.wav") {
        writer.write_sample((32768.0 * (0.05 - 0.4 * x)) as i16).unwrap();
    }
    writer.finalize().unwrap();
    let args = ["align", "spec.toml", "a.wav", "c.wav", "-o", "aligned.toml", "--trim", "cut"];
    let text = desk.good(&args);
    assert!(text.contains("relative to channel 1") && text.contains("fuse them"), "{text}");
    let aligned =
        hybank::spec::Spec::from_toml(&crate::support::text(&desk.read("aligned.toml")), "aligned.toml");
    let channel = aligned.unwrap().channels[1].clone();
    assert!((channel.gain / -0.4 - 1.0).abs() < 0.01 && (channel.offset - 0.05).abs() < 0.01, "{channel:?}");
    // The trimmed recordings have the samples and the format of the inputs.
    let mut cut = hound::WavReader::open(desk.path("cut/ch2.wav")).unwrap();
    let mut whole = hound::WavReader::open(desk.path("c.wav")).unwrap();
    assert_eq!(cut.spec(), spec);
    let [cut, whole] =
        [&mut cut, &mut whole].map(|r| r.samples::<i16>().map(Result::unwrap).collect::<Vec<_>>());
    assert_eq!(cut[..], whole[..cut.len()]);
    let first = wav::samples(&desk, "a.wav").len() - wav::samples(&desk, "cut/ch1.wav").len();
    assert!((first as i64 - 24_000).abs() <= 1, "{first}");
    // Nothing is replaced without --force, and with it everything is.
    desk.refused(1, &args, &["cut/ch1.wav", "--force"]);
    desk.good(&[&args[..], &["--force"]].concat());
}

/// Taps that follow `drift.jsonl` are better than those of the bank, which stay.
#[test]
fn the_delays_over_time_are_followed() {
    let desk = Desk::with_spec(include_str!("../../../examples/recorders/spec.toml"));
    let source = "tones:294Hz,562Hz,904Hz,1320Hz,1810Hz,22374Hz,3012Hz,1763Hz,2549Hz,3409Hz,2382Hz,23390Hz";
    let simulated = ["simulate", "spec.toml", "-o", "c", "--samples", "153600", "--gain", "0.01"];
    desk.good(&[&simulated[..], &["--noise", "1e-5", "--drift", "0,3", "--source", source]].concat());
    let within = ["--trim", "cut", "--within", "100ms"];
    let align = ["align", "spec.toml", "c/ch1.wav", "c/ch2.wav", "-o", "aligned.toml"];
    desk.report(&[&align[..], &within].concat());
    desk.good(&["design", "aligned.toml", "-o", "bank.json", "--no-proof"]);
    let snr = |more: &[&str]| {
        let fuse = ["fuse", "bank.json", "cut/ch1.wav", "cut/ch2.wav", "-o", "y.wav", "--force"];
        desk.good(&[&fuse[..], more].concat());
        number(&desk.report(&["measure", "y.wav", "--ref", "c/target.wav"]), "/reference/snr_db")
    };
    let (fixed, followed) = (snr(&[]), snr(&["--track", "cut/drift.jsonl"]));
    assert!(followed > fixed + 20.0, "{fixed} {followed}");
}

/// Two recorders with noise whose delays drift: `align` writes the noise, so that the SNR that is predicted
/// is that of the output, and its last lines run as they are.
#[test]
fn noise_is_measured_and_the_commands_that_are_named_run() {
    let spec = "fast_rate = 48000\nratio = 2\n[target]\nfilter = { family = \"butterworth\", order = 2, cutoff = 40000 }\n\
        [signal]\nband = 18000\n[[channel]]\ndelay = 0\n[[channel]]\ndelay = 0\n[design]\nmethod = \"h2\"\ntaps = 24\n";
    let desk = Desk::with_spec(spec);
    let mut dice = Random(95);
    let tones: Vec<[f64; 2]> = (0..150).map(|_| [18_000.0 * dice.part(), TAU * dice.part()]).collect();
    let at = |k: usize| tones.iter().map(|[f, phase]| (TAU * f * k as f64 / RATE + phase).cos()).sum::<f64>();
    let event: Vec<f32> = (0..192_000).map(|k| (0.01 * at(k)) as f32).collect();
    wav::write(&desk, "event.wav", 1, 48_000, &event);
    let simulated = ["simulate", "spec.toml", "--source", "event.wav", "-o", "c", "--samples", "192000"];
    desk.good(&[&simulated[..], &["--noise", "1e-3", "--delay-error", "0,10us", "--drift", "0,3"]].concat());
    let align = ["align", "spec.toml", "c/ch1.wav", "c/ch2.wav", "-o", "aligned.toml"];
    let report = desk.report(&[&align[..], &["--trim", "cut"]].concat());
    let spec = hybank::spec::Spec::from_toml(&crate::support::text(&desk.read("aligned.toml")), "a").unwrap();
    let noise: f64 = spec.channels.iter().map(|channel| channel.noise.powi(2)).sum();
    assert!((10.0 * (noise / 2e-6).log10()).abs() < 1.0, "{noise:e}");
    let power = 1e-4 * 150.0 / 2.0;
    assert!((spec.signal.unwrap().rms.powi(2) / power - 1.0).abs() < 0.1, "{power}");
    let run = |report: &Value| {
        let commands = report.pointer("/next").and_then(Value::as_array).unwrap();
        let words =
            |command: &Value| command.as_str().unwrap().split(' ').skip(1).map(String::from).collect();
        let all: Vec<Vec<String>> = commands.iter().map(words).collect();
        let run = |words: &Vec<String>| desk.report(&words.iter().map(String::as_str).collect::<Vec<_>>());
        let mut reports: Vec<Value> = all.iter().map(run).collect();
        reports.pop().unwrap()
    };
    let fused = run(&report);
    let measured = desk.report(&["measure", "fused.wav", "--ref", "c/target.wav"]);
    let [predicted, found] = [number(&fused, "/predicted_snr_db"), number(&measured, "/reference/snr_db")];
    assert!((predicted - found).abs() < 1.0, "{predicted} predicted, {found} measured");
    // Without --trim, too.
    let merged = run(&desk.report(&align));
    assert!((number(&merged, "/predicted_snr_db") - predicted).abs() < 2.0, "{merged} {predicted}");
    // What was said of the starts is said again, and options of the format are not lost.
    let next = |more: &[&str]| desk.report(&[&align[..], more].concat())["next"].to_string();
    assert!(next(&["--within", "1s"]).contains(" --within 1s\""));
    assert_eq!(next(&["--channel", "1"]), "[]");
    // A recording that was muted is merged: a bank would take its zeros for samples.
    let mut muted = wav::samples(&desk, "c/ch2.wav");
    muted[30_000..45_000].fill(0.0);
    wav::write(&desk, "muted.wav", 1, 24_000, &muted);
    let muted = ["align", "spec.toml", "c/ch1.wav", "muted.wav", "-o", "m.toml", "--trim", "cut2"];
    let report = desk.report(&muted);
    assert!(report["next"].to_string().contains("hybank merge"), "{report}");
    assert!(report["warnings"].to_string().contains("zeros in rows"), "{report}");
}

/// The frequency of a slow sweep moves as its delay would: without its error the drift was -64 ppm.
#[test]
fn a_slow_sweep_is_refused() {
    let case = Case { event: Event::Noise, seconds: 6.0, ppm: 1.5, late: 0.1 };
    let sweep = |k: u32| {
        let t = f64::from(k) / RATE;
        (0.3 * (TAU * (1000.0 + 500.0 * t) * t).sin()) as f32
    };
    let desk = desk(case, "1e-3", &(0..292_800).map(sweep).collect::<Vec<_>>());
    let parts = ["channels 1 and 2", "narrow band", "broad sound"];
    desk.refused(1, &[&ALIGN[..], &["--within", "100.1ms"]].concat(), &parts);
}

/// Of a sweep past half the recorders' rate each probe shows several lags: the drift was -22.1 +- 3.5 ppm
/// where 1.5 is true.
#[test]
fn a_sweep_that_folds_is_refused() {
    let desk = Desk::with_spec(include_str!("../../../examples/recorders/spec.toml"));
    let source = "chirp:200Hz..34kHz@0.2s+step@0.31+step@0.46+step@0.58+tones:440Hz";
    let simulated = ["simulate", "spec.toml", "-o", "c", "--samples", "153600", "--gain", "0.08"];
    let errors = ["--noise", "1e-4", "--delay-error", "0,-50.4ms", "--drift", "0,1.5", "--source", source];
    desk.good(&[&simulated[..], &errors].concat());
    let parts = ["channels 1 and 2", "narrow band"];
    desk.refused(1, &["align", "spec.toml", "c/ch1.wav", "c/ch2.wav", "-o", "aligned.toml"], &parts);
}

#[test]
fn recordings_that_do_not_fit_are_refused_with_the_reason() {
    let mut dice = Random(93);
    let desk = Desk::with_spec(SPEC);
    let random =
        |dice: &mut Random| -> Vec<f32> { (0..30_000).map(|_| 0.3 * dice.sample() as f32).collect() };
    let (a, b) = (random(&mut dice), random(&mut dice));
    wav::write(&desk, "a.wav", 1, 48_000, &a);
    wav::write(&desk, "b.wav", 1, 48_000, &b);
    wav::write(&desk, "cd.wav", 1, 44_100, &a);
    wav::write(&desk, "short.wav", 1, 48_000, &b[..500]);
    wav::write(&desk, "silent.wav", 1, 48_000, &[0.125; 30_000]);
    let tone =
        |early: f64| -> Vec<f32> { (0..30_000).map(|k| (0.3 * (k as f64 + early)).sin() as f32).collect() };
    wav::write(&desk, "tone.wav", 1, 48_000, &tone(0.0));
    wav::write(&desk, "late.wav", 1, 48_000, &tone(700.3));
    let align = |code: i32, inputs: [&str; 2], more: &[&str], parts: &[&str]| {
        let args = [&["align", "spec.toml", inputs[0], inputs[1], "-o", "aligned.toml"][..], more].concat();
        desk.refused(code, &args, parts)
    };
    let all = ["--trim", "cut"];
    align(1, ["a.wav", "b.wav"], &all, &["channels 1 and 2 have nothing in common"]);
    align(1, ["a.wav", "cd.wav"], &all, &["cd.wav", "44100 Hz", "48000 Hz"]);
    align(1, ["a.wav", "short.wav"], &all, &["have 500 samples in common", "1024"]);
    align(1, ["silent.wav", "b.wav"], &all, &["channel 1 holds no signal"]);
    align(1, ["tone.wav", "late.wav"], &all, &["agree at several lags", "--within"]);
    align(1, ["a.wav", "none.wav"], &all, &["none.wav"]);
    align(2, ["a.wav", "b.wav"], &["--reference", "0"], &["--reference 0"]);
    align(1, ["a.wav", "b.wav"], &["--reference", "3"], &["channel 3 cannot be the reference"]);
    // Before anything is read.
    desk.write("aligned.toml", "");
    align(1, ["none.wav", "none.wav"], &all, &["aligned.toml", "--force"]);
}
