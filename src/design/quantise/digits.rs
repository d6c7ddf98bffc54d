//! Integers of few canonical signed digits, for multiplication by shifts and adders.
//!
//! The mean square is a quadratic function of the integers of each phase of the output. From good integers
//! of some scales, the change by a power of two that costs least per digit is made as long as the loss is
//! kept; after each one the other integers follow, so that the mean square is low again. The fewest digits
//! of all scales are chosen. H. Samueli, *An improved search algorithm for the design of multiplierless FIR
//! filters with powers-of-two coefficients*, IEEE Trans. Circuits and Systems 36(7), 1989, for the local
//! search.

use super::phases::{Change, Digits, Phases};
use super::problem::Candidate;
use super::quantiser::Quantiser;
use crate::bank::FixedPoint;
use crate::design::DesignError;
use crate::spec::{MAX_FRACTION_BITS, WordLengths};

/// Steps that are tried, finer than that of the fewest bits by so many bits.
const FINER: std::ops::RangeInclusive<i32> = 0..=3;
/// Changes that are tried, those first that cost least per digit.
const TRIALS: usize = 12;

/// Integers of few digits, near several that keep to the mean square. Those with taps left out have fewer
/// digits to begin with, and less room.
///
/// # Errors
/// As [`Quantiser::quantise`].
pub(super) fn fewest_digits(
    quantiser: &Quantiser<'_>,
    starts: &[&Candidate],
    most: &WordLengths,
) -> Result<Candidate, DesignError> {
    let digits = |found: &Candidate| (found.fixed_point.signed_digits(), found.gamma);
    let mut best = starts[0].clone();
    for (start, finer) in starts.iter().flat_map(|start| FINER.map(move |finer| (start, finer))) {
        let Some(words) = refined(&without_zeros(start.fixed_point.clone()), finer, most) else { continue };
        let mut phases = Phases::new(&quantiser.error, &words, start.mean_square);
        if finer > 0 {
            phases.near_optimum()?;
        }
        let stop = quantiser.error.problem.stop;
        while !stop.is_due() && save_digits(&mut phases, quantiser.most_mean_square)? {}
        let found = quantiser.error.candidate(shortened(phases.fixed_point(&words)))?;
        if quantiser.keeps(&found) && digits(&found) < digits(&best) {
            best = found;
        }
        if stop.is_due() {
            break;
        }
    }
    Ok(best)
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

pub(super) fn is_left_out(words: &FixedPoint, n: usize) -> bool {
    words.integers.iter().all(|list| list[n] == 0)
}

/// Taps that are zero in all channels get no bits.
pub(super) fn without_zeros(words: FixedPoint) -> FixedPoint {
    let left_out: Vec<bool> = (0..words.integers[0].len()).map(|n| is_left_out(&words, n)).collect();
    if words.is_zero() || !left_out.contains(&true) {
        return words;
    }
    let bits = left_out.iter().enumerate().map(|(n, is_out)| if *is_out { 0 } else { words.bits.bits(n) });
    FixedPoint { bits: WordLengths::PerTap(bits.collect()), ..words }
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

/// Makes the first of the cheapest changes that save digits and, once the other taps follow, keep to the
/// mean square; whether there is one.
fn save_digits(phases: &mut Phases, most: f64) -> Result<bool, DesignError> {
    // The others follow by single changes without digits, or by a new search that keeps the changed one.
    for follows in [Follows::ByChanges, Follows::ByLattice] {
        for (p, change) in cheapest(phases, follows)? {
            let mut changed = phases.all[p].clone();
            let alone = changed.make(&change);
            let rest = match follows {
                Follows::ByChanges => changed.improve(phases.least_gain(), Digits::NoMore),
                Follows::ByLattice => changed.near_optimum_beside(&change)?,
            };
            let mean_square = phases.mean_square + alone + rest;
            if mean_square <= most && changed.digits() < phases.all[p].digits() {
                (phases.all[p], phases.mean_square) = (changed, mean_square);
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

/// The changes that save digits, each with its phase: those that cost least per digit.
fn cheapest(phases: &Phases, follows: Follows) -> Result<Vec<(usize, Change)>, DesignError> {
    let mut all = Vec::new();
    for (p, phase) in phases.all.iter().enumerate() {
        let savings = match follows {
            Follows::ByChanges => phase.changes(Digits::NoMore).filter(|change| change.saved > 0).collect(),
            Follows::ByLattice => phase.savings()?,
        };
        all.extend(savings.into_iter().map(|change| (p, change)));
    }
    let per_digit = |change: &Change| change.cost / change.saved as f64;
    all.sort_by(|(_, a), (_, b)| per_digit(a).total_cmp(&per_digit(b)));
    all.truncate(TRIALS);
    Ok(all)
}
