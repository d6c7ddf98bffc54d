//! What a tester found by abusing the binary: each stays as a test of its exit code and message.

use crate::support::THESIS;
use std::process::{Command, Output};

/// A folder of its own with the spec in it.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new(spec: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("spec.toml"), spec).unwrap();
        Self(folder)
    }

    fn run(&self, args: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_hybank")).current_dir(self.0.path()).args(args).output().unwrap()
    }

    /// Fails with code 1, one message that holds all of `words`, and leaves no file behind.
    fn refuses(&self, args: &[&str], words: &[&str]) {
        let before = self.names();
        let output = self.run(args);
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{args:?}: {message}");
        assert!(output.stdout.is_empty(), "{args:?}");
        for word in words {
            assert!(message.contains(word), "{args:?}: `{word}` is missing in {message}");
        }
        assert_eq!(self.names(), before, "{args:?}");
    }

    fn names(&self) -> Vec<std::ffi::OsString> {
        let mut names: Vec<_> =
            std::fs::read_dir(self.0.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        names.sort();
        names
    }
}

#[test]
fn delay_errors_out_of_all_proportion_are_refused() {
    let folder = Folder::new(THESIS);
    assert!(folder.run(&["design", "spec.toml", "-o", "bank.json"]).status.success());
    for error in ["1e300,0", "-1e300,0", "1e5,0", "0,-1e5"] {
        folder.refuses(&["analyze", "bank.json", "--delay-error", error], &["bank.json", "states", "unit"]);
    }
}

#[test]
fn a_latency_beyond_memory_is_refused() {
    let folder = Folder::new(&THESIS.replace("latency = 10", "latency = 65536"));
    for method in ["fir", "iir", "h2", "sinc"] {
        folder.refuses(
            &["design", "spec.toml", "-o", "bank.json", "--method", method],
            &["spec.toml", "latency 65536", "states"],
        );
    }
}

#[test]
fn a_chirp_too_fast_for_its_quadrature_is_refused() {
    let folder = Folder::new(THESIS);
    let args = ["simulate", "spec.toml", "--source", "chirp:1Hz..1e9Hz@2s", "-o", "captures"];
    folder.refuses(&args, &["chirp:1Hz..1e9Hz@2s", "units"]);
}

#[test]
fn captures_that_no_sample_can_hold_are_refused() {
    let folder = Folder::new(THESIS);
    let args = ["simulate", "spec.toml", "--source", "step@1", "--gain", "1e300", "-o", "captures"];
    folder.refuses(&args, &["step@1", "--gain"]);
}
