//! Systems that refuse: standard streams and files that cannot be written, memory that is not there.

use crate::support::blocked::until_a_write_waits;
use crate::support::{Desk, TERM, bytes, frames, fused, names, text};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// hybank in a shell, which redirects its streams; `$H` stands for the binary.
fn shell(desk: &Desk, script: &str) -> Output {
    let mut command = Command::new("sh");
    command.current_dir(desk.path("")).env("H", env!("CARGO_BIN_EXE_hybank"));
    command.args(["-c", script]).output().unwrap()
}

#[test]
fn warnings_that_cannot_be_written_cost_nothing() {
    let desk = Desk::new();
    desk.write("in", [bytes(&frames(50)), vec![1, 2, 3]].concat());
    let want = bytes(&fused(&frames(50)));
    for refusal in ["2>/dev/full", "2>&-"] {
        let output = shell(&desk, &format!("$H stream bank.json --input in -o out --force {refusal}"));
        assert_eq!(output.status.code(), Some(0), "{refusal}");
        assert!(desk.read("out") == want, "{refusal}");
        let failing = shell(&desk, &format!("$H stream none.json {refusal}"));
        assert_eq!(failing.status.code(), Some(1), "{refusal}");
        let wrong = shell(&desk, &format!("$H stream --no-such-option {refusal}"));
        assert_eq!(wrong.status.code(), Some(2), "{refusal}");
    }
}

#[test]
fn a_full_standard_output_is_an_error_of_one_line() {
    let desk = Desk::new();
    desk.write("spec.toml", crate::support::THESIS);
    desk.report(&["design", "spec.toml", "-o", "thesis.json"]);
    desk.write("in", bytes(&frames(50)));
    for args in [
        "--help",
        "--version",
        "fuse --help",
        "completions bash",
        "verify thesis.json",
        "analyze thesis.json --json",
        "stream bank.json --input in",
        "design spec.toml -o -",
    ] {
        let output = shell(&desk, &format!("$H {args} >/dev/full"));
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{args}: {message}");
        assert!(message.starts_with("hybank: standard output: cannot write it"), "{args}: {message}");
        assert_eq!(message.lines().count(), 1, "{args}: {message}");
    }
    // A reader that has seen enough is no error.
    let output = shell(&desk, "$H completions bash | head -c 1");
    assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");
}

/// What has no sample yet is not kept for the sake of what was recorded.
#[test]
fn streams_that_fail_before_their_first_sample_leave_nothing() {
    let desk = Desk::with_model();
    desk.write("odd.wav", b"RIFF....WAVEnothing");
    for args in [
        "--input none --input none -o out.f32",
        "-o out.sigmf-meta <.",
        "-o out.f32 --gaps --mask out.mask <.",
        "--input odd.wav --format wav -o out.wav",
        "-o out.f32 <.",
    ] {
        let output = shell(&desk, &format!("$H stream bank.json {args}"));
        assert_eq!(output.status.code(), Some(1), "{args}: {output:?}");
        let there = names(&desk.path(""));
        assert!(!there.iter().any(|name| name.contains("out.")), "{args}: {there:?}");
    }
}

/// The first signal asks for an end in order, which a blocked write holds up; a further one ends the
/// process.
fn end_by_signals(child: &mut Child) {
    let begin = Instant::now();
    while child.try_wait().unwrap().is_none() {
        assert!(begin.elapsed() < Duration::from_secs(60), "the signals did not end the run");
        crate::support::send(child.id(), TERM);
        std::thread::sleep(Duration::from_millis(100));
    }
    assert_eq!(child.wait().unwrap().code(), Some(128 + 15));
}

#[test]
fn a_second_signal_ends_a_run_whose_output_nobody_takes() {
    let desk = Desk::with_model();
    // More than any pipe holds.
    desk.write("in", bytes(&frames(1 << 20)));
    let before = names(&desk.path(""));
    let mut child = Command::new(env!("CARGO_BIN_EXE_hybank"))
        .current_dir(desk.path(""))
        .args(["stream", "bank.json", "--input", "in", "--gaps", "--mask", "mask"])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    while names(&desk.path("")) == before {
        std::thread::sleep(Duration::from_millis(1));
    }
    // Until the pipe is full.
    until_a_write_waits(child.id(), None);
    end_by_signals(&mut child);
    assert_eq!(names(&desk.path("")), before, "an unfinished file is left");
}

/// A recording of zeros, of 400 MB on paper and none on the disk.
#[test]
fn a_recording_that_no_memory_holds_is_refused() {
    let desk = Desk::new();
    let data = 400_000_000u32;
    let mut header = Vec::new();
    header.extend(b"RIFF");
    header.extend((data + 36).to_le_bytes());
    header.extend(b"WAVEfmt ");
    header.extend(16u32.to_le_bytes());
    [3u16, 1].iter().for_each(|x| header.extend(x.to_le_bytes()));
    [24_000u32, 96_000].iter().for_each(|x| header.extend(x.to_le_bytes()));
    [4u16, 32].iter().for_each(|x| header.extend(x.to_le_bytes()));
    header.extend(b"data");
    header.extend(data.to_le_bytes());
    desk.write("a.wav", &header);
    let file = std::fs::File::options().write(true).open(desk.path("a.wav")).unwrap();
    file.set_len(44 + u64::from(data)).unwrap();
    let output = shell(&desk, "ulimit -v 500000; $H measure a.wav");
    let message = text(&output.stderr);
    assert_eq!((output.status.code(), message.lines().count()), (Some(1), 1), "{message}");
    assert!(message.contains("do not fit in memory") && message.contains("shorter part"), "{message}");
}

#[test]
fn an_output_that_does_not_fit_leaves_everything_as_it_was() {
    let desk = Desk::new();
    crate::support::wav::write_pair(&desk, &[0.5; 20_000], &[0.5; 20_000]);
    desk.write("old.wav", "old");
    let before = names(&desk.path(""));
    for output in ["new.wav", "old.wav"] {
        let line = format!("ulimit -f 8; exec $H fuse bank.json a.wav b.wav --force -o {output}");
        let refused = shell(&desk, &line);
        let message = text(&refused.stderr);
        assert_eq!((refused.status.code(), message.lines().count()), (Some(1), 1), "{message}");
        assert!(message.contains(&format!("{output}: cannot write it: File too large")), "{message}");
        assert_eq!((names(&desk.path("")), desk.read("old.wav")), (before.clone(), b"old".to_vec()));
    }
}
