//! Two recordings of one event by free clocks become one, while the delay between them moves by many frames.
//!
//! `HYBANK_SLOW=1` takes minutes of recordings with 20, 50 and 100 ppm, and prints the signal-to-noise
//! ratios.

use crate::support::{Desk, text};
use serde_json::Value;

/// Two recorders of 48 kHz, ratio 1, whose delay may be off by 0.55 samples: taps for all delays of one
/// period. Without its proof.
const BANK: &str = include_str!("banks/two_recordings.json");
const RATE: f64 = 48_000.0;
const LATENCY: usize = 16;

fn samples(desk: &Desk, name: &str) -> Vec<f32> {
    let bytes = desk.read(name);
    let data = bytes.windows(4).position(|four| four == b"data").unwrap() + 8;
    bytes[data..].chunks_exact(4).map(|four| f32::from_le_bytes(four.try_into().unwrap())).collect()
}

/// Signal-to-noise ratio of a fused recording against what the target converter delivers, in decibels, over
/// the last two thirds without the frames that lie beyond the end of the second recording.
fn snr(desk: &Desk, fused: &str, beyond: usize) -> f64 {
    let (have, want) = (samples(desk, fused), samples(desk, "cap/target.wav"));
    let range = have.len() / 3..have.len() - LATENCY - 100 - beyond;
    let of = |x: &dyn Fn(usize) -> f64| range.clone().map(|k| x(k).powi(2)).sum::<f64>();
    let signal = of(&|k| f64::from(want[k]));
    10.0 * (signal / of(&|k| f64::from(have[k]) - f64::from(want[k]))).log10()
}

/// The delays as simulated, in the time of the first recorder.
fn true_delays(desk: &Desk, name: &str, ppm: f64, frames: usize) {
    let line = |frame: usize| {
        let delay = 0.5 / RATE + 1e-6 * ppm * frame as f64 / RATE;
        format!("{{\"frame\": {frame}, \"delay\": [0, {delay:e}], \"half_width\": 1e-9}}\n")
    };
    desk.write(name, (0..frames).step_by(512).map(line).collect::<String>());
}

/// Ratios in decibels.
struct Ratios {
    known: f64,
    blind: f64,
}

/// Fuses recordings of `frames` frames by clocks that run apart by `ppm`.
fn fused(desk: &Desk, ppm: f64, frames: usize) -> Ratios {
    let simulate =
        ["simulate", "bank.json", "--source", "tones:0.7kHz,3.1kHz,5.3kHz", "-o", "cap", "--force"];
    let (drift, count) = (format!("0,{ppm}"), frames.to_string());
    let errors = ["--samples", &count, "--noise", "1e-3", "--drift", &drift];
    desk.good(&[&simulate[..], &errors[..]].concat());
    true_delays(desk, "true.jsonl", ppm, frames);
    let fuse = |by: &str, output: &str| {
        let inputs = ["fuse", "bank.json", "cap/ch1.wav", "cap/ch2.wav", "--force"];
        let track = ["-o", output, "--track", by, "--track-log", "log.jsonl", "--track-frames", "1024"];
        desk.good(&[&inputs[..], &track[..]].concat());
        let log = text(&desk.read("log.jsonl"));
        let last: Value = serde_json::from_str(log.lines().last().unwrap()).unwrap();
        // The frames have moved as far as the clocks.
        let moved = 1e-6 * ppm * last["frame"].as_f64().unwrap();
        let shift = last["shift"][1].as_f64().unwrap();
        assert!((shift - moved).abs() < 1.2, "{moved} {last}");
        assert_eq!(last["lock"][1], "locked", "{last}");
        snr(desk, output, (1e-6 * ppm.max(0.0) * frames as f64).ceil() as usize)
    };
    Ratios { known: fuse("true.jsonl", "known.wav"), blind: fuse("blind", "blind.wav") }
}

#[test]
fn recordings_with_clocks_of_their_own_become_one() {
    let desk = Desk::empty();
    desk.write("bank.json", BANK);
    let is_sweep = trials::is_slow("minutes of two recorders");
    let (seconds, rates) =
        if is_sweep { (180, vec![20.0, 50.0, 100.0, -100.0]) } else { (3, vec![100.0, -100.0]) };
    for ppm in rates {
        let Ratios { known, blind } = fused(&desk, ppm, seconds * RATE as usize);
        println!("{ppm} ppm, {seconds} s: known {known:.2} dB, blind {blind:.2} dB");
        assert!(known > 40.0 && blind > known - 0.3, "{known} {blind}");
    }
}

/// However the stream is cut, and whatever the number of threads: `stream` gives the bits of `fuse`.
#[test]
fn shifted_frames_have_the_same_bits_for_any_cut() {
    let desk = Desk::empty();
    desk.write("bank.json", BANK);
    desk.good(&[
        "simulate",
        "bank.json",
        "--source",
        "tones:0.7kHz,3.1kHz",
        "--samples",
        "48000",
        "-o",
        "cap",
        "--drift",
        "0,-100",
    ]);
    let [first, second] = ["cap/ch1.wav", "cap/ch2.wav"].map(|name| samples(&desk, name));
    let frames: Vec<u8> =
        first.iter().zip(&second).flat_map(|(a, b)| [a.to_le_bytes(), b.to_le_bytes()].concat()).collect();
    let track = ["--track", "blind", "--track-frames", "1024"];
    let args = [&["stream", "bank.json", "--format", "f32le"][..], &track].concat();
    let mut child = desk.spawn(&args);
    let mut stdin = child.stdin.take().unwrap();
    let feeder = std::thread::spawn(move || {
        for piece in frames.chunks(8 * 777) {
            std::io::Write::write_all(&mut stdin, piece).unwrap();
        }
    });
    let streamed = child.wait_with_output().unwrap();
    feeder.join().unwrap();
    assert!(streamed.status.success());
    for (name, threads) in [("one.wav", "1"), ("two.wav", "2")] {
        let fuse = ["fuse", "bank.json", "cap/ch1.wav", "cap/ch2.wav", "-o", name, "--keep-latency"];
        desk.good(&[&fuse[..], &track, &["--threads", threads]].concat());
        assert!(desk.read(name).ends_with(&streamed.stdout[..]), "{name}");
    }
}
