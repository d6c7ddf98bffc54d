//! The search for what proves a bank's gammas. [`crate::verify`] does the proving; whatever is found here is worth
//! nothing until it has passed there.

use super::equivalence::BlockedPlant;
use super::{DesignError, analysis};
use crate::bank::{Bank, Certificate, Proof, SynthesisFilters, Tone};
use crate::linalg::{self, CMat, Mat};
use crate::lmi::kyp;
use crate::lti::peak::{hinf_norm, unexplained_peak};
use crate::lti::{FrequencyResponse, StateSpace};
use crate::spec::Method;
use crate::verify::{CLAIM_TOLERANCE, Midpoint, Subject, Verified};

/// Relative excesses over the computed norm at which a certificate is looked for, smallest first.
const EXCESSES: [f64; 6] = [1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3];
/// Absolute excesses (times the norm of what is wanted) where the norm is zero up to rounding.
const FLOORS: [f64; 3] = [1e-12, 1e-10, 1e-8];
/// Noise added to every state in the choice of coordinates, relative to gamma and the root of their number: no direction is
/// unobservable then, and the norm rises by some 1e-9 only.
const STATE_NOISE: f64 = 1e-5;
/// What a bound may fall short of the designer's and still be taken for its proof.
const SHORTFALL: f64 = 0.5 * CLAIM_TOLERANCE;

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
    let subject = Subject::new(bank)?;
    let upper = certificate(&subject, bank)?;
    let (gamma, proof) = (upper.gamma, Proof { upper: Some(upper), ..Proof::default() });
    let attained = subject.judge(&proof)?.attained;
    Ok(Certified { gamma, attained, states: subject.states() })
}

/// The bank with all that can be proven of its gammas, and what that is.
///
/// `tones` are those of the design's dual (FIR), from which the lower end is proven where the noncausal bound does not.
///
/// # Errors
/// As [`super::analyze`]; [`DesignError::NotCertified`] if no certificate was found.
pub fn prove(bank: &Bank, tones: &[Tone]) -> Result<(Proof, Verified), DesignError> {
    let subject = Subject::new(bank)?;
    let upper = Some(certificate(&subject, bank)?);
    let gamma = &bank.gamma;
    let enough = |proven: f64, stated: Option<f64>| stated.is_none_or(|x| proven >= x * (1.0 - SHORTFALL));
    let tone = noncausal_tone(bank)?;
    let unexplained = subject.unexplained(&tone);
    let noncausal = unexplained.filter(|&proven| enough(proven, gamma.noncausal)).map(|_| tone);
    let explained = unexplained.is_some_and(|proven| enough(proven, gamma.lower));
    let lower = if bank.method != Method::Fir || explained { Vec::new() } else { tones.to_vec() };
    let reached = subject.out_of_reach(&lower).is_some_and(|proven| enough(proven, gamma.lower));
    let lower = if reached { lower } else { Vec::new() };
    let proof = Proof { upper, lower, noncausal };
    let verified = subject.judge(&proof)?;
    Ok((proof, verified))
}

/// The least gamma of the ladder for which a certificate passes.
fn certificate(subject: &Subject<'_>, bank: &Bank) -> Result<Certificate, DesignError> {
    let middle = subject.midpoint().ok_or(DesignError::NotCertified)?;
    let error = StateSpace::new(middle.a.clone(), middle.b.clone(), middle.c.clone(), middle.d.clone())?;
    let peak = hinf_norm(&error)?;
    // The file says the norm to its last digit; the one computed here may differ in the last few.
    let norm = bank.gamma.upper.map_or(peak.gain, |stated| stated.max(peak.gain));
    let response = error.response_at(linalg::Complex::from_polar(1.0, peak.frequency));
    let tone = tone(peak.frequency, &leading_direction(&response)?);
    let size = middle.c.norm() * middle.b.norm() + middle.d.norm();
    let relative = EXCESSES.iter().map(|excess| norm * (1.0 + excess));
    let absolute = FLOORS.iter().map(|floor| norm + floor * size);
    for gamma in relative.chain(absolute) {
        let Some(factor) = factor(&middle, gamma) else { continue };
        if subject.keeps(&factor, gamma) {
            return Ok(Certificate { gamma, peak: tone, factor });
        }
    }
    Err(DesignError::NotCertified)
}

/// Rows of R with P = R R' for the error system at gamma: by the bounded-real Riccati equation of the transposed system, in
/// coordinates in which its controllability Gramian (the observability Gramian here) is the identity.
fn factor(middle: &Midpoint, gamma: f64) -> Option<Vec<Vec<f64>>> {
    let Midpoint { a, b, c, d } = middle;
    let n = a.nrows();
    let noise = STATE_NOISE * gamma / (n.max(1) as f64).sqrt();
    let mut inputs = Mat::zeros(n, c.nrows() + n);
    inputs.columns_mut(0, c.nrows()).copy_from(&c.transpose());
    inputs.columns_mut(c.nrows(), n).fill_with_identity();
    inputs.columns_mut(c.nrows(), n).scale_mut(noise);
    let k = kyp::gramian_coordinates(&a.transpose(), &inputs, 0.0).ok()?;
    let heard = k.b.columns(0, c.nrows()).into_owned();
    let found = kyp::certificate(&k.a, &heard, &(b.tr_mul(&k.basis)), &d.transpose(), gamma).ok()?;
    let half = linalg::cholesky(&found.p).ok()?;
    let root = linalg::lq_factor(&(k.inverse.tr_mul(&half) * gamma.sqrt()));
    Some((0..n).map(|i| root.row(i).iter().take(i + 1).copied().collect()).collect())
}

/// A tone at which the samples leave most of the wanted ones unexplained.
fn noncausal_tone(bank: &Bank) -> Result<Tone, DesignError> {
    let problem = analysis::bank_problem(bank)?.without_duplicates().0;
    let plant = BlockedPlant::new(&problem);
    let (n, m) = (plant.measured, plant.wanted);
    let frequency = unexplained_peak(&plant.system, n)?.frequency;
    let l = linalg::lq_factor_c(&FrequencyResponse::new(&plant.system).at_frequency(frequency));
    let rest = l.ncols().saturating_sub(n);
    let part = if rest == 0 { CMat::zeros(m, 1) } else { l.view((n, n), (m, rest)).into_owned() };
    Ok(tone(frequency, &leading_direction(&part)?))
}

/// The left singular vector of the largest singular value.
fn leading_direction(response: &CMat) -> Result<CMat, DesignError> {
    Ok(linalg::svd_c(response)?.u.columns(0, 1).into_owned())
}

fn tone(frequency: f64, wanted: &CMat) -> Tone {
    let (s, c) = (0.5 * frequency).sin_cos();
    Tone { half: [c, s], wanted: pairs(wanted), measured: Vec::new() }
}

fn pairs(column: &CMat) -> Vec<[f64; 2]> {
    column.iter().map(|z| [z.re, z.im]).collect()
}
