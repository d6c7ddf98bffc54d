//! What the way in and out costs: `hybank stream` and `hybank fuse` beside `cat | cat` and sox on the same
//! bytes in the same run, and how long the first output takes when frames come one by one.
//!
//! `cargo bench --bench pipe_overhead`; set TMPDIR to a folder in memory to leave the disk out. Bank A: N =
//! M = 2, 24 taps.

use trials::random;

use random::Random;
use std::fs::File;
use std::io::{Read, Write};
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// Bytes of a recording.
const BYTES: usize = 512 << 20;
/// The best of so many.
const REPEATS: usize = 7;

fn main() {
    // `cargo test --benches` runs this too; it wants no figures.
    if !std::env::args().any(|arg| arg == "--bench") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    write_inputs(folder.path());
    let table = Table { folder: folder.path() };
    pipes(&table);
    files(&table);
    latency(folder.path());
}

fn write_inputs(folder: &Path) {
    let mut random = Random(1);
    let block: Vec<f32> = (0..1 << 18).map(|_| 0.5 * random.sample() as f32).collect();
    let floats: Vec<u8> = block.iter().flat_map(|x| x.to_le_bytes()).collect();
    let mut raw = File::create(folder.join("in.f32")).unwrap();
    (0..BYTES / floats.len()).for_each(|_| raw.write_all(&floats).unwrap());
    let sample_format = hound::SampleFormat::Int;
    let spec = hound::WavSpec { channels: 2, sample_rate: 24_000, bits_per_sample: 16, sample_format };
    let mut wav = hound::WavWriter::create(folder.join("in.wav"), spec).unwrap();
    for _ in 0..BYTES / 8 / block.len() {
        block.iter().for_each(|x| wav.write_sample((x * 32768.0) as i16).unwrap());
    }
    wav.finalize().unwrap();
    std::fs::write(folder.join("bank.json"), bank()).unwrap();
}

fn bank() -> String {
    let taps = |i: usize| {
        let taps: Vec<_> =
            (0..24).map(|t| format!("{}", ((t * 7 + i * 3) % 11) as f64 / 88.0 - 0.06)).collect();
        format!(r#"{{ "delay": 0.0, "taps": [{}] }}"#, taps.join(", "))
    };
    format!(
        r#"{{ "format": "hybank-bank", "version": 1, "spec": null, "fast_period": 1.0, "ratio": 2, "latency": 11,
        "method": "fir", "channels": [{}, {}], "state_space": null,
        "gamma": {{ "upper": null, "lower": null, "noncausal": null }} }}"#,
        taps(0),
        taps(1)
    )
}

/// Shell lines in a folder, timed.
struct Table<'a> {
    folder: &'a Path,
}

impl Table<'_> {
    /// Prints and returns the best time of a line; `$hybank` is the binary, `bytes` what goes through.
    fn row(&self, name: &str, line: &str, bytes: usize, yardstick: Option<f64>) -> f64 {
        let best = (0..REPEATS).map(|_| self.seconds(line)).fold(f64::INFINITY, f64::min);
        let share = yardstick.map_or(String::new(), |yardstick| format!("{:8.2}", yardstick / best));
        println!("{name:58} {:8.0} MB/s {share}", bytes as f64 / best / 1e6);
        best
    }

    fn seconds(&self, line: &str) -> f64 {
        let mut shell = Command::new("sh");
        shell.current_dir(self.folder).args(["-c", line]).env("hybank", env!("CARGO_BIN_EXE_hybank"));
        let begin = Instant::now();
        assert!(shell.status().unwrap().success(), "{line}");
        begin.elapsed().as_secs_f64()
    }
}

fn pipes(table: &Table) {
    println!("{:58} {:>13} {:>8}", "f32 through pipes (bytes in)", "", "of cat");
    let row = |name, line, yardstick| table.row(name, line, BYTES, yardstick);
    let one = row("cat in | cat > /dev/null", "cat in.f32 | cat > /dev/null", None);
    row("cat in | hybank stream > /dev/null", "cat in.f32 | $hybank stream bank.json > /dev/null", Some(one));
    let two = row("cat in | cat | cat > /dev/null", "cat in.f32 | cat | cat > /dev/null", None);
    row(
        "cat in | hybank stream | cat > /dev/null",
        "cat in.f32 | $hybank stream bank.json | cat > /dev/null",
        Some(two),
    );
    row("the same with --gaps", "cat in.f32 | $hybank stream bank.json --gaps | cat > /dev/null", Some(two));
}

fn files(table: &Table) {
    let bytes = BYTES / 4;
    println!("\n{:58} {:>13} {:>8}", "16-bit WAV file to float WAV (bytes in)", "", "of sox");
    let has_sox = Command::new("sox").arg("--version").stdout(Stdio::null()).status().is_ok();
    if !has_sox {
        println!("sox is not installed");
    }
    let beside_sox = |to: &str, sox: &str, fuse: &[(&str, &str)]| {
        let name = format!("sox, conversion only, to a {to}");
        let yardstick = has_sox.then(|| table.row(&name, sox, bytes, None));
        for (name, line) in fuse {
            table.row(&format!("hybank fuse, {name}, to a {to}"), line, bytes, yardstick);
        }
    };
    beside_sox(
        "pipe",
        "sox in.wav -e floating-point -b 32 -t wav - | cat > /dev/null",
        &[("with the filters", "$hybank fuse bank.json in.wav -o - | cat > /dev/null")],
    );
    // Both begin with no file: a new one is cheaper where an old one has just been given up.
    beside_sox(
        "file",
        "rm -f out.wav; sox in.wav -e floating-point -b 32 out.wav",
        &[
            ("with the filters", "rm -f out.wav; $hybank fuse bank.json in.wav -o out.wav"),
            ("16 bits out", "rm -f out.wav; $hybank fuse bank.json in.wav -o out.wav --bits 16"),
        ],
    );
}

/// One frame at a time, a thousand per second: from writing its inputs to reading its outputs.
fn latency(folder: &Path) {
    const PERIOD: Duration = Duration::from_millis(1);
    const FRAMES: u32 = 3000;
    let mut child = Command::new(env!("CARGO_BIN_EXE_hybank"))
        .current_dir(folder)
        .args(["stream", "bank.json"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let (mut stdin, mut stdout) = (child.stdin.take().unwrap(), child.stdout.take().unwrap());
    // Reading the bank is not what is asked here.
    sleep(200 * PERIOD);
    let begin = Instant::now();
    let mut waits = Vec::new();
    for k in 0..FRAMES {
        sleep((begin + k * PERIOD).saturating_duration_since(Instant::now()));
        let sent = Instant::now();
        stdin.write_all(&[0; 8]).unwrap();
        stdout.read_exact(&mut [0; 8]).unwrap();
        waits.push(sent.elapsed().as_secs_f64() / PERIOD.as_secs_f64());
    }
    drop(stdin);
    assert!(child.wait().unwrap().success());
    let first = waits[0];
    waits.sort_by(f64::total_cmp);
    let (median, late, most) =
        (waits[waits.len() / 2], waits[waits.len() * 99 / 100], waits[waits.len() - 1]);
    println!("\nframe periods from input to output at 1,000 frames/s: first {first:.3}, median {median:.3},");
    println!("99 of 100 below {late:.3}, most {most:.3}");
}
