//! Which files a run may write, when they appear, and what becomes of what was there.

use crate::support::{Desk, bytes, channel, frames, fused, names, text, wav};
use std::fs;
use std::io::Write;
use std::os::unix::fs::symlink;
use std::process::{Child, Command};

/// A desk with the recordings a.wav and b.wav of two channels.
fn desk() -> Desk {
    let desk = Desk::with_model();
    let frames = frames(100);
    wav::write_pair(&desk, &channel(&frames, 0), &channel(&frames, 1));
    desk
}

/// `hybank stream`, with more arguments, that has begun its output and waits for the rest of its input.
fn waiting(desk: &Desk, more: &[&str], unfinished: usize) -> Child {
    let mut child = desk.spawn(&[&["stream", "bank.json"], more].concat());
    child.stdin.as_mut().unwrap().write_all(&bytes(&frames(10))).unwrap();
    while names(&desk.path("")).iter().filter(|name| name.ends_with(".part")).count() < unfinished {
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    child
}

fn end(mut child: Child) -> (Option<i32>, String) {
    drop(child.stdin.take());
    let output = child.wait_with_output().unwrap();
    // A slow machine may take a second to come here.
    let lines = text(&output.stderr);
    let lines = lines.lines().filter(|line| !line.contains("waiting for") && !line.contains("goes on"));
    (output.status.code(), lines.map(|line| format!("{line}\n")).collect())
}

#[test]
fn an_input_is_never_replaced_even_by_force() {
    let desk = desk();
    fs::hard_link(desk.path("a.wav"), desk.path("same.wav")).unwrap();
    symlink("b.wav", desk.path("link.wav")).unwrap();
    let before = (desk.read("a.wav"), desk.read("b.wav"), desk.read("bank.json"));
    for output in ["a.wav", "./b.wav", "same.wav", "link.wav", "bank.json"] {
        let args = ["fuse", "bank.json", "a.wav", "b.wav", "-o", output, "--force"];
        desk.refused(1, &args, &[output, "also the input"]);
        let mask = ["fuse", "bank.json", "a.wav", "b.wav", "-o", "out.wav", "--force", "--gaps", "--mask"];
        desk.refused(1, &[&mask[..], &[output]].concat(), &[output, "also the input"]);
    }
    desk.write("spec.toml", crate::support::THESIS);
    desk.refused(1, &["design", "spec.toml", "-o", "spec.toml", "--force"], &["also the input"]);
    fs::copy(desk.path("a.wav"), desk.path("ch1.wav")).unwrap();
    let simulate = ["simulate", "spec.toml", "--source", "ch1.wav", "-o", ".", "--force"];
    desk.refused(1, &simulate, &["ch1.wav", "also the input"]);
    assert_eq!((desk.read("a.wav"), desk.read("b.wav"), desk.read("bank.json")), before);
}

/// The samples of a SigMF recording may lie in a file of any name.
#[test]
fn the_samples_of_a_sigmf_recording_are_an_input_too() {
    let desk = desk();
    let meta = |dataset: &str| {
        format!(
            r#"{{ "global": {{ "core:datatype": "rf32_le", "core:num_channels": 2, "core:version": "1.0.0"{dataset} }} }}"#
        )
    };
    desk.write("both.sigmf-meta", meta(""));
    desk.write("named.sigmf-meta", meta(r#", "core:dataset": "samples.bin""#));
    for data in ["both.sigmf-data", "samples.bin"] {
        desk.write(data, bytes(&frames(10)));
    }
    for (input, output) in [("both.sigmf-meta", "both.sigmf-data"), ("named.sigmf-meta", "samples.bin")] {
        for output in [input, output] {
            let args = ["stream", "bank.json", "--input", input, "-o", output, "--force"];
            desk.refused(1, &args, &[output, "also the input"]);
        }
    }
    assert_eq!(desk.read("samples.bin"), bytes(&frames(10)));
}

/// What a live run could not give its names is whole, and named by the message; removes it.
fn remain(desk: &Desk, message: &str, count: usize) {
    let (_, files) = message.trim_end().split_once("; what was recorded is in ").expect(message);
    let files: Vec<&str> = files.split(" and ").collect();
    assert_eq!(files.len(), count, "{message}");
    assert_eq!(desk.read(files[0]), bytes(&fused(&frames(10))));
    files.iter().for_each(|file| fs::remove_file(desk.path(file)).unwrap());
}

#[test]
fn output_and_mask_appear_together_or_not_at_all() {
    let desk = Desk::with_model();
    let args = ["-o", "out", "--gaps", "--mask", "mask"];
    let child = waiting(&desk, &args, 2);
    desk.write("mask", "another's");
    let (code, message) = end(child);
    assert!(code == Some(1) && message.contains("mask: the file exists"), "{message}");
    remain(&desk, &message, 2);
    assert_eq!(names(&desk.path("")), ["bank.json", "mask"]);
    assert_eq!(desk.read("mask"), b"another's");
    let child = waiting(&desk, &[&args[..], &["--force"]].concat(), 2);
    assert_eq!(end(child).0, Some(0));
    assert_eq!((desk.read("out"), desk.read("mask")), (bytes(&fused(&frames(10))), vec![0; 20]));
    assert_eq!(names(&desk.path("")), ["bank.json", "mask", "out"]);
}

#[test]
fn one_pipe_is_not_read_for_two_channels() {
    let desk = Desk::new();
    assert!(Command::new("mkfifo").arg(desk.path("pipe")).status().unwrap().success());
    symlink("pipe", desk.path("link")).unwrap();
    for second in ["pipe", "link"] {
        let args = ["stream", "bank.json", "--input", "pipe", "--input", second];
        desk.refused(1, &args, &["pipe", "the same pipe"]);
    }
}

#[test]
fn samples_that_are_dropped_with_the_latency_do_not_count_as_clipped() {
    let desk = Desk::new();
    // The first three output samples, 10, 20 and 30 times 0.2, are before the output's beginning.
    wav::write_pair(&desk, &[0.0; 5], &[0.2, 0.0, 0.0, 0.0, 0.0]);
    let args = ["fuse", "bank.json", "a.wav", "b.wav", "-o", "out.wav", "--bits", "16", "--strict"];
    assert_eq!(desk.report(&args)["clipped"], 0);
    wav::write_pair(&desk, &[0.0; 5], &[0.0, 0.2, 0.0, 0.0, 0.0]);
    let output = desk.run(&[&args[..], &["--force"]].concat(), &[]);
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.starts_with("hybank: 2 output samples were clipped"), "{message}");
}
