//! The command line itself: exit code 2, help, completions, and files that are named or protected.

use crate::support::{Desk, THESIS};

#[test]
fn wrong_usage_is_exit_code_two() {
    let desk = Desk::with_spec(THESIS);
    desk.refused(2, &[], &["Usage"]);
    desk.refused(2, &["dezign"], &["dezign"]);
    desk.refused(2, &["design"], &["SPEC"]);
    desk.refused(2, &["design", "spec.toml", "-o", "b.json", "--method", "magic"], &["fir, iir, h2"]);
    desk.refused(2, &["design", "spec.toml", "-o", "b.json", "--taps", "many"], &["many"]);
    desk.refused(2, &["design", "spec.toml", "-o", "-", "--json"], &["--json", "standard output"]);
    desk.refused(2, &["simulate", "spec.toml", "--source", "stp@1", "-o", "x"], &["stp@1", "step@0.3"]);
    desk.refused(2, &["simulate", "spec.toml", "--source", "tones:1,x", "-o", "x"], &["`x`"]);
    desk.good(&["design", "spec.toml", "-o", "b.json"]);
    let one = ["analyze", "b.json", "--delay-error", "0.1"];
    desk.refused(1, &one, &["b.json", "1 delay errors", "2 channels"]);
    desk.refused(2, &["analyze", "b.json", "--delay-error", "0.1,nan"], &["nan", "10ps"]);
    let both = ["analyze", "b.json", "--delay-box", "1ps", "--delay-error", "0,0"];
    desk.refused(2, &both, &["--delay-error"]);
}

#[test]
fn files_are_named_and_never_overwritten_unasked() {
    let desk = Desk::with_spec(THESIS);
    desk.refused(1, &["design", "none.toml", "-o", "b.json"], &["none.toml", "cannot read"]);
    desk.refused(1, &["analyze", "none.json"], &["none.json", "cannot read"]);
    desk.refused(1, &["design", "spec.toml", "-o", "no/such/b.json"], &["no/such/b.json", "cannot create"]);
    desk.write("mine.json", "precious");
    desk.refused(1, &["design", "spec.toml", "-o", "mine.json"], &["mine.json", "exists", "--force"]);
    assert_eq!(desk.read("mine.json"), b"precious");
    desk.refused(1, &["analyze", "mine.json"], &["mine.json"]);
    desk.good(&["design", "spec.toml", "-o", "mine.json", "--force"]);
    desk.good(&["analyze", "mine.json"]);
}

#[test]
fn completions_know_the_verbs() {
    let desk = Desk::with_spec(THESIS);
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = desk.good(&["completions", shell]);
        assert!(script.contains("analyze") && script.contains("simulate"), "{shell}");
    }
    desk.refused(2, &["completions", "csh"], &["csh"]);
}

#[test]
fn help_and_version() {
    let desk = Desk::with_spec(THESIS);
    assert_eq!(desk.good(&["--version"]), format!("hybank {}\n", env!("CARGO_PKG_VERSION")));
    for command in ["design", "analyze", "simulate", "fuse", "measure", "stream", "demo", "completions"] {
        let help = desk.good(&[command, "--help"]);
        assert!(help.contains("Examples:") && help.contains("Usage:"), "{command}");
    }
}
