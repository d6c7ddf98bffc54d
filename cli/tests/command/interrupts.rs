//! Interrupts of commands that compute, which end at once, and of a design, which ends with what it has.

use crate::support::blocked::{until_a_thread_begins, until_a_thread_has_ended};
use crate::support::{Desk, INT, TERM, THESIS, ending_signals, names, send, text, wav};
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

/// Noise in two recordings of so many samples.
fn recorded(desk: &Desk, samples: usize) {
    let mut dice = crate::support::random::Random(7);
    let mut noise = || (0..samples).map(|_| 0.5 * dice.sample() as f32).collect::<Vec<_>>();
    wav::write_pair(desk, &noise(), &noise());
}

/// The first recording is whole, without its name yet, while the second one is computed.
#[test]
fn a_signal_ends_a_simulation_and_leaves_no_file() {
    for signal in ending_signals() {
        let desk = Desk::with_spec(THESIS);
        let tones: Vec<String> = (1..90).map(|k| format!("{}", f64::from(k) * 0.005)).collect();
        let source = format!("tones:{}", tones.join(","));
        let args = ["simulate", "spec.toml", "--source", &source, "--samples", "6000000", "-o", "captures"];
        let child = desk.spawn(&args);
        let captures = desk.path("captures");
        until(|| captures.exists() && names(&captures).iter().any(|name| name.ends_with(".part")));
        assert_eq!(interrupted(child, signal), "");
        assert_eq!(names(&captures), Vec::<String>::new());
    }
}

/// What was read before does not take the interrupt.
#[test]
fn a_signal_ends_a_calibration_after_its_captures_are_read() {
    let desk = Desk::with_spec(THESIS);
    recorded(&desk, 3_000_000);
    let calibrate = ["calibrate", "spec.toml", "a.wav", "b.wav", "--blind", "-o", "calibrated.toml"];
    let child = desk.spawn(&calibrate);
    until_a_thread_has_ended(child.id(), "input");
    interrupted(child, INT);
    assert_eq!(names(&desk.path("")), ["a.wav", "b.wav", "spec.toml"]);
}

#[test]
fn a_signal_ends_an_alignment_after_its_recordings_are_read() {
    let desk = Desk::with_spec(THESIS);
    recorded(&desk, 3_000_000);
    let child = desk.spawn(&["align", "spec.toml", "a.wav", "b.wav", "-o", "aligned"]);
    until_a_thread_has_ended(child.id(), "input");
    interrupted(child, INT);
    assert_eq!(names(&desk.path("")), ["a.wav", "b.wav", "spec.toml"]);
}

/// The fused recording has its name by then and keeps it.
#[test]
fn a_signal_ends_the_measurement_of_what_was_fused() {
    let desk = Desk::new();
    recorded(&desk, 1 << 21);
    let child = desk.spawn(&["fuse", "bank.json", "a.wav", "b.wav", "-o", "out.wav", "--measure"]);
    until(|| desk.path("out.wav").exists());
    interrupted(child, INT);
    assert_eq!(names(&desk.path("")), ["a.wav", "b.wav", "bank.json", "out.wav"]);
    assert_eq!(wav::samples(&desk, "out.wav").len(), 1 << 22);
}

/// A design that takes minutes, as soon as it has begun.
fn design() -> (Desk, Child) {
    let long = THESIS.replace("taps = 22", "taps = 900").replace("latency = 10", "latency = 400");
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
