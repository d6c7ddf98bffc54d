//! Recordings that differ in length, rate or width, that are damaged, empty or out of range.

use super::{quietly, ramps, refused, scale_bank};
use crate::support::{Desk, fused, interleaved, text, wav};

#[test]
fn integers_saturate_and_the_count_is_reported() {
    let desk = Desk::new();
    scale_bank(&desk, 1.0, 1.0 / 16.0);
    wav::write_pair(&desk, &[0.1, 0.1, 0.1], &[0.0, 0.0, 0.0]);
    let args = ["fuse", "bank.json", "a.wav", "b.wav", "-o", "out.wav", "--bits", "16", "--keep-latency"];
    quietly(&desk, &args);
    let ints: Vec<i16> =
        hound::WavReader::open(desk.path("out.wav")).unwrap().samples().map(Result::unwrap).collect();
    let want = fused(&interleaved(&[0.1; 3], &[0.0; 3]));
    let quantised = |y: &f32| (y / 16.0 * 32768.0).round_ties_even() as i16;
    assert_eq!(ints, want.iter().map(quantised).collect::<Vec<_>>());
    wav::write(&desk, "b.wav", 1, 24_000, &[0.0, 3.2, 0.0]);
    let output = desk.run(&[&args[..], &["--force", "--json"]].concat(), &[]);
    assert!(output.status.success());
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    // 10, 20 and 30 times 0.2 exceed 1.
    assert_eq!((report["clipped"].as_u64(), report["samples"].as_u64()), (Some(3), Some(6)));
    assert!(text(&output.stderr).contains("3 output samples were clipped"));
    refused(&desk, &[&args[..], &["--force", "--strict"]].concat(), &["clipped", "--strict"]);
}

#[test]
fn unequal_lengths_are_reported_and_strict_refuses_them() {
    let desk = Desk::new();
    let (a, b) = ramps(50_000);
    wav::write_pair(&desk, &a, &b[..20_000]);
    let args = ["fuse", "bank.json", "a.wav", "b.wav", "-o", "out.wav"];
    refused(&desk, &[&args[..], &["--strict"]].concat(), &["a.wav", "30000 samples", "--strict"]);
    desk.warned(&args, &["a.wav: longer than the shortest channel, 30000 samples"]);
    assert_eq!(wav::samples(&desk, "out.wav").len(), 40_000);
}

#[test]
fn what_is_not_finite_is_counted_and_replaced() {
    let desk = Desk::new();
    wav::write_pair(&desk, &[1.0, f32::NAN, 2.0], &[0.0, f32::INFINITY, 0.0]);
    let args = ["fuse", "bank.json", "a.wav", "b.wav", "-o", "out.wav", "--keep-latency"];
    desk.warned(&args, &["2 input samples were missing, NaN or infinite"]);
    assert_eq!(wav::samples(&desk, "out.wav"), fused(&interleaved(&[1.0, 0.0, 2.0], &[0.0; 3])));
    refused(&desk, &[&args[..], &["--strict", "--force"]].concat(), &["NaN"]);
}

#[test]
fn rates_must_match_unless_time_is_normalised() {
    let desk = Desk::new();
    scale_bank(&desk, 1.0 / 48_000.0, 1.0);
    wav::write_pair(&desk, &[0.0; 9], &[0.0; 9]);
    wav::write(&desk, "c.wav", 1, 22_050, &[0.0; 9]);
    quietly(&desk, &["fuse", "bank.json", "a.wav", "b.wav", "-o", "out.wav"]);
    assert_eq!(wav::read(&desk.path("out.wav")).0.sample_rate, 48_000);
    refused(&desk, &["fuse", "bank.json", "a.wav", "c.wav", "-o", "no.wav"], &["c.wav", "22050", "24000"]);
    refused(&desk, &["fuse", "bank.json", "c.wav", "c.wav", "-o", "no.wav"], &["c.wav", "22050", "24000"]);
}

#[test]
fn faults_have_one_clear_message_and_leave_nothing() {
    let desk = Desk::new();
    wav::write(&desk, "a.wav", 1, 24_000, &[0.0; 9]);
    wav::write(&desk, "b.wav", 2, 24_000, &[0.0; 18]);
    desk.write("text.wav", "hello, world");
    desk.write("half.wav", &desk.read("a.wav")[..30]);
    desk.write("bad.json", "{ \"ratio\": }");
    desk.write("there.wav", "old");
    let fuse = |bank: &'static str, a, b, o| ["fuse", bank, a, b, "-o", o];
    let refused = |args: [&str; 6], parts: &[&str]| refused(&desk, &args, parts);
    refused(fuse("bank.json", "a.wav", "none.wav", "no.wav"), &["none.wav", "open"]);
    refused(fuse("none.json", "a.wav", "a.wav", "no.wav"), &["none.json"]);
    refused(fuse("bad.json", "a.wav", "a.wav", "no.wav"), &["bad.json", "line 1"]);
    refused(fuse("bank.json", "a.wav", "b.wav", "no.wav"), &["2 channels", "3", "b.wav: 2"]);
    refused(fuse("bank.json", "a.wav", "text.wav", "no.wav"), &["text.wav", "not a WAV file", "hell"]);
    refused(fuse("bank.json", "a.wav", "half.wav", "no.wav"), &["half.wav", "byte 30", "truncated"]);
    refused(fuse("bank.json", "a.wav", "a.wav", "there.wav"), &["there.wav", "--force"]);
    refused(fuse("bank.json", "a.wav", "a.wav", "no/such/o.wav"), &["no/such/o.wav"]);
    refused(fuse("bank.json", "a.wav", "a.wav", "."), &[".: "]);
    assert_eq!(desk.read("there.wav"), b"old");
    desk.refused(2, &["fuse", "bank.json", "-", "-", "-o", "no.wav"], &["twice"]);
    desk.refused(2, &["fuse", "bank.json", "a.wav", "a.wav"], &["--output"]);
}

#[test]
fn empty_recordings_give_an_empty_one_with_a_warning() {
    let desk = Desk::with_model();
    wav::write(&desk, "empty.wav", 1, 24_000, &[]);
    for more in [&[][..], &["--keep-latency"], &["--algorithm", "overlap-save"], &["--gaps"]] {
        let args =
            [&["fuse", "bank.json", "empty.wav", "empty.wav", "-o", "out.wav", "--force"], more].concat();
        let stderr = desk.warned(&args, &["length is zero"]);
        assert!(stderr.starts_with("hybank: warning: empty.wav"), "{stderr}");
        assert_eq!(stderr.trim_end().lines().count(), 1, "{stderr}");
        let (spec, samples) = wav::read(&desk.path("out.wav"));
        assert_eq!((spec.sample_rate, spec.channels, samples.len()), (48_000, 1, 0), "{args:?}");
    }
    let strict = ["fuse", "bank.json", "empty.wav", "empty.wav", "-o", "no.wav", "--strict"];
    refused(&desk, &strict, &["empty.wav", "length is zero", "--strict"]);
}

/// What follows the samples in a second data chunk is left out, and said to be.
#[test]
fn a_second_data_chunk_is_not_lost_in_silence() {
    let desk = Desk::new();
    let (a, b) = ramps(100);
    wav::write_pair(&desk, &a, &b);
    let first = desk.read("a.wav");
    let samples = first.windows(4).position(|id| id == b"data").unwrap();
    desk.write("a.wav", [&first[..], &first[samples..]].concat());
    let fuse = ["fuse", "bank.json", "a.wav", "b.wav", "-o", "out.wav", "--keep-latency"];
    desk.warned(&fuse, &["a.wav: 400 bytes of samples follow"]);
    assert_eq!(wav::samples(&desk, "out.wav"), fused(&interleaved(&a, &b)));
    refused(&desk, &[&fuse[..], &["--strict", "--force"]].concat(), &["a.wav", "one data chunk", "--strict"]);
}
