//! The thesis example; a folder in which the program works, and the definition of what its small bank does.
// Each test program uses a part of it.
#![allow(dead_code, unused_imports)]

pub(crate) mod blocked;
mod desk;
pub(crate) mod forgery;
pub(crate) use trials::random;
pub(crate) mod schema;
pub(crate) mod sweep;
pub(crate) mod wav;

pub(crate) use desk::{Desk, names};

use hybank::bank::{Bank, SynthesisFilters};
use hybank::spec::Spec;
use hybank::units::Seconds;
use serde_json::Value;

/// The thesis example as an FIR bank.
pub(crate) const THESIS: &str = "\
fast_period = 1.0
ratio = 2
latency = 10
[target]
filter = { num = [0.25], den = [1.0, 1.0, 0.25] }
[[channel]]
delay = 1.2
[[channel]]
delay = 0.6
[design]
method = \"fir\"
taps = 22
";

/// N = M = 2, m0 = 3.
pub(crate) const TAPS: [&[f32]; 2] = [&[1.0, 2.0, 3.0, 4.0], &[10.0, 20.0, 30.0, 0.0]];

/// A bank of these taps for h = 1 after Butterworth filters of order 2, each channel with its delay.
pub(crate) fn modelled(taps: Vec<Vec<f64>>, delays: &[f64], ratio: usize, latency: usize) -> Bank {
    let channels: Vec<String> = delays.iter().map(|delay| format!("{{ delay = {delay} }}")).collect();
    let text = format!(
        "fast_period = 1.0\nratio = {ratio}\nlatency = {latency}\nchannel = [{}]\n\
         target.filter = {{ family = \"butterworth\", order = 2, cutoff = 0.4 }}\ndesign.taps = {}\n",
        channels.join(", "),
        taps[0].len()
    );
    let spec = Some(Spec::from_toml(&text, "spec.toml").unwrap());
    let delays = delays.iter().copied().map(Seconds).collect();
    Bank { spec, latency, delays, ..Bank::bare(SynthesisFilters::Fir(taps), ratio) }
}

/// The signals of Ctrl-C, of supervisors, of terminals that go, and of Ctrl-\\.
pub(crate) const INT: u32 = 2;
pub(crate) const TERM: u32 = 15;
const HUP: u32 = 1;
const QUIT: u32 = 3;

/// Signals that end a run, without those that this process ignores, as under `nohup`: the runs that it
/// starts ignore them too.
pub(crate) fn ending_signals() -> impl Iterator<Item = u32> {
    let ignored = signals_of("self", "SigIgn:").unwrap_or(0);
    [INT, TERM, HUP, QUIT]
        .into_iter()
        .filter(move |&signal| signal != HUP || ignored >> (signal - 1) & 1 == 0)
}

/// Waits until the process handles `signal`.
#[cfg(target_os = "linux")]
pub(crate) fn until_caught(process: u32, signal: u32) {
    while signals_of(&process.to_string(), "SigCgt:").unwrap() >> (signal - 1) & 1 == 0 {
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
}

/// Sends `signal` to the process.
pub(crate) fn send(process: u32, signal: u32) {
    let signal = signal.to_string();
    let kill = std::process::Command::new("kill").args(["-s", &signal, &process.to_string()]).status();
    assert!(kill.unwrap().success());
}

/// The mask of signals that `/proc` shows for the process under this key.
fn signals_of(process: &str, key: &str) -> Option<u64> {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let mask = status.lines().find_map(|line| line.strip_prefix(key))?;
    u64::from_str_radix(mask.trim(), 16).ok()
}

/// A file or folder of the repository.
pub(crate) fn repository(path: &str) -> std::path::PathBuf {
    std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/..")).join(path)
}

/// The words of a command line.
pub(crate) fn words(line: &str) -> Vec<&str> {
    line.split(' ').collect()
}

/// What a program printed.
pub(crate) fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// Small integers, so that every sum is exact in any order and precision.
pub(crate) fn frames(count: usize) -> Vec<f32> {
    (0..2 * count).map(|i| ((i * 7) % 23) as f32 - 11.0).collect()
}

/// Channel i of interleaved frames.
pub(crate) fn channel(frames: &[f32], i: usize) -> Vec<f32> {
    frames.iter().skip(i).step_by(2).copied().collect()
}

/// Frames of two channels.
pub(crate) fn interleaved(a: &[f32], b: &[f32]) -> Vec<f32> {
    a.iter().zip(b).flat_map(|(&a, &b)| [a, b]).collect()
}

pub(crate) fn bytes(samples: &[f32]) -> Vec<u8> {
    samples.iter().flat_map(|x| x.to_le_bytes()).collect()
}

pub(crate) fn floats(bytes: &[u8]) -> Vec<f32> {
    bytes.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect()
}

/// The definition: y[2k + p] = sum_i sum_j f_i[p + 2j] x_i[k - j].
pub(crate) fn fused(x: &[f32]) -> Vec<f32> {
    let sample = |t: usize, i: usize, f: &[f32]| -> f32 {
        (t % 2..f.len().min(t + 1)).step_by(2).map(|n| f[n] * x[t - n + i]).sum()
    };
    (0..x.len()).map(|t| TAPS.iter().enumerate().map(|(i, f)| sample(t, i, f)).sum()).collect()
}

/// The number at a JSON pointer.
pub(crate) fn number(value: &Value, pointer: &str) -> f64 {
    let number = value.pointer(pointer).and_then(Value::as_f64);
    number.unwrap_or_else(|| panic!("{pointer} is no number in {value}"))
}
