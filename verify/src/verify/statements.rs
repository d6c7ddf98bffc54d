//! Compares the gammas that a file states with the proven bounds.

use super::{Verified, VerifyError};
use hybank_core::bank::Gamma;

/// Relative excess of a certificate's gamma over the norm for which the stated number still counts as the
/// same.
const CERTIFICATE_WIDTH: f64 = 1e-8;
/// Maximum relative width of the proven interval of the norm.
const WIDEST_INTERVAL: f64 = 0.2;
/// Norms below this, relative to the scale of the reference samples, are zero up to rounding.
pub const ZERO_NORM: f64 = 1e-10;
/// Maximum width of the proven interval of such a norm, relative to the scale.
const WIDEST_AT_ZERO_NORM: f64 = 2e-6;

/// Which stated numbers a comparison accepts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Strictness {
    /// Only numbers that are proven.
    Proven,
    /// All numbers that the proof does not refute.
    NotRefuted,
}

fn disproved(
    place: &'static str,
    stated: f64,
    relation: &'static str,
    proven: f64,
) -> Result<(), VerifyError> {
    Err(VerifyError::Disproved { place, stated, relation, proven })
}

/// Compares each gamma in the file with what was proven; `scale` is the size of the reference samples.
///
/// # Errors
/// [`VerifyError::Disproved`] with the first number that fails the comparison, [`VerifyError::TooWide`] if
/// the proven interval of the norm is too wide.
pub(super) fn compare(
    gamma: &Gamma,
    proven: &Verified,
    scale: f64,
    strictness: Strictness,
) -> Result<(), VerifyError> {
    let Verified { attained, upper, .. } = *proven;
    let is_narrow = upper - attained <= (WIDEST_INTERVAL * upper).max(WIDEST_AT_ZERO_NORM * scale);
    if !is_narrow {
        return Err(VerifyError::TooWide { attained, upper });
    }
    compare_norm(gamma, proven, ZERO_NORM * scale)?;
    compare_upper(gamma, proven, strictness)
}

/// The computed norm with its own error lies in the proven interval.
fn compare_norm(gamma: &Gamma, proven: &Verified, floor: f64) -> Result<(), VerifyError> {
    let Some(stated) = gamma.norm else { return Ok(()) };
    let error = Gamma::NORM_ACCURACY * stated + floor;
    if stated + error < proven.attained {
        return disproved("gamma.norm", stated, "a norm of at least", proven.attained);
    }
    if stated - error > proven.upper {
        return disproved("gamma.norm", stated, "a norm of at most", proven.upper);
    }
    Ok(())
}

/// The stated upper end is the certificate's.
fn compare_upper(gamma: &Gamma, proven: &Verified, strictness: Strictness) -> Result<(), VerifyError> {
    let Some(stated) = gamma.upper else { return Ok(()) };
    let place = "gamma.upper";
    match strictness {
        _ if stated < proven.attained => disproved(place, stated, "a norm of at least", proven.attained),
        Strictness::Proven if stated < proven.upper => disproved(place, stated, "no less than", proven.upper),
        Strictness::Proven if stated > proven.upper * (1.0 + CERTIFICATE_WIDTH) => {
            disproved(place, stated, "a norm of at most", proven.upper)
        }
        _ => Ok(()),
    }
}
