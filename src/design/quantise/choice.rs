//! The fewest bits of integer taps for an allowed loss of SNR, and then the taps that can be left out.
//!
//! Integers that fit few bits fit more bits, so the least loss of all integers falls with the bits. The
//! search finds good integers and not always the best, so it scans neighbouring word lengths, from a first
//! guess onwards, until one holds the loss and the next shorter one does not.

use super::problem::Candidate;
use super::quantiser::Quantiser;
use super::{QuantisationProblem, WordChoice, WordStudy};
use crate::bank::FixedPoint;
use crate::design::DesignError;
use crate::spec::WordLengths;

/// Word lengths that are tried at once.
const BATCH: usize = 5;
/// Word lengths of the report on each side of the chosen one.
const BESIDE: usize = 2;

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
    let Allowance { loss_db, most } = allowance;
    let quantiser = Quantiser::within(problem, *loss_db)?;
    let lengths = Lengths::up_to(most);
    let (found, least) = scan(&quantiser, &lengths, allowance)?;
    let chosen = leave_out(&quantiser, &found[least])?;
    let beside = &found[least.saturating_sub(BESIDE)..(least + BESIDE + 1).min(found.len())];
    let words = beside.iter().map(|found| quantiser.loss(found, None)).collect::<Result<_, _>>()?;
    let snr_loss_db = quantiser.mean_square_loss_db(&chosen);
    let fixed_point = without_zeros(chosen.fixed_point);
    let choice = WordChoice {
        allowed_db: *loss_db,
        snr_loss_db,
        taps_left_out: (0..problem.taps[0].len()).filter(|&n| is_left_out(&fixed_point, n)).count(),
    };
    let least_gamma = quantiser.error.least_gamma;
    Ok((fixed_point, WordStudy { real_gamma, least_gamma, words, choice: Some(choice) }))
}

/// Word lengths that differ by a bit, the shortest first.
struct Lengths(Vec<WordLengths>);

impl Lengths {
    fn up_to(most: &WordLengths) -> Self {
        let mut all: Vec<WordLengths> = (0..).map_while(|fewer: i32| most.widened(-fewer)).collect();
        all.reverse();
        Self(all)
    }

    /// The first one whose longest word has so many bits, or the last one.
    fn of_bits(&self, bits: u32, taps: usize) -> usize {
        let longest = |words: &WordLengths| (0..taps).map(|n| words.bits(n)).max().unwrap_or(0);
        self.0.iter().position(|words| longest(words) >= bits).unwrap_or(self.0.len() - 1)
    }
}

/// Integers of consecutive word lengths, and the index of the first that keeps to the loss; the one before
/// it, if there is one, does not.
fn scan(
    quantiser: &Quantiser<'_>,
    lengths: &Lengths,
    allowance: &Allowance,
) -> Result<(Vec<Candidate>, usize), DesignError> {
    let all = &lengths.0;
    let guess = lengths.of_bits(quantiser.bits_by_rounding(), quantiser.error.problem.taps[0].len());
    let (mut first, mut end) = (guess.saturating_sub(BATCH / 2), (guess + BATCH / 2 + 1).min(all.len()));
    let mut found = quantiser.quantise_all(&all[first..end], None)?;
    while quantiser.keeps(&found[0]) && first > 0 {
        let before = first.saturating_sub(BATCH);
        found.splice(0..0, quantiser.quantise_all(&all[before..first], None)?);
        first = before;
    }
    while !found.iter().any(|found| quantiser.keeps(found)) && end < all.len() {
        let after = (end + BATCH).min(all.len());
        found.extend(quantiser.quantise_all(&all[end..after], None)?);
        end = after;
    }
    let losses = found.iter().map(|found| quantiser.mean_square_loss_db(found));
    let best = losses.fold(f64::INFINITY, f64::min);
    match found.iter().position(|found| quantiser.keeps(found)) {
        Some(least) => Ok((found, least)),
        None => {
            Err(DesignError::WordsLoseMore { bits: allowance.most.clone(), best, allowed: allowance.loss_db })
        }
    }
}

/// The same bits with as many taps left out as the loss allows: those whose integers matter least, and the
/// others chosen again. Bisection between numbers of taps of which the smaller keeps to the loss.
fn leave_out(quantiser: &Quantiser<'_>, found: &Candidate) -> Result<Candidate, DesignError> {
    let FixedPoint { bits, integers, .. } = &found.fixed_point;
    let powers = quantiser.error.powers();
    let size = |n: usize| -> f64 {
        integers.iter().zip(&powers).map(|(list, power)| power * (list[n] as f64).powi(2)).sum()
    };
    let mut order: Vec<usize> = (0..integers[0].len()).collect();
    order.sort_by(|&a, &b| size(a).total_cmp(&size(b)));
    let without = |count: usize| {
        let bits = |n: usize| if order[..count].contains(&n) { 0 } else { bits.bits(n) };
        WordLengths::PerTap((0..order.len()).map(bits).collect())
    };
    let mut best = found.clone();
    let (mut few, mut many) = (order.iter().filter(|&&n| size(n) == 0.0).count(), order.len());
    while many - few > 1 && !quantiser.error.problem.stop.is_due() {
        let middle = few + (many - few) / 2;
        let tried = quantiser.quantise(&without(middle), None)?;
        if quantiser.keeps(&tried) {
            (few, best) = (middle, tried);
        } else {
            many = middle;
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
