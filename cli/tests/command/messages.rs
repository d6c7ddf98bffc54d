//! Messages that once misled, one test each: they name what is wrong, where it is, and what to do.

use crate::support::{Desk, THESIS, wav};
use std::process::Command;

const FUSE: [&str; 6] = ["fuse", "bank.json", "a.wav", "b.wav", "-o", "out.wav"];

/// The small bank with two recordings.
fn desk() -> Desk {
    let desk = Desk::with_model();
    wav::write_pair(&desk, &[0.25; 64], &[0.5; 64]);
    desk
}

fn fuse<'a>(more: &[&'a str]) -> Vec<&'a str> {
    FUSE.iter().chain(more).copied().collect()
}

/// The message of a FIFO recommended `-`, which the other message refused.
#[test]
#[cfg(unix)]
fn a_mask_is_a_file() {
    let desk = desk();
    assert!(Command::new("mkfifo").arg(desk.path("fifo")).status().unwrap().success());
    let said = desk.refused(1, &fuse(&["--gaps", "--mask", "fifo"]), &["fifo", "a device, pipe or socket"]);
    assert!(said.contains("give the name of a file") && !said.contains("`-`"), "{said}");
    desk.refused(2, &fuse(&["--gaps", "--mask", "-"]), &["--mask -", "give it a file"]);
    // What may go to standard output says so.
    desk.write("spec.toml", THESIS);
    let design = ["design", "spec.toml", "-o", "fifo", "--force"];
    desk.refused(1, &design, &["fifo", "write to `-` and redirect"]);
}

/// They named the option that was missing, and not the one that was given.
#[test]
fn options_about_missing_samples_need_gaps() {
    let desk = desk();
    for (option, value) in
        [("--mask", Some("m")), ("--lost", Some("l")), ("--max-lost", Some("3")), ("--longest", None)]
    {
        let args: Vec<&str> = [option].into_iter().chain(value).collect();
        let said = desk.refused(2, &fuse(&args), &[option, "without --gaps", "give it too"]);
        assert!(!said.contains("required arguments"), "{said}");
    }
}

/// So many threads of readers that the system had no memory maps left: a panic of the standard library.
#[test]
fn thousands_of_inputs_are_refused_before_any_is_opened() {
    let desk = desk();
    let many = ["none.wav"; 20_000];
    let args = [&["fuse", "bank.json", "-o", "out.wav"][..], &many].concat();
    desk.refused(1, &args, &["none.wav", "20000 inputs", "at most 1024 are read together"]);
}

/// "Is a directory (os error 21)".
#[test]
fn a_folder_is_no_input() {
    let desk = desk();
    std::fs::create_dir(desk.path("folder")).unwrap();
    for args in [
        &["analyze", "folder"][..],
        &["design", "folder", "-o", "out.json"],
        &["measure", "folder"],
        &["fuse", "bank.json", "folder", "b.wav", "-o", "out.wav"],
    ] {
        let said = desk.refused(1, args, &["folder: cannot read", "it is a folder; give the name of a file"]);
        assert!(!said.contains("os error"), "{said}");
    }
}
