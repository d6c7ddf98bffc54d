//! Taps for fixed-point hardware: integers times a power of two, chosen for the least gamma instead of the
//! least distance from the optimal taps.
//!
//! Rounding each tap by itself wastes gamma, because noise in the taps matters only where the channels carry
//! signal. The search has two stages:
//! 1. The closest point of a lattice in the quadratic form of the mean-square error that a change of taps
//!    adds (`forms`, `lattice`). The weights of the form grow at the frequencies where the last integers
//!    were worst (Lawson's method of minimax approximation).
//! 2. A descent on gamma itself, from the best of these points (`descent`).
//!
//! The scale is the finest power of two at which the taps fit their bits, or one step finer with the
//! largest taps clipped. Where that costs more than 0.05 dB, taps that are smaller than the optimal ones
//! and still have almost their gamma are tried with finer steps (`smaller_taps`), and banks of few taps
//! are searched through at all scales (`enumeration`). The zero output is always a candidate. Among all
//! candidates with about the least gamma, the one with the least mean-square error and converter noise at
//! the output is chosen.

mod descent;
mod enumeration;
mod forms;
mod lattice;
mod problem;
mod quadratic_bound;
mod quantiser;
mod search;
mod smaller_taps;
mod study;

pub use problem::QuantisationProblem;
pub use study::{WordLoss, WordStudy};

use crate::bank::FixedPoint;
use crate::design::DesignError;
use crate::spec::WordLengths;
use quantiser::{Quantised, Quantiser};

/// Word lengths of a study, relative to the requested one.
const NEIGHBOURS: [i32; 5] = [-2, -1, 0, 1, 2];

/// The best integers found near the filters of `problem`, whose norm is `real_gamma`, and the cost of the
/// neighbouring word lengths.
///
/// # Errors
/// [`DesignError::Lti`] if the plant is not stable, [`DesignError::Linalg`] if a decomposition fails,
/// [`DesignError::NoTaps`] if `bits` are out of their range, [`DesignError::AllZero`] if all taps are zero
/// at the given scale, and [`DesignError::TinyTaps`] if they are no better there than zero taps. Without a
/// given scale all taps may be zero, too: see [`FixedPoint::is_zero`].
pub fn quantise(
    problem: QuantisationProblem<'_>,
    real_gamma: f64,
    bits: &WordLengths,
    fraction_bits: Option<i32>,
) -> Result<(FixedPoint, WordStudy), DesignError> {
    let quantiser = Quantiser::new(problem)?;
    let all: Vec<WordLengths> = NEIGHBOURS.into_iter().filter_map(|more| bits.widened(more)).collect();
    let mut found = quantiser.quantise_all(&all, fraction_bits)?;
    // Integers that fit few bits fit more bits.
    for k in 1..found.len() {
        if found[k - 1].is_better(&found[k], problem.gamma_margin) {
            let fixed_point = FixedPoint { bits: all[k].clone(), ..found[k - 1].fixed_point.clone() };
            found[k] = Quantised { fixed_point, rounded: found[k].rounded, ..found[k - 1] };
        }
    }
    let words = found.iter().map(|found| quantiser.loss(found)).collect();
    let asked = found.into_iter().find(|found| found.fixed_point.bits == *bits).ok_or(DesignError::NoTaps)?;
    match fraction_bits {
        Some(fraction_bits)
            if asked.fixed_point.is_zero() && problem.taps.iter().flatten().any(|&tap| tap != 0.0) =>
        {
            Err(DesignError::AllZero { fraction_bits, fitting: quantiser.finest_that_fits(bits) })
        }
        Some(fraction_bits) if quantiser.does_nothing(&asked)? => {
            Err(DesignError::TinyTaps { fraction_bits, fitting: quantiser.finest_that_fits(bits) })
        }
        _ => Ok((asked.fixed_point, WordStudy { real_gamma, words })),
    }
}

#[cfg(test)]
mod tests;
