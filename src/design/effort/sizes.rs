//! The sizes of a design problem, as numbers to compute with.

use crate::design::error_grid::coarse_intervals;
use crate::design::problem::Problem;

/// The sizes of all matrices follow from these.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sizes {
    /// N, distinct channels.
    pub(super) channels: f64,
    /// M.
    pub(super) ratio: f64,
    /// States of the lifted plant: of the analog side and of the delay chains.
    pub(super) states: f64,
    /// States of the front ends and of the signal's filter alone.
    pub(super) front_end_states: f64,
    /// Taps per channel at the fast rate.
    pub(super) taps: f64,
    /// How far back plain interleaving reaches: the largest m0 - D_i, fast periods.
    pub(super) look_back: f64,
    /// Fast periods.
    pub(super) longest_delay: f64,
    /// m0, fast samples.
    pub(super) latency: f64,
}

impl Sizes {
    /// Of a problem without identical channels.
    pub(super) fn new(problem: &Problem, taps: usize) -> Self {
        let front_end_states = problem.analog_states();
        Self {
            channels: problem.channels.len() as f64,
            ratio: problem.ratio as f64,
            states: front_end_states as f64 + chain_states(problem),
            front_end_states: front_end_states as f64,
            taps: taps as f64,
            look_back: look_back(problem),
            longest_delay: problem.longest_delay().0,
            latency: problem.latency as f64,
        }
    }

    /// Rows of the lifted plant, N + M.
    pub(super) fn outputs(&self) -> f64 {
        self.channels + self.ratio
    }

    /// Inputs of the lifted plant: no more than it has states and outputs.
    pub(super) fn inputs(&self) -> f64 {
        self.states + self.outputs()
    }

    /// J, lags of the longest phase.
    pub(super) fn lags(&self) -> f64 {
        (self.taps / self.ratio).ceil()
    }

    /// Unknown taps.
    pub(super) fn unknowns(&self) -> f64 {
        self.channels * self.taps
    }

    /// Points of the frequency grid of FIR designs on which the optimum is computed.
    pub(super) fn points(&self) -> f64 {
        coarse_intervals(self.lags() as usize) as f64 + self.lags()
    }

    /// States of the error system of FIR filters.
    pub(super) fn fir_error_states(&self) -> f64 {
        self.states + self.channels * (self.lags() - 1.0).max(0.0)
    }
}

fn look_back(problem: &Problem) -> f64 {
    let ages = problem.channels.iter().map(|channel| problem.latency as f64 - channel.delay.0);
    ages.fold(0.0, f64::max)
}

/// States of all delay chains: one for each whole slow period by which a sample is older than the newest.
fn chain_states(problem: &Problem) -> f64 {
    let references = (0..problem.ratio).map(|p| p as f64 - problem.latency as f64);
    let times: Vec<f64> = problem.channels.iter().map(|channel| -channel.delay.0).chain(references).collect();
    let latest = times.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    times.iter().map(|time| ((latest - time) / problem.ratio as f64).floor()).sum()
}
