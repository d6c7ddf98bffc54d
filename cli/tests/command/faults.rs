//! Systems that refuse: standard streams that cannot be written, threads that cannot be started, inputs
//! without end.

use crate::support::blocked::until_a_write_waits;
use crate::support::{Desk, bytes, frames, fused, names, text};
use std::io::Write;
use std::os::fd::AsRawFd;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

/// More than any address space: no thread with such a stack can be started.
const IMPOSSIBLE_STACK: &str = "1000000000000000";

/// hybank in a shell, which redirects its streams; `$H` stands for the binary.
fn shell(desk: &Desk, script: &str) -> Output {
    let mut command = Command::new("sh");
    command.current_dir(desk.path("")).env("H", env!("CARGO_BIN_EXE_hybank"));
    command.args(["-c", script]).output().unwrap()
}

/// Where addresses are limited the program begins again, but not what another file of its name is, nor the
/// loader that was asked to run it.
#[test]
fn limited_addresses_run_the_same_program() {
    let desk = Desk::new();
    let script = "ulimit -v 200000; exec 8<gone; rm gone; /proc/self/fd/8 --version";
    let output = shell(&desk, &format!("cp $H gone; cp /bin/echo 'gone (deleted)'; {script}"));
    assert!(text(&output.stdout).starts_with("hybank "), "{output:?}");
    let loader = "/lib64/ld-linux-x86-64.so.2";
    if std::path::Path::new(loader).exists() {
        let output = shell(&desk, &format!("ulimit -v 200000; {loader} $H --version"));
        assert!(text(&output.stdout).starts_with("hybank "), "{output:?}");
    }
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

/// Before `main` the standard library puts /dev/null in the place of a closed stream.
#[test]
fn a_closed_standard_stream_is_an_error_of_one_line() {
    let desk = Desk::new();
    desk.write("spec.toml", crate::support::THESIS);
    desk.report(&["design", "spec.toml", "-o", "thesis.json"]);
    desk.write("in", bytes(&frames(50)));
    let channel = |k| crate::support::channel(&frames(50), k);
    crate::support::wav::write_pair(&desk, &channel(0), &channel(1));
    for args in [
        "--help",
        "--version",
        "help spec",
        "init",
        "schema spec",
        "completions bash",
        "verify thesis.json",
        "analyze thesis.json --json",
        "stream bank.json --input in",
        "fuse bank.json a.wav b.wav -o -",
        "design spec.toml -o -",
    ] {
        let output = shell(&desk, &format!("$H {args} >&-"));
        let message = text(&output.stderr);
        assert_eq!((output.status.code(), message.lines().count()), (Some(1), 1), "{args}: {message}");
        assert!(message.starts_with("hybank: standard output: cannot write it"), "{args}: {message}");
        assert!(message.contains("closed"), "{args}: {message}");
        // Nobody closed this one.
        assert_eq!(shell(&desk, &format!("$H {args} >/dev/null")).status.code(), Some(0), "{args}");
        assert_eq!(shell(&desk, &format!("$H {args} 1<>/dev/null")).status.code(), Some(0), "{args}");
    }
    for args in ["stream bank.json", "fuse bank.json - -o out.wav", "verify -", "design - -o out.json"] {
        let output = shell(&desk, &format!("$H {args} <&-"));
        let message = text(&output.stderr);
        assert_eq!((output.status.code(), message.lines().count()), (Some(1), 1), "{args}: {message}");
        assert!(
            message.contains("standard input: cannot") && message.contains("closed"),
            "{args}: {message}"
        );
    }
    // What goes to a file is there before the report that cannot be printed.
    let output = shell(&desk, "$H fuse bank.json a.wav b.wav -o out.wav >&-");
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    assert!(text(&output.stderr).trim_end().ends_with("; out.wav is written"), "{output:?}");
    assert_eq!(crate::support::wav::samples(&desk, "out.wav").len(), 100);
}

/// What has no sample yet is not kept for the sake of what was recorded.
#[test]
fn streams_that_fail_before_their_first_sample_leave_nothing() {
    let desk = Desk::new();
    desk.write("odd.wav", b"RIFF....WAVEnothing");
    for args in [
        "--input none --input none -o out.f32",
        "-o out.f32 <&-",
        "-o out.sigmf-meta <&-",
        "-o out.f32 --gaps mask --mask out.mask <&-",
        "--input odd.wav --format wav -o out.wav",
        "-o out.f32 <.",
    ] {
        let output = shell(&desk, &format!("$H stream bank.json {args}"));
        assert_eq!(output.status.code(), Some(1), "{args}: {output:?}");
        assert!(
            !names(&desk.path("")).iter().any(|name| name.contains("out.")),
            "{args}: {:?}",
            names(&desk.path(""))
        );
    }
}

#[test]
fn without_threads_the_work_is_done_or_refused_in_one_line() {
    let desk = Desk::new();
    desk.write("spec.toml", crate::support::THESIS);
    let input = bytes(&frames(50));
    desk.write("in", &input);
    let run = |args: &str| shell(&desk, &format!("RUST_MIN_STACK={IMPOSSIBLE_STACK} $H {args}"));
    // Raw standard input needs no thread, and an interrupt then has its usual meaning.
    let output = run("stream bank.json <in");
    assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");
    assert!(output.stdout == bytes(&fused(&frames(50))));
    for args in ["design spec.toml -o thesis.json", "verify thesis.json"] {
        let output = run(args);
        assert!(output.status.success() && output.stderr.is_empty(), "{args}: {output:?}");
    }
    for (args, part) in [
        ("stream bank.json --input in", "in: cannot start a thread that reads it"),
        ("stream bank.json --threads 2 <in", "--threads 2"),
    ] {
        let output = run(args);
        let message = text(&output.stderr);
        assert_eq!((output.status.code(), message.lines().count()), (Some(1), 1), "{args}: {message}");
        assert!(message.contains(part), "{args}: {message}");
    }
}

#[test]
fn a_signal_ends_a_run_whose_output_nobody_takes() {
    let desk = Desk::new();
    // More than any pipe holds.
    desk.write("in", bytes(&frames(1 << 20)));
    let before = names(&desk.path(""));
    let mut child = Command::new(env!("CARGO_BIN_EXE_hybank"))
        .current_dir(desk.path(""))
        .args(["stream", "bank.json", "--input", "in", "--gaps", "zero", "--mask", "mask"])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    while names(&desk.path("")) == before {
        std::thread::sleep(Duration::from_millis(1));
    }
    // Until the pipe is full.
    until_a_write_waits(child.id(), None);
    let begin = Instant::now();
    crate::support::send(child.id(), 15);
    while child.try_wait().unwrap().is_none() {
        assert!(begin.elapsed() < Duration::from_secs(60), "the signal did not end the run");
        std::thread::sleep(Duration::from_millis(20));
    }
    assert_eq!(child.wait().unwrap().code(), Some(128 + 15));
    assert_eq!(names(&desk.path("")), before, "an unfinished file is left");
}

#[test]
fn inputs_without_end_are_refused_with_their_bound() {
    let desk = Desk::new();
    desk.write("in", bytes(&[1.0; 20]));
    let bound = "longer than 268435456 bytes, the most that a spec or bank file may have";
    desk.refused(1, &["verify", "/dev/zero"], &["/dev/zero", bound]);
    let stream =
        ["stream", "bank.json", "--input", "in", "--input", "in", "-o", "out", "--gaps", "zero", "--lost"];
    desk.refused(1, &[&stream[..], &["/dev/zero"]].concat(), &["/dev/zero", "longer than", "lost samples"]);
    desk.write("lost", "{\"channel\":1,\"sample_start\":0,\"global_index\":0}\n{\"channel\":1,\"sample_start\":1,\"global_index\":4000000000}");
    let refused = [&stream[..], &["lost"]].concat();
    desk.refused(1, &refused, &["in: ", "more than 67108864", "allow 3999999999 to be lost"]);
    desk.write("zero.sigmf-meta", r#"{"global": {"core:datatype": "ri8", "core:dataset": "/dev/zero"}}"#);
    let args = ["stream", "bank.json", "--input", "zero.sigmf-meta", "-o", "out"];
    desk.refused(1, &args, &["zero.sigmf-meta", "core:dataset", "same folder"]);
    // A link beside the metadata leads as far.
    std::os::unix::fs::symlink("/dev/zero", desk.path("link")).unwrap();
    desk.write("zero.sigmf-meta", r#"{"global": {"core:datatype": "ri8", "core:dataset": "link"}}"#);
    desk.refused(1, &args, &["zero.sigmf-meta", "core:dataset leads to \"link\"", "no file"]);
    // A pipe without a writer does not even open.
    std::fs::remove_file(desk.path("link")).unwrap();
    assert!(Command::new("mkfifo").arg(desk.path("link")).status().unwrap().success());
    desk.refused(1, &args, &["zero.sigmf-meta", "core:dataset leads to \"link\"", "no file"]);
}

/// A pipe that nobody reads, full to the last byte.
fn full_pipe() -> (std::io::PipeReader, std::io::PipeWriter) {
    let (reader, writer) = std::io::pipe().unwrap();
    let mut filler = writer.try_clone().unwrap();
    // The write that finds no room waits until the reader goes, at the end of the test.
    let descriptor = filler.as_raw_fd();
    std::thread::spawn(move || while filler.write_all(&[b'.'; 4096]).is_ok() {});
    until_a_write_waits(std::process::id(), Some(descriptor));
    (reader, writer)
}

#[test]
fn a_signal_ends_a_run_whose_messages_nobody_takes() {
    let desk = Desk::new();
    desk.write("in", [bytes(&frames(50)), vec![1, 2, 3]].concat());
    let (reader, writer) = full_pipe();
    let mut child = Command::new(env!("CARGO_BIN_EXE_hybank"))
        .current_dir(desk.path(""))
        .args(["stream", "bank.json", "--input", "in", "-o", "out"])
        .stderr(writer)
        .spawn()
        .unwrap();
    // The warning about the cut frame comes after the output.
    while !desk.path("out").exists() {
        std::thread::sleep(Duration::from_millis(1));
    }
    until_a_write_waits(child.id(), None);
    assert!(child.try_wait().unwrap().is_none(), "the message was taken");
    let begin = Instant::now();
    crate::support::send(child.id(), 15);
    while child.try_wait().unwrap().is_none() {
        assert!(begin.elapsed() < Duration::from_secs(60), "the signal did not end the run");
        std::thread::sleep(Duration::from_millis(20));
    }
    assert_eq!(child.wait().unwrap().code(), Some(128 + 15));
    assert!(desk.read("out") == bytes(&fused(&frames(50))));
    assert_eq!(names(&desk.path("")), ["bank.json", "in", "out"]);
    drop(reader);
}

#[test]
fn captures_that_no_memory_holds_are_refused() {
    let desk = Desk::new();
    desk.write("spec.toml", crate::support::THESIS);
    let simulate =
        "ulimit -v 1000000; $H simulate spec.toml --source tones:0.3 --samples 268435456 -o captures";
    let output = shell(&desk, simulate);
    let message = text(&output.stderr);
    assert_eq!((output.status.code(), message.lines().count()), (Some(1), 1), "{message}");
    assert!(message.contains("2.1 GB of memory") && message.contains("fewer samples"), "{message}");
    assert!(!desk.path("captures").exists());
}

/// Recordings of zeros, of 400 MB on paper and none on the disk.
#[test]
fn recordings_that_no_memory_holds_are_refused() {
    let desk = Desk::new();
    desk.write("spec.toml", crate::support::THESIS);
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
    for name in ["a.wav", "b.wav"] {
        std::fs::write(desk.path(name), &header).unwrap();
        let file = std::fs::File::options().write(true).open(desk.path(name)).unwrap();
        file.set_len(44 + u64::from(data)).unwrap();
    }
    for line in ["$H measure a.wav", "$H calibrate spec.toml a.wav b.wav -o c.toml --blind"] {
        let output = shell(&desk, &format!("ulimit -v 1000000; {line}"));
        let message = text(&output.stderr);
        assert_eq!((output.status.code(), message.lines().count()), (Some(1), 1), "{line}: {message}");
        assert!(message.contains("GB of memory") && message.contains("shorter part"), "{line}: {message}");
    }
    assert!(!desk.path("c.toml").exists());
}

/// A bank made elsewhere with very many taps: neither reading it nor filtering with it ends the process.
#[test]
fn banks_that_no_memory_holds_are_refused() {
    let desk = Desk::new();
    let bank = |taps: usize| {
        let channel = format!("{{\"delay\":0.0,\"taps\":[{}]}}", vec!["1e-3"; taps].join(","));
        format!(
            "{{\"format\":\"hybank-bank\",\"version\":1,\"spec\":null,\"fast_period\":1.0,\"ratio\":2,\"latency\":1,\
             \"method\":\"fir\",\"channels\":[{channel},{channel}],\"state_space\":null,\
             \"gamma\":{{\"norm\":null,\"upper\":null,\"lower\":null,\"noncausal\":null}}}}"
        )
    };
    desk.write("long.json", bank(300_000));
    desk.write("longest.json", bank(2_500_000));
    desk.write("in", bytes(&frames(50)));
    crate::support::wav::write_pair(&desk, &[0.0; 8], &[0.0; 8]);
    for (name, work) in [("long.json", "to filter with it"), ("longest.json", "to read it")] {
        for command in
            [format!("fuse {name} a.wav b.wav -o out.wav"), format!("stream {name} --input in -o out")]
        {
            let line = format!("ulimit -v 330000; $H {command} --algorithm overlap-save </dev/null");
            let output = shell(&desk, &line);
            let message = text(&output.stderr);
            assert_eq!((output.status.code(), message.lines().count()), (Some(1), 1), "{command}: {message}");
            assert!(message.contains(name) && message.contains(work), "{command}: {message}");
        }
    }
}
