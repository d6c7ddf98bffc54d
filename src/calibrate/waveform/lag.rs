//! The lag between a waveform and captures, by correlation.

use super::LEAST_FRAMES;
use crate::calibrate::error::CalibrateError;
use crate::calibrate::model::Model;
use crate::calibrate::record::Record;
use crate::linalg::{Complex, fourier};
use crate::simulate::{Instants, Recording};
use crate::units::FastPeriods;

/// Lags per fast period that are correlated.
const LAGS_PER_PERIOD: usize = 2;

/// L to half a lag: the largest correlation of a capture with the waveform.
pub(super) fn lag_of(
    model: &Model,
    record: &Record,
    recording: &Recording,
    i: usize,
) -> Result<f64, CalibrateError> {
    let ratio = model.ratio as f64;
    let frames = record.samples.len();
    let covered = (recording.duration().0 / ratio).floor() as usize;
    if frames.min(covered) < LEAST_FRAMES {
        return Err(CalibrateError::ShortOverlap { frames: frames.min(covered), needed: LEAST_FRAMES });
    }
    let capture: Vec<f64> = centred(&record.samples, &record.keep);
    let count = LAGS_PER_PERIOD * model.ratio;
    let mut best = (0.0, 0.0);
    for q in 0..count {
        let part = q as f64 / LAGS_PER_PERIOD as f64;
        let first = FastPeriods(-model.delays[i].0 - part);
        let instants = Instants { first, step: FastPeriods(ratio), count: covered };
        let template = recording.sample(&model.front_ends[i], instants);
        let (shift, height) = largest_correlation(&capture, &centred(&template, &vec![true; covered]));
        if height > best.1 {
            best = (part + ratio * shift, height);
        }
    }
    Ok(best.0)
}

/// Deviations from the mean, 0 where a sample is left out.
fn centred(samples: &[f64], keep: &[bool]) -> Vec<f64> {
    let kept = || samples.iter().zip(keep).filter(|(_, keep)| **keep).map(|(x, _)| *x);
    let mean = kept().sum::<f64>() / kept().count().max(1) as f64;
    samples.iter().zip(keep).map(|(x, &keep)| if keep { x - mean } else { 0.0 }).collect()
}

/// The shift s of the largest |sum_k x[k] y[k - s]|, and that sum.
fn largest_correlation(x: &[f64], y: &[f64]) -> (f64, f64) {
    let size = (x.len() + y.len()).next_power_of_two();
    let padded = |samples: &mut dyn Iterator<Item = f64>| {
        let mut list: Vec<Complex<f64>> = samples.map(Complex::from).collect();
        list.resize(size, Complex::ZERO);
        list
    };
    let sums =
        fourier::circular_convolution(padded(&mut x.iter().copied()), padded(&mut y.iter().rev().copied()));
    let largest = sums.iter().enumerate().max_by(|a, b| a.1.re.abs().total_cmp(&b.1.re.abs()));
    largest.map_or((0.0, 0.0), |(n, sum)| (n as f64 - (y.len() - 1) as f64, sum.re.abs()))
}
