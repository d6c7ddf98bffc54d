//! Taps for fixed-point hardware: integers times a power of two, chosen for the least gamma instead of the
//! least distance from the optimal taps. Those of `h2` are chosen for the least mean-square error, by the
//! first of the stages alone.
//!
//! Rounding each tap by itself wastes gamma, because noise in the taps matters only where the channels carry
//! signal. The search (`search`) has two stages:
//! 1. The closest point of a lattice in the quadratic form of the mean-square error that a change of taps
//!    adds (`problem`, `lattice`). The weights of the form grow at the frequencies where the last integers
//!    were worst (Lawson's method of minimax approximation).
//! 2. A descent on gamma itself, from the best of these points (`descent`).
//!
//! The scale is the finest power of two at which the taps fit their bits, or one step finer with the
//! largest taps clipped. The zero output is always a candidate. Among all candidates with about the least
//! gamma, the one with the least mean-square error and converter noise at the output is chosen.

mod choice;
mod descent;
mod lattice;
mod problem;
mod quantiser;
mod search;
mod settings;

pub(super) use choice::{Allowance, quantise_within};
pub(super) use problem::QuantisationProblem;

use crate::design::DesignError;
use hybank_core::bank::FixedPoint;
use hybank_core::spec::WordLengths;
use problem::RoundedTaps;
use quantiser::TapQuantiser;

/// Word lengths of a study, relative to the requested one.
const NEIGHBOURS: [i32; 5] = [-2, -1, 0, 1, 2];

/// The cost of integer taps, beside that of fewer and of more bits.
#[derive(Debug, Clone, serde::Serialize)]
pub struct WordStudy {
    /// Computed gamma of the real taps.
    pub real_gamma: f64,
    /// Smaller gammas are rounding errors.
    #[serde(skip)]
    pub(super) least_gamma: f64,
    /// In ascending order of the bits.
    pub words: Vec<WordLoss>,
    /// How the bits were chosen, where a loss was given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub choice: Option<WordChoice>,
}

/// The cost of taps of one word length.
#[derive(Debug, Clone, serde::Serialize)]
pub struct WordLoss {
    /// Bits of the taps.
    pub bits: WordLengths,
    /// The taps are integers times `2^-fraction_bits`.
    pub fraction_bits: i32,
    /// gamma over that of the real taps in decibels, estimated on a grid of frequencies.
    pub loss_db: f64,
    /// The mean-square error over that of the real taps in decibels.
    pub mean_square_loss_db: f64,
    /// `loss_db` of the real taps rounded one by one, at the finest scale at which they fit.
    pub rounded_loss_db: f64,
}

/// Integer taps that were chosen for a loss of SNR: of the whole error, the mean square of the error for the
/// signal and of the converters' noise at the output, relative to that of the real taps.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct WordChoice {
    /// The most that may be lost, in decibels.
    pub allowed_db: f64,
    /// What these integers lose.
    pub snr_loss_db: f64,
    /// Taps that are zero in all channels.
    pub taps_left_out: usize,
    /// The others, by their bits.
    pub taps: Vec<TapsOfBits>,
    /// Sum of the bits of all taps of a channel.
    pub bits_per_channel: u32,
}

/// How many taps of a channel have words of some bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct TapsOfBits {
    /// Bits.
    pub bits: u32,
    /// Number of the taps.
    pub taps: usize,
}

impl WordStudy {
    /// `gamma` over that of the real taps in decibels: 0 where both are rounding errors.
    pub fn loss_db(&self, gamma: f64) -> f64 {
        20.0 * decades(gamma.max(self.least_gamma), self.real_gamma.max(self.least_gamma))
    }
}

/// log10(a / b); infinite if only b is zero.
fn decades(a: f64, b: f64) -> f64 {
    if a == b { 0.0 } else { (a / b).log10() }
}

/// The best integers found near the filters of `problem`, whose norm is `real_gamma`, and the cost of the
/// neighbouring word lengths.
///
/// # Errors
/// [`DesignError::Lti`] if the plant is not stable, [`DesignError::Linalg`] if a decomposition fails,
/// and [`DesignError::TinyTaps`] if the taps are no better at the given scale than zero taps. Without a
/// given scale all taps may be zero, too: see [`FixedPoint::is_zero`].
pub(super) fn quantise(
    problem: QuantisationProblem<'_>,
    real_gamma: f64,
    bits: &WordLengths,
    fraction_bits: Option<i32>,
) -> Result<(FixedPoint, WordStudy), DesignError> {
    let quantiser = TapQuantiser::new(problem)?;
    let all: Vec<WordLengths> = NEIGHBOURS.into_iter().filter_map(|more| bits.widened(more)).collect();
    let mut found = quantiser.quantise_all(&all, fraction_bits)?;
    // Integers that fit few bits fit more bits.
    for k in 1..found.len() {
        if found[k - 1].is_better(&found[k], problem) {
            let fixed_point = FixedPoint { bits: all[k].clone(), ..found[k - 1].fixed_point.clone() };
            found[k] = RoundedTaps { fixed_point, ..found[k - 1] };
        }
    }
    let loss = |found| quantiser.loss(found, fraction_bits);
    let words = found.iter().map(loss).collect::<Result<_, _>>()?;
    let asked = match all.iter().position(|neighbour| neighbour == bits) {
        Some(index) => found.swap_remove(index),
        None => quantiser.quantise(bits, fraction_bits)?,
    };
    match fraction_bits {
        Some(fraction_bits) if quantiser.does_nothing(&asked)? => {
            Err(DesignError::TinyTaps { fraction_bits, fitting: quantiser.finest_that_fits(bits) })
        }
        _ => {
            let least_gamma = quantiser.error.least_gamma;
            Ok((asked.fixed_point, WordStudy { real_gamma, least_gamma, words, choice: None }))
        }
    }
}

#[cfg(test)]
mod tests;
