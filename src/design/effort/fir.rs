//! The effort of FIR designs.

use super::amount::Effort;
use super::cost::{
    COMPLEX, PRODUCT, REAL, SMALL, SURVEYED, causal_bound, complex_cube, is_noncausal, peak, proof, response,
    smoother,
};
use super::sizes::Sizes;
use crate::design::error_grid::FINE;
use crate::design::methods::fir_kyp::MAX_STATES;
use crate::design::prove::MOST_LONG_TAPS;

/// Interior-point iterations and rounds of the exchange of one design.
const ITERATIONS: f64 = 25.0;
const ROUNDS: f64 = 4.0;
/// Norms of one design: of the taps, and of those after a peak that the grid missed.
const NORMS: f64 = 2.0;

/// Nodes of the average over a delay, usually.
const AVERAGING_NODES: f64 = 400.0;
/// Seconds per cube of the taps of a search for witnesses in 512 bits.
const LONG_WITNESSES: f64 = 1.1e-7;

/// A design by the exchange of frequencies.
pub(super) fn design(sizes: &Sizes) -> Effort {
    let exchange = grid(sizes).with(iteration(sizes).times(ITERATIONS)).with(errors(sizes).times(ROUNDS));
    exchange.then(norm(sizes).times(NORMS)).then(noncausal(sizes))
}

/// Plants and norms of all scenarios, and an exchange of pairs of a frequency and a scenario.
pub(super) fn robust(sizes: &Sizes, scenarios: usize) -> Effort {
    let scenarios = scenarios as f64;
    let exchange = grid(sizes)
        .each(scenarios + 1.0)
        .with(iteration_on(sizes, 2.0 * sizes.points()).times(ROUNDS * ITERATIONS))
        .with(errors(sizes).times(scenarios * ROUNDS));
    exchange.then(norm(sizes).times(2.0 * scenarios)).then(noncausal(sizes).times(scenarios))
}

/// Scenarios of a box of delays, about.
const SCENARIOS: f64 = 32.0;

/// A design of taps that are scheduled by the delays of all channels but one: every tap is a function of N
/// numbers.
pub(super) fn affine(sizes: &Sizes) -> Effort {
    let functions = Sizes { channels: sizes.channels * sizes.channels, ..*sizes };
    let points = 2.0 * sizes.channels * sizes.points();
    let rounds = 2.0 * ROUNDS;
    let exchange = grid(sizes)
        .each(SCENARIOS)
        .with(iteration_on(&functions, points).times(rounds * ITERATIONS))
        .with(errors(sizes).times(SCENARIOS * rounds));
    exchange.then(norm(sizes).times(2.0 * SCENARIOS))
}

/// The least errors of these taps at all latencies, for the phases with most lags and for the others.
pub(super) fn reachable(sizes: &Sizes) -> Effort {
    smoother(sizes, sizes.lags() + sizes.longest_delay / sizes.ratio, SURVEYED).times(2.0)
}

/// The plant at all frequencies of the fine grid, with a copy of the coarse one.
fn grid(sizes: &Sizes) -> Effort {
    let kept = COMPLEX * sizes.outputs() * sizes.outputs().min(sizes.inputs());
    let points = FINE as f64 * sizes.points();
    let Effort { seconds, bytes } = response(sizes).times(points);
    Effort { seconds, bytes: bytes + (points + 2.0 * sizes.points()) * kept }
}

/// An interior-point iteration: blocks of order M + N at each frequency, and the Newton matrix of the taps.
fn iteration(sizes: &Sizes) -> Effort {
    iteration_on(sizes, sizes.points())
}

/// The same with another number of frequencies.
fn iteration_on(sizes: &Sizes, points: f64) -> Effort {
    let (n, m, u, lags) = (sizes.channels, sizes.ratio, sizes.unknowns(), sizes.lags());
    let order = m + n.min(sizes.inputs());
    let blocks = points * complex_cube(order);
    let rows = m.min(sizes.taps);
    let sums = 0.5 * rows * rows * n * n * points;
    let products = 12.0 * lags * sums;
    let factor = u.powi(3) / 3.0;
    Effort {
        seconds: blocks + SMALL * (32.0 * sums + 2.0 * u * u) + PRODUCT * (products + factor),
        bytes: COMPLEX * points * order * order * 9.0 + REAL * u * u * 3.0,
    }
}

/// The error of taps on the fine grid.
fn errors(sizes: &Sizes) -> Effort {
    gain(sizes).times(FINE as f64 * sizes.points())
}

/// The error of taps at one frequency and its largest singular value.
fn gain(sizes: &Sizes) -> Effort {
    let (n, m) = (sizes.channels, sizes.ratio);
    let columns = sizes.outputs().min(sizes.inputs());
    let response = 8.0 * m * n * sizes.lags();
    changed(sizes).with(Effort { seconds: SMALL * response, bytes: COMPLEX * m * columns })
}

/// The same after a change of one tap.
fn changed(sizes: &Sizes) -> Effort {
    let columns = sizes.outputs().min(sizes.inputs());
    let product = 8.0 * sizes.ratio * sizes.channels * columns;
    Effort { seconds: SMALL * product + 0.45 * complex_cube(sizes.ratio), bytes: 0.0 }
}

/// The norm of the error of taps.
fn norm(sizes: &Sizes) -> Effort {
    peak(sizes.fir_error_states(), response(sizes).with(gain(sizes)))
}

/// The search for a proof: of the norm, and of the lower bound by the taps that up to 64 directions need.
pub(super) fn proven(sizes: &Sizes) -> Effort {
    let (rows, unknowns) = (128.0 * sizes.channels, sizes.unknowns());
    let certificate = proof(sizes.fir_error_states());
    if certificate == Effort::default() {
        return certificate;
    }
    let seconds = 4.0 * 2.2e-10 * rows * unknowns * rows.min(unknowns);
    let is_short = unknowns > MOST_LONG_TAPS as f64 || is_noncausal(sizes);
    let long = if is_short { 0.0 } else { LONG_WITNESSES * unknowns.powi(3) };
    let witnesses = Effort { seconds: 0.5 * seconds + long, bytes: 5.0 * REAL * rows * unknowns };
    certificate.then(witnesses).then(causal_bound(sizes))
}

/// The noncausal bound.
fn noncausal(sizes: &Sizes) -> Effort {
    peak(sizes.front_end_states, response(sizes))
}

/// Taps of a method that minimises nothing: their norm and the noncausal bound.
pub(super) fn judged(sizes: &Sizes) -> Effort {
    norm(sizes).then(noncausal(sizes))
}

/// The scale that is stated beside gamma: the errors of a bank of zeros and of plain interleaving, whose
/// taps reach back over the latency that the delays leave.
pub(super) fn scale(sizes: &Sizes) -> Effort {
    judged(&Sizes { taps: sizes.look_back + sizes.ratio, ..*sizes })
}

/// The bank of least mean square: the smoother passes through the history once for the phases with most lags
/// and once for the others.
pub(super) fn mean_square(sizes: &Sizes) -> Effort {
    smoother(sizes, sizes.lags(), sizes.ratio).times(2.0).then(judged(sizes))
}

/// The bank of least mean square over uncertain delays: a covariance for each pair of channels and each lag,
/// and two factorisations.
pub(super) fn averaged(sizes: &Sizes) -> Effort {
    let (s, pairs) = (sizes.front_end_states, sizes.channels * (sizes.channels + sizes.ratio));
    let lags = 2.0 * sizes.lags();
    let exponential = 40.0 * s.powi(3) + 8000.0;
    let tables = pairs * AVERAGING_NODES * s * s;
    let rows = sizes.channels * sizes.lags();
    let seconds = SMALL * (pairs * lags * exponential + tables) + PRODUCT * rows.powi(3);
    Effort { seconds, bytes: 3.0 * REAL * rows * rows }.then(judged(sizes))
}

/// A bank for whole delays and a fractional delay for each channel.
pub(super) fn separation(sizes: &Sizes) -> Effort {
    let alone = Sizes { channels: 1.0, ratio: 1.0, taps: (0.5 * sizes.lags()).ceil(), ..*sizes };
    design(sizes).then(design(&alone).times(sizes.channels)).then(judged(sizes))
}

/// The bounded-real LMI: its time grows with the sixth power of the states. The method itself refuses more
/// than [`MAX_STATES`], at once.
pub(super) fn by_lmi(sizes: &Sizes) -> Effort {
    let states = sizes.fir_error_states();
    if states > MAX_STATES as f64 {
        return Effort::default();
    }
    let unknowns = 0.5 * states * states;
    Effort { seconds: 40.0 * PRODUCT * unknowns.powi(3), bytes: 3.0 * REAL * unknowns * unknowns }
}

/// Integer taps of five word lengths: lattice points close to the optimum, then single steps, each judged
/// on the fine grid.
pub(super) fn integers(sizes: &Sizes) -> Effort {
    let phase = sizes.unknowns() / sizes.ratio;
    let lattice = sizes.ratio * (phase.powi(3) / 3.0 * PRODUCT + 130.0 * phase * phase * SMALL) * 60.0;
    let change = FINE as f64 * sizes.points() * changed(sizes).seconds;
    let descent = 0.5 * sizes.unknowns() * change * 5.0;
    let grid = grid(sizes);
    grid.with(Effort { seconds: lattice + descent, bytes: 3.0 * REAL * phase * phase })
}
