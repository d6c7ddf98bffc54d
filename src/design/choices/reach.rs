//! What FIR filters of a given length can reach: the least mean-square error at each latency, before any
//! filter is designed.
//!
//! Phase p of the output has `J_p = ceil((taps - p) / M)` lags, so it sees the newest `J_p` frames. Its
//! least mean-square error depends only on the instant `p - m0` of the target relative to these frames:
//! see [`HistoryErrors`].

use crate::design::DesignError;
use crate::design::history_errors::HistoryErrors;
use crate::design::merging::Repeats;
use crate::design::problem::Problem;
use crate::spec::MAX_LATENCY;
use crate::units::FastPeriods;
use std::ops::RangeInclusive;

/// Share of the target's power that some phase must be able to remove. Below it the error is that of zero
/// output.
const LEAST_REMOVED: f64 = 1e-3;
/// Front ends with more states in all are replaced by the target's, so that the errors cost little.
const MOST_STATES: usize = 128;
/// Factor on the lower bound where front ends were replaced: the errors are then only a guess.
const GUESS: f64 = 0.5;

/// The least mean-square errors of filters of one length at a range of latencies.
#[derive(Debug)]
pub(super) struct Reach {
    ratio: usize,
    taps: usize,
    /// For the phases with the most lags, and for those with one lag less.
    long: HistoryErrors,
    short: HistoryErrors,
    /// The errors are those of the given front ends.
    exact: bool,
}

impl Reach {
    /// Of `taps` taps per channel.
    ///
    /// # Errors
    /// As [`HistoryErrors::new`].
    pub(super) fn new(
        problem: &Problem,
        taps: usize,
        latencies: &RangeInclusive<usize>,
    ) -> Result<Self, DesignError> {
        let (problem, exact) = manageable(problem);
        let ratio = problem.ratio;
        let instants = -(*latencies.end() as i64)..=(ratio as i64 - 1 - *latencies.start() as i64);
        let errors = |frames: usize| HistoryErrors::new(&problem, frames, instants.clone());
        let long = errors(taps.div_ceil(ratio))?;
        let short = if taps.is_multiple_of(ratio) { long.clone() } else { errors(taps / ratio)? };
        Ok(Self { ratio, taps, long, short, exact })
    }

    /// The rms of the target, the error of a bank that outputs zeros.
    pub(super) fn zero_output(&self) -> f64 {
        self.long.power.sqrt()
    }

    /// The least mean-square error of each phase of the output.
    fn errors(&self, latency: usize) -> impl Iterator<Item = f64> {
        let most = self.taps.div_ceil(self.ratio);
        (0..self.ratio).map(move |p| {
            let has_most = self.taps.saturating_sub(p).div_ceil(self.ratio) == most;
            let history = if has_most { &self.long } else { &self.short };
            history.at(p as i64 - latency as i64)
        })
    }

    /// The least root mean square over all phases, of error and noise together.
    pub(super) fn rms(&self, latency: usize) -> f64 {
        (self.errors(latency).sum::<f64>() / self.ratio as f64).sqrt()
    }

    /// A lower bound of the same.
    pub(super) fn lower_bound(&self, latency: usize) -> f64 {
        if self.exact { self.rms(latency) } else { GUESS * self.rms(latency) }
    }

    /// Whether the filters can remove a noticeable part of the target at any phase.
    fn is_reached(&self, latency: usize) -> bool {
        let least = self.errors(latency).fold(f64::INFINITY, f64::min);
        least <= (1.0 - LEAST_REMOVED) * self.long.power
    }
}

/// The problem with few analog states, and whether it is the same problem.
fn manageable(problem: &Problem) -> (Problem, bool) {
    if problem.analog_states() <= MOST_STATES {
        return (problem.clone(), true);
    }
    let mut alike = problem.clone();
    alike.front_ends = vec![problem.front_ends[problem.target].clone()];
    alike.target = 0;
    for channel in &mut alike.channels {
        (channel.front_end, channel.gain) = (0, channel.converter_gain);
    }
    (alike.merge_channels(Repeats::AtOneInstant).problem, false)
}

/// Refuses a latency at which no tap sees a sample that has to do with the target.
///
/// # Errors
/// [`DesignError::OutOfReach`] with the latencies that the taps reach.
pub(super) fn check(problem: &Problem, taps: usize) -> Result<(), DesignError> {
    let latency = problem.latency;
    // Where there is much noise no tap removes anything, however near its sample is.
    let problem = &Problem { noise: vec![0.0; problem.noise.len()], ..problem.clone() };
    if is_covered(problem, taps) || Reach::new(problem, taps, &(latency..=latency))?.is_reached(latency) {
        return Ok(());
    }
    let latencies = candidates(problem, taps);
    let reach = Reach::new(problem, taps, &latencies)?;
    let mut reached = latencies.filter(|&latency| reach.is_reached(latency));
    let shortest = reached.next().unwrap_or_default();
    let longest = reached.next_back().unwrap_or(shortest);
    Err(DesignError::OutOfReach { latency, taps, shortest, longest })
}

/// Whether an output instant lies between the samples that the taps of one channel see.
fn is_covered(problem: &Problem, taps: usize) -> bool {
    let newest_of = |delay: FastPeriods| -delay.0;
    let history = (taps.div_ceil(problem.ratio).saturating_sub(1) * problem.ratio) as f64;
    let with_taps = taps.min(problem.ratio);
    let mut instants = (0..with_taps).map(|p| p as f64 - problem.latency as f64);
    instants.any(|instant| {
        let sees = |newest: f64| (newest - history..=newest).contains(&instant);
        problem.channels.iter().any(|channel| sees(newest_of(channel.delay)))
    })
}

/// All latencies that may be worth a design: up to the oldest sample that a tap sees.
pub(super) fn candidates(problem: &Problem, taps: usize) -> RangeInclusive<usize> {
    0..=(taps + problem.longest_delay().0.ceil() as usize).min(MAX_LATENCY)
}
