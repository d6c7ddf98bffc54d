//! WAV files, written and read by a crate that is not ours.

#[path = "../../../tests/support/wav_file.rs"]
mod wav_file;

use super::Desk;
use hound::{SampleFormat, WavSpec, WavWriter};
pub(crate) use wav_file::read;

pub(crate) fn write(desk: &Desk, name: &str, channels: u16, sample_rate: u32, samples: &[f32]) {
    let spec = WavSpec { channels, sample_rate, bits_per_sample: 32, sample_format: SampleFormat::Float };
    write_all(desk, name, spec, samples);
}

/// Two channels of integers of so many bits.
pub(crate) fn write_integers(desk: &Desk, name: &str, bits_per_sample: u16, samples: &[i32]) {
    let (channels, sample_format) = (2, SampleFormat::Int);
    write_all(desk, name, WavSpec { channels, sample_rate: 8000, bits_per_sample, sample_format }, samples);
}

fn write_all<S: hound::Sample + Copy>(desk: &Desk, name: &str, spec: WavSpec, samples: &[S]) {
    let mut writer = WavWriter::create(desk.path(name), spec).unwrap();
    samples.iter().for_each(|&x| writer.write_sample(x).unwrap());
    writer.finalize().unwrap();
}

/// What samples are against those wanted, without `skip` of them at either end, dB.
pub(crate) fn snr_db(got: &[f32], wanted: &[f32], skip: usize) -> f64 {
    assert_eq!(got.len(), wanted.len());
    let judged = skip..wanted.len() - skip;
    let power: f64 = judged.clone().map(|n| f64::from(wanted[n]).powi(2)).sum();
    let error: f64 = judged.map(|n| f64::from(got[n] - wanted[n]).powi(2)).sum();
    10.0 * (power / error).log10()
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
