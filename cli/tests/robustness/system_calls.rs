//! System calls that fail: one error at a time, injected by strace at any call of a run.

use crate::support::jobs::Job;
use crate::support::random::Random;
use crate::support::text;
use crate::work::{desk, jobs};
use std::collections::BTreeMap;
use std::fs;
use std::process::Command;
use trials::rounds;

/// Calls with the errors that they may give.
const CALLS: [(&str, &[&str]); 12] = [
    ("openat", &["EMFILE", "EACCES", "EIO"]),
    ("read", &["EIO", "EINTR"]),
    ("write", &["EIO", "ENOSPC", "EINTR"]),
    ("lseek", &["EIO"]),
    ("fsync", &["EIO", "ENOSPC"]),
    ("close", &["EIO", "ENOSPC"]),
    ("renameat2", &["EIO", "ENOSPC", "EXDEV"]),
    ("rename", &["EIO", "ENOSPC"]),
    ("unlink", &["EIO"]),
    ("fchmod", &["EPERM"]),
    ("mkdir", &["ENOSPC"]),
    ("clone3", &["EAGAIN"]),
];

/// The job under strace with these options.
fn strace(job: &Job, options: &[&str]) -> Command {
    let mut command = Command::new("strace");
    command.current_dir(&job.folder).args(["-f", "-qq"]).args(options);
    command.arg(job.program).args(&job.args);
    command
}

fn is_there() -> bool {
    Command::new("strace").args(["-o", "/dev/null", "true"]).status().is_ok_and(|status| status.success())
}

/// The calls of an undisturbed run, a line each in the order of time.
fn calls(job: &Job) -> String {
    let names: Vec<_> = CALLS.iter().map(|(name, _)| *name).collect();
    let log = job.folder.join("strace.log");
    job.prepare(true);
    let trace = format!("trace={}", names.join(","));
    let status = strace(job, &["-o", log.to_str().unwrap(), "-e", &trace]).output().unwrap().status;
    assert!(status.success());
    fs::read_to_string(log).unwrap()
}

/// Each output is on the disk before it gets its name: after a crash of the system the name means a whole
/// file.
fn assert_synced_before_named(log: &str) {
    let mut synced = 0;
    for line in log.lines() {
        if line.contains(" fsync(") {
            synced += 1;
        }
        // A name that is taken already is refused once, and then exchanged.
        if line.contains(" rename") && line.ends_with("= 0") {
            synced -= 1;
            assert!(synced >= 0, "a file got its name before it was synced:\n{log}");
        }
    }
}

/// How often the busiest thread makes each call.
fn counts(log: &str) -> Vec<usize> {
    let calls = |(name, _): &(&str, &[&str])| {
        let mut of_thread = BTreeMap::new();
        let made = log.lines().filter(|line| line.contains(&format!(" {name}(")));
        made.filter_map(|line| line.split_whitespace().next())
            .for_each(|thread| *of_thread.entry(thread).or_insert(0) += 1);
        of_thread.into_values().max().unwrap_or(0)
    };
    CALLS.iter().map(calls).collect()
}

#[derive(Default)]
struct Tally {
    errors: usize,
    /// The run succeeded all the same, with whole outputs.
    done: usize,
    /// The run failed with one message and left everything as it was.
    refused: usize,
    /// The system could not even start the program.
    not_started: usize,
}

#[test]
fn a_failing_call_is_an_error_of_one_line_or_none_at_all() {
    if !is_there() {
        trials::skipped(&"failing system calls: strace is not there or may not trace");
        return;
    }
    let desk = desk(20_000);
    let mut dice = Random(76);
    for job in jobs(&desk) {
        let log = calls(&job);
        assert_synced_before_named(&log);
        let counts = counts(&log);
        let called: Vec<_> = (0..CALLS.len()).filter(|&call| counts[call] > 0).collect();
        let mut tally = Tally::default();
        for round in 0..rounds(12) {
            let call = called[round % called.len()];
            let (name, errors) = CALLS[call];
            let when = 1 + dice.below(counts[call]);
            // Once, or from then on; a call that is interrupted each time never ends.
            let (error, more) = (dice.of(errors), dice.of(&["", "", "+"]));
            let more = if error == "EINTR" { "" } else { more };
            let inject = format!("inject={name}:error={error}:when={when}{more}");
            fail(&job, name, &inject, dice.below(2) == 0, &mut tally);
        }
        let Tally { errors, done, refused, not_started } = tally;
        println!(
            "{}: {errors} errors, {done} done all the same, {refused} refused, {not_started} not started",
            job.args.join(" ")
        );
    }
}

/// The third of three outputs gets no name, and the first two can neither be taken back nor removed.
#[test]
fn outputs_that_cannot_be_taken_back_are_named() {
    if !is_there() {
        return trials::skipped(&"outputs that cannot be taken back: strace is not there or may not trace");
    }
    let desk = desk(2_000);
    let job = jobs(&desk).pop().unwrap();
    // Of old files each name is tried, and then exchanged.
    for (old, third) in [(false, 3), (true, 5)] {
        let before = job.prepare(old);
        let inject = format!("inject=renameat2:error=EIO:when={third}+");
        let others = "inject=rename,unlink:error=EIO:when=1+";
        let trace = ["-e", "trace=renameat2,rename,unlink", "-e", &inject, "-e", others];
        let output = strace(&job, &[&["-o", "/dev/null"][..], &trace].concat()).output().unwrap();
        let message = text(&output.stderr);
        assert_eq!((output.status.code(), message.lines().count()), (Some(1), 1), "{message}");
        assert_eq!(job.judge(&before, &message), None, "{message}");
        let (_, stay) = message.split_once("already in place and not taken back: ").expect(&message);
        assert!(stay.contains("captures/ch1.wav") && stay.contains("captures/ch2.wav"), "{message}");
        // Unless an old file has it, nothing has a hidden name but what could not be removed.
        for path in job.unfinished() {
            let name = path.file_name().unwrap().to_str().unwrap();
            assert!(stay.contains(name) || name.contains("target"), "{name}: {message}");
            fs::remove_file(path).unwrap();
        }
    }
}

/// All outputs have their names, and the files that had them before cannot be removed.
#[test]
fn old_files_that_cannot_be_removed_are_named() {
    if !is_there() {
        return trials::skipped(&"old files that stay: strace is not there or may not trace");
    }
    let desk = desk(2_000);
    let job = jobs(&desk).pop().unwrap();
    let before = job.prepare(true);
    let inject = ["-e", "trace=unlink", "-e", "inject=unlink:error=EIO:when=1+"];
    let output = strace(&job, &[&["-o", "/dev/null"][..], &inject].concat()).output().unwrap();
    let message = text(&output.stderr);
    assert_eq!((output.status.code(), message.lines().count()), (Some(1), 1), "{message}");
    assert!(message.contains("is written; what it replaced is still there as "), "{message}");
    assert_eq!(job.judge(&before, &message), Some(true), "{message}");
    let stay = job.unfinished();
    assert_eq!(stay.len(), 2, "{message}");
    for path in stay {
        assert!(message.contains(path.file_name().unwrap().to_str().unwrap()), "{path:?}: {message}");
        fs::remove_file(path).unwrap();
    }
}

/// One run in which calls of this name fail.
fn fail(job: &Job, call: &str, inject: &str, old: bool, tally: &mut Tally) {
    let before = job.prepare(old);
    let trace = format!("trace={call}");
    let output = strace(job, &["-o", "/dev/null", "-e", &trace, "-e", inject]).output().unwrap();
    let message = text(&output.stderr);
    let what = format!("{:?}, {inject}, old {old}: {message}", job.args);
    tally.errors += 1;
    match output.status.code() {
        Some(0) => {
            tally.done += 1;
            assert_eq!(job.judge(&before, &what), Some(true), "{what}");
        }
        Some(1) => {
            tally.refused += 1;
            // A report that cannot be printed comes after the outputs.
            let reported = message.contains("standard output: cannot write it");
            let judged = job.judge(&before, &what);
            // Without a message, which may be what could not be written, both are possible.
            let is_silent = message.is_empty() && judged.is_some();
            let is_told = judged == Some(reported) || message.contains("not taken back: ");
            assert!(is_told || is_silent, "{what}");
            let lines = message.lines().filter(|line| !line.starts_with("hybank: warning")).count();
            assert!(lines == 1 || (lines == 0 && call == "write"), "{what}");
            assert!(message.starts_with("hybank: ") || call == "write", "{what}");
        }
        Some(127) if message.contains("shared librar") => tally.not_started += 1,
        // No message can be written, or nothing can be read.
        _ if inject.ends_with('+') && ["write", "read", "openat"].contains(&call) => {}
        _ => panic!("{:?}: {what}", output.status),
    }
    let unfinished = job.unfinished();
    let is_named = |path: &std::path::PathBuf| message.contains(path.file_name().unwrap().to_str().unwrap());
    assert!(call == "unlink" || unfinished.iter().all(is_named), "{what}: {unfinished:?}");
    unfinished.iter().for_each(|path| fs::remove_file(path).unwrap());
}
