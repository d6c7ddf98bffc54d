//! WAV files, written and read by a crate that is not ours.

#[path = "../../../tests/support/wav_file.rs"]
mod wav_file;

use super::Desk;
use hound::{SampleFormat, WavSpec, WavWriter};
pub(crate) use wav_file::read;

pub(crate) fn write(desk: &Desk, name: &str, channels: u16, sample_rate: u32, samples: &[f32]) {
    let spec = WavSpec { channels, sample_rate, bits_per_sample: 32, sample_format: SampleFormat::Float };
    let mut writer = WavWriter::create(desk.path(name), spec).unwrap();
    samples.iter().for_each(|&x| writer.write_sample(x).unwrap());
    writer.finalize().unwrap();
}

/// Two files of one channel at 24 kHz, `a.wav` and `b.wav`.
pub(crate) fn write_pair(desk: &Desk, a: &[f32], b: &[f32]) {
    write(desk, "a.wav", 1, 24_000, a);
    write(desk, "b.wav", 1, 24_000, b);
}

/// Integers are shares of full scale.
pub(crate) fn samples(desk: &Desk, name: &str) -> Vec<f32> {
    read(&desk.path(name)).1
}
