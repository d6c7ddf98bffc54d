//! Samples that were lost: what tells of them, what stands in for them, what they touch. As a user runs it.

use crate::support::{Desk, bytes, channel, floats, frames, fused, wav};
use serde_json::{Value, json};

const COUNT: usize = 3000;

/// Channel 1 joins two frames late and loses frame 7 and frames 100..1500; channel 2 is whole.
const SEQUENCE: &str = r#"
{"channel": 1, "sample_start": 0, "global_index": 1002}
{"channel": 1, "sample_start": 5, "global_index": 1008}

{"channel": 1, "sample_start": 97, "global_index": 2500}
{"channel": 2, "sample_start": 0, "global_index": 1000}
"#;

fn is_lost(frame: usize) -> bool {
    frame < 2 || frame == 7 || (100..1500).contains(&frame)
}

fn gaps(list: &[(u64, u64, u64)]) -> Value {
    let gap = |&(channel, first, length): &_| json!({ "channel": channel, "first": first, "length": length });
    Value::Array(list.iter().map(gap).collect())
}

/// Frames with channel 1 replaced by `stand_in(last good sample)` where it was lost.
fn filled(whole: &[f32], stand_in: impl Fn(f32) -> f32) -> Vec<f32> {
    let mut frames = whole.to_vec();
    let mut last = 0.0;
    for (k, frame) in frames.chunks_exact_mut(2).enumerate() {
        if is_lost(k) {
            frame[0] = stand_in(last);
        } else {
            last = frame[0];
        }
    }
    frames
}

fn kept(whole: &[f32]) -> Vec<f32> {
    let kept = channel(whole, 0).into_iter().enumerate().filter(|(k, _)| !is_lost(*k));
    kept.map(|(_, x)| x).collect()
}

/// The mask must be exact: what it leaves out is as if nothing had been lost, what it marks is not.
fn check_mask(mask: &[u8], got: &[f32], whole: &[f32]) {
    assert_eq!(mask.len(), got.len());
    for (t, ((mask, got), want)) in mask.iter().zip(got).zip(whole).enumerate() {
        // f_1 has no zero tap, and no lost sample of the test is replaced by itself.
        assert_eq!(*mask == 0, got == want, "sample {t}");
    }
}

/// Samples that are never what stands in for them.
fn whole() -> Vec<f32> {
    (0..2 * COUNT).map(|i| (1 + i % 1021) as f32).collect()
}

#[test]
fn samples_that_were_left_out_are_bridged_reported_and_masked() {
    let desk = Desk::new();
    let whole = whole();
    desk.write("a", bytes(&kept(&whole)));
    desk.write("b", bytes(&channel(&whole, 1)));
    wav::write(&desk, "a.wav", 1, 24_000, &kept(&whole));
    wav::write(&desk, "b.wav", 1, 24_000, &channel(&whole, 1));
    desk.write("lost.jsonl", SEQUENCE);
    let lost = ["--lost", "lost.jsonl", "--mask", "mask"];
    let stream = ["stream", "bank.json", "--input", "a", "--input", "b", "-o", "out"];
    let fuse = ["fuse", "bank.json", "a.wav", "b.wav", "-o", "out.wav", "--keep-latency"];
    for (policy, hold) in [("zero", 0.0), ("mask", 0.0), ("hold", 1.0)] {
        let want = fused(&filled(&whole, |last| hold * last));
        for command in [&stream[..], &fuse] {
            let report = desk.report(&[command, &lost, &["--gaps", policy]].concat());
            assert_eq!(report["gaps"]["list"], gaps(&[(1, 0, 2), (1, 7, 1), (1, 100, 1400)]));
            assert_eq!(
                (report["gaps"]["missing"].as_u64(), report["frames"].as_u64()),
                (Some(1403), Some(3000))
            );
            assert_eq!(report["replaced"], 0);
            let got = match command[0] {
                "stream" => floats(&desk.read("out")),
                _ => wav::samples(&desk, "out.wav"),
            };
            assert!(got == want, "{policy}");
            check_mask(&desk.read("mask"), &got, &fused(&whole));
        }
    }
}

#[test]
fn void_samples_of_an_interleaved_stream_are_in_the_report_of_another_run() {
    let desk = Desk::new();
    let clean = frames(500);
    let mut marked = clean.clone();
    for (channel, range) in [(0, 0..1), (1, 40..43), (0, 41..300), (1, 499..500)] {
        range.for_each(|k: usize| marked[2 * k + channel] = f32::NAN);
    }
    desk.write("marked", bytes(&marked));
    let args = ["stream", "bank.json", "--gaps", "hold", "--mask", "mask", "-o", "out"];
    let report = desk.report(&[&args[..], &["--input", "marked"]].concat());
    let list = report["gaps"]["list"].as_array().unwrap();
    assert_eq!(list.len(), 4);
    let (out, mask) = (desk.read("out"), desk.read("mask"));
    // The same gaps with anything else in their place, as integers that cannot say NaN.
    let lines: Vec<_> = list.iter().map(Value::to_string).collect();
    desk.write("void.jsonl", lines.join("\n"));
    let coded: Vec<u8> = clean.iter().flat_map(|x| ((x * 1024.0) as i16).to_be_bytes()).collect();
    desk.write("coded", coded);
    let format =
        ["--input", "coded", "--format", "s16be", "--output-format", "f32le", "--lost", "void.jsonl"];
    let again = desk.report(&[&args[..], &format].concat());
    assert_eq!(again["gaps"], report["gaps"]);
    let scaled: Vec<f32> = floats(&out).iter().map(|y| y / 32.0).collect();
    assert_eq!((floats(&desk.read("out")), desk.read("mask")), (scaled, mask));
}

#[test]
fn channels_that_end_early_may_be_bridged_to_the_end_of_the_longest() {
    let desk = Desk::new();
    let whole = frames(5000);
    desk.write("a", bytes(&channel(&whole, 0)[..4000]));
    desk.write("b", bytes(&channel(&whole, 1)));
    let args = ["stream", "bank.json", "--input", "a", "--input", "b", "-o", "out", "--gaps", "zero"];
    let report = desk.report(&args);
    assert_eq!((report["frames"].as_u64(), report["gaps"]["count"].as_u64()), (Some(4000), Some(0)));
    assert_eq!(report["warnings"].as_array().unwrap().len(), 1);
    let report = desk.report(&[&args[..], &["--longest", "--strict"]].concat());
    assert_eq!((report["frames"].as_u64(), &report["warnings"]), (Some(5000), &json!([])));
    assert_eq!(report["gaps"]["list"], gaps(&[(1, 4000, 1000)]));
    let mut zeros = whole.clone();
    zeros.chunks_exact_mut(2).skip(4000).for_each(|frame| frame[0] = 0.0);
    assert!(floats(&desk.read("out")) == fused(&zeros));
    desk.refused(2, &["stream", "bank.json", "--longest"], &["--gaps"]);
}

fn meta(datatype: &str, channels: usize, captures: &str) -> String {
    format!(
        r#"{{ "global": {{ "core:datatype": "{datatype}", "core:sample_rate": 24000.5, "core:num_channels": {channels},
        "core:version": "1.0.0" }}, "captures": [{captures}], "annotations": [] }}"#
    )
}

/// What the metadata say of bytes that are no samples, of samples that are not there, and of what a reader
/// must know.
#[test]
fn sigmf_that_is_not_all_samples_is_read_or_refused() {
    let desk = Desk::new();
    let input = frames(50);
    let meta = |more: &str| {
        format!(r#"{{"global": {{"core:datatype": "rf32_le", "core:num_channels": 2, {more}}}}}"#)
    };
    desk.write("in.sigmf-data", [bytes(&input), vec![7; 80]].concat());
    desk.write("in.sigmf-meta", meta(r#""core:trailing_bytes": 80"#));
    let stream = ["stream", "bank.json", "--input", "in.sigmf-meta", "--output-format", "f32le"];
    assert_eq!(floats(&desk.run(&stream, &[]).stdout), fused(&input));
    for (more, parts) in [
        (r#""core:trailing_bytes": 481"#, ["core:trailing_bytes is 481", "480 bytes"]),
        (r#""core:metadata_only": true"#, ["core:metadata_only", "no samples"]),
        (
            r#""core:extensions": [{"name": "x", "optional": true}, {"name": "crypt", "optional": false}]"#,
            ["the extension \"crypt\"", "unknown"],
        ),
    ] {
        desk.write("in.sigmf-meta", meta(more));
        desk.refused(1, &stream, &parts);
    }
}

#[test]
fn captures_tell_stream_what_was_lost() {
    let desk = Desk::new();
    let whole = whole();
    let captures = r#"{ "core:sample_start": 10, "core:global_index": 1002 },
        { "core:sample_start": 15, "core:global_index": 1008 }, { "core:sample_start": 50 },
        { "core:sample_start": 107, "core:global_index": 2500 }"#;
    // The recording is the second part of a longer one.
    let offset = meta("rf32_le", 1, captures).replace("\"core:num", "\"core:offset\": 10, \"core:num");
    desk.write("a.sigmf-meta", offset);
    desk.write("a.sigmf-data", bytes(&kept(&whole)));
    desk.write(
        "b.sigmf-meta",
        meta("rf32_le", 1, r#"{ "core:sample_start": 0, "core:global_index": 1000 }"#),
    );
    desk.write("b.sigmf-data", bytes(&channel(&whole, 1)));
    let args = ["stream", "bank.json", "--input", "a.sigmf-meta", "--input", "b.sigmf-meta", "-o", "out"];
    let report = desk.report(&[&args[..], &["--gaps", "hold", "--mask", "mask"]].concat());
    assert_eq!(report["gaps"]["list"], gaps(&[(1, 0, 2), (1, 7, 1), (1, 100, 1400)]));
    let got = floats(&desk.read("out"));
    assert!(got == fused(&filled(&whole, |last| last)));
    check_mask(&desk.read("mask"), &got, &fused(&whole));
    // What is void is reported beside the captures; what is left out only once.
    desk.write("lost", r#"{"channel": 2, "first": 2990, "length": 3}"#);
    let both = [&args[..], &["--gaps", "hold", "--lost", "lost"]].concat();
    assert_eq!(desk.report(&both)["gaps"]["list"][3], gaps(&[(2, 2990, 3)])[0]);
    desk.write("lost", r#"{"channel": 2, "sample_start": 0, "global_index": 3}"#);
    desk.refused(1, &[&both[..], &["--force"]].concat(), &["b.sigmf-meta", "captures of its own"]);
}
