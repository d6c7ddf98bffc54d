//! Searches for certificates and witnesses that prove a bank's gammas. They prove nothing by themselves:
//! [`crate::verify`] checks them.

mod lower;
mod upper;

use super::limits::Stop;
use super::merging::Repeats;
use super::methods::DualSolution;
use super::plant::LiftedPlant;
use super::{DesignError, analysis};
use crate::bank::{Bank, DualWitness, Gamma, Proof};
use crate::linalg::{self, CMat};
use crate::lti::FrequencyResponse;
use crate::verify::{EnclosedErrorSystem, Strictness, Verified};
use lower::lower_proof;
pub(super) use lower::max_witnesses;
pub(super) use upper::MAX_SEARCHED_STATES;
use upper::certificate;

/// Relative distance below the designer's bound at which a proven bound still counts as its proof.
const SHORTFALL: f64 = 0.5e-6;
/// Relative distance of a stated lower bound below the proven one: another machine may round an approximate
/// inverse differently.
const STATED_BELOW: f64 = 1e-12;

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
    let witness = noncausal_witness(bank)?;
    let noncausal = error.noncausal_bound(&witness);
    let above = noncausal.unwrap_or(0.0);
    // What the noncausal bound does not explain is looked for.
    let wanted = bank.gamma.lower.map(|stated| stated.max(dual.bound) * (1.0 - SHORTFALL));
    let explained = wanted.is_some_and(|wanted| above >= wanted);
    let interval = (above, upper.gamma);
    let lower = if explained { None } else { lower_proof(&error, bank, dual, wanted, interval, stop)? };
    if stop.is_due() {
        return Err(DesignError::Stopped);
    }
    let proof = Proof { upper: Some(upper), lower, noncausal: noncausal.map(|_| witness) };
    let verified = error.judge(stated, &proof, Strictness::NotRefuted)?;
    Ok((proof, verified))
}

/// Adds a proof to `bank` and sets the gammas to the proven bounds. A computed norm outside of the proven
/// interval, which rounding displaces where the error is a tiny difference, becomes the nearer end of it.
///
/// # Errors
/// As [`prove`]; `bank` is then unchanged.
pub(crate) fn attach_proof(
    bank: &mut Bank,
    dual: &DualSolution,
    stop: &Stop,
) -> Result<Verified, DesignError> {
    let (proof, verified) = prove(bank, &Gamma::default(), dual, stop)?;
    let stated = |proven: f64| Some(proven * (1.0 - STATED_BELOW));
    bank.gamma = Gamma {
        norm: bank.gamma.norm.map(|norm| norm.max(verified.attained).min(verified.upper)),
        upper: Some(verified.upper),
        lower: stated(verified.lower),
        noncausal: stated(verified.noncausal),
        ..bank.gamma
    };
    bank.proof = Some(proof);
    Ok(verified)
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
