//! The least errors of causal banks of any length. They see all past samples, and a bank that delays its
//! output by one fast sample is a bank of one more sample of latency, so the error does not grow with the
//! latency.

use super::worthwhile;
use crate::design::DesignError;
use crate::design::history_errors::HistoryErrors;
use crate::design::problem::Problem;
use crate::spec::MAX_LATENCY;

/// Latencies are tried up to so many slow periods beyond the longest delay, at first and at most.
const PERIODS: (usize, usize) = (8, 512);
/// Share of [`worthwhile`] by which twice the latency must lower the least error to be looked at.
const STILL_FALLING: f64 = 0.25;
/// Frames of history that stand for all past samples, at first and at most.
const HISTORY: (usize, usize) = (32, 2048);
/// The history suffices when its doubling changes no error by more than this fraction.
const SAME_ERROR: f64 = 1e-4;
/// Errors below this fraction of the target count as equal.
const NEGLIGIBLE: f64 = 1e-9;

/// The least errors of all causal banks at the latencies 0, 1, ..
#[derive(Debug)]
pub(super) struct CausalErrors {
    /// The root mean square over all phases of the output, of error and noise together.
    rms: Vec<f64>,
}

impl CausalErrors {
    /// Up to a latency from which on the error falls no more.
    ///
    /// # Errors
    /// As [`HistoryErrors::new`].
    pub(super) fn new(problem: &Problem) -> Result<Self, DesignError> {
        let mut periods = PERIODS.0;
        let mut errors = Self::up_to(problem, periods)?;
        while periods < PERIODS.1 {
            periods *= 2;
            let more = Self::up_to(problem, periods)?;
            let gain = errors.least() / more.least() - 1.0;
            errors = more;
            if gain.is_nan() || gain <= STILL_FALLING * (worthwhile() - 1.0) {
                break;
            }
        }
        Ok(errors)
    }

    /// The root mean squares at the latencies 0, 1, ..
    pub(super) fn rms(&self) -> &[f64] {
        &self.rms
    }

    fn least(&self) -> f64 {
        self.rms.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// Up to so many slow periods beyond the longest delay.
    fn up_to(problem: &Problem, periods: usize) -> Result<Self, DesignError> {
        let longest = problem.longest_delay().0.ceil() as usize + periods * problem.ratio;
        let longest = longest.min(MAX_LATENCY);
        let mut frames = longest.div_ceil(problem.ratio) + HISTORY.0;
        let mut errors = Self::with_history(problem, longest, frames)?;
        while frames < HISTORY.1 {
            frames *= 2;
            let more = Self::with_history(problem, longest, frames)?;
            let done = errors.rms.iter().zip(&more.rms).all(|(a, b)| a - b <= SAME_ERROR * a);
            errors = more;
            if done {
                break;
            }
        }
        Ok(errors)
    }

    fn with_history(problem: &Problem, longest: usize, frames: usize) -> Result<Self, DesignError> {
        let ratio = problem.ratio as i64;
        let history = HistoryErrors::new(problem, frames, -(longest as i64)..=ratio - 1)?;
        let least = NEGLIGIBLE * NEGLIGIBLE * history.power;
        let errors = |latency: usize| (0..ratio).map(move |p| p - latency as i64);
        let square = |latency: usize| errors(latency).map(|at| history.at(at).max(least)).sum::<f64>();
        Ok(Self { rms: (0..=longest).map(|m| (square(m) / ratio as f64).sqrt()).collect() })
    }
}
