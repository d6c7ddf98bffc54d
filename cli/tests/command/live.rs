//! What a run reports while it goes on: gaps, clipping, stalls. As a user runs it.

use crate::support::{Desk, bytes, channel, floats, frames, fused, interleaved, text, wav};
use serde_json::{Value, json};
use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, Command};
use std::sync::mpsc::{Receiver, channel as messages};
use std::time::Duration;

/// More than any of these runs waits.
const PATIENCE: Duration = Duration::from_secs(60);

fn fifo(desk: &Desk, name: &str) {
    assert!(Command::new("mkfifo").arg(desk.path(name)).status().unwrap().success());
}

/// Opens a FIFO for writing as soon as it is read.
fn writer(desk: &Desk, name: &str) -> File {
    OpenOptions::new().write(true).open(desk.path(name)).unwrap()
}

/// The lines on standard error, as they come.
fn lines(child: &mut Child) -> Receiver<String> {
    let (sender, lines) = messages();
    let stderr = BufReader::new(child.stderr.take().unwrap());
    std::thread::spawn(move || stderr.lines().map_while(Result::ok).try_for_each(|line| sender.send(line)));
    lines
}

/// Lines up to the first one that contains `part`.
fn until(lines: &Receiver<String>, part: &str) -> Vec<String> {
    let mut found = Vec::new();
    while found.last().is_none_or(|line: &String| !line.contains(part)) {
        let line = lines.recv_timeout(PATIENCE);
        found.push(line.unwrap_or_else(|error| panic!("{error}: no `{part}` in {found:?}")));
    }
    found
}

fn json_lines(bytes: &[u8]) -> Vec<Value> {
    text(bytes).lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[test]
fn gaps_clipping_and_stalls_are_told_while_they_happen() {
    let desk = Desk::with_model();
    ["a", "b"].iter().for_each(|name| fifo(&desk, name));
    let inputs = ["--input", "a", "--input", "b", "--gaps", "--output-format", "s16le"];
    let reported = ["--report", "report", "--json"];
    let mut child = desk.spawn(&[&["stream", "bank.json"], &inputs[..], &reported].concat());
    let said = lines(&mut child);
    // Multiples of 2^-9, so that 16 bits hold every sum of the small ones; the large ones clip.
    let (mut a, mut b) = (vec![1.0 / 512.0; 90], vec![-1.0 / 512.0; 90]);
    a[3] = f32::NAN;
    b[60..65].fill(f32::NAN);
    a[8] = 1.0;
    let (mut first, mut second) = (writer(&desk, "a"), writer(&desk, "b"));
    first.write_all(&bytes(&a)).unwrap();
    // Estimates look 24 frames ahead.
    second.write_all(&bytes(&b[..50])).unwrap();
    let mut lines: Vec<String> = (0..3).map(|_| said.recv_timeout(PATIENCE).unwrap()).collect();
    lines.sort();
    // Taps 2, 3 and 4 times 1 saturate; with tap 1 the other samples keep the sum below 1.
    assert!(lines[0].starts_with("hybank: clipped: 3 of the output samples"), "{lines:?}");
    assert!(lines[1].starts_with("hybank: gap: channel 1, sample 3, 1 missing, SNR "), "{lines:?}");
    assert_eq!(lines[2], "hybank: waiting for channel 2 (b)");
    // The report can be read before the end.
    let events: Vec<_> = json_lines(&desk.read("report"));
    let of = |kind: &str| events.iter().find(|event| event["event"] == kind).unwrap();
    assert_eq!((of("gap")["channel"].as_u64(), of("gap")["first"].as_u64()), (Some(1), Some(3)));
    assert_eq!((of("clipped")["samples"].as_u64(), &of("stall")["channels"]), (Some(3), &json!([2, 2])));
    second.write_all(&bytes(&b[50..])).unwrap();
    until(&said, "channel 2 (b) goes on after");
    drop((first, second));
    let mut samples = Vec::new();
    child.stdout.take().unwrap().read_to_end(&mut samples).unwrap();
    assert!(child.wait().unwrap().success());
    let zero = |x: &f32| if x.is_nan() { 0.0 } else { *x };
    let whole: Vec<f32> = interleaved(&a, &b).iter().map(zero).collect();
    let want: Vec<i16> =
        fused(&whole).iter().map(|y| (y * 32768.0).clamp(-32768.0, 32767.0) as i16).collect();
    let got: Vec<i16> = samples.chunks_exact(2).map(|b| i16::from_le_bytes([b[0], b[1]])).collect();
    // The four taps of a filter touch two frames.
    let is_whole = |k: usize| !(3..5).contains(&(k / 2)) && !(60..66).contains(&(k / 2));
    assert!(got.len() == want.len() && (0..got.len()).all(|k| !is_whole(k) || got[k] == want[k]));
    // Samples have standard output, so the JSON object is on standard error; the report ends with the same.
    let rest: Vec<String> = said.iter().collect();
    assert!(rest.iter().any(|line| line.contains("gap: 2 in all, 6 samples missing")), "{rest:?}");
    let printed: Value = serde_json::from_str(rest.last().unwrap()).unwrap();
    let events = json_lines(&desk.read("report"));
    let summary = events.last().unwrap();
    assert_eq!((summary["event"].as_str(), summary["samples"].as_u64()), (Some("summary"), Some(180)));
    for key in ["samples", "clipped", "gaps", "warnings", "plan", "frames"] {
        assert_eq!(summary[key], printed[key], "{key}");
    }
    assert_eq!(events.iter().filter(|event| event["event"] == "gap").count(), 2);
}

#[test]
fn an_output_may_be_a_fifo() {
    let desk = Desk::new();
    fifo(&desk, "out.wav");
    let (a, b) = (channel(&frames(300), 0), channel(&frames(300), 1));
    wav::write_pair(&desk, &a, &b);
    let fuse = ["fuse", "bank.json", "a.wav", "b.wav", "--keep-latency", "-o"];
    let child = desk.spawn(&[&fuse[..], &["out.wav", "--json"]].concat());
    let bytes = std::fs::read(desk.path("out.wav")).unwrap();
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");
    // Standard output is free for the report; a pipe's header knows no length.
    assert_eq!(serde_json::from_slice::<Value>(&output.stdout).unwrap()["samples"], 600);
    assert_eq!((&bytes[40..44], floats(&bytes[44..])), (&[0xFF; 4][..], fused(&frames(300))));
    assert!(desk.path("out.wav").metadata().unwrap().len() == 0, "the FIFO is still there");
    desk.refused(2, &[&fuse[..], &["out.wav", "--measure"]].concat(), &["out.wav", "once more"]);
    // A reader that has seen enough ends the run quietly.
    let child = desk.spawn(&["stream", "bank.json", "--input", "/dev/zero", "-o", "out.wav"]);
    File::open(desk.path("out.wav")).unwrap().read_exact(&mut [0; 100]).unwrap();
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");
}

#[test]
fn reports_are_replaced_only_by_force_and_tell_of_failures() {
    let desk = Desk::new();
    wav::write_pair(&desk, &[0.5; 9], &[0.5; 7]);
    let fuse = ["fuse", "bank.json", "a.wav", "b.wav", "-o", "out.wav", "--report"];
    desk.write("report", "precious");
    desk.refused(1, &[&fuse[..], &["report"]].concat(), &["report: the file exists", "--force"]);
    desk.refused(1, &[&fuse[..], &["a.wav", "--force"]].concat(), &["a.wav", "also the input"]);
    desk.refused(1, &[&fuse[..], &["out.wav"]].concat(), &["same file"]);
    desk.refused(2, &[&fuse[..], &["-", "--json"]].concat(), &["--report -", "--json"]);
    desk.refused(2, &["stream", "bank.json", "--report", "-"], &["--report -", "--output"]);
    let output = desk.run(&[&fuse[..], &["report", "--strict", "--force"]].concat(), &[]);
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{message}");
    let last = json_lines(&desk.read("report")).pop().unwrap();
    assert_eq!(last["event"], "error");
    assert_eq!(format!("hybank: {}\n", last["message"].as_str().unwrap()), message);
    let output = desk.run(&[&fuse[..], &["-"]].concat(), &[]);
    assert_eq!(json_lines(&output.stdout).last().unwrap()["event"], "summary");
}
