//! The command `fuse`, as a user runs it.

mod recordings;
mod turns;

use crate::support::{Desk, TAPS, bytes, fused, interleaved, names, text, wav};
use hybank::bank::{Bank, SynthesisFilters};
use hybank::units::Seconds;
use std::fs;

/// N = M = 2, m0 = 3.
fn write_bank(desk: &Desk, name: &str, fast_period: f64, taps: [Vec<f64>; 2]) {
    let bare = Bank::bare(SynthesisFilters::Fir(taps.to_vec()), 2);
    desk.write_bank(name, &Bank { fast_period: Seconds(fast_period), latency: 3, ..bare });
}

/// Replaces bank.json by one with all taps times `scale`.
fn scale_bank(desk: &Desk, fast_period: f64, scale: f64) {
    let taps = TAPS.map(|taps| taps.iter().map(|&c| f64::from(c) * scale).collect());
    write_bank(desk, "bank.json", fast_period, taps);
}

/// Runs and wants success with what was written, and nothing to object; nothing at all where samples go to
/// standard output.
fn quietly(desk: &Desk, args: &[&str]) {
    let said = desk.good(args);
    let is_told = said.lines().count() == 2 && said.contains(" samples at ");
    assert!(said.is_empty() || is_told, "{args:?}: {said}");
}

/// Runs and wants exit code 1 with a message of one line.
fn refused(desk: &Desk, args: &[&str], parts: &[&str]) {
    let message = desk.refused(1, args, parts);
    assert_eq!(message.trim_end().lines().count(), 1, "{message}");
}

fn ramps(frames: usize) -> (Vec<f32>, Vec<f32>) {
    ((0..frames).map(|k| (k % 7) as f32).collect(), (0..frames).map(|k| -((k % 5) as f32)).collect())
}

#[test]
fn mono_files_line_up_with_their_time_axis() {
    let desk = Desk::new();
    // More than one block, and not a whole number of them.
    for frames in [1, 2, 5, 40_000] {
        let (a, b) = ramps(frames);
        wav::write_pair(&desk, &a, &b);
        quietly(&desk, &["fuse", "bank.json", "a.wav", "b.wav", "-o", "out.wav", "--force"]);
        let (spec, got) = wav::read(&desk.path("out.wav"));
        assert_eq!((spec.sample_rate, spec.channels, spec.bits_per_sample), (48_000, 1, 32));
        let flushed = [interleaved(&a, &b), vec![0.0; 4]].concat();
        assert_eq!(got, fused(&flushed)[3..3 + 2 * frames]);
    }
}

#[test]
fn kept_latency_is_the_causal_output() {
    let desk = Desk::new();
    let (a, b) = ramps(100);
    wav::write(&desk, "a.wav", 1, 8_000, &a);
    wav::write(&desk, "b.wav", 1, 8_000, &b);
    quietly(&desk, &["fuse", "bank.json", "a.wav", "b.wav", "-o", "out.wav", "--keep-latency"]);
    assert_eq!(wav::samples(&desk, "out.wav"), fused(&interleaved(&a, &b)));
}

#[test]
fn pipes_carry_headers_without_lengths() {
    let desk = Desk::new();
    let (a, b) = ramps(300);
    let both = interleaved(&a, &b);
    wav::write(&desk, "both.wav", 2, 24_000, &both);
    quietly(&desk, &["fuse", "bank.json", "both.wav", "-o", "file.wav"]);
    let input = fs::File::open(desk.path("both.wav")).unwrap();
    let mut command = desk.command(&["fuse", "bank.json", "-", "-o", "-"]);
    let output = command.stdin(input).output().unwrap();
    assert!(output.status.success() && output.stderr.is_empty());
    // The same samples; the header says that it does not know how many.
    let file = desk.read("file.wav");
    let data = 4 * 600;
    assert_eq!(output.stdout[output.stdout.len() - data..], file[file.len() - data..]);
    assert_eq!(output.stdout[40..44], [0xFF; 4]);
    // And our own reader takes it, through the identity bank of one channel.
    desk.write_bank("one.json", &Bank::bare(SynthesisFilters::Fir(vec![vec![1.0]]), 1));
    desk.write("streamed.wav", &output.stdout);
    quietly(&desk, &["fuse", "one.json", "streamed.wav", "-o", "again.wav"]);
    assert_eq!(wav::samples(&desk, "again.wav"), wav::samples(&desk, "file.wav"));
}

#[cfg(unix)]
#[test]
fn an_interrupt_leaves_nothing_behind() {
    let desk = Desk::new();
    wav::write(&desk, "both.wav", 2, 24_000, &[0.5; 200]);
    let before = names(&desk.path(""));
    let mut child = desk.spawn(&["fuse", "bank.json", "-", "-o", "out.wav"]);
    let mut stdin = child.stdin.take().unwrap();
    // Less than the header promises, and the pipe stays open: only the signal can end this.
    let wav = desk.read("both.wav");
    std::io::Write::write_all(&mut stdin, &wav[..wav.len() - 80]).unwrap();
    while names(&desk.path("")) == before {
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    crate::support::send(child.id(), 2);
    let output = child.wait_with_output().unwrap();
    drop(stdin);
    let message = text(&output.stderr);
    assert_eq!((output.status.code(), message.as_str()), (Some(128 + 2), ""));
    assert_eq!(names(&desk.path("")), before);
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let desk = Desk::new();
    // Long filters, so that even short recordings are shared out.
    let taps = |i: usize| (0..512).map(|t| ((t * 7 + i) % 11) as f64 / 1e3).collect();
    write_bank(&desk, "long.json", 1.0, [0, 1].map(taps));
    let samples: Vec<f32> = (0..2 * 60_000).map(|i| ((i * 7919) % 1000) as f32 / 1000.0 - 0.5).collect();
    wav::write(&desk, "both.wav", 2, 48_000, &samples);
    desk.write("both.raw", bytes(&samples));
    for threads in ["1", "2", "3", "0"] {
        let out = format!("fused{threads}.wav");
        quietly(&desk, &["fuse", "long.json", "both.wav", "-o", &out, "--threads", threads]);
        let live = format!("live{threads}.raw");
        quietly(&desk, &["stream", "long.json", "--input", "both.raw", "-o", &live, "--threads", threads]);
        for (name, one) in [(out, "fused1.wav"), (live, "live1.raw")] {
            assert!(desk.read(&name) == desk.read(one), "{name}");
        }
    }
    desk.refused(2, &["fuse", "long.json", "both.wav", "-o", "x.wav", "--threads", "1025"], &["--threads"]);
    desk.refused(2, &["stream", "long.json", "--threads", "many"], &["--threads"]);
}
