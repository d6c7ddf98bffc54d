//! What is steady in a change of rate: a curve that is taken out of lags before a spline goes through them.
//!
//! A smoothing spline is alike everywhere, and its ends are straight. Lags of a clock whose rate changes all
//! the time contradict its ends, and those of a clock that jumps to another rate contradict it there, where
//! they are known far better than what they bend by between two readings. They would be refused.

use super::clock::ClockReading;
use crate::linalg::{Mat, PositiveFactor};
use crate::sampling::median;

/// Fewest readings whose bend is looked at, and fewest on either side of a jump.
const LEAST_READINGS: usize = 16;
const LEAST_BESIDE: usize = 4;
/// The curve leaves this share of the squares that a line leaves, or it is no bend. Of a clock that jumps to
/// another rate a polynomial leaves 6 %.
const CLEARLY_LESS: f64 = 0.02;
/// Rounds in which the interval of a jump loses a third: to a ten thousandth.
const THIRDS: usize = 24;

/// A curve over places from -1 to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Shape {
    /// A rate that is constant.
    Line,
    /// A polynomial of the third degree: a rate that changes all the time.
    Cubic,
    /// Two lines that meet here: a rate that jumps.
    Knee(f64),
}

impl Shape {
    /// The functions that it is a sum of: Legendre's polynomials, or a hinge in place of the higher ones.
    fn basis(self, x: f64) -> Vec<f64> {
        match self {
            Self::Line => vec![1.0, x],
            Self::Cubic => vec![1.0, x, 1.5 * x * x - 0.5, (2.5 * x * x - 1.5) * x],
            Self::Knee(at) => vec![1.0, x, (x - at).max(0.0)],
        }
    }
}

/// A curve through lags over the samples of a recording; 0 without coefficients.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Bend {
    middle: f64,
    half: f64,
    shape: Shape,
    coefficients: Vec<f64>,
}

/// A curve of least squares.
struct Fit {
    /// What it leaves of the squares.
    left: f64,
    shape: Shape,
    coefficients: Vec<f64>,
}

/// Lags at places from -1 to 1, with the roots of their weights.
struct WeighedLags {
    places: Vec<f64>,
    roots: Vec<f64>,
    lags: Vec<f64>,
}

impl Bend {
    /// No bend.
    pub(super) fn none() -> Self {
        Self { middle: 0.0, half: 1.0, shape: Shape::Line, coefficients: Vec::new() }
    }

    /// Of least squares through readings; 0 if they do not clearly bend.
    pub(super) fn of(readings: &[ClockReading]) -> Self {
        let samples = || readings.iter().map(|reading| reading.sample);
        let (first, last) = (samples().fold(f64::INFINITY, f64::min), samples().fold(0.0, f64::max));
        let (middle, half) = (0.5 * (first + last), 0.5 * (last - first));
        if readings.len() < LEAST_READINGS || half <= 0.0 {
            return Self::none();
        }
        let lags = WeighedLags::new(readings, |sample| (sample - middle) / half);
        let bends = [lags.fit(Shape::Cubic), lags.knee()].into_iter().flatten();
        let best = bends.min_by(|a, b| a.left.total_cmp(&b.left));
        match (lags.fit(Shape::Line), best) {
            (Some(line), Some(Fit { left, shape, coefficients })) if left < CLEARLY_LESS * line.left => {
                Self { middle, half, shape, coefficients }
            }
            _ => Self::none(),
        }
    }

    /// The value at a sample.
    pub(super) fn at(&self, sample: f64) -> f64 {
        let basis = self.shape.basis((sample - self.middle) / self.half);
        self.coefficients.iter().zip(basis).map(|(c, p)| c * p).sum()
    }
}

impl WeighedLags {
    fn new(readings: &[ClockReading], place: impl Fn(f64) -> f64) -> Self {
        // Deviations are those of few samples: none of them decides alone.
        let usual = median(readings.iter().map(|reading| reading.deviation).collect());
        let root = |one: &ClockReading| (one.deviation.powi(2) + usual * usual).sqrt().recip();
        Self {
            places: readings.iter().map(|one| place(one.sample)).collect(),
            roots: readings.iter().map(root).collect(),
            lags: readings.iter().map(|one| one.lag).collect(),
        }
    }

    fn fit(&self, shape: Shape) -> Option<Fit> {
        let rows: Vec<Vec<f64>> = self.places.iter().map(|x| shape.basis(*x)).collect();
        let basis = Mat::from_fn(rows.len(), rows[0].len(), |k, n| rows[k][n] * self.roots[k]);
        let lags = Mat::from_fn(rows.len(), 1, |k, _| self.lags[k] * self.roots[k]);
        let found = PositiveFactor::new(&basis.tr_mul(&basis)).ok()?.solve(&basis.tr_mul(&lags));
        let left = (lags - basis * &found).norm_squared();
        Some(Fit { left, shape, coefficients: found.as_slice().to_vec() })
    }

    /// The best knee: at a reading, and then between those beside it.
    fn knee(&self) -> Option<Fit> {
        let left = |at: f64| self.fit(Shape::Knee(at)).map_or(f64::INFINITY, |fit| fit.left);
        let inner = LEAST_BESIDE..self.places.len().saturating_sub(LEAST_BESIDE);
        let lefts: Vec<(usize, f64)> = inner.map(|k| (k, left(self.places[k]))).collect();
        let (best, _) = lefts.into_iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
        let (mut low, mut high) = (self.places[best - 1], self.places[best + 1]);
        for _ in 0..THIRDS {
            let third = (high - low) / 3.0;
            if left(low + third) < left(high - third) { high -= third } else { low += third }
        }
        self.fit(Shape::Knee(0.5 * (low + high)))
    }
}
