//! A bound of the worst case over a box of errors, from two norms: delays, gains and cut-offs that are
//! not what the spec says.
//!
//! The filters F are fixed. The errors of a converter change its own rows of H only. For errors t_s,
//! |t_s| <= delta_s, of its delay, gain and cut-off they are
//!
//! ```text
//! h_i(t) = h_i + sum over the errors s of sample i of t_s h'_s  +  r_i(t)
//! ```
//!
//! with fixed rows h'_s ([`slopes`]) and a remainder r_i(t), whose norm over the unit circle is at most
//! rho_i ([`rows`]). Let H' hold all rows delta_s h'_s, D be a positive diagonal matrix with a number for
//! each, and L diagonal with L_i^2 the sum of 1 / D_s^2 over the errors of sample i. Then K(t) = K - F
//! (H(t) - H), and
//!
//! ```text
//! ||K(t)|| <= ||K|| + ||F L|| ( ||D H'|| + [ sum over i of rho_i^2 / L_i^2 ]^(1/2) ).
//! ```
//!
//! For the first-order part is the product of the columns F_i / D_s, a diagonal matrix of the shares t_s
//! / delta_s, and D H'; the columns together have the Gram matrix of F L. D commutes with the shares, so
//! that the samples of one converter in a frame may share an error. The phases of r_i are unknown, so the
//! rows r_i / L_i together have at most the root of the sum of their squares.
//!
//! F L is a digital system and D H' the lifted form of an analog one; both norms are bounded by the
//! bounded-real lemma, with certificates in the file ([`hybank_core::bank::BoxProof`]). Nothing is searched
//! here.
//!
//! The bound is close where the columns of F and the rows of H' are nearly orthogonal, since the norm of
//! their product is then nearly that of its largest term, and where either ||K|| or what the errors add
//! is small.

mod rows;
mod slopes;

use self::rows::UncertainRows;
use super::VerifyError;
use super::error_system::BlockForm;
use super::slow_period::SlowPeriod;
use super::system::EnclosedSystem;
use super::timeline::timeline;
use crate::arithmetic::Ball;
use hybank_core::bank::{Bank, BoxProof, Certificate};
use hybank_core::spec::{ErrorBox, Spec};

/// Makes up for the roundings of sums of up to a thousand terms in double precision.
const OUTWARD: f64 = 1.0 + 1e-12;

/// What errors of a box change, enclosed.
pub struct EnclosedBox {
    filters: BlockForm,
    /// Its samples are the rows of H'.
    slopes: SlowPeriod,
    /// The sample of a frame that each row belongs to.
    samples: Vec<usize>,
    /// rho, for each sample of a frame.
    remainders: Vec<f64>,
}

impl EnclosedBox {
    /// Encloses what the errors of `errors` change in the error system of `bank`.
    ///
    /// # Errors
    /// As [`super::EnclosedErrorSystem::new`]; [`VerifyError::ErrorBox`] for a box that does not fit the
    /// bank.
    pub fn new(bank: &Bank, errors: &ErrorBox) -> Result<Self, VerifyError> {
        check(errors, bank.channel_count())?;
        let UncertainRows { front_ends, rows, samples, remainders } = UncertainRows::new(bank, errors)?;
        front_ends.check_work(rows.len())?;
        let slopes = SlowPeriod::new(&front_ends, &timeline(&rows, bank.ratio)?, &rows);
        Ok(Self { filters: BlockForm::new(&bank.filters, bank.ratio), slopes, samples, remainders })
    }

    /// The sample of a frame, from 0, of each row of H'.
    pub fn samples(&self) -> &[usize] {
        &self.samples
    }

    /// D H'.
    pub fn slopes(&self, scales: &[f64]) -> EnclosedSystem {
        EnclosedSystem::of_samples(&self.slopes, scales)
    }

    /// F L.
    pub fn filters(&self, scales: &[f64]) -> EnclosedSystem {
        EnclosedSystem::of_filters(&self.filters, &self.powers(scales))
    }

    /// L^2.
    fn powers(&self, scales: &[f64]) -> Vec<Ball> {
        let mut powers = vec![Ball::ZERO; self.remainders.len()];
        for (&sample, &scale) in self.samples.iter().zip(scales) {
            powers[sample] += Ball::from(1.0) / (Ball::from(scale) * Ball::from(scale));
        }
        powers
    }

    /// A proven bound of what the errors add to the norm; `None` if `proof` does not prove one.
    pub fn increase(&self, proof: &BoxProof) -> Option<f64> {
        let BoxProof { scales, filters, slopes } = proof;
        let fits = scales.len() == self.samples.len() && scales.iter().all(|scale| *scale > 0.0);
        if !fits || !self.filters(scales).certifies(filters) || !self.slopes(scales).certifies(slopes) {
            return None;
        }
        let rest =
            |(power, &bound): (Ball, &f64)| if bound > 0.0 { bound * bound / power.lower() } else { 0.0 };
        let rest: f64 = self.powers(scales).into_iter().zip(&self.remainders).map(rest).sum();
        let increase = filters.norm * (slopes.norm + rest.sqrt()) * OUTWARD;
        increase.is_finite().then_some(increase)
    }
}

/// Checks the lists of a box and their numbers.
fn check(errors: &ErrorBox, channels: usize) -> Result<(), VerifyError> {
    let refuse = |rule: String| Err(VerifyError::ErrorBox { rule });
    let lists = [errors.delays.len(), errors.gains.len(), errors.cutoffs.len()];
    if let Some(given) = lists.into_iter().find(|given| *given != channels) {
        return refuse(format!("{given} half-widths for {channels} channels: give one for each"));
    }
    let sizes = errors.delays.iter().map(|delay| delay.0).chain(errors.gains.iter().copied());
    if let Some(value) = sizes.clone().find(|x| !(x.is_finite() && *x >= 0.0)) {
        return refuse(format!("a half-width of {value}: it is zero or more"));
    }
    if errors.sides() == 0 {
        return refuse("all its half-widths are zero".to_owned());
    }
    match errors.cutoffs.iter().find(|x| !(0.0..0.5).contains(*x)) {
        Some(value) => refuse(format!("a cut-off off by {value}: the share is from 0 to below 0.5 (50 %)")),
        None => Ok(()),
    }
}

/// The bound of the norm over the box `errors`, from a certificate of the norm without errors and the
/// proof of what they add; `None` if that is not proven. The certificate is one that passed.
///
/// # Errors
/// As [`EnclosedBox::new`].
pub fn worst_case(
    bank: &Bank,
    errors: &ErrorBox,
    nominal: &Certificate,
    proof: &BoxProof,
) -> Result<Option<f64>, VerifyError> {
    let increase = EnclosedBox::new(bank, errors)?.increase(proof);
    Ok(increase.map(|increase| (nominal.gamma + increase) * OUTWARD))
}

/// Proves the worst case that the bank states for the box of its spec's `[uncertainty]`. The certificate of
/// `gamma.upper` has passed.
///
/// # Errors
/// [`VerifyError::WorstCase`] if it is not proven; else as [`EnclosedBox::new`].
pub(super) fn check_stated(bank: &Bank) -> Result<(), VerifyError> {
    let Some(stated) = bank.gamma.worst_case else { return Ok(()) };
    let errors = bank.spec.as_ref().and_then(Spec::error_box);
    let proofs = bank
        .proof
        .as_ref()
        .and_then(|proof| proof.worst_case.as_ref().map(|box_proof| (&proof.upper, box_proof)));
    let proven = match errors.zip(proofs) {
        Some((errors, (nominal, proof))) => worst_case(bank, &errors, nominal, proof)?,
        None => None,
    };
    match proven {
        Some(proven) if proven <= stated => Ok(()),
        _ => Err(VerifyError::WorstCase { stated }),
    }
}
