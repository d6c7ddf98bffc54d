//! How long `hybank fuse` takes for a recording on file: ten minutes of two 24 kHz channels of 32-bit floats
//! through 24 taps. One hour is six times that.
//!
//! `cargo bench --bench fuse_time`; set TMPDIR to a folder in memory to leave the disk out.

use trials::random;
#[path = "../../benches/stopwatch/mod.rs"]
mod stopwatch;

use random::Random;
use std::path::Path;
use std::process::Command;

const RATE: u32 = 24_000;
const SECONDS: usize = 600;

fn write_channel(path: &Path, seed: u64) {
    let mut random = Random(seed);
    let second: Vec<f32> = (0..RATE).map(|_| 0.5 * random.sample() as f32).collect();
    let sample_format = hound::SampleFormat::Float;
    let spec = hound::WavSpec { channels: 1, sample_rate: RATE, bits_per_sample: 32, sample_format };
    let mut wav = hound::WavWriter::create(path, spec).unwrap();
    (0..SECONDS).flat_map(|_| &second).for_each(|&sample| wav.write_sample(sample).unwrap());
    wav.finalize().unwrap();
}

fn main() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    write_channel(&path("ch1.wav"), 1);
    write_channel(&path("ch2.wav"), 2);
    let median = stopwatch::time("ten minutes of 2 x 24 kHz float WAV", || {
        let status = Command::new(env!("CARGO_BIN_EXE_hybank"))
            .args(["fuse", concat!(env!("CARGO_MANIFEST_DIR"), "/../filters/speech-2x.json")])
            .args([path("ch1.wav"), path("ch2.wav")])
            .args(["--force", "-o"])
            .arg(path("fused.wav"))
            .status()
            .unwrap();
        assert!(status.success());
    });
    let samples = 2 * RATE as usize * SECONDS;
    println!("{:.0} million fast samples per second", samples as f64 / median.as_secs_f64() / 1e6);
}
