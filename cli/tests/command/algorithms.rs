//! Algorithms of FIR filters, as a user chooses them: all give the same samples at the same time.
//! The direct algorithm is the measure of the other.

use crate::support::{Desk, bytes, channel, floats, modelled, wav};
use serde_json::Value;

const COUNT: usize = 3000;

/// N = M = 2, 600 taps per channel, m0 = 7: long enough for overlap-save to win.
fn desk() -> Desk {
    let desk = Desk::new();
    let taps = |seed: usize| -> Vec<f64> {
        (0..600).map(|t| ((t * 37 + seed * 11) % 101) as f64 / 1000.0 - 0.05).collect()
    };
    desk.write_bank("long.json", &modelled(vec![taps(1), taps(2)], &[0.0; 2], 2, 7));
    desk.write("frames", bytes(&input()));
    for (i, name) in ["a.wav", "b.wav"].into_iter().enumerate() {
        wav::write(&desk, name, 1, 24_000, &channel_of(i));
    }
    desk
}

/// With two gaps.
fn input() -> Vec<f32> {
    let mut frames: Vec<f32> = (0..2 * COUNT).map(|i| (i * 7919 % 1009) as f32 / 1009.0 - 0.5).collect();
    (500..520).for_each(|k| frames[2 * k] = f32::NAN);
    frames[2 * 2000 + 1] = f32::INFINITY;
    frames
}

fn channel_of(i: usize) -> Vec<f32> {
    channel(&input(), i)
}

fn fuse(desk: &Desk, more: &[&str]) -> (Vec<f32>, Value) {
    let report = desk.report(&[&["fuse", "long.json", "a.wav", "b.wav", "-o", "out.wav"], more].concat());
    (wav::samples(desk, "out.wav"), report)
}

fn stream(desk: &Desk, more: &[&str]) -> (Vec<f32>, Value) {
    let report = desk.report(&[&["stream", "long.json", "--input", "frames", "-o", "out"], more].concat());
    (floats(&desk.read("out")), report)
}

fn same(a: &[f32], b: &[f32]) {
    assert_eq!(a.len(), b.len());
    // 600 products below 0.03 in f32.
    let differs = a.iter().zip(b).position(|(a, b)| (a - b).abs() > 1e-5);
    assert_eq!(differs, None);
}

#[test]
fn fuse_takes_the_faster_form_and_gives_the_same_samples() {
    let desk = desk();
    for latency in [&[][..], &["--keep-latency"]] {
        let of = |form| fuse(&desk, &[&["--algorithm", form], latency].concat());
        let (direct, report) = of("direct");
        assert_eq!((direct.len(), &report["plan"]["algorithm"]), (2 * COUNT, &Value::from("direct")));
        assert_eq!(report["plan"]["multiply_adds"], 600.0);
        assert_eq!(report["latency_dropped"], if latency.is_empty() { 7 } else { 0 });
        let (blocks, report) = of("overlap-save");
        same(&blocks, &direct);
        let plan = &report["plan"];
        let (len, block) = (plan["transform"].as_u64().unwrap(), plan["block"].as_u64().unwrap());
        assert_eq!(len, block + 299);
        let extra = plan["extra_latency"].as_u64().unwrap();
        assert_eq!(report["latency_dropped"], extra + if latency.is_empty() { 7 } else { 0 });
        assert!(plan["multiply_adds"].as_f64().unwrap() < 200.0, "{plan}");
        assert!(report["replaced"] == 21 && plan["algorithm"] == "overlap-save", "{report}");
        assert_eq!(of("auto").1["plan"], *plan);
        assert_eq!(of("auto").0, blocks);
    }
    // Short filters stay direct.
    let report = desk.report(&["fuse", "bank.json", "a.wav", "b.wav", "-o", "out.wav"]);
    assert_eq!(report["plan"]["algorithm"], "direct");
}

#[test]
fn stream_is_late_only_when_asked_to_be() {
    let desk = desk();
    let (direct, report) = stream(&desk, &["--flush", "--algorithm", "direct"]);
    assert!(report["plan"]["algorithm"] == "direct" && report["plan"]["extra_latency"] == 0, "{report}");
    assert_eq!(stream(&desk, &["--flush"]).0, direct);
    assert_eq!(stream(&desk, &[]).0, direct[..2 * COUNT]);
    let (blocks, report) = stream(&desk, &["--flush", "--algorithm", "overlap-save"]);
    let extra = report["plan"]["extra_latency"].as_u64().unwrap() as usize;
    assert!(extra > 0 && blocks[..extra].iter().all(|&y| y == 0.0));
    same(&blocks[extra..], &direct);
    // Without a flush the end stays inside.
    let (cut, _) = stream(&desk, &["--algorithm", "overlap-save"]);
    assert_eq!(cut, blocks[..2 * COUNT]);
}
