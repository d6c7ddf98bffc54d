//! Messages that once misled, one test each: they name what is wrong, where it is, and what to do.

use crate::support::random::Random;
use crate::support::{Desk, THESIS, wav};
use std::process::Command;

const FUSE: [&str; 6] = ["fuse", "bank.json", "a.wav", "b.wav", "-o", "out.wav"];

/// The small bank with two recordings.
fn desk() -> Desk {
    let desk = Desk::new();
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
    let said =
        desk.refused(1, &fuse(&["--gaps", "zero", "--mask", "fifo"]), &["fifo", "a device, pipe or socket"]);
    assert!(said.contains("give the name of a file") && !said.contains("`-`"), "{said}");
    desk.refused(2, &fuse(&["--gaps", "zero", "--mask", "-"]), &["--mask -", "give it a file"]);
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
fn options_about_missing_samples_need_a_policy() {
    let desk = desk();
    for (option, value) in
        [("--mask", Some("m")), ("--lost", Some("l")), ("--max-lost", Some("3")), ("--longest", None)]
    {
        let args: Vec<&str> = [option].into_iter().chain(value).collect();
        let said = desk.refused(2, &fuse(&args), &[option, "without --gaps", "hold, zero or mask"]);
        assert!(!said.contains("required arguments"), "{said}");
    }
}

/// The format of the recording did not reach the one that it is compared with.
#[test]
fn a_reference_is_read_like_the_recording() {
    let desk = Desk::empty();
    let tone: Vec<f32> = (0..4000).map(|n| (0.1 * n as f32).sin() * 0.5).collect();
    let raw: Vec<u8> = tone.iter().flat_map(|x| x.to_le_bytes()).collect();
    desk.write("a.raw", &raw);
    desk.write("b.f32", &raw);
    wav::write_pair(&desk, &tone, &tone);
    let rate = "24kHz";
    for reference in ["b.f32", "a.raw", "b.wav"] {
        let args = ["measure", "a.raw", "--format", "f32le", "--rate", rate, "--ref", reference, "--json"];
        let output = desk.run(&args, &[]);
        assert!(output.status.success(), "{reference}: {output:?}");
    }
    let said = desk.refused(1, &["measure", "b.wav", "--ref", "a.raw"], &["a.raw", "not a WAV file"]);
    assert!(said.contains("f32le"), "{said}");
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

/// It blamed latency and delays.
#[test]
fn a_box_that_is_too_wide_is_named() {
    let desk = Desk::with_spec(
        &THESIS
            .replace("fast_period = 1.0", "fast_period = 1e-5")
            .replace("delay = 1.2", "delay = 1.2e-5")
            .replace("delay = 0.6", "delay = 0.6e-5"),
    );
    desk.report(&["design", "spec.toml", "-o", "bank.json"]);
    let said = desk.refused(
        1,
        &["analyze", "bank.json", "--delay-box", "1"],
        &["--delay-box", "1 s", "1024 fast periods"],
    );
    assert!(said.contains("unit") && !said.contains("latency"), "{said}");
    // The states of its delay chains once had 300 digits.
    let args = ["analyze", "bank.json", "--delay-error", "1e300,0"];
    let said = desk.refused(1, &args, &["delay chains of", "check the unit of the delays"]);
    assert!(said.len() < 300, "{said}");
}

/// "It has 1 channels", and a rate that no file has: 249999999.99999997 Hz.
#[test]
fn what_does_not_fit_a_bank_is_counted_as_people_do() {
    let desk = desk();
    let said =
        desk.refused(1, &fuse(&["--channel", "2"]), &["a.wav: channel 2 was asked for: it has 1 channel,"]);
    assert!(!said.contains("1 channels"), "{said}");
    let bank = std::fs::read_to_string(desk.path("bank.json")).unwrap();
    let mut fast: serde_json::Value = serde_json::from_str(&bank).unwrap();
    fast["fast_period"] = (1.0 / 3e8).into();
    desk.write("fast.json", fast.to_string());
    let args = ["fuse", "fast.json", "a.wav", "b.wav", "-o", "out.wav"];
    desk.refused(1, &args, &["24000 Hz", "slow channels of 150000000 Hz"]);
}

/// So many threads of readers that the system had no memory maps left: a panic of the standard library.
#[test]
fn thousands_of_inputs_are_refused_before_any_is_opened() {
    let desk = desk();
    let many = ["none.wav"; 20_000];
    let args = [&["fuse", "bank.json", "-o", "out.wav"][..], &many].concat();
    desk.refused(1, &args, &["none.wav", "20000 inputs", "at most 1024 are read together"]);
}

/// The usage of the program did not say how inputs are given.
#[test]
fn names_after_the_bank_of_a_stream_are_inputs() {
    let desk = desk();
    desk.refused(2, &["stream", "bank.json", "a.wav", "b.wav"], &["a.wav", "--input"]);
}

/// A sample that was "NaN, beyond the range of a 32-bit float", which no gain mends, and a number "with the
/// unit \"\"".
#[test]
fn numbers_beyond_every_range_are_said_to_be_that() {
    let desk = desk();
    // The poles of this family are its form; a quotient of polynomials is zero there.
    let filter = "filter = { family = \"butterworth\", order = 4, cutoff = 0.1 }";
    desk.write("spec.toml", THESIS.replace("filter = { num = [0.25], den = [1.0, 1.0, 0.25] }", filter));
    let source = ["simulate", "spec.toml", "--source", "tones:1e300Hz", "--samples", "100", "-o", "captures"];
    desk.refused(1, &source, &["tones:1e300Hz: a captured sample is NaN, as a frequency", "use lower ones"]);
    let scale = ["fuse", "bank.json", "1.wav", "2.wav", "-o", "out.wav", "--full-scale", "1e300"];
    let said = desk.refused(2, &scale, &["\"1e300\" is out of range; write the number that is full scale"]);
    assert!(!said.contains("the unit"), "{said}");
}

/// Only the parser's words, without the line.
#[test]
fn nesting_is_refused_with_its_line() {
    let desk = desk();
    let dotted = vec!["a"; 200].join(".");
    for deep in [format!("{dotted} = 1"), format!("a = {}{}", "[".repeat(200), "]".repeat(200))] {
        desk.write("spec.toml", format!("ratio = 2\n{deep}\n"));
        desk.refused(1, &["design", "spec.toml", "-o", "out.json"], &["spec.toml:2:", "nested too deeply"]);
    }
    desk.write("deep.json", format!("{{\"format\": \"hybank-bank\",\n\"meta\": {}", "[".repeat(500)));
    desk.refused(1, &["analyze", "deep.json"], &["deep.json: line 2, column", "nested too deeply"]);
}

/// "Is a directory (os error 21)", of the metadata.
#[test]
fn a_folder_is_no_dataset() {
    let desk = desk();
    desk.write("x.sigmf-meta", r#"{"global": {"core:datatype": "rf32_le", "core:num_channels": 2}}"#);
    std::fs::create_dir(desk.path("x.sigmf-data")).unwrap();
    desk.refused(1, &["fuse", "bank.json", "x.sigmf-meta", "-o", "out.wav"], &["x.sigmf-data", "no file"]);
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

/// The message named no file, and spoke of the largest peak where only those near the tone were looked at.
#[test]
fn a_tone_that_is_not_there_is_named_with_the_recordings() {
    let desk = Desk::with_spec(THESIS);
    let mut dice = Random(7);
    let mut tone = |phase: f64| -> Vec<f32> {
        (0..4000).map(|n| (0.5 * (0.7 * f64::from(n) + phase).sin() + 1e-3 * dice.sample()) as f32).collect()
    };
    let (a, b) = (tone(0.0), tone(0.4));
    wav::write_pair(&desk, &a, &b);
    let args = ["calibrate", "spec.toml", "a.wav", "b.wav", "-o", "out.toml", "--tone", "0.01Hz"];
    desk.refused(1, &args, &["a.wav, b.wav: no tone found near 0.01 Hz", "give its frequency"]);
    desk.refused(1, &["measure", "a.wav", "--tone", "7kHz"], &["a.wav: no tone found near 7000 Hz"]);
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

/// `expected usize`, `struct SigmfMeta` and their like.
#[test]
fn errors_of_json_are_in_plain_words() {
    let desk = desk();
    let recording = ["fuse", "bank.json", "x.sigmf-meta", "-o", "out.wav"];
    for (global, words) in [
        (
            r#"{"core:datatype": "rf32_le", "core:num_channels": "two"}"#,
            "expected a whole number, zero or more, without point and exponent, found the text \"two\"",
        ),
        (r#"{"core:datatype": 3}"#, "expected a text, found 3"),
        ("{}", "the key core:datatype is missing"),
        ("3", "expected a table of keys and values, found 3"),
    ] {
        desk.write("x.sigmf-meta", format!("{{\"global\": {global}}}"));
        desk.refused(1, &recording, &["x.sigmf-meta", "line 1, column", words]);
    }
    for (text, words) in [("", "empty.json: it is empty"), ("no", "a value is missing or not one of JSON")] {
        desk.write("empty.json", text);
        desk.refused(1, &["analyze", "empty.json"], &[words]);
    }
    desk.write("x.sigmf-meta", "{\"global\": {");
    desk.refused(1, &recording, &["the text ends inside a table"]);
    for (line, words) in [
        (r#"{"first": "one", "length": 3}"#, "expected a whole number, zero or more, without point"),
        (r#"{"frist": 1, "length": 3}"#, "unknown key \"frist\"; the keys here are channel, sample_start"),
        ("[1]", "but a JSON object such as"),
    ] {
        desk.write("lost", line);
        desk.refused(1, &fuse(&["--gaps", "zero", "--lost", "lost"]), &["lost: line 1:", words]);
    }
}

/// 300 digits.
#[test]
fn large_numbers_are_written_with_an_exponent() {
    let desk = Desk::with_spec(&THESIS.replace("delay = 0.6", "delay = 1e300"));
    desk.refused(1, &["design", "spec.toml", "-o", "out.json"], &["1e300 s is out of range"]);
    desk.write("spec.toml", THESIS);
    for args in [
        &["design", "spec.toml", "-o", "out.json", "--snr", "1e300", "--method", "h2"][..],
        &["design", "spec.toml", "-o", "out.json", "--gamma-margin", "1e300"],
        &["simulate", "spec.toml", "--source", "step@1", "-o", "x", "--noise", "1e300"],
        &["simulate", "spec.toml", "--source", "step@1", "-o", "x", "--drift", "1e300"],
        &["simulate", "spec.toml", "--source", "step@1", "-o", "x", "--offset", "1e300"],
        &["simulate", "spec.toml", "--source", "step@1", "-o", "x", "--gain", "1e300"],
    ] {
        let said = desk.refused(1, args, &[]);
        let digits = said.split(|c: char| !c.is_ascii_digit()).map(str::len).max().unwrap_or(0);
        assert!(digits < 40, "{said}");
    }
}

#[test]
fn names_that_no_output_can_have_are_refused_first() {
    let desk = Desk::new();
    desk.write("file", "");
    desk.refused(
        1,
        &["plot", "none.json", "-o", "file/pictures"],
        &["file/pictures", "the name of a folder"],
    );
    desk.refused(2, &["report", "bank.json", "-o", "report.pdf"], &["report.pdf", ".html"]);
}
