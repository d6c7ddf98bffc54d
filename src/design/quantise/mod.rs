//! Taps for fixed-point hardware: integers times a power of two, chosen for the least gamma (not for the least distance
//! from the taps of the optimum).
//!
//! Rounding each tap by itself throws away what the front ends allow: noise in the taps matters only where the channels carry
//! signal. So the integers are looked for
//! 1. as the closest point of a lattice, in the sense of the mean square that a change of taps adds to the error (`forms`, `lattice`),
//!    the more weighted the frequencies at which the last integers were worst (Lawson's method, as for minimax approximation);
//! 2. by descent from the best of these, on the worst case itself (`descent`).
//!
//! The scale is the finest power of two at which the taps fit their bits, or one step finer with the largest taps cut off. Of all
//! integers found on the way, those whose gamma is next to the least are equally good in this sense; among them the least
//! mean-square error decides, with the converters' noise at the output.

mod descent;
mod forms;
mod lattice;
mod quantiser;
mod search;

use super::DesignError;
use super::equivalence::BlockedPlant;
use crate::bank::FixedPoint;
use crate::spec::WordLengths;
use quantiser::{Quantised, Quantiser, decades};

/// Taps to be made integers.
#[derive(Debug, Clone, Copy)]
pub struct Subject<'a> {
    /// The front ends.
    pub plant: &'a BlockedPlant,
    /// Filters of one length, one a channel.
    pub taps: &'a [Vec<f64>],
    /// Power of each channel's noise.
    pub noise: &'a [f64],
    /// Relative excess of gamma that may go into the mean square.
    pub gamma_margin: f64,
}

/// What integer taps cost, beside those of fewer and of more bits.
#[derive(Debug, Clone, serde::Serialize)]
pub struct WordStudy {
    /// gamma of the real taps, exact.
    pub real_gamma: f64,
    /// From fewer to more bits.
    pub words: Vec<WordLoss>,
}

/// What taps of some word length cost.
#[derive(Debug, Clone, serde::Serialize)]
pub struct WordLoss {
    /// Bits of the taps.
    pub bits: WordLengths,
    /// Taps are integers times two to the minus this.
    pub fraction_bits: i32,
    /// gamma over that of the real taps in decibels, estimated on a grid of frequencies.
    pub loss_db: f64,
    /// The mean-square error over that of the real taps in decibels.
    pub mean_square_loss_db: f64,
    /// `loss_db` of the real taps rounded one by one, at the finest scale at which they fit.
    pub rounded_loss_db: f64,
}

impl WordStudy {
    /// `gamma` over that of the real taps in decibels: 0 where both are zero, infinite where only the real one is.
    pub fn loss_db(&self, gamma: f64) -> f64 {
        20.0 * decades(gamma, self.real_gamma)
    }
}

/// Bits more or fewer that a study looks at.
const NEIGHBOURS: [i32; 5] = [-2, -1, 0, 1, 2];

/// The best integers found near the filters of `subject`, whose norm is `real_gamma`, and what the neighbouring word lengths
/// cost.
///
/// # Errors
/// [`DesignError::Lti`] if the plant is not stable, [`DesignError::Linalg`] if a decomposition fails,
/// [`DesignError::NoTaps`] if `bits` are out of their range, and [`DesignError::AllZero`] if at the scale given nothing is
/// left of the taps. A scale that is left open may lose all taps, too: see [`FixedPoint::is_silent`].
pub fn quantise(
    subject: Subject<'_>,
    real_gamma: f64,
    bits: &WordLengths,
    fraction_bits: Option<i32>,
) -> Result<(FixedPoint, WordStudy), DesignError> {
    let quantiser = Quantiser::new(subject)?;
    let all: Vec<WordLengths> = NEIGHBOURS.into_iter().filter_map(|more| bits.widened(more)).collect();
    let mut found = quantiser.quantise_all(&all, fraction_bits)?;
    // What fits few bits fits more.
    for k in 1..found.len() {
        if found[k - 1].is_better(&found[k], subject.gamma_margin) {
            let fixed_point = FixedPoint { bits: all[k].clone(), ..found[k - 1].fixed_point.clone() };
            found[k] = Quantised { fixed_point, rounded: found[k].rounded, ..found[k - 1] };
        }
    }
    let words = found.iter().map(|found| quantiser.loss(found)).collect();
    let asked = found.into_iter().find(|found| found.fixed_point.bits == *bits).ok_or(DesignError::NoTaps)?;
    match fraction_bits {
        Some(fraction_bits)
            if asked.fixed_point.is_silent() && subject.taps.iter().flatten().any(|&tap| tap != 0.0) =>
        {
            Err(DesignError::AllZero { fraction_bits, fitting: quantiser.finest_that_fits(bits) })
        }
        _ => Ok((asked.fixed_point, WordStudy { real_gamma, words })),
    }
}

#[cfg(test)]
mod tests;
