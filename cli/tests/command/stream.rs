//! The command stream, as a user runs it.

#[cfg(target_os = "linux")]
use crate::support::until_caught;
use crate::support::{Desk, bytes, floats, frames, fused, send, text};
use std::fs;
use std::io::{Read, Write};
use std::path::PathBuf;
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

/// A folder in which `hybank stream` works with its bank.
struct Bench(Desk);

impl Bench {
    fn new() -> Self {
        Self(Desk::with_model())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path(name)
    }

    /// Length of the output that has no name yet.
    fn unfinished_bytes(&self) -> Option<u64> {
        let mut files = fs::read_dir(self.path("")).unwrap().map(Result::unwrap);
        let file = files.find(|file| file.file_name().to_string_lossy().ends_with(".part"))?;
        Some(file.metadata().ok()?.len())
    }

    fn spawn(&self, args: &[&str]) -> Child {
        self.0.spawn(&[&["stream", "bank.json"], args].concat())
    }

    /// What a run without a word gives.
    fn piped(&self, args: &[&str], input: &[u8]) -> Vec<u8> {
        self.0.piped(&[&["stream", "bank.json"], args].concat(), input)
    }

    fn run(&self, args: &[&str], input: &[u8]) -> Output {
        self.0.run(&[&["stream", "bank.json"], args].concat(), input)
    }
}

#[test]
fn interleaved_floats_are_the_default() {
    let bench = Bench::new();
    for count in [0, 1, 7, 100_000] {
        let input = frames(count);
        assert!(floats(&bench.piped(&[], &bytes(&input))) == fused(&input), "{count} frames");
    }
}

#[test]
fn a_frame_comes_out_as_soon_as_it_is_in() {
    let bench = Bench::new();
    let mut child = bench.spawn(&[]);
    let (mut stdin, mut stdout) = (child.stdin.take().unwrap(), child.stdout.take().unwrap());
    let input = frames(50);
    let want = fused(&input);
    for (frame, want) in input.chunks_exact(2).zip(want.chunks_exact(2)) {
        // In two pieces, cut inside a sample.
        let frame = bytes(frame);
        stdin.write_all(&frame[..3]).unwrap();
        stdin.write_all(&frame[3..]).unwrap();
        let mut got = [0; 8];
        // An output that waits for a block would never come.
        stdout.read_exact(&mut got).unwrap();
        assert_eq!(floats(&got), want);
    }
    drop(stdin);
    assert!(child.wait().unwrap().success());
}

#[test]
fn one_fifo_a_channel_in_any_order_of_opening() {
    let bench = Bench::new();
    let input = frames(20_000);
    for name in ["a", "b"] {
        assert!(Command::new("mkfifo").arg(bench.path(name)).status().unwrap().success());
    }
    let child = bench.spawn(&["--input", "a", "--input", "b"]);
    let channel = |i: usize| bytes(&input.iter().skip(i).step_by(2).copied().collect::<Vec<_>>());
    let writers = [("b", channel(1)), ("a", channel(0))].map(|(name, data)| {
        let path = bench.path(name);
        std::thread::spawn(move || fs::OpenOptions::new().write(true).open(path).unwrap().write_all(&data))
    });
    let output = child.wait_with_output().unwrap();
    // Only a child that opened both lets the writers go.
    assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");
    for writer in writers {
        writer.join().unwrap().unwrap();
    }
    assert!(floats(&output.stdout) == fused(&input));
}

#[test]
fn wav_goes_through_with_its_rate() {
    let bench = Bench::new();
    let input = frames(300);
    crate::support::wav::write(&bench.0, "in.wav", 2, 24_000, &input);
    let wav = bench.0.read("in.wav");
    let raw = bench.run(&[], &wav);
    assert!(!raw.status.success() && text(&raw.stderr).contains("give the format wav"), "{raw:?}");
    let output = bench.piped(&["--format", "wav"], &wav);
    assert_eq!((&output[..4], &output[24..28]), (&b"RIFF"[..], &48_000u32.to_le_bytes()[..]));
    assert_eq!(floats(&output[44..]), fused(&input));
    // A file knows its length.
    bench.piped(&["--format", "wav", "-o", "out.wav"], &wav);
    let mut file = hound::WavReader::open(bench.path("out.wav")).unwrap();
    assert_eq!((file.spec().sample_rate, file.duration()), (48_000, 600));
    assert!(file.samples::<f32>().map(Result::unwrap).eq(fused(&input)));
}

#[test]
fn flushing_brings_out_the_last_samples() {
    let bench = Bench::new();
    let mut input = frames(40);
    let output = bench.run(&["--flush"], &bytes(&input));
    input.extend([0.0; 4]);
    assert_eq!(floats(&output.stdout), fused(&input));
}

#[test]
fn cut_frames_and_unequal_channels_are_reported() {
    let bench = Bench::new();
    let input = frames(10);
    let mut cut = bytes(&input);
    cut.extend([1, 2, 3, 4, 5]);
    let output = bench.run(&[], &cut);
    assert!(output.status.success());
    assert_eq!(floats(&output.stdout), fused(&input));
    assert!(text(&output.stderr).contains("the last frame is cut (5 bytes"), "{output:?}");
    let strict = bench.run(&["--strict"], &cut);
    assert_eq!(strict.status.code(), Some(1));
    fs::write(bench.path("a"), bytes(&[1.0; 10])).unwrap();
    fs::write(bench.path("b"), bytes(&[1.0; 7])).unwrap();
    let output = bench.run(&["--input", "a", "--input", "b"], &[]);
    assert_eq!(output.stdout.len(), 7 * 2 * 4);
    let said = text(&output.stderr);
    assert!(said.contains("a: longer than the shortest channel, at least 3 samples"), "{said}");
}

#[test]
fn a_signal_ends_after_whole_frames_and_reports() {
    crate::support::ending_signals().for_each(ends_after_whole_frames);
}

fn ends_after_whole_frames(signal: u32) {
    let bench = Bench::new();
    let mut child = bench.spawn(&["-o", "out.raw", "--json"]);
    let mut stdin = child.stdin.take().unwrap();
    let input = frames(100);
    stdin.write_all(&bytes(&input)).unwrap();
    stdin.flush().unwrap();
    // The pipe stays open: only the signal can end this, once all samples are written.
    while bench.unfinished_bytes() < Some(800) {
        std::thread::sleep(Duration::from_millis(1));
    }
    send(child.id(), signal);
    let output = child.wait_with_output().unwrap();
    drop(stdin);
    assert!(output.status.success(), "{output:?}");
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((report["interrupted"].as_bool(), report["frames"].as_u64()), (Some(true), Some(100)));
    assert!(text(&output.stderr).contains("interrupted after 100 frames, 200 samples written"), "{output:?}");
    assert_eq!(floats(&fs::read(bench.path("out.raw")).unwrap()), fused(&input));
}

/// As after `nohup`: the stream goes on when its terminal is gone.
#[cfg(target_os = "linux")]
#[test]
fn an_ignored_hangup_stays_ignored() {
    let bench = Bench::new();
    let run = format!("trap '' HUP; exec {} stream bank.json -o out.raw", env!("CARGO_BIN_EXE_hybank"));
    let mut command = Command::new("sh");
    command.current_dir(bench.path("")).args(["-c", &run]).stdin(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    until_caught(child.id(), 15);
    send(child.id(), 1);
    let input = frames(100);
    child.stdin.take().unwrap().write_all(&bytes(&input)).unwrap();
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");
    assert_eq!(floats(&fs::read(bench.path("out.raw")).unwrap()), fused(&input));
}

/// Another process takes the name while samples arrive: what cannot be recorded again is not lost.
#[test]
fn a_recording_whose_name_is_taken_stays_under_its_hidden_name() {
    let bench = Bench::new();
    let mut child = bench.spawn(&["-o", "out.raw"]);
    let mut stdin = child.stdin.take().unwrap();
    let input = frames(100);
    stdin.write_all(&bytes(&input)).unwrap();
    while bench.unfinished_bytes() < Some(800) {
        std::thread::sleep(Duration::from_millis(1));
    }
    fs::write(bench.path("out.raw"), "another").unwrap();
    drop(stdin);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    let message = text(&output.stderr);
    assert!(message.starts_with("hybank: out.raw: the file exists"), "{message}");
    let (_, hidden) = message.trim_end().split_once("; what was recorded is in ").expect(&message);
    assert_eq!(floats(&fs::read(bench.path(hidden)).unwrap()), fused(&input));
    assert_eq!(fs::read(bench.path("out.raw")).unwrap(), b"another");
}

#[test]
fn a_closed_pipe_ends_quietly() {
    let bench = Bench::new();
    let mut child = bench.spawn(&[]);
    drop(child.stdout.take());
    let mut stdin = child.stdin.take().unwrap();
    let feeder = std::thread::spawn(move || while stdin.write_all(&[0; 65536]).is_ok() {});
    let output = child.wait_with_output().unwrap();
    feeder.join().unwrap();
    assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");
}

/// What was recorded beside samples that nobody read any more cannot be recorded again.
#[test]
fn a_closed_pipe_names_the_mask_that_stays() {
    let bench = Bench::new();
    let mut child = bench.spawn(&["--gaps", "--mask", "mask"]);
    let mut output = child.stdout.take().unwrap();
    let mut stdin = child.stdin.take().unwrap();
    let feeder = std::thread::spawn(move || while stdin.write_all(&[0; 65536]).is_ok() {});
    output.read_exact(&mut [0; 65536]).unwrap();
    drop(output);
    let output = child.wait_with_output().unwrap();
    feeder.join().unwrap();
    assert!(output.status.success(), "{output:?}");
    let warning = text(&output.stderr);
    assert!(warning.contains("what was recorded is in .mask."), "{warning}");
    assert!(bench.unfinished_bytes().is_some_and(|bytes| bytes > 0) && !bench.path("mask").exists());
}

/// A name that ends in wav says the format; --output-format says it too, and must agree.
#[test]
fn the_name_of_the_output_implies_wav() {
    let bench = Bench::new();
    let frames: Vec<f32> = frames(50);
    for (name, how) in [("y.wav", &[][..]), ("z.WAV", &["--output-format", "wav"])] {
        bench.piped(&[&["-o", name], how].concat(), &bytes(&frames));
        assert_eq!(crate::support::wav::read(&bench.path(name)).1, fused(&frames), "{name}");
    }
    let output = bench.run(&["-o", "x.wav", "--output-format", "f32le"], &bytes(&frames));
    assert!(text(&output.stderr).contains("the output is raw samples, not wav"), "{output:?}");
    assert!(!bench.path("x.wav").exists());
}

/// Two inputs of two channels each are the four channels of a bank, as one input of four is.
#[test]
fn inputs_have_several_channels_each() {
    let desk = crate::support::Desk::empty();
    let channel = |delay: f64| format!("[[channel]]\ndelay = {delay}\n");
    let channels: String = [3.0, 2.0, 1.0, 0.0].map(channel).concat();
    let head =
        "fast_period = 1.0\nratio = 4\nlatency = 8\n[target]\nfilter = { num = [1.0], den = [1.0, 1.0] }\n";
    desk.write("spec.toml", format!("{head}[design]\nmethod = \"fir\"\ntaps = 16\n{channels}"));
    crate::calibrate::design(&desk, "spec.toml");
    std::fs::rename(desk.path("bank.json"), desk.path("b.json")).unwrap();
    let samples: Vec<f32> = (0..400).map(|n| ((n * n * 7) % 101) as f32 / 101.0 - 0.5).collect();
    let pair = |from: usize| -> Vec<f32> { samples.chunks(4).flat_map(|x| [x[from], x[from + 1]]).collect() };
    desk.write("left.raw", bytes(&pair(0)));
    desk.write("right.raw", bytes(&pair(2)));
    let stream = ["stream", "b.json", "--input", "left.raw", "--input", "right.raw"];
    let output = desk.piped(&[&stream[..], &["--channels", "2"]].concat(), b"");
    assert_eq!(output, desk.piped(&["stream", "b.json"], &bytes(&samples)));
    assert!(output.len() == 4 * 400);
    desk.refused(2, &stream, &["given 2 times", "4 channels", "--channels how many each input holds"]);
    desk.refused(1, &[&stream[..], &["--channels", "3"]].concat(), &["4 channels"]);
    let wav = ["stream", "b.json", "--format", "wav", "--channels", "2"];
    desk.refused(2, &wav, &["--channels", "state their channels"]);
}

#[test]
fn wrong_usage_and_missing_inputs_are_reported() {
    let bench = Bench::new();
    fs::write(bench.path("there"), "old").unwrap();
    for (code, args, part) in [
        (2, &["--format", "f16"][..], "f16"),
        (2, &["--report", "-"], "--output"),
        (2, &["--input", "a", "--input", "b", "--input", "c"], "2 times"),
        (2, &["--input", "-", "--input", "-"], "twice"),
        (1, &["--input", "none", "--input", "none"], "none: cannot open"),
        (1, &["--format", "wav"], "standard input"),
        (1, &["-o", "there"], "--force"),
    ] {
        let output = bench.run(args, b"");
        assert_eq!(output.status.code(), Some(code), "{args:?}: {output:?}");
        assert!(text(&output.stderr).contains(part), "{args:?}: {output:?}");
        assert!(output.stdout.is_empty());
    }
    assert_eq!(fs::read(bench.path("there")).unwrap(), b"old");
}
