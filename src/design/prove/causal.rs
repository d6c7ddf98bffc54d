//! Searches for the largest gamma that the finite-horizon recursion of [`crate::verify`] refutes.

use crate::bank::CausalWitness;
use crate::verify::{EnclosedErrorSystem, Precision, Recursion};

/// Maximum number of slow periods in 106-bit arithmetic.
const SHORT_PERIODS: usize = 512;
/// Maximum number of slow periods in 512-bit arithmetic, where each takes some milliseconds.
const LONG_PERIODS: usize = 128;
/// Relative distances of the first trial gammas below the upper end. Most banks are almost optimal.
const FIRST_SHORTFALLS: [f64; 3] = [1e-6, 1e-5, 1e-4];
/// Relative width of the interval at which the bisection ends.
const WIDTH: f64 = 1e-5;
/// Maximum number of bisections in 106-bit arithmetic.
const SHORT_BISECTIONS: usize = 24;
/// Maximum number of bisections in 512-bit arithmetic.
const LONG_BISECTIONS: usize = 6;
/// Maximum number of slow periods of one search in 512-bit arithmetic.
pub(in crate::design) const SEARCHED_PERIODS: usize =
    LONG_PERIODS * (FIRST_SHORTFALLS.len() + LONG_BISECTIONS);

/// The largest gamma found in the interval that no causal bank achieves.
pub(super) fn witness(error: &EnclosedErrorSystem<'_>, (lower, upper): (f64, f64)) -> Option<CausalWitness> {
    let refuted = |gamma: f64, precision: Precision| {
        let limit = if precision == Precision::Short { SHORT_PERIODS } else { LONG_PERIODS };
        match error.causal_recursion(gamma, limit, precision) {
            Recursion::Refuted { periods } => Some(CausalWitness { gamma, periods }),
            Recursion::Standing | Recursion::Undecided => None,
        }
    };
    let near = FIRST_SHORTFALLS.map(|shortfall| upper * (1.0 - shortfall));
    let near = near.into_iter().filter(|&gamma| gamma > lower);
    let short = near.clone().find_map(|gamma| refuted(gamma, Precision::Short));
    let reached = short.map_or(lower, |witness| witness.gamma);
    if reached >= upper * (1.0 - FIRST_SHORTFALLS[1]) {
        return short;
    }
    let long = near.filter(|&gamma| gamma > reached).find_map(|gamma| refuted(gamma, Precision::Long));
    let search = |precision, count| bisected((lower, upper), count, |gamma| refuted(gamma, precision));
    long.or(short)
        .or_else(|| search(Precision::Short, SHORT_BISECTIONS))
        .or_else(|| search(Precision::Long, LONG_BISECTIONS))
}

/// `count` bisections between the ends, at the geometric mean because the ends may be far apart.
fn bisected(
    (lower, upper): (f64, f64),
    count: usize,
    refuted: impl Fn(f64) -> Option<CausalWitness>,
) -> Option<CausalWitness> {
    let (mut best, mut below, mut standing) = (None, lower, upper);
    for _ in 0..count {
        if standing - below <= WIDTH * standing {
            break;
        }
        let gamma = if below > 0.0 { (below * standing).sqrt() } else { 0.1 * standing };
        match refuted(gamma) {
            Some(witness) => (best, below) = (Some(witness), gamma),
            None => standing = gamma,
        }
    }
    best
}
