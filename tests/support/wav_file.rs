//! WAV files of floats, read by a crate that is not ours.

use hound::{SampleFormat, WavReader, WavSpec};
use std::path::Path;

pub(crate) fn read(path: &Path) -> (WavSpec, Vec<f32>) {
    let mut reader = WavReader::open(path).unwrap();
    let spec = reader.spec();
    let full_scale = 2f64.powi(i32::from(spec.bits_per_sample) - 1);
    let samples = match spec.sample_format {
        SampleFormat::Float => reader.samples::<f32>().map(Result::unwrap).collect(),
        SampleFormat::Int => {
            reader.samples::<i32>().map(|x| (f64::from(x.unwrap()) / full_scale) as f32).collect()
        }
    };
    (spec, samples)
}
