//! The fewest bits of integer taps for an allowed loss of SNR, and then the taps that can be left out.
//!
//! Integers that fit few bits fit more bits, so the least loss of all integers falls with the bits, and so
//! does the number of taps that can stay: both are found by bisection.

use super::problem::RoundedTaps;
use super::quantiser::TapQuantiser;
use super::{NEIGHBOURS, QuantisationProblem, WordChoice, WordStudy};
use crate::design::DesignError;
use hybank_core::bank::FixedPoint;
use hybank_core::spec::WordLengths;
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
/// of the fewest bits that were found, and of these as many taps as possible left out. Among these gamma
/// decides.
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
    let chosen = leave_out(&quantiser, fewest)?;
    let words = beside.iter().map(|found| quantiser.loss(found, None)).collect::<Result<_, _>>()?;
    let snr_loss_db = quantiser.mean_square_loss_db(&chosen);
    let fixed_point = without_zeros(chosen.fixed_point);
    let choice = WordChoice {
        allowed_db: allowance.loss_db,
        snr_loss_db,
        taps_left_out: (0..problem.taps[0].len()).filter(|&n| is_left_out(&fixed_point, n)).count(),
    };
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
    last_that_keeps(quantiser, longest, 0..lengths.len(), |fewer| lengths[fewer].clone())
}

/// The same bits with as many taps left out as the loss allows: those whose integers matter least, and the
/// others chosen again.
fn leave_out(quantiser: &TapQuantiser<'_>, found: &RoundedTaps) -> Result<RoundedTaps, DesignError> {
    let FixedPoint { bits, integers, .. } = &found.fixed_point;
    let powers = quantiser.error.powers();
    let size = |n: usize| -> f64 {
        integers.iter().zip(&powers).map(|(list, power)| power * (list[n] as f64).powi(2)).sum()
    };
    let mut order: Vec<usize> = (0..integers[0].len()).collect();
    order.sort_by(|&a, &b| size(a).total_cmp(&size(b)));
    let few = order.iter().filter(|&&n| size(n) == 0.0).count();
    last_that_keeps(quantiser, found.clone(), few..order.len(), |count| {
        let bits = |n: usize| if order[..count].contains(&n) { 0 } else { bits.bits(n) };
        WordLengths::PerTap((0..order.len()).map(bits).collect())
    })
}

/// Integers of the last of a sequence of word lengths that keeps to the loss, by bisection. `first`, the
/// integers of the first, keeps to it. When the design is stopped, the last that were found.
fn last_that_keeps(
    quantiser: &TapQuantiser<'_>,
    first: RoundedTaps,
    mut open: Range<usize>,
    lengths: impl Fn(usize) -> WordLengths,
) -> Result<RoundedTaps, DesignError> {
    let mut best = first;
    while open.len() > 1 && !quantiser.error.problem.stop.is_due() {
        let middle = open.start + open.len() / 2;
        let tried = quantiser.quantise(&lengths(middle), None)?;
        if quantiser.keeps(&tried) {
            (open.start, best) = (middle, tried);
        } else {
            open.end = middle;
        }
    }
    Ok(best)
}

fn is_left_out(words: &FixedPoint, n: usize) -> bool {
    words.integers.iter().all(|list| list[n] == 0)
}

/// Taps that are zero in all channels get no bits.
fn without_zeros(words: FixedPoint) -> FixedPoint {
    if words.is_zero() {
        return words;
    }
    let bits = |n: usize| if is_left_out(&words, n) { 0 } else { words.bits.bits(n) };
    let all: Vec<u32> = (0..words.integers[0].len()).map(bits).collect();
    if !all.contains(&0) {
        return words;
    }
    FixedPoint { bits: WordLengths::PerTap(all), ..words }
}
