//! Lost samples in WAV and SigMF recordings: bridged, reported and masked.

use super::{ramps, refused};
use crate::support::{Desk, floats, fused, interleaved, text, wav};

#[test]
fn gaps_are_bridged_reported_and_masked() {
    let desk = Desk::new();
    let mut a: Vec<f32> = (0..40).map(|k| k as f32).collect();
    let b = vec![1.0; 40];
    let clean = a.clone();
    a[10..13].fill(f32::NAN);
    wav::write_pair(&desk, &a, &b);
    let args =
        ["fuse", "bank.json", "a.wav", "b.wav", "-o", "out.wav", "--force", "--json", "--mask", "mask"];
    for (policy, value) in [("zero", 0.0), ("hold", 9.0), ("mask", 0.0)] {
        let output = desk.run(&[&args[..], &["--gaps", policy]].concat(), &[]);
        assert!(output.status.success(), "{output:?}");
        assert!(text(&output.stderr).contains("gap: channel 1, sample 10, 3 missing"), "{output:?}");
        let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(report["gaps"]["list"][0], serde_json::json!({ "channel": 1, "first": 10, "length": 3 }));
        let mut filled = clean.clone();
        filled[10..13].fill(value);
        // Two frames of zeros flush the last three samples.
        let causal = |x: &[f32]| fused(&[interleaved(x, &b), vec![0.0; 4]].concat());
        let got = wav::samples(&desk, "out.wav");
        assert_eq!(got, causal(&filled)[3..83]);
        // The mask lines up with the output: outside of it nothing differs from the whole recording.
        let mask = desk.read("mask");
        let want = &causal(&clean)[3..83];
        assert_eq!(mask.len(), got.len());
        assert_eq!(mask.iter().map(|&m| usize::from(m)).sum::<usize>(), 8);
        for (t, (got, want)) in got.iter().zip(want).enumerate() {
            assert_eq!(mask[t] == 0, got == want, "sample {t}");
        }
    }
    desk.refused(2, &["fuse", "bank.json", "a.wav", "b.wav", "-o", "no.wav", "--gaps", "mask"], &["--mask"]);
}

#[test]
fn sigmf_goes_in_and_out() {
    let desk = Desk::new();
    let (a, b) = ramps(20);
    // Channel 1 starts two samples late and loses one after five; channel 2 is whole.
    let meta = |captures: &str, datatype: &str| {
        format!(
            r#"{{ "global": {{ "core:datatype": "{datatype}", "core:sample_rate": 24000, "core:num_channels": 1,
            "core:version": "1.0.0" }}, "captures": [{captures}], "annotations": [] }}"#
        )
    };
    let captures = r#"{ "core:sample_start": 0, "core:global_index": 102 },
        { "core:sample_start": 5, "core:global_index": 108 }"#;
    desk.write("a.sigmf-meta", meta(captures, "rf32_be"));
    let start = r#"{ "core:sample_start": 0, "core:global_index": 100 }"#;
    desk.write("b.sigmf-meta", meta(start, "ri16_le"));
    let there: Vec<u8> = a[2..7].iter().chain(&a[8..]).flat_map(|x| x.to_be_bytes()).collect();
    desk.write("a.sigmf-data", there);
    let coded: Vec<u8> = b.iter().flat_map(|x| ((x * 4096.0) as i16).to_le_bytes()).collect();
    desk.write("b.sigmf-data", coded);
    let args =
        ["fuse", "bank.json", "a.sigmf-meta", "b.sigmf-data", "-o", "out.sigmf-meta", "--keep-latency"];
    let output = desk.run(&[&args[..], &["--gaps", "zero", "--json"]].concat(), &[]);
    assert!(output.status.success(), "{output:?}");
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((report["gaps"]["count"].as_u64(), report["gaps"]["missing"].as_u64()), (Some(2), Some(3)));
    let got = floats(&desk.read("out.sigmf-data"));
    let mut whole = a.clone();
    for lost in [0, 1, 7] {
        whole[lost] = 0.0;
    }
    let scaled: Vec<f32> = b.iter().map(|x| x / 8.0).collect();
    assert_eq!(got, fused(&interleaved(&whole, &scaled)));
    let written = desk.read_json("out.sigmf-meta");
    assert_eq!(written["global"]["core:datatype"], "rf32_le");
    assert_eq!(written["global"]["core:sample_rate"], 48000.0);
    refused(&desk, &args, &["out.sigmf-meta", "--force"]);
    desk.write("a.sigmf-meta", meta(start, "cf32_le"));
    refused(&desk, &[&args[..], &["--force"]].concat(), &["a.sigmf-meta: complex samples"]);
}
