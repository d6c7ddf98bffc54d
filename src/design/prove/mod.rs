//! Searches for certificates and witnesses that prove a bank's gammas. They prove nothing by themselves:
//! [`crate::verify`] checks them.

mod lower;
mod upper;

use super::limits::Stop;
use super::merging::Repeats;
use super::methods::DualSolution;
use super::plant::LiftedPlant;
use super::{DesignError, analysis};
use crate::bank::{Bank, DualWitness, Gamma, LowerProof, Proof};
use crate::linalg::{self, CMat, Complex};
use crate::lti::peak::{Peak, hinf_norm, refine};
use crate::lti::{FrequencyResponse, StateSpace};
use crate::verify::{EnclosedErrorSystem, Midpoint, Strictness, Verified};
use lower::lower_proof;
pub(super) use lower::max_witnesses;
pub(super) use upper::MAX_SEARCHED_STATES;
use upper::certificate;

/// Relative distance below the designer's bound at which a proven bound still counts as its proof.
const SHORTFALL: f64 = 0.5e-6;
/// Relative distance of a stated lower bound below the proven one: another machine may round an approximate
/// inverse differently.
const STATED_BELOW: f64 = 1e-12;
/// Distances from a peak in doubles at which the enclosed gain is looked at, in radians: from the rounding
/// of a frequency to the width of a wide resonance.
const DISTANCES: [f64; 6] = [1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3];
/// Relative change of a gain at which the refinement of an enclosed peak ends.
const FLAT_GAIN: f64 = 1e-11;

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

/// Searches for witnesses of the bank's gammas. Returns the proof and the bounds that it proves, which
/// do not refute the `stated` gamma.
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
    // What the noncausal bound does not explain is looked for.
    let wanted = bank.gamma.lower.map(|stated| stated.max(dual.bound) * (1.0 - SHORTFALL));
    let explained = wanted.is_some_and(|wanted| above >= wanted);
    let found = || lower_proof(error, bank, dual, wanted, (above, upper), stop);
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
    let (proof, verified) = match prove(bank, &Gamma::default(), dual, stop) {
        Ok(found) => found,
        Err(reason) => {
            if matches!(reason, DesignError::NotCertified { .. } | DesignError::Verify(_)) {
                bank.gamma = without_certificate(bank, dual, stop)?;
            }
            return Err(reason);
        }
    };
    bank.gamma = Gamma {
        norm: bank.gamma.norm.map(|norm| resolved_norm(bank, norm, &verified)).transpose()?,
        upper: Some(verified.upper),
        lower: Some(stated(verified.lower)),
        noncausal: Some(stated(verified.noncausal)),
        ..bank.gamma
    };
    bank.proof = Some(proof);
    Ok(verified)
}

/// The norm that was computed in double precision, within the proven interval. Where it is not the enclosed
/// gain at its peak, the largest enclosed gain near there takes its place.
fn resolved_norm(bank: &Bank, norm: f64, verified: &Verified) -> Result<f64, DesignError> {
    let is_resolved = (norm - verified.attained).abs() <= Gamma::NORM_ACCURACY * norm;
    let peak = if is_resolved { None } else { enclosed_peak(&EnclosedErrorSystem::new(bank)?)? };
    Ok(peak.map_or(norm, |peak| peak.gain).max(verified.attained).min(verified.upper))
}

/// The gammas of a bank for which no certificate was found. In double precision a gamma that is a small
/// difference may be off by more than its stated error, so the norm is the largest gain near the peak in the
/// arithmetic of `verify`, and the lower ends are those that it proves.
fn without_certificate(bank: &Bank, dual: &DualSolution, stop: &Stop) -> Result<Gamma, DesignError> {
    let error = EnclosedErrorSystem::new(bank)?;
    let Some(peak) = enclosed_peak(&error)? else { return Ok(bank.gamma) };
    let norm = peak.gain;
    let proof = lower_ends(&error, bank, dual, norm, stop)?;
    let noncausal = proof.noncausal.as_ref().and_then(|witness| error.noncausal_bound(witness));
    let lower = match &proof.lower {
        Some(LowerProof::Fir(witnesses)) => error.fir_bound(witnesses),
        Some(LowerProof::Causal(witness)) => Some(witness.gamma),
        None => noncausal,
    };
    let [lower, noncausal] = [lower, noncausal].map(|proven| proven.map(stated));
    let computed = Gamma::computed(norm, 0.0, 0.0, 0.0).upper;
    let upper = [computed, bank.gamma.upper, lower, noncausal].into_iter().flatten().reduce(f64::max);
    Ok(Gamma { norm: Some(norm), upper, lower, noncausal, ..bank.gamma })
}

/// The largest gain that `verify` proves beside the peak of the system in doubles; `None` if there is none.
fn enclosed_peak(error: &EnclosedErrorSystem<'_>) -> Result<Option<Peak>, DesignError> {
    let Some(Midpoint { a, b, c, d }) = error.midpoint() else { return Ok(None) };
    let system = StateSpace::new(a, b, c, d)?;
    let at = |frequency: f64| {
        let response = system.response_at(Complex::from_polar(1.0, frequency));
        let gain = error.attains(&witness(frequency, &leading_direction(&response)?));
        Ok::<_, DesignError>(Peak { gain: gain.unwrap_or(0.0), frequency })
    };
    let centre = hinf_norm(&system)?.frequency;
    let sides = DISTANCES.map(|distance| -distance).into_iter().rev().chain([0.0]).chain(DISTANCES);
    let near = sides.map(|distance| at(centre + distance)).collect::<Result<Vec<_>, _>>()?;
    let best = near.windows(3).max_by(|x, y| x[1].gain.total_cmp(&y[1].gain));
    let Some(&[low, middle, high]) = best else { return Ok(None) };
    Ok(Some(refine(at, [low, middle, high], FLAT_GAIN)?).filter(|peak| peak.gain > 0.0))
}

/// A stated lower end of a proven one.
fn stated(proven: f64) -> f64 {
    proven * (1.0 - STATED_BELOW)
}

/// The frequency and direction in which the largest part of the reference samples cannot be estimated from
/// the samples.
fn noncausal_witness(bank: &Bank) -> Result<DualWitness, DesignError> {
    let merged = analysis::bank_problem(bank)?.merge_channels(Repeats::AtWholePeriods).of_unit_size()?;
    let plant = LiftedPlant::new(&merged.problem)?;
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
    let (s, c) = (0.5 * frequency).sin_cos();
    DualWitness { half: [c, s], reference: pairs(reference), measured: Vec::new() }
}

fn pairs(column: &CMat) -> Vec<[f64; 2]> {
    // Adding 0.0 turns negative zeros into positive ones, for the file.
    column.iter().map(|z| [z.re + 0.0, z.im + 0.0]).collect()
}
