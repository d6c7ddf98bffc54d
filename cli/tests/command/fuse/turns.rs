//! One file or pipe in which converters take turns.

use crate::support::{Desk, bytes, modelled, wav, words};
use serde_json::json;

/// So that no sample is beyond full scale.
const STEP: f32 = 1.0 / 524_288.0;

/// A bank of three converters with the delays 0, 2 and 1 of a slow period of 3, whose channels go unchanged
/// to the phases: they sample in the order channel 2, 3, 1.
fn write_bank(desk: &Desk, delays: [f64; 3]) {
    let taps = (0..3).map(|i| (0..3).map(|n| f64::from(u8::from(n == i))).collect()).collect();
    desk.write_bank("three.json", &modelled(taps, &delays, 3, 0));
}

/// Sample k of the capture is k steps.
fn capture(turns: usize) -> Vec<f32> {
    (0..3 * turns).map(|k| STEP * k as f32).collect()
}

/// The capture with each turn in the order of the channels.
fn by_channel(turns: usize) -> Vec<f32> {
    (0..turns).flat_map(|turn| [2, 0, 1].map(|j| STEP * (3 * turn + j) as f32)).collect()
}

#[test]
fn the_converter_that_samples_first_comes_first() {
    let desk = Desk::empty();
    write_bank(&desk, [0.0, 2.0, 1.0]);
    // Less than a block, and several.
    for turns in [1, 5, 100_000] {
        wav::write(&desk, "capture.wav", 1, 48_000, &capture(turns));
        let args = ["fuse", "three.json", "capture.wav", "-o", "y.wav", "--interleaved", "3", "--force"];
        assert_eq!(desk.good(&args).lines().count(), 2);
        let (spec, fused) = wav::read(&desk.path("y.wav"));
        assert_eq!(spec.sample_rate, 48_000);
        assert!(fused == by_channel(turns), "{turns} turns");
    }
}

#[test]
fn pipes_are_read_in_turns_too() {
    let desk = Desk::empty();
    write_bank(&desk, [0.0, 2.0, 1.0]);
    let input = bytes(&capture(20_000));
    desk.write("capture.raw", &input);
    let args = ["stream", "three.json", "--interleaved", "3"];
    let piped = desk.piped(&args, &input);
    assert!(piped == bytes(&by_channel(20_000)));
    assert!(desk.piped(&[&args[..], &["--input", "capture.raw"]].concat(), &[]) == piped);
    // A turn that is not whole is left out and reported.
    let cut = desk.run(&args, &input[..12 * 7 + 5]);
    assert!(cut.stdout == bytes(&by_channel(7)), "{cut:?}");
    assert!(
        String::from_utf8(cut.stderr).unwrap().contains("the last frame is cut (5 bytes of it are there)")
    );
}

#[test]
fn timestamps_count_whole_turns() {
    let desk = Desk::empty();
    write_bank(&desk, [0.0, 2.0, 1.0]);
    desk.write("capture.sigmf-data", bytes(&capture(4)));
    let meta = |index: u64| {
        let captures = json!([
            { "core:sample_start": 0, "core:global_index": 0 },
            { "core:sample_start": 6, "core:global_index": index }
        ]);
        let global =
            json!({ "core:datatype": "rf32_le", "core:sample_rate": 3000.0, "core:version": "1.0.0" });
        desk.write("capture.sigmf-meta", json!({ "global": global, "captures": captures }).to_string());
    };
    let args = words("fuse three.json capture.sigmf-meta -o y.wav --interleaved 3 --gaps --force");
    meta(9);
    // The gap is reported.
    desk.warned(&args, &[]);
    let mut want = by_channel(4);
    let lost = 6..9;
    want.splice(6..6, [0.0; 3]);
    let got = wav::samples(&desk, "y.wav");
    assert!(got.len() == 15 && (0..15).all(|n| lost.contains(&n) || got[n] == want[n]), "{got:?}");
    meta(8);
    let parts = ["capture.sigmf-meta", "global_index 8", "beginning of a frame of 3 time-interleaved"];
    desk.refused(1, &args, &parts);
}
