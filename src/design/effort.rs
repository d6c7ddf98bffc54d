//! Time and memory of a design, estimated before it starts.
//!
//! Every step of a design is dense linear algebra on matrices whose sizes follow from the spec. The estimate
//! counts the operations of the steps that take longest, by one formula per method, and divides by one rate.
//! How many rounds a search takes, and whether a proof needs 512 bits, shows only on the way, so the time is
//! a range. The times that docs/figures.md has lie within it, or beyond by half at most.
//! The memory is that of the largest matrices that exist at one time.

use super::DesignError;
use super::error_grid::{FINE, coarse_intervals};
use super::limits::{Effort, Limits, MAX_LONG_STATES, Range};
use super::merging::Repeats;
use super::methods::{Deviations, robust_fir::RobustProblem};
use super::problem::{Problem, common_delay};
use super::prove::{MAX_SEARCHED_STATES, max_witnesses};
use crate::memory::available_memory;
use crate::spec::{Method, Reduction, Spec};

/// Operations at that rate for an interior-point block, relative to the square of its order, and for a gain
/// of such a block: cubes, but the rate of complex decompositions grows with the order.
const BLOCK_OPERATIONS: f64 = 8500.0;
const GAIN_OPERATIONS: f64 = 1000.0;
/// For the norm of a system, times the powers of its states: the eigenvalues of two matrices of twice the
/// order, at a rate that grows with the order.
const NORM_OPERATIONS: Powers = Powers { none: 5e7, square: 2e4, cube: 45.0 };
/// For a Riccati equation with its trials, times the cube of the states.
const RICCATI_OPERATIONS: f64 = 1500.0;
/// For a certificate in double precision, and for one in 512 bits with the bounds that need them.
const CERTIFICATE_OPERATIONS: Powers = Powers { none: 1.5e8, square: 1.2e5, cube: 900.0 };
const LONG_CERTIFICATE_OPERATIONS: f64 = 1.3e5;
/// Certificates that are tried, and how fast: processors differ by a factor of four in small matrices.
const CERTIFICATES: Range = Range { least: 0.25, most: 1.5 };
/// Interior-point iterations of an exchange.
const ITERATIONS: Range = Range { least: 9.0, most: 75.0 };
/// Sweeps over integer taps, all word lengths together.
const SWEEPS: Range = Range { least: 5.0, most: 25.0 };
/// Norms of each scenario of a robust design, and operations of the proof over its box: a limit holds for
/// them.
const NORMS_OF_SCENARIOS: Range = Range { least: 1.0, most: 4.0 };
const BOX_PROOF_OPERATIONS: Range = Range { least: 3e9, most: 1e11 };
/// Histories through which the smoother passes for an open number of taps, whose lengths are doubled and
/// then halved, and for an open latency.
const HISTORIES: [f64; 2] = [24.0, 2.0];
/// Samples of the target whose errors may still fall at one instant of such a history.
const OPEN_TARGETS: f64 = 64.0;
/// Slow periods of latency at which banks of a wanted order are designed where the latency is open.
const PERIODS_COMPARED: f64 = 6.0;
/// Frames of a history that stands for all past samples, and of a bank whose taps are still to be chosen.
const LONG_HISTORY: f64 = 256.0;
const USUAL_FRAMES: usize = 24;
/// Bytes of a real and of a complex number, and of everything that does not grow with the sizes.
const REAL_BYTES: f64 = 8.0;
const COMPLEX_BYTES: f64 = 16.0;
const BASE_BYTES: f64 = 10e6;

/// The effort of the design of a spec, whose latency and taps may still be to be chosen; with the search for
/// a proof if `proving`, and with the scale of gamma that is reported.
///
/// # Errors
/// [`DesignError`] if the spec has no [`Problem`].
pub fn estimate(spec: &Spec, proving: bool) -> Result<Effort, DesignError> {
    let sizes = Sizes::of(spec)?;
    let mut effort = sizes.method(spec).then(sizes.norms());
    if proving {
        effort = effort.then(sizes.proof(spec.design.method));
    }
    if spec.design.has_integers() {
        // For a loss, more word lengths, and taps left out.
        let most = if spec.design.loss_db.is_some() { 3.0 } else { 1.0 };
        effort = effort.then(sizes.integers().times(Range { least: 1.0, most }));
    }
    if proving && RobustProblem::of(spec).is_some() {
        effort = effort.then(Effort::of(1.0, 0.0).times(BOX_PROOF_OPERATIONS));
    }
    if spec.design.reduction.is_some() {
        // A norm for each order that is visited.
        let norms = sizes.norms().times(Range { least: 2.0, most: 2.0 * sizes.states.min(40.0) });
        effort = effort.then(norms);
    }
    if matches!(spec.design.reduction, Some(Reduction::Order(_))) && spec.latency.is_none() {
        // The banks of some slow periods of latency are compared.
        effort = effort.times(Range { least: 1.0, most: PERIODS_COMPARED * sizes.ratio });
    }
    if spec.is_fir() && spec.design.taps.is_none() {
        effort = effort.then(sizes.smoother(HISTORIES[0], sizes.lags(), OPEN_TARGETS));
    } else if spec.latency.is_none() {
        let frames = if spec.is_fir() { sizes.lags() } else { LONG_HISTORY };
        effort = effort.then(sizes.smoother(HISTORIES[1], frames, OPEN_TARGETS));
    }
    Ok(Effort { bytes: effort.bytes + BASE_BYTES, ..effort })
}

/// Refuses what cannot end in time or needs more memory than is free.
///
/// # Errors
/// [`DesignError::TooLong`] or [`DesignError::TooLarge`], with the figures and the way out.
pub(super) fn check(spec: &Spec, proving: bool, limits: Limits) -> Result<Effort, DesignError> {
    let (effort, memory) = (estimate(spec, proving)?, available_memory());
    let remedy = remedy(spec);
    match (limits.time(), memory) {
        (None, _) => Ok(effort),
        (_, Some(memory)) if effort.bytes > memory => Err(DesignError::TooLarge { effort, memory, remedy }),
        (Some(limit), _) if effort.shortest > limit.as_secs_f64() => {
            Err(DesignError::TooLong { effort, limit, remedy })
        }
        _ => Ok(effort),
    }
}

/// What makes the design of a spec shorter.
pub fn remedy(spec: &Spec) -> &'static str {
    match spec.design.method {
        Method::Fir if spec.design.has_integers() => {
            "use fewer taps, leave out bits, take a smaller ratio or fewer channels"
        }
        Method::Fir if spec.design.tracking => {
            "use fewer taps or channels, a smaller ratio, or leave out tracking"
        }
        Method::Fir if spec.uncertainty.is_some() => {
            "use fewer taps, a smaller ratio or fewer channels, or leave out [uncertainty]"
        }
        Method::Iir | Method::H2 if spec.design.reduction.is_some() => {
            "use a shorter latency, leave out the order reduction, or use the method fir"
        }
        Method::Iir | Method::H2 => {
            "use a shorter latency, a smaller ratio, fewer channels, or the method fir"
        }
        Method::Fir | Method::Sinc | Method::Separation => {
            "use fewer taps, a smaller ratio or fewer channels"
        }
    }
}

/// Factors of the powers of a number.
#[derive(Debug, Clone, Copy)]
struct Powers {
    none: f64,
    square: f64,
    cube: f64,
}

impl Powers {
    fn at(self, x: f64) -> f64 {
        self.none + self.square * x * x + self.cube * x * x * x
    }
}

/// The sizes of a design problem, as numbers to compute with: those of all matrices follow from these.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Sizes {
    /// N, distinct channels, and M.
    channels: f64,
    ratio: f64,
    /// States of the lifted plant, and of its analog side alone.
    states: f64,
    analog_states: f64,
    /// Taps per channel at the fast rate; 0 for recursive filters.
    taps: f64,
}

impl Sizes {
    /// Of a spec, with a guess where latency or taps are open.
    fn of(spec: &Spec) -> Result<Self, DesignError> {
        let usual = if spec.is_fir() { USUAL_FRAMES * spec.ratio } else { 0 };
        let taps = spec.design.taps.unwrap_or(usual);
        let common = if spec.latency.is_none() { common_delay(spec) } else { 0 };
        let problem = Problem::new(spec, spec.latency.unwrap_or(common))?.earlier(common);
        let mut problem = problem.merge_channels(Repeats::of(spec)).problem;
        if spec.latency.is_none() {
            problem.latency = problem.longest_delay().0.ceil() as usize + taps / 4;
        }
        let analog_states = problem.analog_states() as f64;
        Ok(Self {
            channels: problem.channels.len() as f64,
            ratio: problem.ratio as f64,
            states: analog_states + problem.chain_states(),
            analog_states,
            taps: taps as f64,
        })
    }

    /// Rows of the lifted plant, N + M.
    fn outputs(&self) -> f64 {
        self.channels + self.ratio
    }

    /// J, lags of the longest phase.
    fn lags(&self) -> f64 {
        (self.taps / self.ratio).ceil()
    }

    /// Points of the frequency grid on which the optimum is computed.
    fn points(&self) -> f64 {
        coarse_intervals(self.lags() as usize) as f64 + self.lags()
    }

    /// States of the error system: those of the plant, and of the delay lines or of a filter as large.
    fn error_states(&self) -> f64 {
        let own = if self.taps > 0.0 { self.channels * (self.lags() - 1.0).max(0.0) } else { self.states };
        self.states + own
    }

    /// The method itself.
    fn method(&self, spec: &Spec) -> Effort {
        match spec.design.method {
            Method::Fir => self.exchange(RobustProblem::of(spec), spec.design.tracking),
            Method::H2 if spec.is_fir() && Deviations::of(spec).is_some() => self.averaged(),
            Method::H2 if spec.is_fir() => self.smoother(2.0, self.lags(), self.ratio),
            Method::Iir | Method::H2 => {
                let order = self.states + self.channels;
                Effort::of(RICCATI_OPERATIONS * order.powi(3), 20.0 * REAL_BYTES * order * order)
            }
            Method::Sinc => Effort::default(),
            Method::Separation => self.exchange(None, false),
        }
    }

    /// An exchange of frequencies, or of pairs of a frequency and a scenario: blocks of order M + N at each
    /// point, and the Newton matrix of the taps, which are affine in the errors of the channels if
    /// `tracking`.
    fn exchange(&self, robust: Option<RobustProblem>, tracking: bool) -> Effort {
        let scenarios = robust.map_or(0.0, |problem| problem.scenario_count() as f64);
        let (n, m, p) = (self.channels, self.ratio, self.outputs());
        let functions = if tracking { n } else { 1.0 };
        let (columns, unknowns) = (functions * n, functions * n * self.taps);
        let points = self.points();
        let blocks = BLOCK_OPERATIONS * points * p * p;
        let products = points * (m.min(self.taps) * columns).powi(2) * (64.0 + 4.0 * self.lags());
        let iteration = blocks + products + unknowns.powi(3) / 12.0;
        // Scenarios take more rounds, on twice the points.
        let rounds = if scenarios > 0.0 { 4.0 + functions } else { 1.0 };
        let fine = FINE as f64 * points * (1.0 + scenarios);
        let grid = fine * p * (12.0 * self.analog_states.powi(2) + GAIN_OPERATIONS * p);
        let norms =
            Effort::of(scenarios * NORM_OPERATIONS.at(self.error_states()), 0.0).times(NORMS_OF_SCENARIOS);
        let kept = COMPLEX_BYTES * p * p * (fine + 9.0 * points);
        let newton = Effort::of(rounds * iteration, kept + 3.0 * REAL_BYTES * unknowns * unknowns);
        newton.times(ITERATIONS).then(Effort::of(grid, 0.0)).then(norms)
    }

    /// The bank of least mean square over uncertain delays: a covariance for each pair of channels and each
    /// lag, and two factorisations.
    fn averaged(&self) -> Effort {
        let rows = self.channels * self.lags();
        let pairs = self.channels * self.outputs() * 2.0 * self.lags();
        let covariances = pairs * (160.0 * self.analog_states.powi(3) + 3e4);
        Effort::of(covariances + 0.6 * rows.powi(3), 3.0 * REAL_BYTES * rows * rows)
    }

    /// The fixed-point smoother so many times over so many frames, with so many samples of the target open.
    fn smoother(&self, times: f64, frames: f64, targets: f64) -> Effort {
        let (s, steps) = (self.analog_states, frames * self.outputs());
        Effort::of(times * steps * 32.0 * s * s * (s + targets), COMPLEX_BYTES * (s * s + steps * s))
    }

    /// The norm of the bank, of plain interleaving, and those of the search.
    fn norms(&self) -> Effort {
        let states = self.error_states();
        Effort::of(3.0 * NORM_OPERATIONS.at(states), 20.0 * REAL_BYTES * states * states)
    }

    /// The search for a proof, which may need 512 bits where they are tried, and for FIR banks of least
    /// gamma all directions.
    fn proof(&self, method: Method) -> Effort {
        let states = self.error_states();
        if states > MAX_SEARCHED_STATES as f64 {
            return Effort::default();
        }
        let long =
            if states > MAX_LONG_STATES as f64 { 0.0 } else { LONG_CERTIFICATE_OPERATIONS * states.powi(3) };
        let taps = if method == Method::Fir { self.channels * self.taps } else { 0.0 };
        let rows = 2.0 * max_witnesses(taps as usize) as f64 * self.channels;
        let witnesses = 4.0 * rows * taps * rows.min(taps);
        let bytes = REAL_BYTES * (30.0 * states * states + 5.0 * rows * taps);
        let certificates = Effort::of(CERTIFICATE_OPERATIONS.at(states), bytes).times(CERTIFICATES);
        certificates.perhaps(Effort::of(long + witnesses, 0.0))
    }

    /// Integer taps of five word lengths: lattice points close to the optimum, then single steps, each
    /// judged on the fine grid.
    fn integers(&self) -> Effort {
        let (phase, p) = (self.channels * self.lags(), self.outputs());
        let lattice = 60.0 * self.ratio * (0.2 * phase.powi(3) + 520.0 * phase * phase);
        let fine = FINE as f64 * self.points();
        let step = fine * (32.0 * self.channels * p + GAIN_OPERATIONS * self.ratio) * self.ratio;
        let bytes = COMPLEX_BYTES * p * p * fine + 3.0 * REAL_BYTES * phase * phase;
        Effort::of(lattice, bytes).then(Effort::of(self.channels * self.taps * step, 0.0).times(SWEEPS))
    }
}

#[cfg(test)]
mod tests;
