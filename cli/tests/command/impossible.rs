//! Designs that cannot be: a latency out of reach, numbers too large.

use crate::support::{THESIS, names, text};
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

fn design(folder: &Path, spec: &str, args: &[&str]) -> Command {
    fs::write(folder.join("spec.toml"), spec).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_hybank"));
    command.current_dir(folder).args(["design", "spec.toml", "-o", "bank.json"]).args(args);
    command
}

/// Wants exit code 1, one message with all of `parts`, and no file.
fn refused(spec: &str, args: &[&str], parts: &[&str]) -> String {
    let folder = tempfile::tempdir().unwrap();
    let Output { status, stdout, stderr } = design(folder.path(), spec, args).output().unwrap();
    let message = text(&stderr);
    assert_eq!((status.code(), text(&stdout).as_str()), (Some(1), ""), "{message}");
    assert_eq!(message.matches("hybank: ").count(), 1, "one message only: {message}");
    for part in parts {
        assert!(message.contains(part), "`{part}` is missing in: {message}");
    }
    assert_eq!(names(folder.path()), ["spec.toml"]);
    message
}

/// Channels in a circle around the ratio, all behind the filter of the target.
fn spec(channels: usize, ratio: usize, design: &str) -> String {
    let delay =
        |i: usize| format!("[[channel]]\ndelay_samples = {}\n", (i * ratio) as f64 / channels as f64 + 0.1);
    let channels: String = (0..channels).map(delay).collect();
    format!(
        "fast_rate = 48000.0\nratio = {ratio}\n[target]\n\
         filter = {{ family = \"butterworth\", order = 4, cutoff = 9000.0 }}\n{channels}[design]\n{design}\n"
    )
}

#[test]
fn a_latency_out_of_reach_is_refused_before_anything_is_computed() {
    let parts =
        ["at latency 1000 filters with taps = 32", "latencies 0 to ", "leave the latency out", "more taps"];
    refused(&spec(4, 4, "taps = 32"), &["--latency", "1000"], &parts);
    refused(&spec(2, 2, "taps = 24"), &["--latency", "1025"], &["at latency 1025", "latencies 0 to "]);
    for method in ["sinc", "separation"] {
        refused(
            &spec(2, 2, "method = \"fir\"\ntaps = 24"),
            &["--latency", "500", "--method", method],
            &["at latency 500"],
        );
    }
}

#[test]
fn numbers_near_the_end_of_double_precision_are_refused_by_their_key() {
    let swapped = |from: &str, to: &str| {
        assert!(THESIS.contains(from));
        THESIS.replacen(from, to, 1)
    };
    let huge = "{ zeros = [], poles = [[-0.5, 0.0], [-0.5, 0.0]], gain = 1e308 }";
    let target = swapped("num = [0.25]", "num = [1e307]");
    refused(&target, &[], &["target.filter: the gain is", "check num, gain or c"]);
    let channel = swapped("delay = 0.6", &format!("delay = 0.6\nfilter = {huge}"));
    refused(&channel, &[], &["filter of channel 2: the gain is"]);
    let tiny = swapped("num = [0.25]", "num = [1e-300]");
    refused(&tiny, &[], &["target.filter: the gain is"]);
    refused(THESIS, &["--gamma-margin", "1e308"], &["--gamma-margin", "at most 1000000"]);
}
