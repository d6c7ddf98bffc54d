//! Kills at random times: no half-written file under a final name, and leftovers that the next run names.

use crate::support::jobs::{ENDING, Job};
use crate::support::random::Random;
use std::fmt;
use std::fs;
use std::os::unix::process::ExitStatusExt;
use std::process::{Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// What a campaign saw.
#[derive(Default)]
pub(crate) struct Seen {
    kills: usize,
    /// The signal came before the end.
    during: usize,
    /// Runs whose outputs were whole.
    whole: usize,
    /// Recordings that a signal completed.
    completed: usize,
    /// Of a set of files some were whole and some as before.
    parts_of_sets: usize,
    /// Unfinished files after SIGKILL, all of them named by the next run.
    leftovers: usize,
}

impl fmt::Display for Seen {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { kills, during, whole, completed, parts_of_sets, leftovers } = self;
        write!(f, "{kills} kills, {during} before the end; {whole} whole, {completed} completed, ")?;
        write!(f, "{parts_of_sets} sets in part; ")?;
        write!(f, "{leftovers} unfinished files, all named by the next run")
    }
}

/// Signals that do not end a run once it has begun: those of failed writes, which are errors.
const IGNORED: [u32; 2] = {
    let [pipe, xfsz] = [13, 25];
    [pipe, xfsz]
};
const KILL: u32 = 9;

/// Kills `job` so often, with SIGKILL and the other signals by turns, at times from its start to a little
/// after its end.
pub(crate) fn campaign(job: &Job, kills: usize, dice: &mut Random) -> Seen {
    let begin = Instant::now();
    assert!(job.command().stdout(Stdio::null()).status().unwrap().success());
    let longest = begin.elapsed().mul_f64(1.1);
    let mut seen = Seen { kills, ..Seen::default() };
    for kill in 0..kills {
        let (hard, old) = (kill % 2 == 0, kill % 4 < 2);
        let signal = if hard { KILL } else { dice.of(&[&ENDING[..], &IGNORED[..]].concat()) };
        let before = job.prepare(old);
        let (status, during, said) = killed(job.command(), longest.mul_f64(dice.part()), signal);
        let what = format!("{:?}, signal {signal}, {kill}: {status}: {said}", job.args);
        check_status(status, signal, &what);
        seen.during += usize::from(during);
        if let Some(bytes) = completed(job, status, &said) {
            job.judge_live(bytes, &what);
            assert!(job.unfinished().is_empty(), "{what}");
            seen.completed += 1;
            continue;
        }
        let judged = job.judge(&before, &what);
        match judged {
            Some(whole) => seen.whole += usize::from(whole),
            None => seen.parts_of_sets += 1,
        }
        assert!(hard || judged.is_some(), "{what}: a set in part");
        match status.code() {
            // An end without any output is none in order.
            Some(0) => assert_eq!(judged, Some(true), "{what}"),
            Some(1) => assert_eq!(judged, Some(said.contains("was written")), "{what}"),
            _ => {}
        }
        let leftovers = job.unfinished();
        assert!(hard || leftovers.is_empty(), "{what}: {leftovers:?}");
        if !leftovers.is_empty() {
            let next = job.command().output().unwrap();
            let said = String::from_utf8(next.stderr).unwrap();
            assert!(next.status.success(), "{what}: {said}");
            for path in &leftovers {
                let name = path.file_name().unwrap().to_str().unwrap();
                assert!(said.contains(name), "{what}: {name} is not named in: {said}");
                fs::remove_file(path).unwrap();
            }
            assert_eq!(job.judge(&before, &what), Some(true), "{what}");
            assert!(job.unfinished().is_empty(), "{what}");
            seen.leftovers += leftovers.len();
        }
    }
    seen
}

/// The bytes of a recording that a signal completed.
fn completed(job: &Job, status: ExitStatus, said: &str) -> Option<usize> {
    const BYTES: usize = 4;
    let (_, samples) = said.split_once(" frames, ").filter(|_| job.is_live && status.success())?;
    let samples = samples.split_once(" samples written")?.0;
    Some(BYTES * samples.parse::<usize>().unwrap())
}

/// Ends a run by a signal after `delay`; true if the run had not ended before, and what it said.
fn killed(mut command: Command, delay: Duration, signal: u32) -> (ExitStatus, bool, String) {
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    std::thread::sleep(delay);
    let during = child.try_wait().unwrap().is_none();
    if during {
        let signal = signal.to_string();
        let _ = Command::new("kill")
            .args(["-s", &signal, &child.id().to_string()])
            .stderr(Stdio::null())
            .status();
    }
    let output = child.wait_with_output().unwrap();
    (output.status, during, String::from_utf8_lossy(&output.stderr).into_owned())
}

/// Done, or ended by this signal: at once, in order (1), or after removing files (128 + signal). Before the
/// program has begun it does not handle any.
fn check_status(status: ExitStatus, signal: u32, what: &str) {
    let number = i32::try_from(signal).unwrap();
    let fits = match status.code() {
        Some(0) => true,
        Some(code) => ENDING.contains(&signal) && (code == 1 || code == 128 + number),
        None => status.signal() == Some(number),
    };
    assert!(fits, "{what}");
}
