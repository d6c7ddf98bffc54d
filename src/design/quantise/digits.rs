//! Integers of few canonical signed digits, for multiplication by shifts and adders.
//!
//! The mean square is a quadratic function of the integers of each phase of the output. From good integers of
//! some scales, the change by a power of two that costs least per digit is made as long as the loss is kept;
//! after each one, changes that take no digit lower the mean square again. The fewest digits of all scales
//! are chosen. H. Samueli, *An improved search algorithm for the design of multiplierless FIR filters with
//! powers-of-two coefficients*, IEEE Trans. Circuits and Systems 36(7), 1989, for the local search.

use super::phases::{Change, Digits, Phases};
use super::problem::Candidate;
use super::quantiser::{Quantised, Quantiser};
use crate::bank::FixedPoint;
use crate::design::DesignError;
use crate::spec::{MAX_FRACTION_BITS, WordLengths};

/// Steps that are tried, finer than that of the fewest bits by so many bits.
const FINER: std::ops::RangeInclusive<i32> = 0..=3;
/// Changes that are tried, those first that cost least per digit.
const TRIALS: usize = 12;

/// Integers of few digits, from those of the fewest bits.
///
/// # Errors
/// As [`Quantiser::quantise`].
pub(super) fn fewest_digits(
    quantiser: &Quantiser<'_>,
    start: &Quantised,
    most: &WordLengths,
) -> Result<Quantised, DesignError> {
    let Quantised { fixed_point, gamma, mean_square, rounded } = start.clone();
    let mut best = Candidate { fixed_point, gamma, mean_square };
    for finer in FINER {
        let Some(words) = refined(&start.fixed_point, finer, most) else { break };
        let mut phases = Phases::new(&quantiser.error, &words, mean_square);
        phases.near_optimum()?;
        while save_digits(&mut phases, quantiser.most_mean_square)? {}
        let found = quantiser.error.candidate(shortened(phases.fixed_point(&words)))?;
        let key = |found: &Candidate| (found.fixed_point.signed_digits(), found.gamma);
        if found.mean_square <= quantiser.most_mean_square && key(&found) < key(&best) {
            best = found;
        }
        if quantiser.error.problem.stop.is_due() {
            break;
        }
    }
    let Candidate { fixed_point, gamma, mean_square } = best;
    Ok(Quantised { fixed_point, gamma, mean_square, rounded })
}

/// The same taps with a step finer by so many bits; `None` beyond the most bits.
fn refined(words: &FixedPoint, finer: i32, most: &WordLengths) -> Option<FixedPoint> {
    let bits = words.bits.widened(finer)?;
    let fits = (0..words.integers[0].len()).all(|n| bits.bits(n) <= most.bits(n));
    let fraction_bits =
        Some(words.fraction_bits + finer).filter(|bits| fits && *bits <= MAX_FRACTION_BITS)?;
    let integers = words.integers.iter().map(|list| list.iter().map(|x| x << finer).collect()).collect();
    Some(FixedPoint { bits, fraction_bits, integers })
}

/// The same taps with the longest step and the fewest bits that hold them.
fn shortened(words: FixedPoint) -> FixedPoint {
    let all = || words.integers.iter().flatten().copied().filter(|integer| *integer != 0);
    let Some(shift) = all().map(i64::trailing_zeros).min() else { return words };
    let shift = shift.min((words.fraction_bits + MAX_FRACTION_BITS) as u32);
    let own = |x: i64| 1 + i64::BITS - (if x < 0 { !x } else { x }).leading_zeros();
    let bits = all().map(|integer| own(integer >> shift)).max().unwrap_or(0).max(2);
    let integers = words.integers.iter().map(|list| list.iter().map(|x| x >> shift).collect()).collect();
    FixedPoint { bits: WordLengths::Same(bits), fraction_bits: words.fraction_bits - shift as i32, integers }
}

/// Makes the first of the cheapest changes that save digits and, once the other taps follow, keep to the mean
/// square; whether there is one.
fn save_digits(phases: &mut Phases, most: f64) -> Result<bool, DesignError> {
    let saving = |p: usize| {
        let changes = phases.all[p].changes(Digits::NoMore).filter(|change| change.saved > 0);
        changes.map(|change| (p, change)).collect::<Vec<_>>()
    };
    let mut all: Vec<(usize, Change)> = (0..phases.all.len()).flat_map(saving).collect();
    let per_digit = |change: &Change| change.cost / change.saved as f64;
    all.sort_by(|(_, a), (_, b)| per_digit(a).total_cmp(&per_digit(b)));
    let least = phases.least_gain();
    all.truncate(TRIALS);
    // The others follow by single changes, or by a new search that keeps the changed one.
    for follows in [Follows::ByChanges, Follows::ByLattice] {
        for (p, change) in &all {
            let mut changed = phases.all[*p].clone();
            changed.make(change);
            let cost = match follows {
                Follows::ByChanges => changed.improve(least, Digits::NoMore),
                Follows::ByLattice => changed.near_optimum_beside(change)?,
            };
            let mean_square = phases.mean_square + change.cost + cost;
            if mean_square <= most && changed.digits() < phases.all[*p].digits() {
                (phases.all[*p], phases.mean_square) = (changed, mean_square);
                return Ok(true);
            }
        }
    }
    Ok(false)
}

/// How the other integers follow a change of one.
#[derive(Debug, Clone, Copy)]
enum Follows {
    ByChanges,
    ByLattice,
}
