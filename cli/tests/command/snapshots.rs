//! Help and reports, word by word. What a number says is tested elsewhere: here each is a `#`, and runs of
//! spaces are one.
//!
//! The texts lie in `snapshots/`. A test that fails leaves what is printed now in the folder of what is
//! built, and says how to accept it.

use crate::support::{Desk, THESIS, text};
use std::fs;
use std::path::Path;

/// Two audio converters.
const AUDIO: &str = "\
fast_rate = \"48 kS/s\"
ratio = 2
latency = 12
[target]
filter = { family = \"butterworth\", order = 4, cutoff = \"9 kHz\" }
[[channel]]
delay = \"25 us\"
[[channel]]
delay = \"12.5 us\"
[design]
method = \"fir\"
taps = 24
";

const COMMANDS: [&str; 19] = [
    "init",
    "design",
    "analyze",
    "verify",
    "plot",
    "report",
    "import",
    "export",
    "simulate",
    "calibrate",
    "align",
    "fuse",
    "measure",
    "stream",
    "demo",
    "completions",
    "man",
    "schema",
    "help",
];

/// Numbers as `#`, of whatever length, and runs of spaces as one.
fn redacted(text: &str) -> String {
    let mut words = String::new();
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let number = number_length(rest);
        let glued = words.ends_with(|c: char| c.is_alphanumeric() || c == '_');
        let length = match first {
            _ if number > 0 && !glued => {
                words.push('#');
                number
            }
            ' ' if words.ends_with(' ') => 1,
            _ => {
                words.push(first);
                first.len_utf8()
            }
        };
        rest = &rest[length..];
    }
    words.lines().map(str::trim_end).collect::<Vec<_>>().join("\n") + "\n"
}

/// Length of the number that a text begins with: digits, a point among them, an exponent.
fn number_length(text: &str) -> usize {
    let digits = |text: &str| text.len() - text.trim_start_matches(|c: char| c.is_ascii_digit()).len();
    let mut length = digits(text);
    if length == 0 {
        return 0;
    }
    if text[length..].starts_with('.') && digits(&text[length + 1..]) > 0 {
        length += 1 + digits(&text[length + 1..]);
    }
    let exponent = text[length..].strip_prefix('e').map(|rest| rest.strip_prefix('-').unwrap_or(rest));
    match exponent.map(|rest| (rest, digits(rest))) {
        Some((rest, count)) if count > 0 => text.len() - rest.len() + count,
        _ => length,
    }
}

fn check(name: &str, got: &str) {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
        .join("cli/tests/command/snapshots")
        .join(format!("{name}.txt"));
    let got = redacted(got);
    let known = fs::read_to_string(&path).unwrap_or_default();
    let printed = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}.txt"));
    fs::write(&printed, &got).unwrap();
    let differs = got.lines().zip(known.lines()).find(|(got, known)| got != known);
    assert!(
        got == known,
        "not what is printed now; first difference: {differs:?}; accept it by\ncp {} {}",
        printed.display(),
        path.display()
    );
}

fn printed(desk: &Desk, args: &[&str]) -> String {
    let output = desk.run(args, &[]);
    assert!(output.status.success(), "{args:?}: {output:?}");
    text(&output.stdout) + &text(&output.stderr)
}

#[test]
fn help_is_what_it_was() {
    let desk = Desk::new();
    check("help", &printed(&desk, &["--help"]));
    for command in COMMANDS {
        check(&format!("help-{command}"), &printed(&desk, &[command, "--help"]));
    }
}

#[test]
fn reports_are_what_they_were() {
    let desk = Desk::new();
    desk.write("spec.toml", THESIS);
    desk.write(
        "iir.toml",
        THESIS.replace("latency = 10", "latency = 4").replace("\"fir\"\ntaps = 22", "\"iir\""),
    );
    desk.write("robust.toml", format!("{THESIS}\n[uncertainty]\ndelay_samples = 0.1\nreference = 0\n"));
    desk.write("audio.toml", AUDIO);
    desk.write("taps.csv", "ch1,ch2\n0.1,0.2\n0.5,0.9\n0.4,-0.2\n");
    desk.write("lost.jsonl", "{\"channel\": 2, \"first\": 40, \"length\": 3}\n");
    for (name, args) in [
        ("design-fir", &["design", "spec.toml", "-o", "fir.json"][..]),
        ("design-fir-verbose", &["design", "spec.toml", "-o", "fir.json", "--verbose", "--force"]),
        ("design-bits", &["design", "spec.toml", "-o", "bits.json", "--bits", "8", "--verbose"]),
        ("design-iir", &["design", "iir.toml", "-o", "iir.json"]),
        ("design-reduced", &["design", "iir.toml", "-o", "two.json", "--order", "2", "--verbose"]),
        ("analyze", &["analyze", "fir.json"]),
        ("analyze-certify", &["analyze", "fir.json", "--certify"]),
        ("analyze-box", &["analyze", "fir.json", "--delay-box", "0.05samples", "--gain-box", "0,1%"]),
        ("design-robust", &["design", "robust.toml", "-o", "robust.json", "--verbose"]),
        ("verify-robust", &["verify", "robust.json"]),
        ("verify-fir", &["verify", "fir.json"]),
        ("verify-iir", &["verify", "iir.json"]),
        ("simulate", &["simulate", "spec.toml", "--source", "step@0.3", "-o", "cap"]),
        ("fuse", &["fuse", "fir.json", "cap/ch1.wav", "cap/ch2.wav", "-o", "y.wav"]),
        ("demo", &["demo", "-o", "shown"]),
        ("import", &["import", "spec.toml", "taps.csv", "-o", "imported.json"]),
        (
            "stream",
            &[
                "stream",
                "fir.json",
                "--input",
                "cap/ch1.wav",
                "--input",
                "cap/ch2.wav",
                "-o",
                "fast.raw",
                "--gaps",
                "hold",
                "--lost",
                "lost.jsonl",
            ],
        ),
        (
            "simulate-tones",
            &[
                "simulate",
                "audio.toml",
                "--source",
                "tones:3.1kHz,5.3kHz",
                "--samples",
                "8192",
                "--gain",
                "0.4",
                "--bits",
                "12",
                "--noise",
                "1e-4",
                "--delay-error",
                "300ns,0",
                "--offset",
                "0.01",
                "-o",
                "tones",
            ],
        ),
        (
            "calibrate",
            &[
                "calibrate",
                "audio.toml",
                "tones/ch1.wav",
                "tones/ch2.wav",
                "-o",
                "measured.toml",
                "--tone",
                "3.1kHz,5.3kHz",
                "--reference",
                "2",
            ],
        ),
        ("measure", &["measure", "tones/ch1.wav", "--tone", "3.1kHz,5.3kHz"]),
        ("measure-ref", &["measure", "tones/ch1.wav", "--ref", "tones/ch2.wav"]),
    ] {
        check(name, &printed(&desk, args));
    }
}

#[test]
fn numbers_are_redacted() {
    let text = "gamma  0.0399, 1e-9 (22 taps) f32 -3.5e10 dB. 7.\n  x2 1.2.3 e5\n";
    assert_eq!(redacted(text), "gamma #, # (# taps) f32 -# dB. #.\n x2 #.# e5\n");
}
