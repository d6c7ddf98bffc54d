//! What errors of delays, gains and cut-offs cost a finished bank: where gamma is worst in a box, how fast
//! it changes, and what no bank can do better.
//!
//! The two ends of the worst case are proven by [`crate::verify::uncertainty`]. Here they are searched, in
//! double precision.

pub(super) mod box_plant;
mod derivatives;
mod floor;
pub(super) mod search;
pub(super) mod sides;
#[cfg(test)]
mod tests;

pub use derivatives::{DelayDerivatives, delay_derivatives};
pub use floor::{Floor, floor};
pub use search::norm_at;

use super::DesignError;
use super::analysis::bank_problem;
use super::plant::LiftedPlant;
use crate::bank::Bank;
use crate::verify::uncertainty::{ErrorBox, Taps, WorstCase, keeps_within, worst_case as proven_worst_case};

/// Doublings of the box in the search for the largest one that is affordable.
const MAX_DOUBLINGS: usize = 24;
/// Relative width at which the bisection ends.
const FACTOR_ACCURACY: f64 = 0.01;

/// The worst case of `bank` over `errors`, with fixed or with delay-scheduled taps, proven from both sides,
/// at most `accuracy` (relative) apart where the work allows.
///
/// # Errors
/// As [`super::analyze`]; [`DesignError::Verify`] as [`crate::verify::uncertainty::worst_case`].
pub fn worst_case(
    bank: &Bank,
    errors: &ErrorBox,
    taps: Taps,
    accuracy: f64,
) -> Result<WorstCase, DesignError> {
    errors.check(bank.channel_count())?;
    let candidates = search::candidates(bank, errors, taps)?;
    Ok(proven_worst_case(bank, errors, taps, accuracy, &candidates)?)
}

/// The largest factor t for which errors in t times the box are proven to cost at most `loss` (relative to
/// gamma without errors), within 1 %; zero if none is found.
///
/// # Errors
/// As [`worst_case`].
pub fn affordable(bank: &Bank, errors: &ErrorBox, loss: f64) -> Result<f64, DesignError> {
    errors.check(bank.channel_count())?;
    let plant = LiftedPlant::new(&bank_problem(bank)?)?;
    let allowed = plant.bank_norm(&bank.filters)?.gain * (1.0 + loss);
    let keeps = |factor: f64| -> Result<bool, DesignError> {
        let scaled = errors.scaled(factor);
        // Gains and cut-offs of 50 % are out of the range of the proof.
        Ok(scaled.check(bank.channel_count()).is_ok() && keeps_within(bank, &scaled, Taps::Fixed, allowed)?)
    };
    let (mut kept, mut lost) = (0.0, 1.0);
    let grows = keeps(1.0)?;
    for _ in 0..MAX_DOUBLINGS {
        let factor = if grows { lost } else { 0.5 * lost };
        if keeps(factor)? {
            kept = factor;
            if !grows {
                break;
            }
            lost = 2.0 * factor;
        } else {
            lost = factor;
            if grows {
                break;
            }
        }
    }
    while kept > 0.0 && lost - kept > FACTOR_ACCURACY * kept {
        let middle = 0.5 * (kept + lost);
        if keeps(middle)? { kept = middle } else { lost = middle }
    }
    Ok(kept)
}
