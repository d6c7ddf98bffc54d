//! Foreign text in every kind of input: whatever a message quotes, no control character reaches the
//! terminal, no line is forged, and a message has at most a few kilobytes.

use crate::support::{Desk, THESIS};
use hybank::messages::printable;

/// Clears the screen, turns text around, and begins a line that looks like one of the program.
const HOSTILE: &str = "\u{1b}[2J\u{9b}31m\u{202e}\u{7}\r\nhybank: forged";
/// Most bytes that a run may say.
const MOST: usize = 8 << 10;
/// A number of more digits than a quoted text may have is printed with an exponent.
const MOST_DIGITS: usize = 200;

/// A file with foreign text, and the run that reads it.
struct Case {
    file: &'static str,
    content: Vec<u8>,
    run: &'static str,
}

fn case(file: &'static str, content: impl Into<Vec<u8>>, run: &'static str) -> Case {
    Case { file, content: content.into(), run }
}

/// `text` as a text of TOML or JSON.
fn quoted(text: &str) -> String {
    serde_json::to_string(text).unwrap().replace('\u{9b}', "\\u009b")
}

fn specs(text: &str) -> Vec<Case> {
    let quoted = quoted(text);
    let spec = |from: &str, to: &str| case("spec.toml", THESIS.replacen(from, to, 1), DESIGN);
    const DESIGN: &str = "design spec.toml -o out.json";
    vec![
        spec("ratio = 2", &format!("ratio = 2\n{quoted} = 3")),
        spec("method = \"fir\"", &format!("method = {quoted}")),
        spec("delay = 0.6", &format!("delay = {quoted}")),
        spec("delay = 0.6", &format!("delay = 0.6\nfilter = {{ {quoted} = 1 }}")),
        spec("delay = 0.6", &format!("delay = 0.6\nfilter = {{ touchstone = {quoted}, order = 2 }}")),
        spec("ratio = 2", &format!("ratio = 2\nname = {quoted}\nlatency = 7")),
        spec("ratio = 2", &format!("ratio = 2\n{quoted} = 1\n{quoted} = 2")),
        spec("ratio = 2", &format!("ratio = {text}")),
        spec("fast_period = 1.0", &format!("name = {quoted}\nfast_period = 1.0")),
        case("spec.toml", text, DESIGN),
    ]
}

fn banks(desk: &Desk, text: &str) -> Vec<Case> {
    let (quoted, bank) = (quoted(text), String::from_utf8(desk.read("bank.json")).unwrap());
    let bank = |from: &str, to: &str| {
        assert!(bank.contains(from), "{from}");
        case("bank.json", bank.replacen(from, to, 1), "analyze bank.json")
    };
    vec![
        bank("\"hybank-bank\"", &quoted),
        bank("\"fir\"", &quoted),
        bank("\"ratio\": 2", &format!("\"ratio\": {quoted}")),
        bank("\"ratio\": 2", &format!("\"ratio\": 2, {quoted}: 1")),
        bank("\"ratio\": 2", &format!("\"ratio\": 2, {quoted}: 1, {quoted}: 2")),
        bank("\"ratio\": 2", &format!("\"ratio\": 2, \"digest\": {quoted}")),
        bank("\"ratio\": 2", &format!("\"ratio\": 2, \"meta\": {text}")),
    ]
}

fn recordings(text: &str) -> Vec<Case> {
    let (cell, json) = (text.replace(['\r', '\n'], " "), quoted(text));
    let meta = |more: &str| {
        let text =
            format!("{{\"global\": {{\"core:datatype\": \"rf32_le\", \"core:num_channels\": 2{more}}}}}");
        case("both.sigmf-meta", text, "fuse bank.json both.sigmf-meta -o out.wav")
    };
    let npy = |header: String| {
        let header = header.into_bytes();
        let length = (header.len() as u32).to_le_bytes();
        let bytes = [&b"\x93NUMPY\x02\x00"[..], &length, &header].concat();
        case("rows.npy", bytes, "fuse bank.json rows.npy -o out.wav")
    };
    let wav = |bytes: &[u8]| case("a.wav", bytes, "fuse bank.json a.wav b.wav -o out.wav");
    let lost = |line: String| case("lost", line, "fuse bank.json a.wav b.wav --gaps --lost lost -o out.wav");
    let table = |text: String| case("both.csv", text, "fuse bank.json both.csv -o out.wav");
    vec![
        table(format!("time,{cell},b\n0,1,2\n1,{cell},4\n")),
        table(format!("1,2\n{cell}\n")),
        case("taps.csv", format!("1,2\n3,{cell}\n"), "import spec.toml taps.csv -o out.json"),
        meta(&format!(", \"core:sample_rate\": {json}")),
        meta(&format!(", \"core:dataset\": {json}")),
        meta(&format!(", \"core:extensions\": [{{\"name\": {json}, \"optional\": false}}]")),
        meta(&format!(", \"core:sample_rate\": 1, \"core:sample_rate\": 2, {json}: {text}")),
        case(
            "both.sigmf-meta",
            format!("{{\"global\": {{\"core:datatype\": {json}}}}}"),
            "stream bank.json --input both.sigmf-meta -o out",
        ),
        npy(format!("{{'descr': '{text}', 'fortran_order': False, 'shape': (2, 4), }}")),
        npy(format!("{{'descr': '<f4', 'fortran_order': False, 'shape': (2, {text}), }}")),
        npy(format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({}), }}", "1, ".repeat(20_000))),
        wav(&text.as_bytes()[..16.min(text.len())]),
        wav(&[b"RIFF\x24\0\0\0".as_slice(), text.as_bytes()].concat()),
        lost(format!("{{{json}: 1}}")),
        lost(format!("{{\"first\": {json}, \"length\": 1}}")),
        lost(text.to_owned()),
        case("low.s2p", format!("# GHz S MA\n1 2 {text}\n"), "design measured.toml -o out.json"),
        case("low.s2p", format!("# {text}\n1 2 3\n"), "design measured.toml -o out.json"),
        case("bode.csv", format!("{text}\n1,2,3\n"), "design bode.toml -o out.json"),
    ]
}

/// What a run says on standard error, and on standard output where it prints text.
fn said(desk: &Desk, args: &[&str]) -> String {
    let output = desk.run(args, b"");
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(matches!(output.status.code(), Some(0..=2)), "{args:?}: {}", &stderr[..stderr.len().min(MOST)]);
    assert!(!stderr.contains("panicked"), "{args:?}: {stderr}");
    stderr + &String::from_utf8(output.stdout).unwrap()
}

/// Checks what was said, on whatever occasion; gives whether anything was.
fn check(said: &str, what: &str) -> bool {
    let shown: String = said.chars().take(MOST).collect();
    assert!(said.len() <= MOST, "{what}: {} bytes: {shown}", said.len());
    assert_eq!(printable(said), said, "{what}");
    assert!(said.lines().all(|line| !line.starts_with("hybank: forged")), "{what}: {shown}");
    let longest = said.split(|c: char| !c.is_ascii_digit()).map(str::len).max();
    assert!(longest.is_none_or(|digits| digits <= MOST_DIGITS), "{what}: {shown}");
    !said.is_empty()
}

fn desk() -> Desk {
    let desk = crate::desk();
    let filter = |filter: &str| THESIS.replacen("delay = 0.6", &format!("delay = 0.6\nfilter = {filter}"), 1);
    desk.write("measured.toml", filter("{ touchstone = \"low.s2p\", order = 2 }"));
    desk.write("bode.toml", filter("{ response = \"bode.csv\", order = 2 }"));
    desk.write("both.sigmf-data", [0u8; 160]);
    desk
}

#[test]
fn foreign_text_in_files_is_quoted_and_bounded() {
    let desk = desk();
    let long = format!("{HOSTILE}{}", "x".repeat(1 << 20));
    let mut trials = 0;
    for text in [HOSTILE, &long, &"9".repeat(5000)] {
        let mut cases = specs(text);
        cases.extend(banks(&desk, text));
        cases.extend(recordings(text));
        for Case { file, content, run } in cases {
            let before = desk.path(file).exists().then(|| desk.read(file));
            desk.write(file, &content);
            let args: Vec<&str> = run.split(' ').chain(["--force"]).filter(|_| true).collect();
            let args = if run.starts_with("analyze") { &args[..args.len() - 1] } else { &args[..] };
            let start: String = String::from_utf8_lossy(&content).chars().take(300).collect();
            check(&said(&desk, args), &format!("{run}: {start:?}"));
            match before {
                Some(before) => desk.write(file, before),
                None => std::fs::remove_file(desk.path(file)).unwrap(),
            }
            trials += 1;
        }
    }
    println!("{trials} inputs with foreign text");
}

/// Every name that a run may have, and every option that takes a value.
#[test]
fn foreign_names_and_arguments_are_quoted_and_bounded() {
    let desk = desk();
    let long = "y".repeat(50_000);
    for text in [HOSTILE, &long] {
        let toml = format!("{text}.toml");
        for args in [
            &["design", &toml, "-o", "out.json"][..],
            &["design", "spec.toml", "-o", &format!("{text}/out.json")],
            &["analyze", text],
            &["verify", text],
            &["fuse", "bank.json", text, "b.wav", "-o", "out.wav"],
            &["fuse", "bank.json", "a.wav", "b.wav", "-o", text],
            &["fuse", "bank.json", "a.wav", "b.wav", "-o", "out.wav", "--gaps", "--lost", text],
            &["fuse", "bank.json", "a.wav", "b.wav", "-o", "out.wav", "--gaps", text],
            &["stream", "bank.json", "--input", text, "-o", "out"],
            &["stream", "bank.json", "--format", text],
            &["measure", text],
            &["measure", "a.wav", "--tone", text],
            &["measure", "a.wav", "--ref", text],
            &["simulate", "spec.toml", "--source", text, "-o", "captures"],
            &["simulate", "spec.toml", "--source", &format!("step@{text}"), "-o", "captures"],
            &["simulate", "spec.toml", "--source", "step@1", "-o", "captures", "--seed", text],
            &["import", "spec.toml", text, "-o", "out.json"],
            &["calibrate", "spec.toml", text, "-o", "out.toml"],
            &["design", "spec.toml", "-o", "out.json", "--bits", text],
            &["design", "spec.toml", "-o", "out.json", "--taps", text],
            &["design", "spec.toml", "-o", "out.json", &format!("--taps={text}")],
            &["design", "spec.toml", "-o", "out.json", &format!("--{text}")],
            &["analyze", "bank.json", "--delay-box", text],
            &["analyze", "bank.json", "--delay-error", &format!("1,{text}")],
            &["export", "bank.json", "--format", "c", "--name", text, "-o", "out.h"],
            &["help", text],
            &[text],
        ] {
            // A file of such a name may be written without a word.
            check(&said(&desk, args), &format!("{:?}", &args[..args.len().min(3)]));
        }
    }
}
