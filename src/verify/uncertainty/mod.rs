//! Proven bounds of the worst case over a box of errors: delays, gains and cut-offs that are not what the
//! spec says.
//!
//! The filters F are fixed. For errors delta of the channels let K_delta = W - F H_delta be the error
//! system. [`worst_case`] proves
//!
//! ```text
//! lower <= max over the box of ||K_delta|| <= upper.
//! ```
//!
//! The lower end is the gain of one K_delta at one frequency. The upper end rests on two facts.
//!
//! *Over the errors, at a fixed frequency* (`at_frequency`): each channel's row is a convex mix of its
//! rows at the ends of the box plus a remainder that falls with the width (`remainder`), so the gain is at
//! most the largest gain at a vertex plus what the remainders add. Where that is too much, the box is
//! halved. Many vertices are bounded at once (`multipliers`).
//!
//! *Between frequencies, for fixed errors*: with its memory cut off after J slow periods (`memory`) K is a
//! polynomial in z^-1, and |a* K|^2 is a nonnegative trigonometric polynomial p of some degree d for every
//! direction a. By M. Riesz's lemma, p(omega + t) >= max p cos^2(d t / 2) around its maximum, |t| <= pi / d.
//! (P. Borwein, T. Erdelyi, *Polynomials and Polynomial Inequalities*, 1995, lemma E.3 of section 5.1, for
//! p - max p / 2.) So if every frequency lies within y of one that was evaluated,
//!
//! ```text
//! ||K_delta|| <= max over these frequencies of (sigma(K_delta) + tail) / cos(d y / 2) + tail.
//! ```
//!
//! Only the frequencies near the peak need narrow cells and small boxes, and no norm is computed.

mod aliases;
mod angle;
mod at_frequency;
mod channel;
mod complex_matrix;
mod cover;
mod grid;
mod judge;
mod memory;
mod multipliers;
mod quick;
mod remainder;
mod slopes;
#[cfg(test)]
mod tests;
mod transfer;
mod vertex_tree;

pub use slopes::{Slopes, slopes};

use super::VerifyError;
use crate::bank::Bank;
use crate::spec::UncertaintySpec;
use crate::units::{RadiansPerSlowPeriod, Seconds};

/// How far the channels may be off, in both directions. All lists have one entry per channel. A delay in
/// seconds lies between the doubles nearest to its ends.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct ErrorBox {
    /// Largest error of each delay, zero or more.
    pub delays: Vec<Seconds>,
    /// Largest relative error of each gain, from 0 to below 1.
    pub gains: Vec<f64>,
    /// Largest relative error of each cut-off, from 0 to below 1: Phi_i(s / (1 + x)) for all |x| up to it.
    pub cutoffs: Vec<f64>,
}

/// Errors of the channels. All lists have one entry per channel.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct ErrorPoint {
    /// True delay minus the one in the bank.
    pub delays: Vec<Seconds>,
    /// True gain over the one in the bank, minus one.
    pub gains: Vec<f64>,
    /// True cut-off over the one in the bank, minus one.
    pub cutoffs: Vec<f64>,
}

/// One uncertain number of a channel, a side of the box.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Side {
    Delay(usize),
    Gain(usize),
    Cutoff(usize),
}

/// The worst case over a box, proven from both sides (h = 1).
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct WorstCase {
    /// The norm at `point` is at least this.
    pub lower: f64,
    /// No norm in the box is larger.
    pub upper: f64,
    /// The worst errors found.
    pub point: ErrorPoint,
    /// The frequency of `lower`.
    pub frequency: RadiansPerSlowPeriod,
    /// Number of gains computed.
    pub gains_computed: usize,
}

impl ErrorBox {
    /// No errors at all.
    pub fn none(channels: usize) -> Self {
        Self {
            delays: vec![Seconds(0.0); channels],
            gains: vec![0.0; channels],
            cutoffs: vec![0.0; channels],
        }
    }

    /// The box of a spec's `[uncertainty]`, for `channels` channels.
    pub fn of(table: &UncertaintySpec, channels: usize) -> Self {
        Self {
            delays: table.delays(channels),
            gains: table.gains(channels),
            cutoffs: table.cutoffs(channels),
        }
    }

    /// Whether there are no errors.
    pub fn is_point(&self) -> bool {
        self.delays.iter().all(|x| x.0 == 0.0) && self.gains.iter().chain(&self.cutoffs).all(|x| *x == 0.0)
    }

    /// The sides that have a length: delays, then gains, then cut-offs.
    pub(crate) fn sides(&self) -> Vec<Side> {
        let channels = 0..self.delays.len();
        let delays = channels.clone().filter(|&i| self.delays[i].0 > 0.0).map(Side::Delay);
        let gains = channels.clone().filter(|&i| self.gains[i] > 0.0).map(Side::Gain);
        let cutoffs = channels.filter(|&i| self.cutoffs[i] > 0.0).map(Side::Cutoff);
        delays.chain(gains).chain(cutoffs).collect()
    }

    /// The box with all sides multiplied by `factor`.
    pub fn scaled(&self, factor: f64) -> Self {
        let times = |list: &[f64]| list.iter().map(|x| x * factor).collect();
        Self {
            delays: self.delays.iter().map(|&x| x * factor).collect(),
            gains: times(&self.gains),
            cutoffs: times(&self.cutoffs),
        }
    }

    /// Checks the lists and their numbers.
    ///
    /// # Errors
    /// [`VerifyError::ErrorBox`].
    pub fn check(&self, channels: usize) -> Result<(), VerifyError> {
        let lists =
            [("delays", self.delays.len()), ("gains", self.gains.len()), ("cut-offs", self.cutoffs.len())];
        if let Some((what, given)) = lists.into_iter().find(|(_, given)| *given != channels) {
            let rule = format!("{given} {what} for {channels} channels: give one for each");
            return Err(VerifyError::ErrorBox { rule });
        }
        let refuse = |what: &str, value: f64| {
            let rule = format!("{what} of {value}: zero or more, and gains and cut-offs below 0.5 (50 %)");
            Err(VerifyError::ErrorBox { rule })
        };
        if let Some(delay) = self.delays.iter().find(|x| !(x.0 >= 0.0 && x.0.is_finite())) {
            return refuse("a delay error", delay.0);
        }
        match self.gains.iter().chain(&self.cutoffs).find(|x| !(0.0..0.5).contains(*x)) {
            Some(&share) => refuse("a relative error", share),
            None => Ok(()),
        }
    }
}

impl ErrorPoint {
    /// No errors.
    pub fn none(channels: usize) -> Self {
        let ErrorBox { delays, gains, cutoffs } = ErrorBox::none(channels);
        Self { delays, gains, cutoffs }
    }
}

/// Proves the two ends of the worst case of `bank` over `errors`, at most `accuracy` (relative) apart if the
/// work allows. `candidates` are points that may be the worst, with the frequency of their peak; they only
/// save work.
///
/// # Errors
/// As [`super::EnclosedErrorSystem::new`]; [`VerifyError::ErrorBox`] for a box that does not fit the bank;
/// [`VerifyError::LongMemory`] if the filters or front ends remember for too long; [`VerifyError::WideBox`]
/// if no upper end was proven.
pub fn worst_case(
    bank: &Bank,
    errors: &ErrorBox,
    accuracy: f64,
    candidates: &[(ErrorPoint, RadiansPerSlowPeriod)],
) -> Result<WorstCase, VerifyError> {
    errors.check(bank.channel_count())?;
    let mut cover = cover::Cover::new(bank, errors)?;
    // A first lower end, so that the accuracy has a meaning.
    if candidates.is_empty() {
        cover.try_point(&ErrorPoint::none(bank.channel_count()), RadiansPerSlowPeriod(0.0))?;
    }
    for (point, frequency) in candidates {
        cover.try_point(point, *frequency)?;
    }
    cover.prove(accuracy)
}

/// Whether it is proven that ||K_delta|| <= `gamma` for all errors in the box. It may hold without a proof
/// where the worst case is less than a per cent below `gamma`.
///
/// # Errors
/// As [`worst_case`], without [`VerifyError::WideBox`].
pub fn certifies(bank: &Bank, errors: &ErrorBox, gamma: f64) -> Result<bool, VerifyError> {
    errors.check(bank.channel_count())?;
    cover::Cover::new(bank, errors)?.certifies(gamma)
}

/// Proves the worst case that the bank states for its spec's `[uncertainty]`.
///
/// # Errors
/// [`VerifyError::WorstCase`] if it is not proven or there is no such table; else as [`worst_case`].
pub(crate) fn check_stated(bank: &Bank) -> Result<(), VerifyError> {
    let Some(stated) = bank.gamma.worst_case else { return Ok(()) };
    let table = bank.spec.as_ref().and_then(|spec| spec.uncertainty.as_ref());
    let errors = table.map(|table| ErrorBox::of(table, bank.channel_count()));
    match errors.map_or(Ok(false), |errors| certifies(bank, &errors, stated))? {
        true => Ok(()),
        false => Err(VerifyError::WorstCase { stated }),
    }
}
