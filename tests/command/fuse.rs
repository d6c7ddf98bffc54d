//! The verb fuse, as a user runs it.

use crate::support::{names, text};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// A folder with a bank in it: N = M = 2, f_1 = (1, 2, 3, 4), f_2 = (10, 20, 30), m0 = 3.
struct Bench {
    folder: tempfile::TempDir,
}

const TAPS: [&[f64]; 2] = [&[1.0, 2.0, 3.0, 4.0], &[10.0, 20.0, 30.0, 0.0]];

impl Bench {
    fn new() -> Self {
        let bench = Self { folder: tempfile::tempdir().unwrap() };
        bench.bank(1.0, 1.0);
        bench
    }

    /// Writes bank.json with all taps times `scale`.
    fn bank(&self, fast_period: f64, scale: f64) {
        let channel = |taps: &[f64]| {
            let taps: Vec<_> = taps.iter().map(|c| format!("{}", c * scale)).collect();
            format!(r#"{{ "delay": 0.0, "taps": [{}] }}"#, taps.join(", "))
        };
        let text = format!(
            r#"{{ "format": "hybank-bank", "version": 1, "spec": null, "fast_period": {fast_period:?}, "ratio": 2,
            "latency": 3, "method": "fir", "channels": [{}, {}], "state_space": null,
            "gamma": {{ "upper": null, "lower": null, "noncausal": null }} }}"#,
            channel(TAPS[0]),
            channel(TAPS[1])
        );
        fs::write(self.path("bank.json"), text).unwrap();
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn wav(&self, name: &str, channels: u16, rate: u32, samples: &[f32]) {
        let spec = hound::WavSpec {
            channels,
            sample_rate: rate,
            bits_per_sample: 32,
            sample_format: hound::SampleFormat::Float,
        };
        let mut writer = hound::WavWriter::create(self.path(name), spec).unwrap();
        samples.iter().for_each(|&x| writer.write_sample(x).unwrap());
        writer.finalize().unwrap();
    }

    fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_hybank"));
        command.current_dir(self.folder.path()).args(args);
        command
    }

    fn run(&self, args: &[&str]) -> Output {
        self.command(args).output().unwrap()
    }

    /// Runs and wants success without a word.
    fn quietly(&self, args: &[&str]) {
        let output = self.run(args);
        assert!(output.status.success(), "{output:?}");
        assert_eq!((text(&output.stdout), text(&output.stderr)), (String::new(), String::new()));
    }

    /// Runs and wants exit code `code` with one message that has all of `parts`, and no new file.
    fn refused(&self, code: i32, args: &[&str], parts: &[&str]) {
        let before = names(self.folder.path());
        let output = self.run(args);
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{args:?}: {message}");
        assert!(output.stdout.is_empty(), "{args:?}");
        for part in parts {
            assert!(message.contains(part), "`{part}` is missing in: {message}");
        }
        if code == 1 {
            assert_eq!(message.trim_end().lines().count(), 1, "{message}");
        }
        assert_eq!(names(self.folder.path()), before, "{args:?}");
    }
}

fn samples(path: &Path) -> (hound::WavSpec, Vec<f32>) {
    let mut reader = hound::WavReader::open(path).unwrap();
    let samples = reader.samples::<f32>().map(Result::unwrap).collect();
    (reader.spec(), samples)
}

/// The definition.
fn fused(x: [&[f32]; 2], ticks: usize) -> Vec<f32> {
    let mut y = vec![0.0; 2 * ticks];
    for (t, y) in y.iter_mut().enumerate() {
        for (x, f) in x.iter().zip(TAPS) {
            let past = (0..=t / 2).filter(|&k| k < x.len());
            *y += past.filter_map(|k| Some(f.get(t - 2 * k)? * f64::from(x[k]))).sum::<f64>() as f32;
        }
    }
    y
}

fn ramps(ticks: usize) -> (Vec<f32>, Vec<f32>) {
    ((0..ticks).map(|k| (k % 7) as f32).collect(), (0..ticks).map(|k| -((k % 5) as f32)).collect())
}

#[test]
fn mono_files_line_up_with_their_time_axis() {
    let bench = Bench::new();
    // More than one block, and not a whole number of them.
    for ticks in [1, 2, 5, 40_000] {
        let (a, b) = ramps(ticks);
        bench.wav("a.wav", 1, 24_000, &a);
        bench.wav("b.wav", 1, 24_000, &b);
        bench.quietly(&["fuse", "bank.json", "a.wav", "b.wav", "-o", "out.wav", "--force"]);
        let (spec, got) = samples(&bench.path("out.wav"));
        assert_eq!((spec.sample_rate, spec.channels, spec.bits_per_sample), (48_000, 1, 32));
        let (mut a, mut b) = (a, b);
        a.extend([0.0; 2]);
        b.extend([0.0; 2]);
        assert_eq!(got, fused([&a, &b], ticks + 2)[3..3 + 2 * ticks]);
    }
}

#[test]
fn one_file_of_two_channels_gives_the_same() {
    let bench = Bench::new();
    let (a, b) = ramps(1000);
    bench.wav("a.wav", 1, 24_000, &a);
    bench.wav("b.wav", 1, 24_000, &b);
    let both: Vec<f32> = a.iter().zip(&b).flat_map(|(&a, &b)| [a, b]).collect();
    bench.wav("both.wav", 2, 24_000, &both);
    bench.quietly(&["fuse", "bank.json", "a.wav", "b.wav", "-o", "1.wav"]);
    bench.quietly(&["fuse", "bank.json", "both.wav", "-o", "2.wav"]);
    assert_eq!(fs::read(bench.path("1.wav")).unwrap(), fs::read(bench.path("2.wav")).unwrap());
}

#[test]
fn kept_latency_is_the_causal_output() {
    let bench = Bench::new();
    let (a, b) = ramps(100);
    bench.wav("a.wav", 1, 8_000, &a);
    bench.wav("b.wav", 1, 8_000, &b);
    bench.quietly(&["fuse", "bank.json", "a.wav", "b.wav", "-o", "out.wav", "--keep-latency"]);
    assert_eq!(samples(&bench.path("out.wav")).1, fused([&a, &b], 100));
}

#[test]
fn pipes_carry_headers_without_lengths() {
    let bench = Bench::new();
    let (a, b) = ramps(300);
    let both: Vec<f32> = a.iter().zip(&b).flat_map(|(&a, &b)| [a, b]).collect();
    bench.wav("both.wav", 2, 24_000, &both);
    bench.quietly(&["fuse", "bank.json", "both.wav", "-o", "file.wav"]);
    let input = fs::File::open(bench.path("both.wav")).unwrap();
    let mut command = bench.command(&["fuse", "bank.json", "-", "-o", "-"]);
    let output = command.stdin(input).output().unwrap();
    assert!(output.status.success() && output.stderr.is_empty());
    // The same samples; the header says that it does not know how many.
    let file = fs::read(bench.path("file.wav")).unwrap();
    let data = 4 * 600;
    assert_eq!(output.stdout[output.stdout.len() - data..], file[file.len() - data..]);
    assert_eq!(output.stdout[40..44], [0xFF; 4]);
    // And our own reader takes it, through the identity bank of one channel.
    let identity = r#"{ "format": "hybank-bank", "version": 1, "spec": null, "fast_period": 1.0, "ratio": 1,
        "latency": 0, "method": "fir", "channels": [{ "delay": 0.0, "taps": [1.0] }], "state_space": null,
        "gamma": { "upper": null, "lower": null, "noncausal": null } }"#;
    fs::write(bench.path("one.json"), identity).unwrap();
    fs::write(bench.path("streamed.wav"), &output.stdout).unwrap();
    bench.quietly(&["fuse", "one.json", "streamed.wav", "-o", "again.wav"]);
    assert_eq!(samples(&bench.path("again.wav")).1, samples(&bench.path("file.wav")).1);
}

#[test]
fn a_closed_pipe_ends_quietly() {
    let bench = Bench::new();
    let (a, b) = ramps(1_000_000);
    bench.wav("a.wav", 1, 24_000, &a);
    bench.wav("b.wav", 1, 24_000, &b);
    let mut command = bench.command(&["fuse", "bank.json", "a.wav", "b.wav", "-o", "-"]);
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "{output:?}");
    assert!(output.stderr.is_empty(), "{output:?}");
}

#[cfg(unix)]
#[test]
fn an_interrupt_leaves_nothing_behind() {
    let bench = Bench::new();
    bench.wav("both.wav", 2, 24_000, &[0.5; 200]);
    let before = names(bench.folder.path());
    let mut command = bench.command(&["fuse", "bank.json", "-", "-o", "out.wav"]);
    let mut child =
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut stdin = child.stdin.take().unwrap();
    // Less than the header promises, and the pipe stays open: only the signal can end this.
    let wav = fs::read(bench.path("both.wav")).unwrap();
    std::io::Write::write_all(&mut stdin, &wav[..wav.len() - 80]).unwrap();
    while names(bench.folder.path()) == before {
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    drop(stdin);
    let told = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{told}");
    assert!(told.contains("interrupted after") && told.contains("nothing was kept"), "{told}");
    assert_eq!(names(bench.folder.path()), before);
}

#[test]
fn integers_saturate_and_the_count_is_told() {
    let bench = Bench::new();
    bench.bank(1.0, 1.0 / 16.0);
    bench.wav("a.wav", 1, 24_000, &[0.1, 0.1, 0.1]);
    bench.wav("b.wav", 1, 24_000, &[0.0, 0.0, 0.0]);
    let args = ["fuse", "bank.json", "a.wav", "b.wav", "-o", "out.wav", "--bits", "16", "--keep-latency"];
    bench.quietly(&args);
    let ints: Vec<i16> =
        hound::WavReader::open(bench.path("out.wav")).unwrap().samples().map(Result::unwrap).collect();
    let want = fused([&[0.1; 3], &[0.0; 3]], 3);
    let quantised = |y: &f32| (y / 16.0 * 32768.0).round_ties_even() as i16;
    assert_eq!(ints, want.iter().map(quantised).collect::<Vec<_>>());
    bench.wav("b.wav", 1, 24_000, &[0.0, 3.2, 0.0]);
    let output = bench.run(&[&args[..], &["--force", "--json"]].concat());
    assert!(output.status.success());
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    // 10, 20 and 30 times 0.2 exceed 1.
    assert_eq!((report["clipped"].as_u64(), report["samples"].as_u64()), (Some(3), Some(6)));
    assert!(text(&output.stderr).contains("3 output samples were clipped"));
    bench.refused(1, &[&args[..], &["--force", "--strict"]].concat(), &["clipped", "--strict"]);
}

#[test]
fn every_width_is_what_it_says() {
    let bench = Bench::new();
    bench.bank(1.0, 1.0 / 1024.0);
    bench.wav("a.wav", 1, 24_000, &[1.0, -0.5, 0.25]);
    bench.wav("b.wav", 1, 24_000, &[0.0; 3]);
    let args = |bits| ["fuse", "bank.json", "a.wav", "b.wav", "-o", "out.wav", "--force", "--bits", bits];
    for (bits, width, format) in [
        ("16", 16, hound::SampleFormat::Int),
        ("24", 24, hound::SampleFormat::Int),
        ("32", 32, hound::SampleFormat::Int),
        ("32f", 32, hound::SampleFormat::Float),
    ] {
        bench.quietly(&args(bits));
        let spec = hound::WavReader::open(bench.path("out.wav")).unwrap().spec();
        assert_eq!((spec.bits_per_sample, spec.sample_format), (width, format));
    }
    bench.quietly(&args("64f"));
    let bytes = fs::read(bench.path("out.wav")).unwrap();
    assert_eq!(bytes[bytes.len() - 48..][..8], (3.0f64 / 1024.0).to_le_bytes());
    bench.refused(2, &args("12"), &["12", "16, 24, 32, 32f, 64f"]);
}

#[test]
fn unequal_lengths_are_told_and_strict_refuses_them() {
    let bench = Bench::new();
    let (a, b) = ramps(50_000);
    bench.wav("a.wav", 1, 24_000, &a);
    bench.wav("b.wav", 1, 24_000, &b[..20_000]);
    let args = ["fuse", "bank.json", "a.wav", "b.wav", "-o", "out.wav"];
    bench.refused(1, &[&args[..], &["--strict"]].concat(), &["a.wav", "30000 samples", "--strict"]);
    let output = bench.run(&args);
    assert!(output.status.success());
    assert!(
        text(&output.stderr).contains("a.wav: longer than the shortest channel, 30000 samples"),
        "{output:?}"
    );
    assert_eq!(samples(&bench.path("out.wav")).1.len(), 40_000);
}

#[test]
fn what_is_not_finite_is_counted_and_replaced() {
    let bench = Bench::new();
    bench.wav("a.wav", 1, 24_000, &[1.0, f32::NAN, 2.0]);
    bench.wav("b.wav", 1, 24_000, &[0.0, f32::INFINITY, 0.0]);
    let args = ["fuse", "bank.json", "a.wav", "b.wav", "-o", "out.wav", "--keep-latency"];
    let output = bench.run(&args);
    assert!(output.status.success() && text(&output.stderr).contains("2 input samples were NaN or infinite"));
    assert_eq!(samples(&bench.path("out.wav")).1, fused([&[1.0, 0.0, 2.0], &[0.0; 3]], 3));
    bench.refused(1, &[&args[..], &["--strict", "--force"]].concat(), &["NaN"]);
}

#[test]
fn rates_must_match_unless_time_is_normalised() {
    let bench = Bench::new();
    bench.bank(1.0 / 48_000.0, 1.0);
    bench.wav("a.wav", 1, 24_000, &[0.0; 9]);
    bench.wav("b.wav", 1, 24_000, &[0.0; 9]);
    bench.wav("c.wav", 1, 22_050, &[0.0; 9]);
    bench.quietly(&["fuse", "bank.json", "a.wav", "b.wav", "-o", "out.wav"]);
    assert_eq!(samples(&bench.path("out.wav")).0.sample_rate, 48_000);
    bench.refused(1, &["fuse", "bank.json", "a.wav", "c.wav", "-o", "no.wav"], &["c.wav", "22050", "24000"]);
    bench.refused(1, &["fuse", "bank.json", "c.wav", "c.wav", "-o", "no.wav"], &["c.wav", "22050", "24000"]);
}

#[test]
fn faults_have_one_clear_message_and_leave_nothing() {
    let bench = Bench::new();
    bench.wav("a.wav", 1, 24_000, &[0.0; 9]);
    bench.wav("b.wav", 2, 24_000, &[0.0; 18]);
    fs::write(bench.path("text.wav"), "hello, world").unwrap();
    fs::write(bench.path("half.wav"), &fs::read(bench.path("a.wav")).unwrap()[..30]).unwrap();
    fs::write(bench.path("bad.json"), "{ \"ratio\": }").unwrap();
    fs::write(bench.path("there.wav"), "old").unwrap();
    let fuse = |bank: &'static str, a, b, o| ["fuse", bank, a, b, "-o", o];
    let refused = |args: [&str; 6], parts: &[&str]| bench.refused(1, &args, parts);
    refused(fuse("bank.json", "a.wav", "none.wav", "no.wav"), &["none.wav", "open"]);
    refused(fuse("none.json", "a.wav", "a.wav", "no.wav"), &["none.json"]);
    refused(fuse("bad.json", "a.wav", "a.wav", "no.wav"), &["bad.json", "line 1"]);
    refused(fuse("bank.json", "a.wav", "b.wav", "no.wav"), &["2 channels", "3", "b.wav: 2"]);
    refused(fuse("bank.json", "a.wav", "text.wav", "no.wav"), &["text.wav", "not a WAV file", "hell"]);
    refused(fuse("bank.json", "a.wav", "half.wav", "no.wav"), &["half.wav", "byte 30", "truncated"]);
    refused(fuse("bank.json", "a.wav", "a.wav", "there.wav"), &["there.wav", "--force"]);
    refused(fuse("bank.json", "a.wav", "a.wav", "no/such/o.wav"), &["no/such/o.wav"]);
    refused(fuse("bank.json", "a.wav", "a.wav", "."), &[".: "]);
    assert_eq!(fs::read(bench.path("there.wav")).unwrap(), b"old");
    bench.refused(2, &["fuse", "bank.json", "-", "-", "-o", "no.wav"], &["twice"]);
    bench.refused(2, &["fuse", "bank.json", "a.wav", "a.wav", "-o", "-", "--json"], &["--json"]);
    bench.refused(2, &["fuse", "bank.json", "a.wav", "a.wav"], &["--output"]);
}

#[test]
fn empty_recordings_give_an_empty_one_with_a_warning() {
    let bench = Bench::new();
    bench.wav("empty.wav", 1, 24_000, &[]);
    for more in [&[][..], &["--keep-latency"], &["--algorithm", "overlap-save"], &["--gaps", "zero"]] {
        let args =
            [&["fuse", "bank.json", "empty.wav", "empty.wav", "-o", "out.wav", "--force"], more].concat();
        let output = bench.run(&args);
        let told = text(&output.stderr);
        assert!(output.status.success() && output.stdout.is_empty(), "{args:?}: {told}");
        assert!(told.starts_with("hybank: warning: empty.wav") && told.contains("length is zero"), "{told}");
        assert_eq!(told.trim_end().lines().count(), 1, "{told}");
        let (spec, samples) = samples(&bench.path("out.wav"));
        assert_eq!((spec.sample_rate, spec.channels, samples.len()), (48_000, 1, 0), "{args:?}");
    }
    let strict = ["fuse", "bank.json", "empty.wav", "empty.wav", "-o", "no.wav", "--strict"];
    bench.refused(1, &strict, &["empty.wav", "length is zero", "--strict"]);
}

#[test]
fn a_truncated_file_gives_what_is_whole() {
    let bench = Bench::new();
    let (a, b) = ramps(100);
    bench.wav("a.wav", 1, 24_000, &a);
    bench.wav("b.wav", 1, 24_000, &b);
    let bytes = fs::read(bench.path("a.wav")).unwrap();
    fs::write(bench.path("a.wav"), &bytes[..bytes.len() - 41]).unwrap();
    let output = bench.run(&["fuse", "bank.json", "a.wav", "b.wav", "-o", "out.wav", "--keep-latency"]);
    assert!(output.status.success());
    let told = text(&output.stderr);
    assert!(told.contains("41 bytes") && told.contains("3 bytes of it"), "{told}");
    assert_eq!(samples(&bench.path("out.wav")).1, fused([&a[..89], &b[..89]], 89));
}

/// Real captures beside the checkout, if they are there: see the data's own description.
#[test]
fn speech_of_two_converters_opens() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/captures/speech-2x");
    if !folder.is_dir() {
        println!("skipped: no {}", folder.display());
        return;
    }
    let bench = Bench::new();
    bench.bank(1.0 / 48_000.0, 1.0 / 64.0);
    let file = |name: &str| folder.join(name).display().to_string();
    bench.quietly(&["fuse", "bank.json", &file("ch1.wav"), &file("ch2.wav"), "-o", "out.wav"]);
    let slow = samples(&folder.join("ch1.wav")).1.len();
    assert_eq!(samples(&bench.path("out.wav")).1.len(), 2 * slow);
}

#[test]
fn gaps_are_bridged_reported_and_masked() {
    let bench = Bench::new();
    let mut a: Vec<f32> = (0..40).map(|k| k as f32).collect();
    let b = vec![1.0; 40];
    let clean = a.clone();
    a[10..13].fill(f32::NAN);
    bench.wav("a.wav", 1, 24_000, &a);
    bench.wav("b.wav", 1, 24_000, &b);
    let args =
        ["fuse", "bank.json", "a.wav", "b.wav", "-o", "out.wav", "--force", "--json", "--mask", "mask"];
    for (policy, value) in [("zero", 0.0), ("hold", 9.0), ("mask", 0.0)] {
        let output = bench.run(&[&args[..], &["--gaps", policy]].concat());
        assert!(output.status.success(), "{output:?}");
        assert!(text(&output.stderr).contains("gap: channel 1, sample 10, 3 missing"), "{output:?}");
        let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(report["gaps"]["list"][0], serde_json::json!({ "channel": 1, "first": 10, "length": 3 }));
        let mut filled = clean.clone();
        filled[10..13].fill(value);
        // Two frames of zeros flush the last three samples.
        let causal = |x: &[f32]| fused([&[x, &[0.0; 2]].concat(), &[&b[..], &[0.0; 2]].concat()], 42);
        let got = samples(&bench.path("out.wav")).1;
        assert_eq!(got, causal(&filled)[3..83]);
        // The mask lines up with the output: outside of it nothing differs from the whole recording.
        let mask = fs::read(bench.path("mask")).unwrap();
        let want = &causal(&clean)[3..83];
        assert_eq!(mask.len(), got.len());
        assert_eq!(mask.iter().map(|&m| usize::from(m)).sum::<usize>(), 8);
        for (t, (got, want)) in got.iter().zip(want).enumerate() {
            assert_eq!(mask[t] == 0, got == want, "sample {t}");
        }
    }
    bench.refused(2, &["fuse", "bank.json", "a.wav", "b.wav", "-o", "no.wav", "--gaps", "mask"], &["--mask"]);
}

#[test]
fn sigmf_goes_in_and_out() {
    let bench = Bench::new();
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
    fs::write(bench.path("a.sigmf-meta"), meta(captures, "rf32_be")).unwrap();
    let start = r#"{ "core:sample_start": 0, "core:global_index": 100 }"#;
    fs::write(bench.path("b.sigmf-meta"), meta(start, "ri16_le")).unwrap();
    let there: Vec<u8> = a[2..7].iter().chain(&a[8..]).flat_map(|x| x.to_be_bytes()).collect();
    fs::write(bench.path("a.sigmf-data"), there).unwrap();
    let coded: Vec<u8> = b.iter().flat_map(|x| ((x * 4096.0) as i16).to_le_bytes()).collect();
    fs::write(bench.path("b.sigmf-data"), coded).unwrap();
    let args =
        ["fuse", "bank.json", "a.sigmf-meta", "b.sigmf-data", "-o", "out.sigmf-meta", "--keep-latency"];
    let output = bench.run(&[&args[..], &["--gaps", "zero", "--json"]].concat());
    assert!(output.status.success(), "{output:?}");
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((report["gaps"]["count"].as_u64(), report["gaps"]["missing"].as_u64()), (Some(2), Some(3)));
    let got: Vec<f32> = fs::read(bench.path("out.sigmf-data"))
        .unwrap()
        .chunks_exact(4)
        .map(|b| f32::from_le_bytes(b.try_into().unwrap()))
        .collect();
    let mut whole = a.clone();
    for lost in [0, 1, 7] {
        whole[lost] = 0.0;
    }
    let scaled: Vec<f32> = b.iter().map(|x| x / 8.0).collect();
    assert_eq!(got, fused([&whole, &scaled], 20));
    let written: serde_json::Value =
        serde_json::from_slice(&fs::read(bench.path("out.sigmf-meta")).unwrap()).unwrap();
    assert_eq!(written["global"]["core:datatype"], "rf32_le");
    assert_eq!(written["global"]["core:sample_rate"], 48000.0);
    bench.refused(1, &args, &["out.sigmf-meta", "--force"]);
    fs::write(bench.path("a.sigmf-meta"), meta(start, "cf32_le")).unwrap();
    bench.refused(1, &[&args[..], &["--force"]].concat(), &["a.sigmf-meta", "cf32_le"]);
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let bench = Bench::new();
    // Long filters, so that even short recordings are shared out.
    let taps = |i: usize| {
        (0..512).map(|t| format!("{}", ((t * 7 + i) % 11) as f64 / 1e3)).collect::<Vec<_>>().join(", ")
    };
    let channel = |i: usize| format!(r#"{{ "delay": 0.0, "taps": [{}] }}"#, taps(i));
    let text = format!(
        r#"{{ "format": "hybank-bank", "version": 1, "spec": null, "fast_period": 1.0, "ratio": 2, "latency": 3,
        "method": "fir", "channels": [{}, {}], "state_space": null,
        "gamma": {{ "upper": null, "lower": null, "noncausal": null }} }}"#,
        channel(0),
        channel(1)
    );
    fs::write(bench.path("long.json"), text).unwrap();
    let samples: Vec<f32> = (0..2 * 60_000).map(|i| ((i * 7919) % 1000) as f32 / 1000.0 - 0.5).collect();
    bench.wav("both.wav", 2, 48_000, &samples);
    let raw: Vec<u8> = samples.iter().flat_map(|x| x.to_le_bytes()).collect();
    fs::write(bench.path("both.raw"), raw).unwrap();
    for threads in ["1", "2", "3", "0"] {
        let out = format!("fused{threads}.wav");
        bench.quietly(&["fuse", "long.json", "both.wav", "-o", &out, "--threads", threads]);
        let live = format!("live{threads}.raw");
        bench.quietly(&["stream", "long.json", "--input", "both.raw", "-o", &live, "--threads", threads]);
        for (name, one) in [(out, "fused1.wav"), (live, "live1.raw")] {
            assert!(fs::read(bench.path(&name)).unwrap() == fs::read(bench.path(one)).unwrap(), "{name}");
        }
    }
    bench.refused(2, &["fuse", "long.json", "both.wav", "-o", "x.wav", "--threads", "1025"], &["--threads"]);
    bench.refused(2, &["stream", "long.json", "--threads", "many"], &["--threads"]);
}
