//! The least errors that banks of a given length can reach, at each latency and before any filter is
//! designed: the whole error, that of the signal and the noise of the converters at the output.
//!
//! Phase p of the output has `J_p = ceil((taps - p) / M)` lags, so it sees the newest `J_p` frames. Its
//! least mean-square error depends only on the instant `p - m0` of the target relative to these frames:
//! see [`HistoryErrors`]. A causal recursive bank sees all frames.

use super::DesignError;
use super::history_errors::HistoryErrors;
use super::merging::Repeats;
use super::problem::Problem;
use crate::spec::{MAX_ERROR_STATES, MAX_LATENCY};
use std::ops::RangeInclusive;

/// A longer latency is chosen only if it lowers the whole error by more than 0.1 dB: less than the error of
/// a measured SNR, while the last tenth of a decibel may take many times the latency.
const WORTHWHILE_DB: f64 = 0.1;
/// Share of the target's power that some phase must be able to remove. Below it the error is that of zero
/// output.
const LEAST_REMOVED: f64 = 1e-3;
/// Errors below this fraction of the target count as equal: no converter shows the difference.
const SAME_ERROR: f64 = 1e-9;
/// Front ends with more states in all are replaced by the target's: the time grows with their cube.
const MOST_STATES: usize = 128;
/// Slow periods of latency beyond the longest delay at which causal banks are compared, at first and at
/// most.
const PERIODS: RangeInclusive<usize> = 8..=512;
/// Fast samples of latency beyond the longest delay for which the matrices of a recursive design fit: the
/// plant and the filters have as many states each.
const MOST_BEYOND: usize = MAX_ERROR_STATES / 4;
/// Frames of history that stand for all past samples, for each of these periods.
const HISTORY: usize = 6;
/// Share of [`WORTHWHILE_DB`] that latencies beyond the search may gain: too little to be seen.
const LEFT_BEYOND: f64 = 0.02;

/// The least root mean squares over all phases at a range of latencies.
#[derive(Debug)]
pub(super) struct LeastErrors {
    first: usize,
    rms: Vec<f64>,
    /// Whether some phase can remove a noticeable part of the target, at each latency.
    removes: Vec<bool>,
    /// What remains of the error at any latency.
    pub(super) lasting: f64,
    /// The rms of the target, the error of a bank that outputs zeros.
    pub(super) zero_output: f64,
}

impl LeastErrors {
    /// Of banks of `taps` taps per channel.
    ///
    /// # Errors
    /// As [`HistoryErrors::new`].
    pub(super) fn new(
        problem: &Problem,
        taps: usize,
        latencies: RangeInclusive<usize>,
    ) -> Result<Self, DesignError> {
        let ratio = problem.ratio;
        let instants = -(*latencies.end() as i64)..=(ratio as i64 - 1 - *latencies.start() as i64);
        let errors = |frames: usize| HistoryErrors::new(problem, frames, instants.clone());
        // The first phases have a lag more than the others, unless all have equally many.
        let long = errors(taps.div_ceil(ratio))?;
        let short = if taps.is_multiple_of(ratio) { long.clone() } else { errors(taps / ratio)? };
        let has_most = |p: usize| taps.saturating_sub(p).div_ceil(ratio) == taps.div_ceil(ratio);
        let floor = SAME_ERROR * SAME_ERROR * long.power;
        let (mut rms, mut removes) = (Vec::new(), Vec::new());
        for latency in latencies.clone() {
            let phase = |p: usize| (if has_most(p) { &long } else { &short }).at(p as i64 - latency as i64);
            let squares: Vec<f64> = (0..ratio).map(|p| phase(p).max(floor)).collect();
            rms.push((squares.iter().sum::<f64>() / ratio as f64).sqrt());
            removes.push(squares.iter().any(|square| *square <= (1.0 - LEAST_REMOVED) * long.power));
        }
        let at_longest = |p: usize| long.lasting(p as i64 - *latencies.end() as i64).max(floor);
        let lasting = ((0..ratio).map(at_longest).sum::<f64>() / ratio as f64).sqrt();
        Ok(Self { first: *latencies.start(), rms, removes, lasting, zero_output: long.power.sqrt() })
    }

    /// Of all causal banks, up to a latency beyond which no latency gains more than [`LEFT_BEYOND`]. A bank
    /// that delays its output by one fast sample is a bank of one more sample of latency, so the error does
    /// not grow with the latency.
    ///
    /// # Errors
    /// As [`HistoryErrors::new`].
    pub(super) fn causal(problem: &Problem) -> Result<Self, DesignError> {
        let mut periods = *PERIODS.start();
        loop {
            let latency = problem.longest_delay().0.ceil() as usize + periods * problem.ratio;
            let frames = latency.div_ceil(problem.ratio) + HISTORY * periods;
            let most = MAX_LATENCY.min(problem.longest_delay().0.ceil() as usize + MOST_BEYOND);
            let errors = Self::new(problem, frames * problem.ratio, problem.wait..=latency.min(most))?;
            if errors.least() <= errors.lasting * worthwhile(LEFT_BEYOND) || periods >= *PERIODS.end() {
                return Ok(errors);
            }
            periods *= 2;
        }
    }

    /// The error at a latency of the range.
    pub(super) fn rms(&self, latency: usize) -> f64 {
        self.rms[latency - self.first]
    }

    /// The longest latency of the range.
    pub(super) fn longest(&self) -> usize {
        self.first + self.rms.len() - 1
    }

    /// The least error of all latencies.
    pub(super) fn least(&self) -> f64 {
        self.rms.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// The shortest latency whose error is within [`WORTHWHILE_DB`] of the least.
    pub(super) fn shortest(&self) -> usize {
        self.first + shortest(&self.rms)
    }
}

/// The index of the first error that is within [`WORTHWHILE_DB`] of the least.
pub(super) fn shortest(rms: &[f64]) -> usize {
    let least = rms.iter().copied().fold(f64::INFINITY, f64::min);
    rms.iter().position(|rms| is_almost(*rms, least)).unwrap_or(0)
}

/// Whether an error is within [`WORTHWHILE_DB`] of the least one.
pub(super) fn is_almost(rms: f64, least: f64) -> bool {
    rms <= least * worthwhile(1.0)
}

/// A share of [`WORTHWHILE_DB`] as a factor.
fn worthwhile(share: f64) -> f64 {
    10f64.powf(share * WORTHWHILE_DB / 20.0)
}

/// The problem with few analog states: where there are many, all channels get the filter of the target.
pub(super) fn manageable(problem: Problem) -> Problem {
    if problem.analog_states() <= MOST_STATES {
        return problem;
    }
    let mut alike = Problem { front_ends: vec![problem.front_ends[problem.target].clone()], ..problem };
    alike.target = 0;
    for channel in &mut alike.channels {
        (channel.front_end, channel.gain) = (0, channel.converter_gain);
    }
    alike.merge_channels(Repeats::AtOneInstant).problem
}

/// Refuses a latency at which no tap sees a sample that has to do with the target.
///
/// # Errors
/// [`DesignError::OutOfReach`] with the latencies that the taps reach.
pub(super) fn check_reach(problem: Problem, taps: usize) -> Result<(), DesignError> {
    let latency = problem.latency;
    if is_covered(&problem, taps) {
        return Ok(());
    }
    // Where there is much noise no tap removes anything, however near its sample is.
    let problem = manageable(Problem { noise: vec![0.0; problem.noise.len()], ..problem });
    if LeastErrors::new(&problem, taps, latency..=latency)?.removes[0] {
        return Ok(());
    }
    let LeastErrors { first, removes, .. } = LeastErrors::new(&problem, taps, candidates(&problem, taps))?;
    let shortest = first + removes.iter().position(|removes| *removes).unwrap_or_default();
    let longest = first + removes.iter().rposition(|removes| *removes).unwrap_or_default();
    Err(DesignError::OutOfReach { latency, taps, shortest, longest })
}

/// Whether an output instant lies between the samples that the taps of one channel see.
fn is_covered(problem: &Problem, taps: usize) -> bool {
    let history = (taps.div_ceil(problem.ratio).saturating_sub(1) * problem.ratio) as f64;
    let mut instants = (0..taps.min(problem.ratio)).map(|p| p as f64 - problem.latency as f64);
    let sees = |newest: f64, instant: f64| (newest - history..=newest).contains(&instant);
    instants.any(|instant| problem.delays().iter().any(|delay| sees(-delay.0, instant)))
}

/// All latencies that may be worth a design: from the wait for a whole frame up to the oldest sample that a
/// tap sees.
pub(super) fn candidates(problem: &Problem, taps: usize) -> RangeInclusive<usize> {
    problem.wait..=(taps + problem.longest_delay().0.ceil() as usize).min(MAX_LATENCY)
}
