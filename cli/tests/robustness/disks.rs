//! Full disks: outputs of any length beyond a limit of the file size, and a small file system.

use crate::support::jobs::Job;
use crate::support::random::Random;
use crate::support::text;
use crate::work::{desk, jobs};
use std::process::Command;
use trials::rounds;

/// Bytes of `ulimit -f` in POSIX.
const BLOCK: usize = 512;

/// The length of the longest output.
fn longest(job: &Job) -> usize {
    job.whole.iter().flatten().map(Vec::len).max().unwrap()
}

/// The job in a shell script, where `$RUN` stands for it.
fn script(job: &Job, shell: &[&str], text: &str) -> Command {
    let mut command = Command::new(shell[0]);
    command.current_dir(&job.folder).args(&shell[1..]).args(["sh", "-c", text]);
    command.env("RUN", format!("{} {}", job.program, job.args.join(" ")));
    command
}

#[test]
fn an_output_that_does_not_fit_leaves_everything_as_it_was() {
    let desk = desk(20_000);
    let mut dice = Random(77);
    for job in jobs(&desk) {
        let (mut refused, mut done) = (0, 0);
        for round in 0..rounds(8) {
            let before = job.prepare(round % 2 == 0);
            let blocks = dice.below(longest(&job) / BLOCK + 2);
            let limited = format!("ulimit -f {blocks}; exec $RUN");
            let output = script(&job, &["env"], &limited).output().unwrap();
            let message = text(&output.stderr);
            let what = format!("{:?}, {blocks} blocks: {message}", job.args);
            let fits = longest(&job) <= blocks * BLOCK;
            assert_eq!(output.status.code(), Some(i32::from(!fits)), "{what}");
            assert_eq!(job.judge(&before, &what), Some(fits), "{what}");
            assert_eq!(message.lines().count(), usize::from(!fits), "{what}");
            assert!(fits || message.contains("cannot write it"), "{what}");
            assert!(job.unfinished().is_empty(), "{what}");
            if fits { done += 1 } else { refused += 1 }
        }
        println!("{}: {refused} too long, {done} fitted", job.args.join(" "));
    }
}

#[test]
fn a_full_file_system_keeps_nothing() {
    const SPACE: [&str; 3] = ["unshare", "-r", "-m"];
    let mounts = ["sh", "-c", "mount -t tmpfs -o size=64k none /mnt"];
    let may = Command::new(SPACE[0]).args(&SPACE[1..]).args(mounts).output();
    if !may.is_ok_and(|output| output.status.success()) {
        trials::skipped(&"full file systems: none may be mounted here");
        return;
    }
    let desk = desk(20_000);
    let mut dice = Random(78);
    std::fs::create_dir(desk.path("disk")).unwrap();
    let (mut refused, mut done) = (0, 0);
    for job in jobs(&desk) {
        for _ in 0..rounds(2) {
            let kilobytes = 4 + dice.below(3 * longest(&job) / 1024);
            // The outputs go to the small disk, where only whole ones may stay.
            let moved = "RUN=$(echo \"$RUN\" | sed 's| -o | -o disk/|; s|--mask |--mask disk/|')";
            let run = format!(
                "mount -t tmpfs -o size={kilobytes}k none disk && {moved}; $RUN >/dev/null; code=$?; \
                 ls -A disk | tr '\\n' ' '; exit $code"
            );
            let output = script(&job, &SPACE, &run).output().unwrap();
            let (message, names) = (text(&output.stderr), text(&output.stdout));
            let what = format!("{:?}, {kilobytes} KiB: {message} {names}", job.args);
            match output.status.code() {
                Some(0) => done += 1,
                Some(1) => {
                    refused += 1;
                    assert!(names.is_empty(), "{what}");
                    assert_eq!(message.lines().count(), 1, "{what}");
                    assert!(message.contains("No space left"), "{what}");
                }
                _ => panic!("{what}"),
            }
            assert!(!names.contains(".part"), "{what}");
        }
    }
    println!("{refused} on a full file system, {done} fitted");
}
