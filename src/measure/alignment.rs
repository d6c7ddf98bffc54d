//! Lag, gain and offset between a record and a reference.

use super::MeasureError;
use super::interpolate::{Interpolator, REACH};
use crate::linalg::{Mat, PositiveFactor};
use std::ops::Range;

/// Most steps of the fractional lag.
const MOST_STEPS: usize = 30;
/// The lag has settled when it moves by less than this (samples).
const SETTLED: f64 = 1e-11;
/// Fewest samples at which record and reference are compared.
const LEAST_OVERLAP: usize = 16;

/// The present lag, gain and offset.
pub(super) struct Alignment<'a> {
    pub(super) samples: &'a [f64],
    pub(super) reference: &'a [f64],
    /// The lag is whole + phase.
    pub(super) whole: i64,
    pub(super) phase: f64,
    pub(super) gain: f64,
    pub(super) offset: f64,
    /// Samples that are compared at most, and where in the record.
    most: usize,
    within: Range<usize>,
}

/// What the last step found.
pub(super) struct Settled {
    /// Of gain, offset and lag.
    pub(super) covariance: Mat,
    /// Mean square of the error.
    pub(super) error: f64,
    /// Mean square of the scaled reference.
    pub(super) signal: f64,
}

/// J'J and J'e for gain, offset and lag.
struct Normal {
    matrix: Mat,
    projection: Mat,
    /// e'e.
    squares: f64,
    /// Samples that took part.
    count: usize,
}

/// A sample at which record and reference are known.
pub(super) struct Point {
    /// Index in the record.
    pub(super) n: usize,
    /// r(n - lag).
    pub(super) value: f64,
    /// Its derivative by the lag.
    slope: f64,
    /// y - gain r - offset.
    pub(super) error: f64,
}

impl<'a> Alignment<'a> {
    pub(super) fn new(samples: &'a [f64], reference: &'a [f64], whole: i64, most: usize) -> Self {
        let within = 0..samples.len();
        Self { samples, reference, whole, phase: 0.0, gain: 1.0, offset: 0.0, most, within }
    }

    /// From now on only these samples of the record are compared.
    pub(super) fn restrict(&mut self, within: Range<usize>) {
        self.within = within;
    }

    /// The samples of the record that have a reference.
    pub(super) fn known(&self) -> Range<usize> {
        let (reach, within) = (REACH as i64, &self.within);
        let first = (self.whole + reach).max(within.start as i64);
        let last = (self.reference.len() as i64 - reach + self.whole).min(within.end as i64);
        usize::try_from(first).unwrap_or(0)..usize::try_from(last.max(first)).unwrap_or(0)
    }

    /// Those among them that are compared.
    pub(super) fn probed(&self) -> Range<usize> {
        let Range { start, end } = self.known();
        start..end.min(start.saturating_add(self.most))
    }

    /// Gauss-Newton in lag, gain and offset.
    pub(super) fn settle(&mut self) -> Result<Settled, MeasureError> {
        let start = self.whole;
        for step in 0..MOST_STEPS {
            let Normal { matrix, projection, squares, count } = self.normal_equations();
            if count < LEAST_OVERLAP {
                return Err(self.overlap(count));
            }
            let lost = |_| MeasureError::NoLag { lag: start };
            // The first step finds gain and offset alone: with a wrong gain the derivative by the lag is
            // wrong.
            let size = if step == 0 { 2 } else { 3 };
            let factor =
                PositiveFactor::new(&matrix.view((0, 0), (size, size)).into_owned()).map_err(lost)?;
            let change = factor.solve(&projection.rows(0, size).into_owned());
            self.gain += change[0];
            self.offset += change[1];
            if step == 0 {
                continue;
            }
            self.shift(change[2].clamp(-0.5, 0.5));
            if change[2].abs() < SETTLED {
                let variance = squares / (count as f64 - 3.0).max(1.0);
                let covariance = factor.solve(&Mat::identity(3, 3)) * variance;
                let signal = self.gain * self.gain * matrix[(0, 0)] / count as f64;
                return Ok(Settled { covariance, error: squares / count as f64, signal });
            }
            if (self.whole - start).abs() > 2 {
                break;
            }
        }
        Err(MeasureError::NoLag { lag: start })
    }

    fn shift(&mut self, change: f64) {
        let phase = self.phase + change;
        self.whole += phase.round() as i64;
        self.phase = phase - phase.round();
    }

    fn overlap(&self, overlap: usize) -> MeasureError {
        MeasureError::Overlap {
            samples: self.samples.len(),
            reference: self.reference.len(),
            overlap,
            lag: self.whole,
            needed: LEAST_OVERLAP + 2 * REACH,
        }
    }

    /// The samples at which both are known.
    pub(super) fn points(&self) -> impl Iterator<Item = Point> {
        let interpolator = Interpolator::new(self.phase);
        let reach = REACH as i64;
        let point = move |n: usize| {
            let begin = (n as i64 - self.whole - reach) as usize;
            let near = &self.reference[begin..=begin + 2 * REACH];
            let sum = |weights: &[f64]| near.iter().zip(weights).map(|(x, c)| x * c).sum::<f64>();
            let (value, slope) = (sum(&interpolator.values), sum(&interpolator.slopes));
            Point { n, value, slope, error: self.samples[n] - self.gain * value - self.offset }
        };
        self.probed().map(point).filter(|point| point.error.is_finite())
    }

    fn normal_equations(&self) -> Normal {
        let (mut matrix, mut projection) = (Mat::zeros(3, 3), Mat::zeros(3, 1));
        let (mut squares, mut count) = (0.0, 0);
        for point in self.points() {
            let row = [point.value, 1.0, self.gain * point.slope];
            for (i, a) in row.iter().enumerate() {
                for (j, b) in row[..=i].iter().enumerate() {
                    matrix[(i, j)] += a * b;
                }
                projection[i] += a * point.error;
            }
            squares += point.error * point.error;
            count += 1;
        }
        matrix.fill_upper_triangle_with_lower_triangle();
        Normal { matrix, projection, squares, count }
    }
}
