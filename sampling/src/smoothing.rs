//! Smoothing splines through nonuniform samples with errors and jitter, with what is known between them.
//!
//! The function is a line plus an integrated random walk: its slope walks at random with the variance q per
//! unit of x. Given samples (x_s, f_s) of standard deviations sigma_s the most probable function minimises
//!
//! ```text
//! sum_s (f_s - J(x_s))^2 / sigma_s^2  +  (1 / q) integral J''(x)^2 dx
//! ```
//!
//! which is a cubic spline (Wahba 1978). It is the mean of what samples on both sides say of f(x), and its
//! variance is known too. sigma_s^2 is the inverse of [`Measured::weight`], so jitter counts by the slope.
//!
//! Dense samples of spacing D act over the length l = (sigma^2 D / q)^(1/4), and the variance is sigma^2 D /
//! (2 sqrt(2) l). A filter, which knows the samples of one side only, has 4 times this variance. Between two
//! exact samples at the distance T the variance is q a^2 b^2 / (3 T), a and b the distances from them.

use super::SamplingError;
use super::fit::{Fit, PosteriorCovariance};
use super::nonuniform::Measured;

/// Knots per length over which samples act.
const KNOTS_PER_LENGTH: f64 = 6.0;
/// Most knots.
const MOST_KNOTS: f64 = 2e5;
/// A spline that is smoother than one of this length over that of its samples is a line.
const LONGEST: f64 = 30.0;
/// Deviation of the best sample, over that of a walk between two knots.
const LEAST_ERROR: f64 = 1e-4;

/// A smoothing spline with its samples.
#[derive(Debug, Clone)]
pub struct SmoothingSpline {
    fit: Fit<4, 1>,
    /// By increasing position.
    samples: Vec<Measured>,
    weights: Vec<f64>,
    /// It is taken off before the fit.
    line: FittedLine,
    /// Distance of knots.
    step: f64,
    walk: f64,
}

/// The line of least squares.
#[derive(Debug, Clone, Copy)]
struct FittedLine {
    /// At the first sample.
    value: f64,
    slope: f64,
}

/// What is known of the function at one position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// f(x).
    pub value: f64,
    /// f'(x).
    pub slope: f64,
    /// Variance of f(x).
    pub variance: f64,
    /// Covariance of f(x) and f'(x).
    pub covariance: f64,
    /// Variance of f'(x).
    pub slope_variance: f64,
}

/// A sample beside what the others say of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeftOut {
    /// The absolute value of the difference.
    pub miss: f64,
    /// Its standard deviation.
    pub deviation: f64,
}

impl SmoothingSpline {
    /// Through samples in any order; `error` and `jitter` are their standard deviations, and `walk` is the
    /// variance by which the slope walks per unit of x.
    ///
    /// # Errors
    /// [`SamplingError::NotFinite`] for numbers that are not finite, [`SamplingError::Setting`] for fewer
    /// than two positions, a walk below zero, or errors and a walk that are all zero.
    pub fn new(mut samples: Vec<Measured>, walk: f64) -> Result<Self, SamplingError> {
        check(&samples, walk)?;
        samples.sort_by(|a, b| a.x.total_cmp(&b.x));
        let length = samples[samples.len() - 1].x - samples[0].x;
        if length <= 0.0 {
            let (name, rule) = ("distance between the first and the last sample", "positive");
            return Err(SamplingError::Setting { name, value: length, rule });
        }
        let line = line(&samples);
        let spacing = length / (samples.len() - 1) as f64;
        let noise = 1.0 / median(samples.iter().map(|s| s.weight(line.slope, 0.0)));
        let walk = walk.max(noise * spacing / (LONGEST * length).powi(4));
        if walk <= 0.0 {
            let (name, rule) = ("variance by which the slope walks", "positive where samples are exact");
            return Err(SamplingError::Setting { name, value: walk, rule });
        }
        let acting = (noise * spacing / walk).powf(0.25).max(shortest(&samples));
        let step = (acting / KNOTS_PER_LENGTH).clamp(length / MOST_KNOTS, length);
        Self::fitted(samples, line, step, walk)
    }

    fn fitted(samples: Vec<Measured>, line: FittedLine, step: f64, walk: f64) -> Result<Self, SamplingError> {
        let first = samples[0].x;
        let end = ((samples[samples.len() - 1].x - first) / step).ceil() as usize;
        let mut fit = Fit::<4, 1>::new(-1, end + 4);
        let floor = LEAST_ERROR * (walk * step.powi(3)).sqrt();
        // In units of the walk, so that the numbers are near one.
        let unit = walk * step.powi(3);
        let weights: Vec<f64> = samples.iter().map(|s| unit * s.weight(line.slope, floor)).collect();
        for (s, weight) in samples.iter().zip(&weights) {
            let value = s.value - line.value - line.slope * (s.x - first);
            fit.add((s.x - first) / step, &[value], *weight, 0.0);
        }
        fit.add_roughness_penalty(1.0);
        fit.solve()?;
        Ok(Self { fit, samples, weights, line, step, walk })
    }

    /// f(x) alone, in less time than [`Self::at`].
    pub fn value(&self, x: f64) -> f64 {
        let from = x - self.samples[0].x;
        match x <= self.samples[self.samples.len() - 1].x && from >= 0.0 {
            true => self.fit.value(from / self.step)[0] + self.line.value + self.line.slope * from,
            false => self.at(x).value,
        }
    }

    /// What is known at x. Beyond the samples the function goes on as a line, and the variance grows.
    pub fn at(&self, x: f64) -> Estimate {
        let (first, last) = (self.samples[0].x, self.samples[self.samples.len() - 1].x);
        let inside = x.clamp(first, last);
        let position = (inside - first) / self.step;
        let unit = self.walk * self.step.powi(3);
        let PosteriorCovariance { variance, covariance, slope_variance } =
            self.fit.posterior_covariance(position);
        let found = Estimate {
            value: self.fit.value(position)[0] + self.line.value + self.line.slope * (inside - first),
            slope: self.fit.slope(position)[0] / self.step + self.line.slope,
            variance: unit * variance,
            covariance: unit * covariance / self.step,
            slope_variance: unit * slope_variance / (self.step * self.step),
        };
        found.moved(x - inside, self.walk)
    }

    /// What the others say of each sample.
    ///
    /// With the share h = w var of a sample in its own value, the others differ by r / (1 - h) from it, with
    /// the variance sigma^2 / (1 - h), r the residual.
    pub fn left_out(&self) -> impl Iterator<Item = LeftOut> + '_ {
        let unit = self.walk * self.step.powi(3);
        self.samples.iter().zip(&self.weights).map(move |(s, weight)| {
            let here = self.at(s.x);
            let (variance, others) = (unit / weight, 1.0 - weight * here.variance / unit);
            let others = others.max(f64::EPSILON);
            let deviation = (variance / others).max(f64::MIN_POSITIVE).sqrt();
            LeftOut { miss: (s.value - here.value).abs() / others, deviation }
        })
    }
}

impl Estimate {
    /// What is known at the distance d, beyond the samples: F P F' + Q of a slope that walks.
    fn moved(self, d: f64, walk: f64) -> Self {
        let far = d.abs();
        Self {
            value: self.value + d * self.slope,
            slope: self.slope,
            variance: self.variance
                + 2.0 * d * self.covariance
                + d * d * self.slope_variance
                + walk * far.powi(3) / 3.0,
            covariance: self.covariance + d * self.slope_variance + walk * d * far / 2.0,
            slope_variance: self.slope_variance + walk * far,
        }
    }
}

fn check(samples: &[Measured], walk: f64) -> Result<(), SamplingError> {
    let numbers = |s: &Measured| {
        [("sample position", s.x), ("sample value", s.value), ("error", s.error), ("jitter", s.jitter)]
    };
    for (index, s) in samples.iter().enumerate() {
        if let Some((name, value)) = numbers(s).into_iter().find(|(_, value)| !value.is_finite()) {
            return Err(SamplingError::NotFinite { name, index, value });
        }
    }
    if samples.len() < 2 {
        let (name, rule) = ("number of samples", "at least two");
        return Err(SamplingError::Setting { name, value: samples.len() as f64, rule });
    }
    if walk >= 0.0 && walk.is_finite() {
        return Ok(());
    }
    let (name, rule) = ("variance by which the slope walks", "finite and not negative");
    Err(SamplingError::Setting { name, value: walk, rule })
}

fn line(samples: &[Measured]) -> FittedLine {
    let count = samples.len() as f64;
    let mean = |of: &dyn Fn(&Measured) -> f64| samples.iter().map(of).sum::<f64>() / count;
    let (x, y) = (mean(&|s| s.x), mean(&|s| s.value));
    let (xx, xy) = (mean(&|s| (s.x - x).powi(2)), mean(&|s| (s.x - x) * (s.value - y)));
    let slope = xy / xx;
    FittedLine { value: y + slope * (samples[0].x - x), slope }
}

/// The least distance of samples at different positions.
fn shortest(samples: &[Measured]) -> f64 {
    let gaps = samples.windows(2).map(|pair| pair[1].x - pair[0].x);
    gaps.filter(|gap| *gap > 0.0).fold(f64::INFINITY, f64::min)
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    let middle = sorted.len() / 2;
    *sorted.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
mod tests;
