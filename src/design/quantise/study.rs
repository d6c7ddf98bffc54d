//! The cost of integer taps.

use crate::spec::WordLengths;

/// The cost of integer taps, beside that of fewer and of more bits.
#[derive(Debug, Clone, serde::Serialize)]
pub struct WordStudy {
    /// Computed gamma of the real taps.
    pub real_gamma: f64,
    /// In ascending order of the bits.
    pub words: Vec<WordLoss>,
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

impl WordStudy {
    /// `gamma` over that of the real taps in decibels: 0 where both are zero, infinite where only the real
    /// one is.
    pub fn loss_db(&self, gamma: f64) -> f64 {
        20.0 * decades(gamma, self.real_gamma)
    }
}

/// log10(a / b); infinite if only b is zero.
pub(super) fn decades(a: f64, b: f64) -> f64 {
    if a == b { 0.0 } else { (a / b).log10() }
}
