//! What errors of delays, gains and cut-offs cost a finished bank: where gamma is worst in a box, how fast
//! it changes, and what no bank can do better.
//!
//! The two ends of the worst case are proven by [`crate::verify::uncertainty`]. Here they are searched, in
//! double precision.
//!
//! ```
//! use hybank::design::uncertainty::{BoxWidths, ErrorStudy, Questions, Sweep};
//! use hybank::{bank::Bank, quantity};
//! let bank = Bank::from_json(include_str!("../../../filters/thesis-fir.json"), "thesis-fir.json")?;
//! // The second delay may be off by a hundredth of a fast period.
//! let widths = BoxWidths { delay_box: vec![quantity::time("0.01 samples")?], ..BoxWidths::default() };
//! let questions = Questions { errors: widths.error_box(&bank)?, loss: Some(0.5), ..Questions::default() };
//! let worst = ErrorStudy::new(&bank, questions)?.worst_case.ok_or("no box")?;
//! assert!(worst.case.lower > 0.0401 && worst.case.upper < 1.02 * worst.case.lower);
//! // A larger box, too, costs less than half of gamma.
//! assert!(worst.affordable.is_some_and(|part| part.factor > 1.0));
//! let curves = Sweep::new(&bank, &worst.errors, &worst.case.point)?.curves;
//! assert_eq!(curves[0].label, "channel 2");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub(super) mod box_plant;
mod derivatives;
mod floor;
pub(super) mod search;
mod study;
#[cfg(test)]
mod tests;
mod widths;

pub use derivatives::{DelayDerivatives, delay_derivatives};
pub use floor::{Floor, floor};
pub use search::norm_at;
pub use study::{Affordable, BoxStudy, ErrorStudy, JitterStudy, Questions, Sensitivity};
pub use study::{Sweep, SweepCurve};
pub use widths::{BoxRule, BoxWidths, ReferenceChannel, RefusedBox};

use super::DesignError;
use super::plant::LiftedPlant;
use super::problem::Problem;
use crate::bank::Bank;
use crate::verify::uncertainty::{ErrorBox, WorstCase, certifies, worst_case as proven_worst_case};

/// Doublings of the box in the search for the largest one that is affordable.
const MAX_DOUBLINGS: usize = 24;
/// Relative width at which the bisection ends.
const FACTOR_ACCURACY: f64 = 0.01;

/// The worst case of `bank` over `errors`, proven from both sides, at most `accuracy` (relative) apart where
/// the work allows.
///
/// # Errors
/// As [`super::analyze`]; [`DesignError::Verify`] as [`crate::verify::uncertainty::worst_case`].
pub fn worst_case(bank: &Bank, errors: &ErrorBox, accuracy: f64) -> Result<WorstCase, DesignError> {
    errors.check(bank.channel_count())?;
    let candidates = search::candidates(bank, errors)?;
    Ok(proven_worst_case(bank, errors, accuracy, &candidates)?)
}

/// The largest factor t for which errors in t times the box are proven to cost at most `loss` (relative to
/// gamma without errors), within 1 %; zero if none is found.
///
/// # Errors
/// As [`worst_case`].
pub fn affordable(bank: &Bank, errors: &ErrorBox, loss: f64) -> Result<f64, DesignError> {
    errors.check(bank.channel_count())?;
    let plant = LiftedPlant::new(&Problem::of_bank(bank)?);
    let allowed = plant.bank_norm(&bank.filters)?.gain * (1.0 + loss);
    let is_certified = |factor: f64| -> Result<bool, DesignError> {
        let scaled = errors.scaled(factor);
        // Gains and cut-offs of 50 % are out of the range of the proof.
        Ok(scaled.check(bank.channel_count()).is_ok() && certifies(bank, &scaled, allowed)?)
    };
    let is_whole = is_certified(1.0)?;
    let (mut within, mut beyond) = if is_whole { (1.0, f64::INFINITY) } else { (0.0, 1.0) };
    for _ in 0..MAX_DOUBLINGS {
        let factor = if is_whole { 2.0 * within } else { 0.5 * beyond };
        let certified = is_certified(factor)?;
        *if certified { &mut within } else { &mut beyond } = factor;
        if certified != is_whole {
            break;
        }
    }
    while within > 0.0 && beyond.is_finite() && beyond - within > FACTOR_ACCURACY * within {
        let middle = 0.5 * (within + beyond);
        *if is_certified(middle)? { &mut within } else { &mut beyond } = middle;
    }
    Ok(within)
}
