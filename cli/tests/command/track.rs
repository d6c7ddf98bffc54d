//! `--track`: delay-scheduled taps.

use crate::support::{Desk, text};
use serde_json::Value;

/// Two 48 kHz recorders whose delays are known to 0.15 fast periods.
const SPEC: &str = r#"
fast_rate = 96000.0
ratio = 2
latency = 12
target = { filter = { family = "butterworth", order = 4, cutoff = 18000.0 } }
channel = [{ delay_samples = 0.0 }, { delay_samples = 1.0 }]
design = { method = "fir", taps = 24, tracking = "affine" }
[uncertainty]
delay_samples = 0.15
"#;

/// With the bank, and captures of two tones by recorders whose clocks drift apart by 1.5 ppm.
fn desk() -> Desk {
    let desk = Desk::with_spec(SPEC);
    let out = desk.good(&["design", "spec.toml", "-o", "bank.json", "--verbose"]);
    assert!(out.contains("tracked ") && out.contains("redesigned "), "{out}");
    desk.good(&[
        "simulate",
        "bank.json",
        "--source",
        "tones:3.1kHz,9.7kHz",
        "--samples",
        "60000",
        "-o",
        "cap",
        "--drift",
        "0,1.5",
        "--delay-error",
        "0,0.3us",
        "--noise",
        "1e-4",
    ]);
    desk
}

/// Slopes that nothing was proven of may be anything, and the report says so.
#[test]
fn verify_says_nothing_of_slopes_without_a_tracked_gamma() {
    let desk = Desk::with_spec(SPEC);
    desk.good(&["design", "spec.toml", "-o", "bank.json"]);
    let proven = desk.good(&["verify", "bank.json"]);
    assert!(proven.contains("no delays within it do while the taps follow them"), "{proven}");
    let mut bank = desk.read_json("bank.json");
    bank["gamma"].as_object_mut().unwrap().remove("tracked");
    bank.as_object_mut().unwrap().remove("digest");
    bank["channels"][1]["tap_slopes"][0][3] = 1e3.into();
    desk.write("bank2.json", bank.to_string());
    let proven = desk.good(&["verify", "bank2.json"]);
    assert!(proven.contains("tracked    not proven: the file states no gamma.tracked"), "{proven}");
}

fn rms_error(desk: &Desk, fused: &str) -> f64 {
    let samples = |name: &str| -> Vec<f32> {
        let bytes = desk.read(name);
        let data = bytes.windows(4).position(|four| four == b"data").unwrap() + 8;
        bytes[data..].chunks_exact(4).map(|four| f32::from_le_bytes(four.try_into().unwrap())).collect()
    };
    let (have, want) = (samples(fused), samples("cap/target.wav"));
    let last = have.len() - 200;
    let square = |k: usize| f64::from(have[k] - want[k]).powi(2);
    // The last third: the delays are known by then.
    let range = 2 * last / 3..last;
    (range.clone().map(square).sum::<f64>() / range.len() as f64).sqrt()
}

fn log(desk: &Desk, name: &str) -> Vec<Value> {
    text(&desk.read(name)).lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// One bank for both: its proof takes a while.
#[test]
fn delays_are_followed() {
    let desk = desk();
    recordings_that_drift_apart_are_fused(&desk);
    a_stream_that_is_followed_has_the_same_bits_for_any_cut(&desk);
}

/// Two recordings with clocks of their own become one: far better than with fixed taps.
fn recordings_that_drift_apart_are_fused(desk: &Desk) {
    let inputs = ["cap/ch1.wav", "cap/ch2.wav"];
    let fuse = |output: &str, more: &[&str]| {
        let args = [&["fuse", "bank.json", inputs[0], inputs[1], "-o", output][..], more].concat();
        desk.good(&args);
        rms_error(desk, output)
    };
    let fixed = {
        let args = ["fuse", "bank.json", inputs[0], inputs[1], "-o", "fixed.wav"];
        assert!(desk.run(&args, b"").status.success());
        rms_error(desk, "fixed.wav")
    };
    let pilot = fuse("pilot.wav", &["--track", "pilot=3.1kHz", "--track-log", "pilot.jsonl"]);
    let blind = fuse("blind.wav", &["--track", "blind"]);
    assert!(pilot < 0.1 * fixed && blind < 0.1 * fixed, "{fixed} {pilot} {blind}");
    let lines = log(desk, "pilot.jsonl");
    assert_eq!(lines.len(), 14);
    let last = &lines[13];
    assert_eq!((&last["lock"][1], &last["frame"]), (&Value::from("locked"), &Value::from(13 * 2048 + 1023)));
    assert!((last["rate_ppm"][1].as_f64().unwrap() - 1.5).abs() < 0.1, "{last}");
    // The log is a file of delays.
    let read = fuse("read.wav", &["--track", "pilot.jsonl"]);
    assert!(read < 0.1 * fixed, "{read}");
    let threads = ["--track", "pilot=3.1kHz", "--threads", "2"];
    fuse("threads.wav", &threads);
    assert_eq!(desk.read("threads.wav"), desk.read("pilot.wav"));
}

/// However the stream is cut, and through `stream` as through `fuse`.
fn a_stream_that_is_followed_has_the_same_bits_for_any_cut(desk: &Desk) {
    let raw: Vec<Vec<u8>> = ["cap/ch1.wav", "cap/ch2.wav"]
        .map(|name| {
            let bytes = desk.read(name);
            let data = bytes.windows(4).position(|four| four == b"data").unwrap() + 8;
            bytes[data..].to_vec()
        })
        .to_vec();
    let frames: Vec<u8> =
        raw[0].chunks_exact(4).zip(raw[1].chunks_exact(4)).flat_map(|(a, b)| [a, b].concat()).collect();
    let track = ["--track", "pilot=3.1kHz", "--track-frames", "1024"];
    let args = [&["stream", "bank.json", "--format", "f32le"][..], &track].concat();
    let whole = desk.run(&args, &frames);
    assert!(whole.status.success(), "{whole:?}");
    let mut child = desk.spawn(&args);
    let mut stdin = child.stdin.take().unwrap();
    let feeder = std::thread::spawn(move || {
        for (number, piece) in frames.chunks(8 * 777).enumerate() {
            std::io::Write::write_all(&mut stdin, piece).unwrap();
            if number % 16 == 0 {
                std::thread::sleep(std::time::Duration::from_millis(1));
            }
        }
    });
    let cut = child.wait_with_output().unwrap();
    feeder.join().unwrap();
    assert_eq!(cut.stdout, whole.stdout);
    let fuse = ["fuse", "bank.json", "cap/ch1.wav", "cap/ch2.wav", "-o", "y.wav", "--keep-latency"];
    desk.good(&[&fuse[..], &track].concat());
    assert!(desk.read("y.wav").ends_with(&whole.stdout[..]));
}

#[test]
fn what_cannot_be_followed_is_refused_with_the_remedy() {
    let desk = Desk::with_spec(SPEC);
    let certain = SPEC.replace("[uncertainty]\ndelay_samples = 0.15\n", "");
    desk.write("plain.toml", certain.replace(", tracking = \"affine\"", ""));
    desk.write("iir.toml", SPEC.replace("\"fir\", taps = 24, tracking = \"affine\"", "\"iir\""));
    for name in ["plain", "iir"] {
        desk.good(&["design", &format!("{name}.toml"), "-o", &format!("{name}.json")]);
    }
    desk.good(&["simulate", "plain.toml", "--source", "tones:3.1kHz", "--samples", "2000", "-o", "cap"]);
    let fuse = |bank: &str, code: i32, more: &[&str], parts: &[&str]| {
        let args = [&["fuse", bank, "cap/ch1.wav", "cap/ch2.wav", "-o", "y.wav"][..], more].concat();
        desk.refused(code, &args, parts);
        assert!(!desk.path("y.wav").exists() && !desk.path("log.jsonl").exists());
    };
    fuse(
        "plain.json",
        1,
        &["--track", "blind"],
        &["plain.json", "tracking = \"affine\"", "[uncertainty] delay"],
    );
    fuse("iir.json", 1, &["--track", "blind"], &["iir.json", "recursive", "method = \"fir\""]);
    fuse("plain.json", 2, &["--track", "loud"], &["--track loud", "pilot=F"]);
    fuse("plain.json", 2, &["--track", "pilot=-3"], &["--track pilot=-3"]);
    fuse("plain.json", 2, &["--track", "blind", "--track-frames", "9"], &["--track-frames 9", "256"]);
    fuse("plain.json", 2, &["--track", "blind", "--track-wander", "0"], &["--track-wander 0", "ppm"]);
    fuse("plain.json", 2, &["--track", "blind", "--track-log", "-"], &["--track-log -"]);
    fuse("plain.json", 2, &["--track-log", "log.jsonl"], &["--track"]);
    fuse("plain.json", 2, &["--track", "blind", "--algorithm", "overlap-save"], &["overlap-save", "direct"]);
    fuse("plain.json", 1, &["--track", "blind", "--track-log", "cap/ch1.wav", "--force"], &["cap/ch1.wav"]);
    fuse("plain.json", 1, &["--track", "none.jsonl"], &["none.jsonl"]);
    desk.write("bad.jsonl", "{\"frame\": 0}\n");
    fuse("plain.json", 1, &["--track", "bad.jsonl"], &["bad.jsonl: line 1"]);
}

#[test]
fn a_spec_that_leaves_nothing_to_follow_is_refused() {
    let desk = Desk::with_spec(SPEC);
    let refused = |from: &str, to: &str, parts: &[&str]| {
        assert!(SPEC.contains(from));
        desk.write("bad.toml", SPEC.replace(from, to));
        desk.refused(1, &["design", "bad.toml", "-o", "bad.json"], parts);
    };
    refused("[uncertainty]\ndelay_samples = 0.15\n", "", &["bad.toml:7", "[uncertainty] delay"]);
    refused("delay_samples = 0.15", "gain = 0.01", &["[uncertainty] delay"]);
    refused("\"affine\"", "\"afine\"", &["bad.toml:7", "did you mean \"affine\"?"]);
    refused("\"fir\", taps = 24", "\"iir\"", &["tracking has no meaning for the method iir"]);
    refused("taps = 24", "taps = 24, bits = 12", &["bits and tracking"]);
    desk.write(
        "plain.toml",
        SPEC.replace(", tracking = \"affine\"", "").replace("delay_samples = 0.15", "gain = 0.01"),
    );
    desk.refused(
        1,
        &["design", "plain.toml", "-o", "b.json", "--tracking", "affine"],
        &["--tracking", "[uncertainty]"],
    );
}
