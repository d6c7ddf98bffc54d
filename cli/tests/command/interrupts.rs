//! Interrupts of commands that compute, which end at once, and of a design, which ends with what it has.

use crate::support::blocked::until_a_thread_begins;
use crate::support::{Desk, INT, TERM, THESIS, ending_signals, names, repository, send, text};
use std::process::{Child, Output};
use std::time::Duration;

/// The run ends by `signal`; its standard error.
fn interrupted(child: Child, signal: u32) -> String {
    send(child.id(), signal);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(128 + signal as i32), "{output:?}");
    text(&output.stderr)
}

fn until(is_so: impl Fn() -> bool) {
    while !is_so() {
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// The first recording is whole, without its name yet, while the second one is computed.
#[test]
fn a_signal_ends_a_simulation_and_leaves_no_file() {
    for signal in ending_signals() {
        let desk = Desk::with_spec(THESIS);
        let tones: Vec<String> = (1..90).map(|k| format!("{}", f64::from(k) * 0.005)).collect();
        let source = format!("tones:{}", tones.join(","));
        let args = ["simulate", "spec.toml", "--source", &source, "--samples", "250000", "-o", "captures"];
        let child = desk.spawn(&args);
        let captures = desk.path("captures");
        until(|| captures.exists() && names(&captures).iter().any(|name| name.ends_with(".part")));
        assert_eq!(interrupted(child, signal), "");
        assert_eq!(names(&captures), Vec::<String>::new());
    }
}

/// A design that takes seconds, as soon as it has begun.
fn design() -> (Desk, Child) {
    let long = THESIS.replace("taps = 22", "taps = 240").replace("latency = 10", "latency = 108");
    let desk = Desk::with_spec(&long);
    let child = desk.spawn(&["design", "spec.toml", "-o", "bank.json", "--force"]);
    until_a_thread_begins(child.id(), "progress");
    (desk, child)
}

#[test]
fn a_design_ends_at_the_first_signal_with_what_it_has() {
    let (desk, child) = design();
    send(child.id(), TERM);
    let Output { status, stderr, .. } = child.wait_with_output().unwrap();
    let said = text(&stderr);
    assert_eq!(status.code(), Some(0), "{said}");
    assert!(said.contains("interrupted: the design ends with the best bank so far"), "{said}");
    assert!(said.contains("warning: spec.toml: the design was ended before it was complete"), "{said}");
    let bank = desk.read_json("bank.json");
    assert!(bank["gamma"]["norm"].is_number() && bank["proof"].is_null(), "{}", bank["gamma"]);
}

#[test]
fn a_design_ends_at_the_second_signal_without_a_file() {
    let (desk, mut child) = design();
    while child.try_wait().unwrap().is_none() {
        send(child.id(), INT);
        std::thread::sleep(Duration::from_millis(20));
    }
    assert_eq!(child.wait().unwrap().code(), Some(128 + 2));
    assert_eq!(names(&desk.path("")), ["spec.toml"]);
}

/// The bank has its name before the search for its proof begins.
#[test]
fn a_search_for_a_proof_ends_at_the_first_signal_and_leaves_the_bank() {
    let filters = repository("filters/interleaved-4x250M.toml");
    let desk = Desk::with_spec(&std::fs::read_to_string(filters).unwrap());
    let child = desk.spawn(&["design", "spec.toml", "-o", "bank.json", "--prove"]);
    until_a_thread_begins(child.id(), "proof");
    send(child.id(), TERM);
    let Output { status, stdout, stderr, .. } = child.wait_with_output().unwrap();
    let said = text(&stderr);
    assert_eq!(status.code(), Some(0), "{said}");
    assert!(said.contains("interrupted: the search for the proof ends"), "{said}");
    assert!(text(&stdout).contains("not proven, the search was interrupted"), "{stdout:?}");
    let bank = desk.read_json("bank.json");
    assert!(bank["gamma"]["norm"].is_number() && bank["proof"].is_null(), "{}", bank["gamma"]);
}
