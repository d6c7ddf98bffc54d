//! The thesis example; a folder with a small bank in it, and the definition of what that bank does.
// Each test program uses a part of it.
#![allow(dead_code)]

pub(crate) mod random;
pub(crate) mod specs;

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};

/// The thesis example as an FIR bank.
pub(crate) const THESIS: &str = "\
fast_period = 1.0
ratio = 2
latency = 10
[target]
filter = { num = [0.25], den = [1.0, 1.0, 0.25] }
[[channel]]
delay = 1.2
[[channel]]
delay = 0.6
[design]
method = \"fir\"
taps = 22
";

/// N = M = 2, m0 = 3.
pub(crate) const TAPS: [&[f32]; 2] = [&[1.0, 2.0, 3.0, 4.0], &[10.0, 20.0, 30.0, 0.0]];

const BANK: &str = r#"{ "format": "hybank-bank", "version": 1, "spec": null, "fast_period": 1.0, "ratio": 2,
    "latency": 3, "method": "fir", "channels": [{ "delay": 0.0, "taps": [1, 2, 3, 4] },
    { "delay": 0.0, "taps": [10, 20, 30, 0] }], "state_space": null,
    "gamma": { "upper": null, "lower": null, "noncausal": null } }"#;

/// A folder with `bank.json`, removed at the end.
pub(crate) struct Desk {
    folder: tempfile::TempDir,
}

impl Desk {
    pub(crate) fn new() -> Self {
        let desk = Self { folder: tempfile::tempdir().unwrap() };
        desk.write("bank.json", BANK);
        desk
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        fs::write(self.path(name), content).unwrap();
    }

    pub(crate) fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap()
    }

    /// hybank at work in the folder, with pipes.
    pub(crate) fn spawn(&self, args: &[&str]) -> Child {
        Command::new(env!("CARGO_BIN_EXE_hybank"))
            .current_dir(self.folder.path())
            .args(args)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap()
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

    /// Runs and wants success; gives the report of `--json`.
    pub(crate) fn report(&self, args: &[&str]) -> serde_json::Value {
        let output = self.run(&[args, &["--json", "--force"]].concat(), &[]);
        assert!(output.status.success(), "{args:?}: {output:?}");
        serde_json::from_slice(&output.stdout).unwrap()
    }

    /// Runs and wants exit code `code` with one message that has all of `parts`, and no new file.
    pub(crate) fn refused(&self, code: i32, args: &[&str], parts: &[&str]) {
        let before = names(self.folder.path());
        let output = self.run(args, &[]);
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{args:?}: {message}");
        assert!(output.stdout.is_empty(), "{args:?}");
        for part in parts {
            assert!(message.contains(part), "`{part}` is missing in: {message}");
        }
        assert_eq!(names(self.folder.path()), before, "{args:?}");
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

/// What a program printed.
pub(crate) fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// Small integers, so that every sum is exact in any order and precision.
pub(crate) fn ticks(count: usize) -> Vec<f32> {
    (0..2 * count).map(|i| ((i * 7) % 23) as f32 - 11.0).collect()
}

/// Channel i of interleaved frames.
pub(crate) fn channel(ticks: &[f32], i: usize) -> Vec<f32> {
    ticks.iter().skip(i).step_by(2).copied().collect()
}

pub(crate) fn bytes(samples: &[f32]) -> Vec<u8> {
    samples.iter().flat_map(|x| x.to_le_bytes()).collect()
}

pub(crate) fn floats(bytes: &[u8]) -> Vec<f32> {
    bytes.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect()
}

/// The definition: y[2k + p] = sum_i sum_j f_i[p + 2j] x_i[k - j].
pub(crate) fn fused(x: &[f32]) -> Vec<f32> {
    let mut y = vec![0.0; x.len()];
    for (t, y) in y.iter_mut().enumerate() {
        for (i, f) in TAPS.iter().enumerate() {
            *y += (0..=t / 2).filter_map(|k| Some(f.get(t - 2 * k)? * x[2 * k + i])).sum::<f32>();
        }
    }
    y
}
