//! The least errors of causal banks at all latencies: the whole error, that of the signal and the noise of
//! the converters at the output.
//!
//! The Kalman filter of the lifted plant has the error z~ of the references with the measurements up to now.
//! Each further slow period gives innovations of covariance R that are correlated with z~, and the smoothed
//! error falls by `E[z~ e'] R^-1 E[e z~']` (Kailath, Sayed and Hassibi, *Linear Estimation*, 2000, chapter
//! 10). So one Riccati equation gives the errors of all latencies: as the error of the noncausal filter and
//! what the periods beyond still lower it by. Differences of larger squares would lose it in rounding.

use super::DesignError;
use super::methods::filtering::Innovations;
use super::plant::LiftedPlant;
use super::problem::Problem;
use super::quadrature::{Integrand, QuadratureNode};
use super::signal::SampledSignal;
use hybank_core::spec::{MAX_ERROR_STATES, MAX_LATENCY};
use hybank_linalg::{CMat, Complex};

/// A longer latency is chosen only if it lowers the whole error by more than 0.1 dB: less than the error of
/// a measured SNR, while the last tenth of a decibel may take many times the latency.
const WORTHWHILE_DB: f64 = 0.1;
/// Most slow periods of latency beyond the longest delay.
const MOST_PERIODS: usize = 512;
/// Fast samples of latency beyond the longest delay for which the matrices of a recursive design fit: the
/// plant and the filters have as many states each.
const MOST_BEYOND: usize = MAX_ERROR_STATES / 4;
/// Periods that lower the mean square by no more than this share, 0.00004 dB, after as many others end the
/// search.
const NEGLIGIBLE_SHARE: f64 = 1e-5;
/// Fewest slow periods beyond the longest delay.
const LEAST_PERIODS: usize = 8;

/// The least root mean squares over all phases at a range of latencies.
#[derive(Debug)]
pub(super) struct CausalErrors {
    first: usize,
    rms: Vec<f64>,
}

impl CausalErrors {
    /// At all latencies that are candidates for a design. The error does not grow with the latency.
    ///
    /// # Errors
    /// [`DesignError::RiccatiFailed`] if the Riccati equation could not be solved.
    pub(super) fn new(problem: &Problem) -> Result<Self, DesignError> {
        let problem = Problem { latency: problem.wait, ..problem.clone() };
        let delay = problem.longest_delay().0.ceil() as usize;
        let (first, ratio) = (problem.wait, problem.ratio);
        let most = MAX_LATENCY.min(delay + MOST_BEYOND.min(MOST_PERIODS * ratio));
        let plant = LiftedPlant::new(&problem).with_noise();
        let periods = (most - first) / ratio + 1;
        let least = (delay.saturating_sub(first)).div_ceil(ratio) + LEAST_PERIODS;
        let (forms, limits) = (Innovations::in_all_coordinates(&plant)?, noncausal_squares(&problem));
        let squares = forms.iter().find_map(|form| form.smoothed(least..=periods, &limits, NEGLIGIBLE_SHARE));
        let states = plant.system().order();
        let squares = squares.ok_or(DesignError::RiccatiFailed { gamma: None, states })?;
        let at = |latency: usize| {
            let (period, later) = ((latency - first) / ratio, (latency - first) % ratio);
            // The last `later` references are a slow period older there.
            let phase = |p: usize| squares[period + usize::from(p >= ratio - later)][p];
            ((0..ratio).map(phase).sum::<f64>() / ratio as f64).sqrt()
        };
        let longest = (first + (squares.len() - 2) * ratio).min(most).max(first);
        Ok(Self { first, rms: (first..=longest).map(at).collect() })
    }

    /// The error at a latency of the range.
    pub(super) fn rms(&self, latency: usize) -> f64 {
        self.rms[latency - self.first]
    }

    /// The longest latency of the range.
    #[cfg(test)]
    pub(super) fn longest(&self) -> usize {
        self.first + self.rms.len() - 1
    }

    /// The least error of all latencies.
    pub(super) fn least(&self) -> f64 {
        self.rms.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// The shortest latency whose error is within [`WORTHWHILE_DB`] of the least.
    pub(super) fn shortest(&self) -> usize {
        let least = self.least();
        self.first + self.rms.iter().position(|rms| is_almost(*rms, least)).unwrap_or(0)
    }
}

/// The least mean square of each phase that all samples of all times leave, the spectrum of the signal being
/// |W|^2: at each frequency the rest of the references beside all that the samples are made of, signal and
/// noise.
fn noncausal_squares(problem: &Problem) -> Vec<f64> {
    let problem = Problem { band: None, ..problem.clone() };
    let signal = SampledSignal::of(&problem);
    let periods = 1.0 + (problem.longest_delay().0 + problem.latency as f64) / problem.ratio as f64;
    let nodes = Integrand { breaks: signal.breaks(), periods, poles: &signal.poles() }.nodes();
    let deviations = problem.noise.iter().map(|power| Complex::from(power.sqrt()));
    let noise = CMat::from_diagonal(&deviations.collect::<Vec<_>>().into());
    let mut squares = vec![0.0; problem.ratio];
    for QuadratureNode { theta, share } in nodes {
        let columns = signal.at(theta);
        let (_, basis) = hybank_linalg::lq(&hybank_linalg::hstack(&[&columns.measurement, &noise]));
        let reference = columns.reference.resize_horizontally(basis.ncols(), Complex::ZERO);
        let rest = &reference - &reference * basis.adjoint() * &basis;
        squares
            .iter_mut()
            .zip(rest.row_iter())
            .for_each(|(square, row)| *square += share * row.norm_squared());
    }
    squares
}

/// Whether an error is within [`WORTHWHILE_DB`] of the least one.
pub(super) fn is_almost(rms: f64, least: f64) -> bool {
    rms <= least * 10f64.powf(WORTHWHILE_DB / 20.0)
}
