//! What the tests of all crates read from the environment, and the list of what they skipped.
//!
//! | variable | meaning |
//! | --- | --- |
//! | `HYBANK_DATA` | the folder of recordings and photographs, `shared/data` beside the repository if not set |
//! | `HYBANK_TRIALS` | the trials of a random test in place of its usual ones: so many (`1000`) or these (`124..125`) |
//! | `HYBANK_CAMPAIGN` | times as many rounds of damage and faults as usual |
//! | `HYBANK_SLOW` | set: also what takes minutes |
//!
//! A fifth, `HYBANK_PYTHON`, names the Python of `.ci/run`.

pub mod random;

use std::env;
use std::fmt::Display;
use std::fs::OpenOptions;
use std::io::Write;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// The numbers of the trials to make: `0..usual` unless `HYBANK_TRIALS` asks for others.
pub fn trials(usual: u64) -> Range<u64> {
    asked_trials().unwrap_or(0..usual)
}

/// The numbers that `HYBANK_TRIALS` asks for.
pub fn asked_trials() -> Option<Range<u64>> {
    let text = env::var("HYBANK_TRIALS").ok()?;
    let (first, end) = text.split_once("..").unwrap_or(("0", &text));
    Some(number("HYBANK_TRIALS", first)..number("HYBANK_TRIALS", end))
}

/// `usual` rounds, or `HYBANK_CAMPAIGN` times as many.
pub fn rounds(usual: usize) -> usize {
    env::var("HYBANK_CAMPAIGN").map_or(1, |text| number("HYBANK_CAMPAIGN", &text) as usize) * usual
}

/// Whether `HYBANK_SLOW` asks for what takes minutes. If not, what is left out goes to the list of skipped
/// tests.
pub fn is_slow(left_out: &str) -> bool {
    let is_slow = env::var_os("HYBANK_SLOW").is_some();
    if !is_slow {
        skipped(&format_args!("{left_out}: HYBANK_SLOW is not set"));
    }
    is_slow
}

/// A file or folder of the data, or `None` if it is not there; then the test goes to the list of skipped
/// tests.
pub fn data(name: &str) -> Option<PathBuf> {
    let path = env::var_os("HYBANK_DATA").map(PathBuf::from).or_else(beside).map(|folder| folder.join(name));
    let found = path.filter(|path| path.exists());
    if found.is_none() {
        skipped(&format_args!("{}: {name} is not in the data folder", current_test()));
    }
    found
}

/// The folder `shared/data` beside the repository or a folder above it.
fn beside() -> Option<PathBuf> {
    let above = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors();
    above.map(|folder| folder.join("shared/data")).find(|folder| folder.is_dir())
}

/// Notes what a test skipped: printed, and appended to `skipped-tests` in the folder of what is built. What
/// a passing test prints is not shown, so `.ci/run` shows that file at its end.
pub fn skipped(what: &dyn Display) {
    println!("skipped: {what}");
    let program = env::current_exe().unwrap_or_default();
    let Some(target) = program.ancestors().find(|folder| folder.join("CACHEDIR.TAG").is_file()) else {
        return;
    };
    let file = OpenOptions::new().create(true).append(true).open(target.join("skipped-tests"));
    let written = file.and_then(|mut file| file.write_all(format!("{what}\n").as_bytes()));
    assert!(written.is_ok(), "{}: {written:?}", target.display());
}

/// Test programs run each test on a thread with its name.
fn current_test() -> String {
    std::thread::current().name().unwrap_or("a test").to_owned()
}

fn number(variable: &str, text: &str) -> u64 {
    text.parse().unwrap_or_else(|_| panic!("{variable}={text}: not a number"))
}
