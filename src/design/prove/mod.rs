//! Searches for certificates and witnesses that prove a bank's gammas. They prove nothing by themselves:
//! [`crate::verify`] checks them.

mod enclosed_norm;
mod lower;
mod normal_equations;
mod upper;

use super::DesignError;
use super::limits::Stop;
use super::merging::Repeats;
use super::methods::DualSolution;
use super::plant::LiftedPlant;
use super::problem::Problem;
use crate::bank::{Bank, DualWitness, Gamma, LowerProof, Proof};
use crate::linalg::{self, CMat};
use crate::lti::FrequencyResponse;
use crate::verify::{EnclosedErrorSystem, Strictness, Verified};
pub(super) use enclosed_norm::resolved_norm;
use enclosed_norm::{EnclosedGains, is_zero};
use lower::lower_proof;
use upper::certificate;

/// Relative distance below the designer's bound at which a proven bound still counts as its proof.
const PROVEN_SHORTFALL: f64 = 0.5e-6;
/// Relative distance of a stated lower bound below the proven one: another machine may round an approximate
/// inverse differently.
const STATED_BELOW: f64 = 1e-12;
/// Relative width of a proven interval above which the norm is looked for in the arithmetic of `verify`:
/// twice the least excess of a certificate.
const NARROW_INTERVAL: f64 = 2e-8;

/// A gamma that is proven, not only computed.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Certified {
    /// ||K|| is less than this.
    pub gamma: f64,
    /// ||K|| is at least this.
    pub attained: f64,
    /// Order of P.
    pub states: usize,
}

/// Proves the bank's norm from both sides; see [`crate::verify`] for how.
///
/// ```
/// use hybank::{bank::Bank, design::certify};
/// let bank = Bank::from_json(include_str!("../../../filters/thesis-fir.json"), "thesis-fir.json")?;
/// let proven = certify(&bank)?;
/// assert!(proven.gamma < 0.039933 && proven.gamma - proven.attained < 1e-7 * proven.gamma);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// As [`super::analyze`]; [`DesignError::NotCertified`] if no certificate was found.
pub fn certify(bank: &Bank) -> Result<Certified, DesignError> {
    let error = EnclosedErrorSystem::new(bank)?;
    let upper = certificate(&error, bank, &Stop::default())?;
    let proof = Proof { upper: Some(upper), ..Proof::default() };
    let Verified { upper, attained, states, .. } =
        error.judge(&bank.gamma, &proof, Strictness::NotRefuted)?;
    Ok(Certified { gamma: upper, attained, states })
}

/// Searches for witnesses of the bank's gammas. Returns the proof and the bounds that it proves,
/// unless they refute what `stated` says; a default `stated` says nothing.
///
/// `dual` is the dual solution of an FIR design. It proves the lower end if the noncausal bound does not.
///
/// # Errors
/// As [`super::analyze`]; [`DesignError::NotCertified`] if no certificate was found;
/// [`DesignError::Verify`] if the proof refutes the stated gamma; [`DesignError::Stopped`] if `stop` ended
/// the search.
pub(crate) fn prove(
    bank: &Bank,
    stated: &Gamma,
    dual: &DualSolution,
    stop: &Stop,
) -> Result<(Proof, Verified), DesignError> {
    let error = EnclosedErrorSystem::new(bank)?;
    let upper = certificate(&error, bank, stop)?;
    let below = lower_ends(&error, bank, dual, upper.gamma, stop)?;
    let proof = Proof { upper: Some(upper), ..below };
    let verified = error.judge(stated, &proof, Strictness::NotRefuted)?;
    Ok((proof, verified))
}

/// The witnesses of the lower ends of a bank whose norm is at most `upper`.
fn lower_ends(
    error: &EnclosedErrorSystem<'_>,
    bank: &Bank,
    dual: &DualSolution,
    upper: f64,
    stop: &Stop,
) -> Result<Proof, DesignError> {
    let witness = noncausal_witness(bank)?;
    let noncausal = error.noncausal_bound(&witness);
    let above = noncausal.unwrap_or(0.0);
    // Nothing of interest lies below a norm that is zero up to rounding.
    if bank.gamma.norm.is_some_and(|norm| is_zero(norm, error)) {
        return Ok(Proof { upper: None, lower: None, noncausal: noncausal.map(|_| witness) });
    }
    // What the noncausal bound does not explain is looked for.
    let wanted = bank.gamma.lower.map(|stated| stated.max(dual.bound) * (1.0 - PROVEN_SHORTFALL));
    let explained = wanted.is_some_and(|wanted| above >= wanted);
    let found = || lower_proof(error, bank, dual, wanted, &(above..upper), stop);
    let lower = if explained { None } else { found()? };
    if stop.is_due() {
        return Err(DesignError::Stopped);
    }
    Ok(Proof { upper: None, lower, noncausal: noncausal.map(|_| witness) })
}

/// Adds a proof to `bank` and sets the gammas to the proven bounds. A computed norm outside of the proven
/// interval, which rounding displaces where the error is a tiny difference, becomes the nearer end of it.
///
/// # Errors
/// As [`prove`]; the gammas are then those of [`without_certificate`], if there are any.
pub(crate) fn attach_proof(
    bank: &mut Bank,
    dual: &DualSolution,
    stop: &Stop,
) -> Result<Verified, DesignError> {
    let (mut proof, mut verified) = match prove(bank, &Gamma::default(), dual, stop) {
        Ok(found) => found,
        Err(reason) => {
            if matches!(reason, DesignError::NotCertified { .. } | DesignError::Verify(_)) {
                bank.gamma = without_certificate(bank, dual, stop)?;
            }
            return Err(reason);
        }
    };
    let norm = match bank.gamma.norm {
        Some(norm) if !is_resolved(norm, &verified) => {
            Some(enclosed_norm(bank, norm, &mut proof, &mut verified)?)
        }
        other => other,
    };
    bank.gamma = Gamma {
        norm: norm.map(|norm| norm.max(verified.attained).min(verified.upper)),
        upper: Some(verified.upper),
        lower: Some(stated(verified.lower)),
        noncausal: Some(stated(verified.noncausal)),
        ..bank.gamma
    };
    bank.proof = Some(proof);
    Ok(verified)
}

/// Whether a norm that was computed in double precision is the gain that was proven at its peak, and no
/// larger gain can lie elsewhere.
fn is_resolved(norm: f64, verified: &Verified) -> bool {
    let is_the_gain = (norm - verified.attained).abs() <= Gamma::NORM_ACCURACY * norm;
    is_the_gain && verified.upper <= verified.attained * (1.0 + NARROW_INTERVAL)
}

/// The largest gain in the arithmetic of `verify` in place of `norm`. Where it exceeds the one that `proof`
/// attains, it becomes that of the proof.
fn enclosed_norm(
    bank: &Bank,
    norm: f64,
    proof: &mut Proof,
    verified: &mut Verified,
) -> Result<f64, DesignError> {
    let error = EnclosedErrorSystem::new(bank)?;
    let found = if is_zero(verified.upper, &error) { None } else { EnclosedGains(&error).peak(proof)? };
    let Some((gain, peak)) = found else { return Ok(norm) };
    if let Some(certificate) = proof.upper.as_mut().filter(|_| gain > verified.attained) {
        (verified.attained, certificate.peak) = (gain, peak);
    }
    Ok(verified.attained)
}

/// The gammas of a bank for which no certificate was found. In double precision a gamma that is a small
/// difference may be off by more than its stated error, so the norm is the largest gain near the peak in the
/// arithmetic of `verify`, and the lower ends are those that it proves.
fn without_certificate(bank: &Bank, dual: &DualSolution, stop: &Stop) -> Result<Gamma, DesignError> {
    let error = EnclosedErrorSystem::new(bank)?;
    let Some((norm, _)) = EnclosedGains(&error).peak(&Proof::default())? else { return Ok(bank.gamma) };
    let proof = lower_ends(&error, bank, dual, norm, stop)?;
    let noncausal = proof.noncausal.as_ref().and_then(|witness| error.noncausal_bound(witness));
    let lower = match &proof.lower {
        Some(LowerProof::Fir(witnesses)) => error.fir_bound(witnesses),
        Some(LowerProof::Causal(witness)) => Some(witness.gamma),
        None => noncausal,
    };
    // Without a witness nothing but zero is known to be below.
    let [lower, noncausal] = [lower, noncausal].map(|proven| Some(proven.map_or(0.0, stated)));
    let accuracy = LiftedPlant::new(&Problem::of_bank(bank)?).accuracy(norm)?;
    let computed = Some(norm * (1.0 + accuracy));
    let upper = [computed, bank.gamma.upper, lower, noncausal].into_iter().flatten().reduce(f64::max);
    Ok(Gamma { norm: Some(norm), upper, lower, noncausal, ..bank.gamma })
}

/// The frequency of a witness in [0, pi].
fn frequency(witness: &DualWitness) -> f64 {
    let [c, s] = witness.half;
    2.0 * s.abs().atan2(c.abs())
}

fn half(frequency: f64) -> [f64; 2] {
    let (s, c) = (0.5 * frequency).sin_cos();
    [c, s]
}

/// A stated lower end of a proven one.
fn stated(proven: f64) -> f64 {
    proven * (1.0 - STATED_BELOW)
}

/// The frequency and direction in which the largest part of the reference samples cannot be estimated from
/// the samples.
fn noncausal_witness(bank: &Bank) -> Result<DualWitness, DesignError> {
    let merged = Problem::of_bank(bank)?.merge_channels(Repeats::AtWholePeriods).of_unit_size()?;
    let plant = LiftedPlant::new(&merged.problem);
    let (n, m) = (plant.channels(), plant.ratio());
    let frequency = plant.noncausal_bound()?.frequency;
    let l = linalg::lq_factor(&FrequencyResponse::new(plant.system()).at_frequency(frequency));
    let rest = l.ncols().saturating_sub(n);
    let part = if rest == 0 { CMat::zeros(m, 1) } else { l.view((n, n), (m, rest)).into_owned() };
    Ok(witness(frequency, &leading_direction(&part)?))
}

/// The left singular vector of the largest singular value.
fn leading_direction(response: &CMat) -> Result<CMat, DesignError> {
    Ok(linalg::svd(response)?.u.columns(0, 1).into_owned())
}

fn witness(frequency: f64, reference: &CMat) -> DualWitness {
    DualWitness { half: half(frequency), reference: pairs(reference), measured: Vec::new() }
}

fn pairs(column: &CMat) -> Vec<[f64; 2]> {
    // Adding 0.0 turns negative zeros into positive ones, for the file.
    column.iter().map(|z| [z.re + 0.0, z.im + 0.0]).collect()
}
