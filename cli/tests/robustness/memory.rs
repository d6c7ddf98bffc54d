//! Too little memory: limits of the address space from 40 MB up. What an input makes large is refused with a
//! message; only small allocations, which no input decides, may end the process.

use crate::large::{LARGE, bank, desk};
use crate::support::Desk;
use crate::support::random::Random;
use crate::work::{jobs, recorder};
use std::fmt;
use std::os::unix::process::ExitStatusExt;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};
use trials::rounds;

/// Kilobytes of address space.
const LEAST: f64 = 40e3;
const MOST: f64 = 1e6;
/// Parts of large inputs.
const PARTS: usize = 60_000;
/// Bytes that a process which has no more memory may fail to get. More than that is what an input decides.
const SMALL: u64 = 64 << 10;
const ABORT: i32 = 6;

#[derive(Debug, Default)]
struct Tally {
    runs: usize,
    done: usize,
    refused: usize,
    /// An allocation of at most [`SMALL`] bytes failed.
    ended: usize,
    /// The loader of the system had too little.
    not_started: usize,
}

impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { runs, done, refused, ended, not_started } = self;
        write!(
            f,
            "{runs} runs: {done} done, {refused} refused, {ended} without a few bytes, {not_started} not started"
        )
    }
}

impl Tally {
    /// Counts a run; true if it said that it succeeded.
    fn judge(&mut self, output: &Output, what: &str) -> bool {
        let message = String::from_utf8_lossy(&output.stderr);
        let shown: String = message.chars().take(500).collect();
        let what = format!("{what}: {}: {shown}", output.status);
        self.runs += 1;
        match (output.status.code(), output.status.signal()) {
            _ if message.contains("panicked") => panic!("{what}"),
            (Some(0), _) => self.done += 1,
            (Some(1), _) => {
                self.refused += 1;
                // One message; other lines show the place in a file, or name an input that is slow to come.
                let said = message.lines().filter(|line| line.starts_with("hybank: "));
                let is_note =
                    |line: &&str| ["warning", "waiting for "].iter().any(|word| line[8..].starts_with(word));
                let errors = said.filter(|line| !is_note(line));
                assert_eq!(errors.count(), 1, "{what}");
            }
            (Some(127), _) => self.not_started += 1,
            (None, Some(ABORT)) => {
                self.ended += 1;
                let failed = message.split_once("memory allocation of ").expect(&what).1;
                let bytes = failed.split_once(" bytes").expect(&what).0.parse::<u64>().unwrap();
                assert!(bytes <= SMALL, "{what}");
            }
            _ => panic!("{what}"),
        }
        output.status.success()
    }
}

/// The least limit with which the system can map the program; a build without optimisation has 70 MB.
fn least(desk: &Desk) -> f64 {
    let starts = |kilobytes: &f64| limited(desk, *kilobytes as u64, "--version").status.success();
    std::iter::successors(Some(LEAST), |limit| Some(1.1 * limit)).find(starts).unwrap()
}

/// A limit, as often between 40 and 60 MB as between 600 and 900.
fn kilobytes(dice: &mut Random, least: f64) -> u64 {
    (least * (MOST / least).powf(dice.part())) as u64
}

fn limited(desk: &Desk, kilobytes: u64, line: &str) -> Output {
    let script = format!("ulimit -v {kilobytes}; exec $H {line}");
    let mut command = Command::new("sh");
    command.current_dir(desk.path("")).env("H", env!("CARGO_BIN_EXE_hybank")).args(["-c", &script]);
    command.stdin(Stdio::null()).output().unwrap()
}

#[test]
fn outputs_are_whole_or_as_before_whatever_the_memory() {
    let desk = crate::work::desk(20_000);
    let (mut dice, least) = (Random(28), least(&desk));
    for job in jobs(&desk).into_iter().chain([recorder(&desk)]) {
        let mut tally = Tally::default();
        for round in 0..rounds(8) {
            let before = job.prepare(round % 2 == 0);
            let kilobytes = kilobytes(&mut dice, least);
            let output = limited(&desk, kilobytes, &job.args.join(" "));
            let what = format!("{:?}, {kilobytes} kB", job.args);
            let done = tally.judge(&output, &what);
            assert_eq!(job.judge(&before, &what), Some(done), "{what}");
            let unfinished = job.unfinished();
            let said = String::from_utf8_lossy(&output.stderr);
            let is_named = |path: &PathBuf| said.contains(path.file_name().unwrap().to_str().unwrap());
            let may_stay = output.status.signal() == Some(ABORT) || unfinished.iter().all(is_named);
            assert!(may_stay, "{what}: {unfinished:?}");
            unfinished.iter().for_each(|path| std::fs::remove_file(path).unwrap());
        }
        println!("{}: {tally}", job.args.join(" "));
    }
}

#[test]
fn large_inputs_are_refused_in_words_where_the_memory_ends() {
    let desk = desk();
    desk.report(&["design", "spec.toml", "-o", "designed.json"]);
    let (mut dice, least) = (Random(29), least(&desk));
    for large in &LARGE {
        let mut tally = Tally::default();
        desk.write(large.file, (large.make)(PARTS));
        for _ in 0..rounds(3) {
            let kilobytes = kilobytes(&mut dice, least);
            let output = limited(&desk, kilobytes, large.line);
            tally.judge(&output, &format!("{} {}, {kilobytes} kB", PARTS, large.parts));
        }
        std::fs::remove_file(desk.path(large.file)).unwrap();
        println!("{PARTS} {}: {tally}", large.parts);
    }
}

/// Threads of readers and of the pool once reserved 64 MB of addresses each, at any time: a run with 72 MB
/// was done, one with 170 MB refused or aborted. Long filters have transforms of tens of megabytes.
#[test]
fn more_memory_is_never_worse() {
    let desk = crate::work::desk(20_000);
    desk.write("long.json", bank(2, 40_000));
    let mut limits: Vec<u64> =
        (0..rounds(24)).map(|k| 40_000 + 360_000 * k as u64 / rounds(24) as u64).collect();
    limits.retain(|&kilobytes| kilobytes as f64 >= least(&desk));
    for line in [
        "fuse long.json a.wav b.wav -o out.wav --force",
        "fuse long.json a.wav b.wav -o out.wav --force --threads 2 --algorithm direct",
        "stream long.json --input a.wav --input b.wav --format wav -o out.wav --force --algorithm overlap-save",
        "design spec.toml -o designed.json --force",
    ] {
        let (mut tally, mut is_done) = (Tally::default(), false);
        for kilobytes in &limits {
            let what = format!("{line}, {kilobytes} kB");
            let done = tally.judge(&limited(&desk, *kilobytes, line), &what);
            assert!(done || !is_done, "{what}: less memory was enough");
            is_done = done;
        }
        println!("{line}: {tally}");
        assert_eq!(tally.ended, 0, "{line}: {tally}");
        assert!(tally.done > 0 && tally.refused > 0, "{line}: {tally}");
    }
}

/// Commands whose work does not grow with an input.
const OTHERS: [&str; 9] = [
    "verify designed.json",
    "analyze designed.json",
    "plot designed.json -o plot.svg --force",
    "report designed.json -o report.html --force",
    "export designed.json -o bank.c --format c --force",
    "measure a.wav",
    "calibrate spec.toml a.wav b.wav -o calibrated.toml --blind --force",
    "man pages --force",
    "fuse designed.json a.wav b.wav -o out.wav --threads 4 --algorithm overlap-save --force",
];

#[test]
fn all_commands_end_in_words_where_the_memory_ends() {
    let desk = crate::work::desk(2_000);
    desk.report(&["design", "spec.toml", "-o", "designed.json"]);
    let (mut dice, least) = (Random(30), least(&desk));
    for line in OTHERS {
        let mut tally = Tally::default();
        for _ in 0..rounds(4) {
            let kilobytes = kilobytes(&mut dice, least);
            tally.judge(&limited(&desk, kilobytes, line), &format!("{line}, {kilobytes} kB"));
        }
        println!("{line}: {tally}");
    }
}
