//! Damaged inputs of the program: an answer or one message, never a crash and never without end.

use crate::parsers::damage;
use crate::support::random::Random;
use crate::support::{Desk, THESIS, names, text};
use std::io::Read;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use trials::rounds;

/// More than any of these runs takes.
const PATIENCE: Duration = Duration::from_secs(60);

/// The file that is damaged, and the run that reads it.
const RUNS: [(&str, &str); 10] = [
    ("bank.json", "fuse bank.json a.wav b.wav -o out.wav --force"),
    ("designed.json", "verify designed.json"),
    ("designed.json", "analyze designed.json"),
    ("spec.toml", "simulate spec.toml --source step@3 --samples 50 -o captures --force"),
    ("a.wav", "fuse bank.json a.wav b.wav -o out.wav --force --gaps"),
    ("both.sigmf-meta", "stream bank.json --input both.sigmf-meta --gaps -o out --force"),
    ("both.sigmf-data", "stream bank.json --input both.sigmf-meta --gaps -o out --force"),
    ("both.csv", "fuse bank.json both.csv -o out.wav --force"),
    ("rows.npy", "fuse bank.json rows.npy -o out.wav --force"),
    ("lost", "stream bank.json --input raw --gaps --lost lost -o out --force"),
];

const META: &str = r#"{ "global": { "core:datatype": "rf32_le", "core:num_channels": 2, "core:version": "1.0.0" },
    "captures": [{ "core:sample_start": 0, "core:global_index": 7 }, { "core:sample_start": 9, "core:global_index": 30 }] }"#;
const LOST: &str = r#"{"sample_start": 0, "global_index": 3}
{"sample_start": 5, "global_index": 12}
{"channel": 2, "first": 4, "length": 3}
"#;

fn desk() -> Desk {
    let desk = crate::desk();
    desk.write("spec.toml", THESIS);
    desk.report(&["design", "spec.toml", "-o", "designed.json"]);
    let raw: Vec<u8> = (0..320u32).map(|i| (i * 37 % 251) as u8).collect();
    desk.write("raw", &raw);
    desk.write("both.sigmf-data", &raw);
    desk.write("both.sigmf-meta", META);
    desk.write("lost", LOST);
    desk.write("both.csv", "time,a,b\n0.0,1,2\n0.5,,4\n1.0,5,6\n");
    let header =
        "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 40), }".to_owned() + &" ".repeat(55) + "\n";
    let header =
        [&b"\x93NUMPY\x01\x00"[..], &(header.len() as u16).to_le_bytes(), header.as_bytes()].concat();
    desk.write("rows.npy", [header, raw].concat());
    desk
}

/// The exit code and the message of a run. Its stderr is read while it runs: a full pipe would hold it up.
fn waited(mut child: Child, what: &str) -> (Option<i32>, String) {
    let mut stderr = child.stderr.take().unwrap();
    let reader = std::thread::spawn(move || {
        let mut message = Vec::new();
        stderr.read_to_end(&mut message).unwrap();
        text(&message)
    });
    let begin = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if begin.elapsed() > PATIENCE {
            child.kill().unwrap();
            panic!("{what} does not end");
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    (child.wait().unwrap().code(), reader.join().unwrap())
}

#[test]
fn damaged_inputs_give_an_answer_or_one_message() {
    let desk = desk();
    let mut dice = Random(40_979);
    for (file, line) in RUNS {
        let whole = desk.read(file);
        let (mut answered, mut refused) = (0, 0);
        for trial in 0..rounds(12) {
            let damaged = if trial == 0 { whole.clone() } else { damage(&mut dice, &whole) };
            desk.write(file, &damaged);
            let what = || format!("{line}, {file}: {}", String::from_utf8_lossy(&damaged));
            let mut command = Command::new(env!("CARGO_BIN_EXE_hybank"));
            command.current_dir(desk.path("")).args(line.split(' '));
            let child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
            let (code, message) = waited(child, &what());
            match code {
                Some(0) => answered += 1,
                Some(1 | 2) => {
                    refused += 1;
                    assert!(message.starts_with("hybank: "), "{}: {message}", what());
                }
                _ => panic!("{}: {code:?} {message}", what()),
            }
            assert!(!message.contains("panicked"), "{}: {message}", what());
            assert!(trial > 0 || code == Some(0), "{}: {message}", what());
        }
        desk.write(file, whole);
        println!("{line}: {file} damaged, {answered} answers, {refused} refusals");
    }
    assert!(names(&desk.path("")).iter().all(|name| !name.ends_with(".part")));
}
