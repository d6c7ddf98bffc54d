//! The fewest bits of integer taps for an allowed loss of SNR, and then the taps that can be left out.
//!
//! Integers that fit few bits fit more bits, so the least loss of all integers falls with the bits, and so
//! does the number of taps that can stay: both are found by bisection.
//!
//! Each tap adds the power of its own rounding, so the sum of all bits is least where all taps have one step
//! (as in the filling of water in rate-distortion theory), the coarsest one that keeps to the loss. Each
//! word is then as long as the integers of its tap.

use super::problem::RoundedTaps;
use super::quantiser::TapQuantiser;
use super::{NEIGHBOURS, QuantisationProblem, TapsOfBits, WordChoice, WordStudy};
use crate::design::DesignError;
use hybank_core::bank::FixedPoint;
use hybank_core::spec::{MAX_BITS, WordLengths};
use std::collections::BTreeMap;
use std::ops::Range;

/// What integer taps may lose and take.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::design) struct Allowance {
    /// The most that the whole error may grow, in decibels.
    pub(in crate::design) loss_db: f64,
    /// The most bits.
    pub(in crate::design) most: WordLengths,
}

/// Integers near the filters of `problem`, whose norm is `real_gamma`, that lose no more SNR than allowed:
/// of the coarsest step that was found, and of these as many taps as possible left out. Among these gamma
/// decides. Each tap has the bits that its integers need.
///
/// # Errors
/// [`DesignError::WordsLoseMore`] if the most bits lose more, else as [`super::quantise`].
pub(in crate::design) fn quantise_within(
    problem: QuantisationProblem<'_>,
    real_gamma: f64,
    allowance: &Allowance,
) -> Result<(FixedPoint, WordStudy), DesignError> {
    let quantiser = TapQuantiser::within(problem, allowance.loss_db)?;
    let fewest = fewest_bits(&quantiser, allowance)?;
    let more_or_fewer = NEIGHBOURS.into_iter().filter_map(|more| fewest.fixed_point.bits.widened(more));
    let beside = quantiser.quantise_all(&more_or_fewer.collect::<Vec<_>>(), None)?;
    // The search does not always find the best integers, so fewer bits may keep to the loss too.
    let fewest = beside.iter().find(|found| quantiser.keeps(found)).unwrap_or(&fewest);
    let chosen = leave_out(&quantiser, &coarsest(&quantiser, fewest)?)?;
    let words = beside.iter().map(|found| quantiser.loss(found, None)).collect::<Result<_, _>>()?;
    let snr_loss_db = quantiser.mean_square_loss_db(&chosen);
    let needed = needed_bits(&chosen.fixed_point);
    let choice = WordChoice {
        allowed_db: allowance.loss_db,
        snr_loss_db,
        taps_left_out: needed.iter().filter(|&&bits| bits == 0).count(),
        taps: taps_of_bits(&needed),
        bits_per_channel: needed.iter().sum(),
    };
    let fixed_point = with_bits(chosen.fixed_point, needed);
    let least_gamma = quantiser.error.least_gamma;
    Ok((fixed_point, WordStudy { real_gamma, least_gamma, words, choice: Some(choice) }))
}

/// Integers of the fewest bits that keep to the loss.
fn fewest_bits(
    quantiser: &TapQuantiser<'_>,
    Allowance { loss_db, most }: &Allowance,
) -> Result<RoundedTaps, DesignError> {
    let longest = quantiser.quantise(most, None)?;
    if !quantiser.keeps(&longest) {
        let best = quantiser.mean_square_loss_db(&longest);
        return Err(DesignError::WordsLoseMore { bits: most.clone(), best, allowed: *loss_db });
    }
    let lengths: Vec<WordLengths> = (0..).map_while(|fewer: i32| most.widened(-fewer)).collect();
    last_that_keeps(quantiser, longest, 0..lengths.len(), |fewer| quantiser.quantise(&lengths[fewer], None))
}

/// The same bits at the coarsest scale that keeps to the loss: each step saves a bit of every tap, where the
/// bits of the largest one leave the scale open.
fn coarsest(quantiser: &TapQuantiser<'_>, found: &RoundedTaps) -> Result<RoundedTaps, DesignError> {
    let FixedPoint { bits, fraction_bits, .. } = &found.fixed_point;
    let mut best = found.clone();
    for coarser in 1..MAX_BITS as i32 {
        let tried = quantiser.quantise(bits, Some(fraction_bits - coarser))?;
        if !quantiser.keeps(&tried) || quantiser.error.problem.stop.is_due() {
            break;
        }
        best = tried;
    }
    Ok(best)
}

/// The same bits with as many taps left out as the loss allows: those whose integers matter least, and the
/// others chosen again.
fn leave_out(quantiser: &TapQuantiser<'_>, found: &RoundedTaps) -> Result<RoundedTaps, DesignError> {
    let FixedPoint { bits, integers, fraction_bits } = &found.fixed_point;
    let powers = quantiser.error.powers();
    let size = |n: usize| -> f64 {
        integers.iter().zip(&powers).map(|(list, power)| power * (list[n] as f64).powi(2)).sum()
    };
    let mut order: Vec<usize> = (0..integers[0].len()).collect();
    order.sort_by(|&a, &b| size(a).total_cmp(&size(b)));
    let few = order.iter().filter(|&&n| size(n) == 0.0).count();
    last_that_keeps(quantiser, found.clone(), few..order.len(), |count| {
        let bits = |n: usize| if order[..count].contains(&n) { 0 } else { bits.bits(n) };
        let words = WordLengths::PerTap((0..order.len()).map(bits).collect());
        quantiser.quantise(&words, Some(*fraction_bits))
    })
}

/// Integers of the last of a sequence of choices that keeps to the loss, by bisection. `first`, the integers
/// of the first, keeps to it. When the design is stopped, the last that were found.
fn last_that_keeps(
    quantiser: &TapQuantiser<'_>,
    first: RoundedTaps,
    mut open: Range<usize>,
    of: impl Fn(usize) -> Result<RoundedTaps, DesignError>,
) -> Result<RoundedTaps, DesignError> {
    let mut best = first;
    while open.len() > 1 && !quantiser.error.problem.stop.is_due() {
        let middle = open.start + open.len() / 2;
        let tried = of(middle)?;
        if quantiser.keeps(&tried) {
            (open.start, best) = (middle, tried);
        } else {
            open.end = middle;
        }
    }
    Ok(best)
}

/// The bits of the integers of each tap in all channels; 0 of a tap that is left out.
fn needed_bits(words: &FixedPoint) -> Vec<u32> {
    // In two's complement -x - 1 is as long as x.
    let bits = |x: i64| if x == 0 { 0 } else { i64::BITS + 1 - (x ^ (x >> (i64::BITS - 1))).leading_zeros() };
    let of_tap = |n: usize| words.integers.iter().map(|list| bits(list[n])).max().unwrap_or(0);
    (0..words.integers[0].len()).map(of_tap).collect()
}

fn taps_of_bits(needed: &[u32]) -> Vec<TapsOfBits> {
    let mut counts: BTreeMap<u32, usize> = BTreeMap::new();
    for bits in needed.iter().filter(|bits| **bits > 0) {
        *counts.entry(*bits).or_default() += 1;
    }
    counts.into_iter().map(|(bits, taps)| TapsOfBits { bits, taps }).collect()
}

/// The same integers in words of these bits, unless these are none that a bank may have.
fn with_bits(words: FixedPoint, needed: Vec<u32>) -> FixedPoint {
    match needed.iter().all(|bits| *bits < 2) {
        true => words,
        false => FixedPoint { bits: WordLengths::PerTap(needed), ..words },
    }
}
