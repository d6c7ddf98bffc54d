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
    desk.refused(
        1,
        &["design", "spec.toml", "-o", "fifo", "--force"],
        &["fifo", "write to `-` and redirect"],
    );
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

/// A negative number was taken for an option, with the advice to write `-- -1`.
#[test]
fn negative_values_are_refused_by_their_rule() {
    let desk = desk();
    desk.write("spec.toml", THESIS);
    let design = ["design", "spec.toml", "-o", "out.json"];
    let analyze = ["analyze", "bank.json"];
    let simulate = ["simulate", "spec.toml", "--source", "step@1", "-o", "x"];
    for (run, option, value) in [
        (&analyze[..], "--delay-box", "-1"),
        (&analyze, "--delay-box", "-10ps"),
        (&analyze, "--gain-box", "-1%"),
        (&design, "--gamma-margin", "-1"),
        (&design, "--taps", "-1"),
        (&design, "--latency", "-1"),
        (&design, "--order", "-1"),
        (&design, "--snr", "-1"),
        (&design, "--bits", "-1"),
        (&simulate, "--seed", "-1"),
        (&simulate, "--bits", "-1"),
        (&simulate, "--noise", "-1"),
        (&["measure", "a.wav"], "--rate", "-1kHz"),
        (&["measure", "a.wav"], "--harmonics", "-1"),
        (&FUSE, "--threads", "-1"),
    ] {
        let args: Vec<&str> = run.iter().chain(&[option, value]).copied().collect();
        let output = desk.run(&args, &[]);
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(matches!(output.status.code(), Some(1 | 2)), "{args:?}: {said}");
        assert!(
            said.contains(option) && !said.contains("tip:") && !said.contains("unexpected argument"),
            "{said}"
        );
        assert!(!said.contains("invalid digit"), "{said}");
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

/// The name of the output was looked at when the work was done, after minutes of it, and the message did not
/// say whether the file or its folder was missing.
#[test]
fn an_output_that_cannot_be_is_refused_before_the_work() {
    let desk = Desk::new();
    desk.write("taken", "");
    // Each is an error of its own, which would come first if the work began.
    desk.write("spec.toml", "ratio = 2");
    desk.write("nothing", "");
    for run in [
        &["design", "spec.toml", "-o"][..],
        &["import", "spec.toml", "nothing", "-o"],
        &["export", "nothing", "--format", "c", "-o"],
        &["report", "nothing", "-o"],
        &["calibrate", "spec.toml", "nothing", "--blind", "-o"],
        &["measure", "nothing", "--plot"],
    ] {
        for (output, words) in [("none/out", "its folder is not there"), ("taken", "the file exists")] {
            desk.refused(1, &[run, &[output]].concat(), &[output, words]);
        }
    }
}

/// "File exists (os error 17)", also of a link that leads to itself.
#[test]
#[cfg(unix)]
fn a_file_is_no_folder_for_captures() {
    let desk = Desk::with_spec(THESIS);
    desk.write("taken", "");
    std::os::unix::fs::symlink("loop", desk.path("loop")).unwrap();
    for folder in ["taken", "taken/inside", "loop"] {
        let args = ["simulate", "spec.toml", "--source", "step@1", "-o", folder];
        let said = desk.refused(1, &args, &[folder, "a file has this name", "the name of a folder"]);
        assert!(!said.contains("os error"), "{said}");
    }
}
