//! Designs that cannot be: a latency out of reach, too long, too large, numbers too large; and long ones
//! that are interrupted.

#[cfg(target_os = "linux")]
use crate::support::until_caught;
use crate::support::{THESIS, names, send, text};
use hybank::design::effort::estimate;
use hybank::spec::Spec;
use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};

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

/// A design with its processor time, of design and proof together.
struct Timed {
    channels: usize,
    ratio: usize,
    latency: usize,
    design: &'static str,
    seconds: f64,
}

const fn timed(channels: usize, ratio: usize, latency: usize, design: &'static str, seconds: f64) -> Timed {
    Timed { channels, ratio, latency, design, seconds }
}

/// `hybank design --no-limit` of a release build on one core of an Intel Xeon (family 6, model 207) that is
/// shared with other work, 2026-11-26; the last ones on an AMD EPYC (Zen 4), 2026-11-22.
const TIMED: [Timed; 40] = [
    timed(2, 2, 10, "method = \"iir\"", 0.08),
    timed(2, 2, 32, "method = \"iir\"", 0.28),
    timed(2, 2, 100, "method = \"iir\"", 2.5),
    timed(4, 4, 40, "method = \"iir\"", 0.40),
    timed(3, 4, 60, "method = \"iir\"", 0.59),
    timed(2, 2, 20, "method = \"iir\"\norder = 6", 10.1),
    timed(2, 2, 100, "method = \"h2\"", 1.9),
    timed(2, 2, 200, "method = \"h2\"", 11.6),
    timed(2, 2, 32, "method = \"h2\"\ntaps = 64", 0.30),
    timed(2, 2, 256, "method = \"h2\"\ntaps = 512", 7.8),
    timed(8, 8, 64, "method = \"h2\"\ntaps = 128", 0.95),
    timed(2, 2, 10, "taps = 22", 0.11),
    timed(2, 2, 32, "taps = 64", 0.49),
    timed(2, 2, 128, "taps = 256", 9.7),
    timed(4, 4, 32, "taps = 64", 0.35),
    timed(8, 8, 32, "taps = 64", 0.62),
    timed(8, 8, 64, "taps = 128", 3.8),
    timed(8, 8, 128, "taps = 256", 9.8),
    timed(16, 16, 64, "taps = 128", 3.1),
    timed(2, 64, 32, "taps = 64", 2.6),
    timed(3, 8, 20, "taps = 40", 0.33),
    timed(2, 2, 10, "taps = 22\nbits = 12", 0.46),
    timed(4, 4, 32, "taps = 64\nbits = 12", 4.1),
    timed(2, 2, 10, "taps = 22\n[uncertainty]\ndelay_samples = 0.1", 0.68),
    timed(2, 2, 32, "taps = 64\n[uncertainty]\ndelay_samples = 0.1", 2.7),
    timed(4, 4, 12, "taps = 24\n[uncertainty]\ndelay_samples = 0.1", 2.5),
    timed(2, 2, 10, "taps = 22\n[uncertainty]\ndelay_samples = 0.1\ncutoff = 0.01", 5.9),
    timed(2, 2, 100, "method = \"iir\"", 1.0),
    timed(2, 2, 200, "method = \"h2\"", 6.8),
    timed(2, 2, 32, "taps = 64", 0.11),
    timed(2, 2, 128, "taps = 256", 5.6),
    timed(8, 8, 32, "taps = 64", 0.14),
    timed(8, 8, 128, "taps = 256", 10.0),
    timed(16, 16, 64, "taps = 128", 2.8),
    timed(2, 64, 32, "taps = 64", 1.8),
    timed(2, 2, 400, "method = \"h2\"", 16.0),
    timed(2, 2, 1000, "method = \"h2\"", 421.0),
    timed(2, 2, 512, "taps = 1024", 59.0),
    timed(32, 32, 32, "taps = 64", 39.0),
    timed(3, 256, 4, "taps = 6", 36.0),
];

/// 12 s were said for what took 0.1 s, and 17 s for 39.
#[test]
fn measured_times_lie_within_the_estimate_or_beyond_by_half() {
    let wrong = TIMED.iter().filter_map(|Timed { channels, ratio, latency, design, seconds }| {
        let text = format!("latency = {latency}\n{}", spec(*channels, *ratio, design));
        let effort = estimate(&Spec::from_toml(&text, "spec.toml").unwrap(), true).unwrap();
        let line = format!("{channels}, {ratio}, latency {latency}, {design:?}: {seconds} s of {effort:?}");
        println!("{line}");
        (effort.shortest > 1.5 * seconds || *seconds > 1.5 * effort.longest).then_some(line)
    });
    assert_eq!(wrong.collect::<Vec<_>>(), Vec::<String>::new());
}

/// Each of these once ran for minutes or ate the memory of the machine, in silence.
#[test]
fn what_cannot_end_is_refused_with_the_figures_and_the_way_out() {
    let out = ["this design would take about", "--no-limit"];
    let with = |more: &'static str| [&out[..], &[more]].concat();
    refused(&spec(256, 256, "taps = 64"), &["--latency", "32"], &["--no-limit", "fewer channels"]);
    refused(&spec(1024, 8, "taps = 16"), &[], &["--no-limit", "fewer channels"]);
    refused(&spec(2, 2, "taps = 8000"), &["--latency", "4000"], &with("fewer taps"));
    refused(&spec(2, 2, "method = \"h2\""), &["--latency", "3000"], &with("a shorter latency"));
    refused(&spec(2, 2, "taps = 2048\nbits = 12"), &["--latency", "1024"], &["--no-limit", "leave out bits"]);
}

#[cfg(target_os = "linux")]
#[test]
fn the_memory_of_the_process_is_a_limit() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("spec.toml"), spec(8, 8, "taps = 512")).unwrap();
    let script = format!(
        "ulimit -v 300000; exec {} design spec.toml -o b.json --latency 256",
        env!("CARGO_BIN_EXE_hybank")
    );
    let output = Command::new("sh").current_dir(folder.path()).args(["-c", &script]).output().unwrap();
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{message}");
    let said = message.split_once("this process may use ").and_then(|(_, rest)| rest.split_once(" MB"));
    let megabytes: f64 = said.unwrap_or_else(|| panic!("{message}")).0.parse().unwrap();
    assert!((50.0..307.0).contains(&megabytes), "{message}");
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

/// Interrupted long before its end, as soon as it listens to the signal.
#[cfg(target_os = "linux")]
#[test]
fn an_interrupt_ends_a_design_at_once_and_leaves_no_file() {
    for signal in crate::support::ending_signals() {
        let folder = tempfile::tempdir().unwrap();
        let mut command =
            design(folder.path(), &spec(2, 2, "taps = 900"), &["--latency", "400", "--no-limit"]);
        let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        until_caught(child.id(), signal);
        send(child.id(), signal);
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(1), "{output:?}");
        assert_eq!(text(&output.stderr), "hybank: interrupted; no unfinished file is left\n");
        assert_eq!(names(folder.path()), ["spec.toml"]);
    }
}
