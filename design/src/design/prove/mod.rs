//! Searches for the certificate that proves a bank's gamma. It proves nothing by itself:
//! [`hybank_verify::verify`] checks it.

mod box_bound;
mod enclosed_norm;
mod upper;

use super::DesignError;
use super::limits::Stop;
use super::plant::LiftedPlant;
use super::problem::Problem;
pub(super) use box_bound::{attach_box_proof, worst_case};
pub(super) use enclosed_norm::resolved_norm;
use enclosed_norm::{EnclosedGains, is_zero};
use hybank_core::bank::{Bank, Certificate, GainWitness, Gamma, Proof};
use hybank_linalg::CMat;
use hybank_verify::verify::{EnclosedErrorSystem, Strictness, Verified};
use upper::certificate;

/// Relative width of a proven interval above which the norm is looked for in the arithmetic of `verify`:
/// twice the least excess of a certificate.
const NARROW_INTERVAL: f64 = 2e-8;

/// A proven lower bound of the norm of `bank`, its gain at a frequency in radians per slow period; `None`
/// where no arithmetic resolves it.
pub(super) fn proven_gain(bank: &Bank, frequency: f64) -> Result<Option<f64>, DesignError> {
    let error = EnclosedErrorSystem::new(bank)?;
    Ok(EnclosedGains(&error).at(frequency)?.map(|(gain, _)| gain))
}

/// Searches for the certificate of the bank's gamma. Returns the proof and the bounds that it proves,
/// unless they refute what `stated` says; a default `stated` says nothing.
///
/// # Errors
/// As [`super::analyze`]; [`DesignError::NotCertified`] if no certificate was found;
/// [`DesignError::Verify`] if the proof refutes the stated gamma; [`DesignError::Stopped`] if `stop` ended
/// the search.
pub(crate) fn prove(bank: &Bank, stated: &Gamma, stop: &Stop) -> Result<(Proof, Verified), DesignError> {
    let error = EnclosedErrorSystem::new(bank)?;
    let upper = certificate(&error, stop)?;
    let verified = error.judge(stated, &upper, Strictness::NotRefuted)?;
    Ok((Proof { upper, worst_case: None }, verified))
}

/// Adds a proof to `bank` and sets norm and upper end to the proven bounds. A computed norm outside of the
/// proven interval, which rounding displaces where the error is a tiny difference, becomes the nearer end of
/// it.
///
/// # Errors
/// As [`prove`]; the gammas are then those of [`without_certificate`], if there are any.
pub(crate) fn attach_proof(bank: &mut Bank, stop: &Stop) -> Result<Verified, DesignError> {
    let (mut proof, mut verified) = match prove(bank, &Gamma::default(), stop) {
        Ok(found) => found,
        Err(reason) => {
            if matches!(reason, DesignError::NotCertified { .. } | DesignError::Verify(_)) {
                bank.gamma = without_certificate(bank)?;
            }
            return Err(reason);
        }
    };
    let norm = match bank.gamma.norm {
        Some(norm) if !is_resolved(norm, &verified) => {
            Some(enclosed_norm(bank, norm, &mut proof.upper, &mut verified)?)
        }
        other => other,
    };
    let norm = norm.map(|norm| norm.max(verified.attained).min(verified.upper));
    bank.gamma = Gamma { norm, upper: Some(verified.upper), ..bank.gamma }.with_bounds_below_the_norm();
    bank.proof = Some(proof);
    Ok(verified)
}

/// Whether a norm that was computed in double precision is the gain that was proven at its peak, and no
/// larger gain can lie elsewhere.
fn is_resolved(norm: f64, verified: &Verified) -> bool {
    let is_the_gain = (norm - verified.attained).abs() <= Gamma::NORM_ACCURACY * norm;
    is_the_gain && verified.upper <= verified.attained * (1.0 + NARROW_INTERVAL)
}

/// The largest gain in the arithmetic of `verify` in place of `norm`. Where it exceeds the one that
/// `certificate` attains, it becomes that of the certificate.
fn enclosed_norm(
    bank: &Bank,
    norm: f64,
    certificate: &mut Certificate,
    verified: &mut Verified,
) -> Result<f64, DesignError> {
    let error = EnclosedErrorSystem::new(bank)?;
    let hint = Some(frequency(&certificate.peak));
    let found = if is_zero(verified.upper, &error) { None } else { EnclosedGains(&error).peak(hint)? };
    let Some((gain, peak)) = found else { return Ok(norm) };
    if gain > verified.attained {
        (verified.attained, certificate.peak) = (gain, peak);
    }
    Ok(verified.attained)
}

/// The gammas of a bank for which no certificate was found. In double precision a gamma that is a small
/// difference may be off by more than its stated error, so the norm is the largest gain near the peak in the
/// arithmetic of `verify`.
fn without_certificate(bank: &Bank) -> Result<Gamma, DesignError> {
    let error = EnclosedErrorSystem::new(bank)?;
    let Some((norm, _)) = EnclosedGains(&error).peak(None)? else { return Ok(bank.gamma) };
    let computed = norm * (1.0 + LiftedPlant::new(&Problem::of_bank(bank)?).accuracy(norm)?);
    let upper = [Some(computed), bank.gamma.upper].into_iter().flatten().reduce(f64::max);
    Ok(Gamma { norm: Some(norm), upper, ..bank.gamma }.with_bounds_below_the_norm())
}

/// The frequency of a witness in [0, pi].
fn frequency(witness: &GainWitness) -> f64 {
    let [c, s] = witness.half;
    2.0 * s.abs().atan2(c.abs())
}

fn half(frequency: f64) -> [f64; 2] {
    let (s, c) = (0.5 * frequency).sin_cos();
    [c, s]
}

/// The left singular vector of the largest singular value.
fn leading_direction(response: &CMat) -> Result<CMat, DesignError> {
    Ok(hybank_linalg::svd(response)?.u.columns(0, 1).into_owned())
}

fn witness(frequency: f64, reference: &CMat) -> GainWitness {
    // Adding 0.0 turns negative zeros into positive ones, for the file.
    let reference = reference.iter().map(|z| [z.re + 0.0, z.im + 0.0]).collect();
    GainWitness { half: half(frequency), reference }
}

#[cfg(test)]
mod tests;
