//! What is steady in a change of rate: a polynomial that is taken out of lags before a spline goes through
//! them.
//!
//! The ends of a smoothing spline are straight. Lags of a clock whose rate changes all the time contradict
//! that where they are known far better than what they bend by between two readings, and would be refused.

use super::clock::ClockReading;
use crate::linalg::{Mat, PositiveFactor};
use crate::sampling::median;

/// Coefficients of a polynomial of the third degree.
const COUNT: usize = 4;
/// Fewest readings whose bend is looked at.
const LEAST_READINGS: usize = 16;
/// The polynomial leaves this share of the squares that a line leaves, or it is no bend. Of a clock that
/// jumps to another rate it leaves 6 %.
const CLEARLY_LESS: f64 = 0.02;

/// A polynomial over the samples of a recording.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Bend {
    middle: f64,
    half: f64,
    /// Of Legendre's polynomials; none for no bend.
    coefficients: Vec<f64>,
}

impl Bend {
    /// Of least squares through readings; 0 if they do not clearly bend.
    pub(super) fn of(readings: &[ClockReading]) -> Self {
        let samples = || readings.iter().map(|reading| reading.sample);
        let (first, last) = (samples().fold(f64::INFINITY, f64::min), samples().fold(0.0, f64::max));
        let none =
            Self { middle: 0.5 * (first + last), half: 0.5 * (last - first), coefficients: Vec::new() };
        // Deviations are those of few samples: none of them decides alone.
        let usual = median(readings.iter().map(|reading| reading.deviation).collect());
        let weights: Vec<f64> =
            readings.iter().map(|one| (one.deviation.powi(2) + usual * usual).recip()).collect();
        let fitted = |count: usize| {
            let basis = Mat::from_fn(readings.len(), count, |k, n| {
                none.basis(readings[k].sample)[n] * weights[k].sqrt()
            });
            let lags = Mat::from_fn(readings.len(), 1, |k, _| readings[k].lag * weights[k].sqrt());
            let found = PositiveFactor::new(&basis.tr_mul(&basis)).ok()?.solve(&basis.tr_mul(&lags));
            let left = (lags - basis * &found).norm_squared();
            Some((left, Self { coefficients: found.as_slice().to_vec(), ..none.clone() }))
        };
        let is_enough = readings.len() >= LEAST_READINGS && none.half > 0.0;
        match (is_enough.then(|| fitted(2)).flatten(), is_enough.then(|| fitted(COUNT)).flatten()) {
            (Some((of_line, _)), Some((left, bend))) if left < CLEARLY_LESS * of_line => bend,
            _ => none,
        }
    }

    /// The value at a sample.
    pub(super) fn at(&self, sample: f64) -> f64 {
        self.coefficients.iter().zip(self.basis(sample)).map(|(c, p)| c * p).sum()
    }

    /// Legendre's polynomials.
    fn basis(&self, sample: f64) -> [f64; COUNT] {
        let x = (sample - self.middle) / self.half;
        [1.0, x, 1.5 * x * x - 0.5, (2.5 * x * x - 1.5) * x]
    }
}
