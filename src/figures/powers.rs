//! Mean squares of the errors of reconstructions: from the signal, from the noise of the converters, and
//! from delays that are not known exactly.

use super::integral::mean_over_circle;
use super::reconstruction::Reconstruction;
use super::signal::{Columns, Signal};
use crate::linalg::{CMat, Complex};
use crate::units::FastPeriods;
use std::ops::Range;

/// Multiply-adds that an integral may take, about: a second or two.
const MOST_WORK: f64 = 1e9;
/// Fewest and most angles of an integral.
const ANGLES: std::ops::RangeInclusive<f64> = 120.0..=40_000.0;

/// What a mean square error is computed for.
pub(super) struct Conditions<'a> {
    /// The signal.
    pub(super) signal: &'a Signal,
    /// s_i^2 of each channel, in the scale of the signal's unit density.
    pub(super) noise: Vec<f64>,
    /// Deviation of each delay from the one in the spec: constant while a recording lasts, Gaussian.
    pub(super) spread: Vec<FastPeriods>,
}

/// Mean squares per fast sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Powers {
    /// Of the error from the signal.
    pub(super) signal: f64,
    /// The same, as a mean over the uncertain delays.
    pub(super) uncertain: f64,
    /// Of the noise at the output.
    pub(super) noise: f64,
    /// Of the noise at the output for noise of unit power on every channel: the square of the noise gain.
    pub(super) unit_noise: f64,
}

/// The mean square of the target.
pub(super) fn target_power(signal: &Signal) -> f64 {
    let work = signal.columns() * signal.problem().ratio;
    let breaks = even_and(signal.breaks());
    let power =
        mean_over_circle(&breaks, angles(work), &mut |theta| vec![signal.at(theta).reference.norm_squared()]);
    power.first().copied().unwrap_or(0.0) / signal.problem().ratio as f64
}

impl Conditions<'_> {
    /// The mean squares of the errors of all `ways`, at the same angles.
    pub(super) fn powers(&self, ways: &[Reconstruction]) -> Vec<Powers> {
        let problem = self.signal.problem();
        let size = problem.ratio * problem.channels.len();
        let lags =
            |way: &Reconstruction| if let Reconstruction::Bank(filters) = way { filters.lags() } else { 1 };
        let work: usize = ways.iter().map(|way| size * (lags(way) + self.signal.columns())).sum();
        let breaks =
            even_and(self.signal.breaks().into_iter().chain(ways.iter().flat_map(Reconstruction::breaks)));
        let means = mean_over_circle(&breaks, angles(work), &mut |theta| {
            let columns = self.signal.at(theta);
            let late = self.is_uncertain().then(|| self.late(&columns));
            ways.iter().flat_map(|way| self.at(way, theta, &columns, late.as_ref())).collect()
        });
        let per_sample = 1.0 / problem.ratio as f64;
        let powers = |p: &[f64]| Powers {
            signal: p[0] * per_sample,
            uncertain: p[1] * per_sample,
            noise: p[2] * per_sample,
            unit_noise: p[3] * per_sample,
        };
        means.chunks_exact(4).map(powers).collect()
    }

    /// Whether some delay is.
    pub(super) fn is_uncertain(&self) -> bool {
        self.spread.iter().any(|spread| spread.0 > 0.0)
    }

    /// The four mean squares of [`Powers`] at an angle, summed over the M phases.
    fn at(&self, way: &Reconstruction, theta: f64, columns: &Columns, late: Option<&Late>) -> [f64; 4] {
        let filters = way.at(theta, columns, &self.noise);
        let per_channel: Vec<f64> = filters.column_iter().map(|column| column.norm_squared()).collect();
        let signal = error(columns, &filters, &columns.measurement);
        let uncertain = match late.filter(|_| way.knows_delays()) {
            Some(late) => {
                let spread = |samples: &Range<usize>| match samples.len() {
                    1 => per_channel[samples.start] * late.spread[samples.start],
                    _ => late.spread_of(&filters, samples),
                };
                error(columns, &filters, &late.mean) + late.converters.iter().map(spread).sum::<f64>()
            }
            None => signal,
        };
        let noise = per_channel.iter().zip(&self.noise).map(|(gain, power)| gain * power).sum();
        [signal, uncertain, noise, per_channel.iter().sum()]
    }

    /// A delay that is late by a Gaussian error of deviation s turns a sample of the frequency w by a
    /// random phase. Its mean is the sample times chi = e^{-(w s)^2 / 2}, and the rest has the power 1 -
    /// chi^2; it is coherent in one converter, and independent between converters.
    fn late(&self, columns: &Columns) -> Late {
        let mut mean = columns.measurement.clone();
        let converters = self.signal.problem().converters();
        let mut rest = mean.clone();
        let mut spread = vec![0.0; mean.nrows()];
        for (samples, s) in converters.iter().zip(&self.spread) {
            for i in samples.clone() {
                for (k, w) in columns.frequencies.iter().enumerate() {
                    let exponent = -(w * s.0).powi(2);
                    spread[i] -= mean[(i, k)].norm_sqr() * exponent.exp_m1();
                    rest[(i, k)] *= (-exponent.exp_m1()).sqrt();
                    mean[(i, k)] *= (0.5 * exponent).exp();
                }
            }
        }
        Late { mean, rest, spread, converters }
    }
}

/// Measurements with delays that are not known exactly.
struct Late {
    mean: CMat,
    /// What each sample has beside its mean at each frequency, and its power.
    rest: CMat,
    spread: Vec<f64>,
    /// The samples of each converter.
    converters: Vec<Range<usize>>,
}

impl Late {
    /// The power of the sum of what the samples of a converter have beside their means: they turn together.
    fn spread_of(&self, filters: &CMat, samples: &Range<usize>) -> f64 {
        let (first, count) = (samples.start, samples.len());
        (filters.columns(first, count) * self.rest.rows(first, count)).norm_squared()
    }
}

/// The squared Frobenius norm of W - F H, from amplitudes: nothing of size 1 is subtracted from a square.
fn error(columns: &Columns, filters: &CMat, measurement: &CMat) -> f64 {
    let mut error = columns.reference.clone();
    error.gemm(-Complex::ONE, filters, measurement, Complex::ONE);
    error.norm_squared()
}

/// Angles that an integral of so many multiply-adds per angle may evaluate.
fn angles(work: usize) -> usize {
    (MOST_WORK / work as f64).clamp(*ANGLES.start(), *ANGLES.end()) as usize
}

/// The given angles, and some to begin with.
fn even_and(breaks: impl IntoIterator<Item = f64>) -> Vec<f64> {
    breaks.into_iter().chain((1..4).map(|k| std::f64::consts::FRAC_PI_4 * f64::from(k))).collect()
}
