//! The estimator of least mean-square error for a history of slow samples, in square-root form.
//!
//! With the samples y and the targets z as random variables, `cov [y; z] = L L'`. Each node of an integral
//! over frequency gives columns of a root: `sqrt(share) e^{-j theta k} [H; W]` for the samples k frames old,
//! real and imaginary part. The noise of the converters gives a column to each sample. One LQ factorisation
//! makes `y = L_y u` with independent u of unit variance and a triangular L_y, and `z = P u + rest`. Nothing
//! is squared, so errors 150 dB below the target and more keep their digits.
//!
//! - The taps for the target t on all samples are `P_t L_y^-1`, and the error is that of the rest.
//! - Samples stand frame by frame from the newest. So the leading rows and columns belong to fewer frames,
//!   and what their u leave adds the squares of the remaining entries of P_t.
//!
//! One factorisation so has the taps and errors of all latencies and of all lengths up to its own.
//!
//! Source: Kailath, Sayed and Hassibi, *Linear Estimation* (2000), chapters 3 and 12.

use super::deviations::Deviations;
use super::problem::Problem;
use super::quadrature::{Integrand, QuadratureNode};
use super::signal::SampledSignal;
use hybank_linalg::{CMat, Complex, Mat};
use std::ops::RangeInclusive;

/// Noise of a sample relative to its size, below which the noise of a converter counts as this: samples that
/// determine one another up to rounding are weighed alike, and not as huge differences.
const INNOVATION_ROUNDING: f64 = 1e-13;

/// Roots of the covariances of a history of samples and of the target at whole instants.
#[derive(Debug, Clone)]
pub(super) struct RootCovariance {
    /// L_y, lower triangular.
    samples: Mat,
    /// P, one row for each instant.
    projections: Mat,
    /// The mean square of the rest at each instant.
    rest: Vec<f64>,
    channels: usize,
    first: i64,
    /// The mean square of the target, its error without any sample.
    pub(super) power: f64,
    /// The power of a noise over that relative to an input of the filter of the signal.
    pub(super) noise_scale: f64,
}

impl RootCovariance {
    /// Of the newest `frames` frames of all channels with their noise, and of the target at `instants` (fast
    /// periods). `deviations` are those of the converters; none if all are exact.
    pub(super) fn new(
        problem: &Problem,
        deviations: &[Deviations],
        frames: usize,
        instants: RangeInclusive<i64>,
    ) -> Self {
        let problem = Problem { latency: 0, ..problem.clone() };
        let signal = SampledSignal::of(&problem);
        let nodes = nodes(&problem, &signal, frames, &instants);
        let mut columns = RootColumns::new(&problem, frames, instants.clone());
        for node in nodes {
            columns.add(&signal, deviations, node);
        }
        columns.factored(&problem)
    }

    /// The least mean-square error at `instant` with the newest `frames` frames.
    pub(super) fn error(&self, frames: usize, instant: i64) -> f64 {
        let row = self.row(instant);
        let left = self.projections.row(row);
        self.rest[row] + left.columns_range(frames * self.channels..).norm_squared()
    }

    /// The taps that attain it: `[j * N + i]` weighs the sample of channel i in the frame j, 0 the newest.
    pub(super) fn taps(&self, frames: usize, instant: i64) -> Vec<f64> {
        let projection = self.projections.row(self.row(instant));
        let mut taps = vec![0.0; frames * self.channels];
        for k in (0..taps.len()).rev() {
            let column = self.samples.column(k);
            let known: f64 = (k + 1..taps.len()).map(|l| taps[l] * column[l]).sum();
            taps[k] = (projection[k] - known) / column[k];
        }
        taps
    }

    /// The mean-square error of any `taps`, as those of [`Self::taps`].
    pub(super) fn error_of(&self, taps: &[f64], instant: i64) -> f64 {
        let row = self.row(instant);
        let left = |k: usize| {
            let column = self.samples.column(k);
            self.projections[(row, k)]
                - taps.iter().enumerate().skip(k).map(|(l, tap)| tap * column[l]).sum::<f64>()
        };
        self.rest[row] + (0..self.samples.ncols()).map(|k| left(k).powi(2)).sum::<f64>()
    }

    /// The estimates from some of the samples alone, which stand in the order of the history.
    pub(super) fn of_known(&self, known: &[usize]) -> PartialHistory<'_> {
        let (samples, basis) = hybank_linalg::lq(&self.samples.select_rows(known));
        PartialHistory { whole: self, samples, basis }
    }

    fn row(&self, instant: i64) -> usize {
        (instant - self.first) as usize
    }
}

/// A history of which some samples are missing.
///
/// With `y = L_y u` the known samples are `K Q u`, with a triangular K and orthonormal rows Q, so `v = Q u`
/// is what they tell. A random variable `a u` has the estimate `a Q' v` from them.
#[derive(Debug)]
pub(super) struct PartialHistory<'a> {
    whole: &'a RootCovariance,
    /// K.
    samples: Mat,
    /// Q.
    basis: Mat,
}

/// An estimate from known samples.
#[derive(Debug)]
pub(super) struct Projection {
    /// The weights of the known samples.
    pub(super) weights: Vec<f64>,
    /// The mean square of its error.
    pub(super) error: f64,
}

impl PartialHistory<'_> {
    /// The estimate of a sample of the history.
    pub(super) fn sample(&self, place: usize) -> Projection {
        let own = self.whole.samples.row(place);
        let projection = own * self.basis.transpose();
        let error = (own - &projection * &self.basis).norm_squared();
        // Every sample has noise, so none of the known ones follows from the others.
        let weights = self.samples.tr_solve_lower_triangular(&projection.transpose());
        Projection { weights: weights.map_or_else(Vec::new, |weights| weights.as_slice().to_vec()), error }
    }

    /// The error of the estimate of the target at `instant`.
    pub(super) fn target_error(&self, instant: i64) -> f64 {
        let row = self.whole.row(instant);
        let own = self.whole.projections.row(row);
        let projection = own * self.basis.transpose();
        self.whole.rest[row] + (own - projection * &self.basis).norm_squared()
    }
}

fn nodes(
    problem: &Problem,
    signal: &SampledSignal,
    frames: usize,
    instants: &RangeInclusive<i64>,
) -> Vec<QuadratureNode> {
    let ratio = problem.ratio as f64;
    let oldest = -problem.longest_delay().0 - frames as f64 * ratio;
    let reach = (*instants.end() as f64).max(0.0) - oldest.min(*instants.start() as f64);
    Integrand { breaks: signal.breaks(), periods: 1.0 + reach / ratio, poles: &signal.poles() }.nodes()
}

/// The columns of the roots of samples and targets, while they are collected.
struct RootColumns {
    ratio: usize,
    frames: usize,
    instants: RangeInclusive<i64>,
    /// Two for each column of a node.
    samples: Vec<f64>,
    targets: Vec<f64>,
    /// The mean square of what no sample of any time shows of each phase.
    unexplained: Vec<f64>,
    /// The mean square of the target.
    power: f64,
    /// The mean squares of the channels.
    sizes: Vec<f64>,
}

impl RootColumns {
    fn new(problem: &Problem, frames: usize, instants: RangeInclusive<i64>) -> Self {
        let (ratio, unexplained) = (problem.ratio, vec![0.0; problem.ratio]);
        let sizes = vec![0.0; problem.channels.len()];
        let (samples, targets) = (Vec::new(), Vec::new());
        Self { ratio, frames, instants, samples, targets, unexplained, power: 0.0, sizes }
    }

    /// Adds what the signal gives at a node. An LQ factorisation leaves the samples no more columns than
    /// channels.
    fn add(&mut self, signal: &SampledSignal, deviations: &[Deviations], node: QuadratureNode) {
        let columns = signal.at(node.theta).with_errors(signal.problem(), deviations);
        let channels = self.sizes.len();
        let stacked =
            hybank_linalg::vstack(&[&columns.measurement, &columns.reference]).map(|x| x * node.share.sqrt());
        let root = hybank_linalg::lq_factor(&stacked);
        let known = channels.min(root.ncols());
        for (i, size) in self.sizes.iter_mut().enumerate() {
            *size += root.row(i).norm_squared();
        }
        for p in 0..self.ratio {
            let row = root.row(channels + p);
            self.power += row.norm_squared() / self.ratio as f64;
            self.unexplained[p] += row.columns_range(known..).norm_squared();
        }
        (0..known).for_each(|column| self.add_column(&root, column, node.theta));
    }

    fn add_column(&mut self, root: &CMat, column: usize, theta: f64) {
        let (channels, ratio) = (self.sizes.len(), self.ratio as i64);
        let sample = |j: usize, i: usize| root[(i, column)] * Complex::from_polar(1.0, -theta * j as f64);
        let samples: Vec<Complex<f64>> = (0..self.frames)
            .flat_map(|j| (0..channels).map(move |i| (j, i)))
            .map(|(j, i)| sample(j, i))
            .collect();
        let target = |instant: i64| {
            let (period, phase) = (instant.div_euclid(ratio), instant.rem_euclid(ratio) as usize);
            root[(channels + phase, column)] * Complex::from_polar(1.0, theta * period as f64)
        };
        let targets: Vec<Complex<f64>> = self.instants.clone().map(target).collect();
        for part in [|x: &Complex<f64>| x.re, |x: &Complex<f64>| x.im] {
            self.samples.extend(samples.iter().map(part));
            self.targets.extend(targets.iter().map(part));
        }
    }

    /// The roots of the samples with their noise, and of the targets.
    fn factored(mut self, problem: &Problem) -> RootCovariance {
        let channels = self.sizes.len();
        let power = self.power;
        let of_filter = problem.signal.as_ref().map(|w| w.power_through(&problem.front_ends[problem.target]));
        let noise_scale = of_filter.filter(|_| problem.band.is_some()).map_or(1.0, |through| power / through);
        let noise = self.noise(problem, noise_scale);
        let (order, count) = (self.frames * channels, self.instants.clone().count());
        for k in 0..order {
            self.samples.extend((0..order).map(|l| if k == l { noise[k % channels].sqrt() } else { 0.0 }));
            self.targets.extend(std::iter::repeat_n(0.0, count));
        }
        let columns = self.targets.len() / count;
        let samples = Mat::from_vec(order, columns, self.samples);
        let targets = Mat::from_vec(count, columns, self.targets);
        let (root, basis) = hybank_linalg::lq(&samples);
        let projections = &targets * basis.transpose();
        let rest = targets - &projections * basis;
        let (first, ratio) = (*self.instants.start(), self.ratio as i64);
        let unexplained = |row: usize| self.unexplained[(first + row as i64).rem_euclid(ratio) as usize];
        let rest = (0..count).map(|row| rest.row(row).norm_squared() + unexplained(row)).collect();
        RootCovariance { samples: root, projections, rest, channels, first, power, noise_scale }
    }

    /// The noise powers of the channels, relative to the signal of the nodes.
    fn noise(&self, problem: &Problem, scale: f64) -> Vec<f64> {
        let least = |size: &f64| INNOVATION_ROUNDING * INNOVATION_ROUNDING * size;
        problem.noise.iter().zip(&self.sizes).map(|(own, size)| (own * scale).max(least(size))).collect()
    }
}
