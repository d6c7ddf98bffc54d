//! A folder in which the program works as a user runs it.

use super::text;
use hybank::bank::Bank;
use serde_json::Value;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};

/// N = M = 2 with the taps [`TAPS`](super::TAPS), m0 = 3.
const BANK: &str = r#"{ "format": "hybank-bank", "version": 1, "spec": null, "fast_period": 1.0, "ratio": 2,
    "latency": 3, "method": "fir", "channels": [{ "delay": 0.0, "taps": [1, 2, 3, 4] },
    { "delay": 0.0, "taps": [10, 20, 30, 0] }], "state_space": null,
    "gamma": { "upper": null, "lower": null, "noncausal": null } }"#;

/// What the converters of [`BANK`] are: with it missing samples can be estimated.
const MODEL: &str = r#"{ "fast_period": 1.0, "ratio": 2, "latency": 3,
    "target": { "filter": { "family": "butterworth", "order": 2, "cutoff": 0.4 } },
    "channel": [{ "delay": 0.0 }, { "delay": 0.0 }], "design": { "method": "fir", "taps": 4 } }"#;

/// A temporary folder, removed at the end.
pub(crate) struct Desk {
    folder: tempfile::TempDir,
}

impl Desk {
    pub(crate) fn empty() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    /// With the small bank as `bank.json`.
    pub(crate) fn new() -> Self {
        let desk = Self::empty();
        desk.write("bank.json", BANK);
        desk
    }

    /// As [`Desk::new`], and the bank has a spec.
    pub(crate) fn with_model() -> Self {
        let desk = Self::empty();
        desk.write("bank.json", BANK.replace("\"spec\": null", &format!("\"spec\": {MODEL}")));
        desk
    }

    /// With `spec.toml`.
    pub(crate) fn with_spec(spec: &str) -> Self {
        let desk = Self::empty();
        desk.write("spec.toml", spec);
        desk
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        fs::write(self.path(name), content).unwrap();
    }

    pub(crate) fn write_bank(&self, name: &str, bank: &Bank) {
        self.write(name, bank.to_json().unwrap());
    }

    pub(crate) fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap()
    }

    pub(crate) fn read_json(&self, name: &str) -> Value {
        serde_json::from_slice(&self.read(name)).unwrap()
    }

    /// hybank in the folder, not yet started.
    pub(crate) fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_hybank"));
        command.current_dir(self.folder.path()).args(args);
        command
    }

    /// hybank at work in the folder, with pipes.
    pub(crate) fn spawn(&self, args: &[&str]) -> Child {
        let mut command = self.command(args);
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
    }

    pub(crate) fn run(&self, args: &[&str], input: &[u8]) -> Output {
        let mut child = self.spawn(args);
        let mut stdin = child.stdin.take().unwrap();
        let input = input.to_vec();
        let feeder = std::thread::spawn(move || stdin.write_all(&input));
        let output = child.wait_with_output().unwrap();
        // A refused run closes its input early.
        let _ = feeder.join().unwrap();
        output
    }

    /// Runs and wants success with nothing on standard error except the progress of a long run on a busy
    /// machine; gives standard output.
    pub(crate) fn good(&self, args: &[&str]) -> String {
        let output = self.run(args, &[]);
        assert!(output.status.success(), "{args:?}: {output:?}");
        let said = text(&output.stderr);
        let words: Vec<&str> = said.lines().filter(|line| !is_progress(line)).collect();
        assert!(words.is_empty(), "{args:?}: {words:?}");
        text(&output.stdout)
    }

    /// As [`good`](Self::good), with one JSON object on one line and nothing else.
    pub(crate) fn json(&self, args: &[&str]) -> Value {
        let out = self.good(args);
        assert_eq!(out.trim_end().lines().count(), 1, "{out}");
        let value: Value = serde_json::from_str(&out).unwrap();
        assert!(value.is_object(), "{out}");
        value
    }

    /// Runs with `--json --force` and wants success, warnings or not; gives the report.
    pub(crate) fn report(&self, args: &[&str]) -> Value {
        let output = self.run(&[args, &["--json", "--force"]].concat(), &[]);
        assert!(output.status.success(), "{args:?}: {output:?}");
        serde_json::from_slice(&output.stdout).unwrap()
    }

    /// Runs and wants success with nothing on standard error; gives standard output.
    pub(crate) fn piped(&self, args: &[&str], input: &[u8]) -> Vec<u8> {
        let output = self.run(args, input);
        assert!(output.status.success() && output.stderr.is_empty(), "{args:?}: {output:?}");
        output.stdout
    }

    /// Runs and wants success with all of `parts` on standard error, which it gives.
    pub(crate) fn warned(&self, args: &[&str], parts: &[&str]) -> String {
        let output = self.run(args, &[]);
        let said = text(&output.stderr);
        assert!(output.status.success() && parts.iter().all(|part| said.contains(part)), "{args:?}: {said}");
        said
    }

    /// Runs and wants exit code `code`, nothing on standard output, one message that has all of `parts`, and
    /// no new file; gives the message.
    pub(crate) fn refused(&self, code: i32, args: &[&str], parts: &[&str]) -> String {
        let before = names(self.folder.path());
        let output = self.run(args, &[]);
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{args:?}: {message}");
        assert!(output.stdout.is_empty(), "{args:?}");
        assert!(!message.contains("panicked"), "{message}");
        for part in parts {
            assert!(message.contains(part), "{args:?}: `{part}` is missing in: {message}");
        }
        if code == 1 {
            assert_eq!(message.matches("hybank: ").count(), 1, "one message only: {message}");
        }
        assert_eq!(names(self.folder.path()), before, "{args:?}");
        message
    }
}

/// What lies in a folder, in order.
pub(crate) fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<_> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

/// Whether the line says how long a run has taken, as in `hybank: searching for a proof of gamma: 30 s`.
fn is_progress(line: &str) -> bool {
    let time = line.strip_prefix("hybank: ").and_then(|said| said.rsplit_once(": "));
    let seconds = time.and_then(|(_, time)| time.strip_suffix(" s"));
    seconds.is_some_and(|seconds| seconds.bytes().all(|c| c.is_ascii_digit()))
}
