//! The search at the two scales in question, and the choice among its candidates.

use super::lattice::IntegerSpan;
use super::problem::{QuantisationProblem, RoundedTaps, TapError};
use super::search::LatticeSearch;
use super::settings::SETTINGS;
use super::{WordLoss, decades};
use crate::design::DesignError;
use crate::design::reduction::Aim;
use hybank_core::bank::FixedPoint;
use hybank_core::spec::{MAX_FRACTION_BITS, WordLengths};
use rayon::prelude::*;

impl RoundedTaps {
    /// Whether gamma is smaller, or about equal with a smaller mean square; only the mean square counts
    /// where that is the aim.
    pub(super) fn is_better(&self, other: &Self, problem: QuantisationProblem<'_>) -> bool {
        let QuantisationProblem { aim, gamma_margin, .. } = problem;
        if aim == Aim::MeanSquare {
            return self.mean_square < other.mean_square;
        }
        let alike = 1.0 + gamma_margin.max(SETTINGS.gamma_tie);
        self.gamma * alike < other.gamma
            || self.gamma < other.gamma * alike && self.mean_square < other.mean_square
    }
}

/// The search for integers near the taps of one bank.
pub(super) struct TapQuantiser<'a> {
    pub(super) error: TapError<'a>,
    /// The mean square that integers should keep to; infinite where only gamma counts.
    most_mean_square: f64,
    /// The real taps of least mean square, if that counts.
    of_least_square: Option<Vec<Vec<f64>>>,
}

impl<'a> TapQuantiser<'a> {
    /// Samples the plant.
    ///
    /// # Errors
    /// [`DesignError::Lti`] if the plant is not stable, [`DesignError::Linalg`] if a decomposition fails.
    pub(super) fn new(problem: QuantisationProblem<'a>) -> Result<Self, DesignError> {
        let error = TapError::new(problem)?;
        let is_least_square = problem.aim == Aim::MeanSquare;
        let of_least_square = is_least_square.then(|| error.taps_of_least_square()).transpose()?;
        Ok(Self { error, most_mean_square: f64::INFINITY, of_least_square })
    }

    /// The same for integers whose mean square is at most `loss_db` above that of the real taps.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub(super) fn within(problem: QuantisationProblem<'a>, loss_db: f64) -> Result<Self, DesignError> {
        let error = TapError::new(problem)?;
        let most_mean_square = error.real_mean_square * 10f64.powf(loss_db / 10.0);
        let of_least_square = Some(error.taps_of_least_square()?);
        Ok(Self { error, most_mean_square, of_least_square })
    }

    /// The best integers of the given bits; `fraction_bits` fixes their scale.
    ///
    /// # Errors
    /// [`DesignError::Linalg`] if a decomposition fails.
    pub(super) fn quantise(
        &self,
        bits: &WordLengths,
        fraction_bits: Option<i32>,
    ) -> Result<RoundedTaps, DesignError> {
        let finest = fraction_bits.unwrap_or_else(|| self.finest_that_fits(bits));
        let mut found = self.candidates(bits, finest)?;
        if fraction_bits.is_none() && finest < MAX_FRACTION_BITS {
            found.extend(self.candidates(bits, finest + 1)?);
        }
        let zero_output =
            self.error.candidate(LatticeSearch::new(&self.error, bits, finest).zero_output())?;
        Ok(self.best(found, zero_output.gamma).unwrap_or(zero_output))
    }

    fn candidates(&self, bits: &WordLengths, fraction_bits: i32) -> Result<Vec<RoundedTaps>, DesignError> {
        let search = LatticeSearch::new(&self.error, bits, fraction_bits);
        let mut found = match self.error.problem.aim {
            Aim::WorstCase => search.run()?,
            Aim::MeanSquare => vec![self.error.candidate(search.rounded())?],
        };
        if let Some(taps) = &self.of_least_square {
            found.push(search.near_least_square(taps)?);
        }
        Ok(found)
    }

    /// The candidate of least mean square: of those of about the least gamma, which is not above that of
    /// zero output, that keep to the mean square that is allowed, or of all where none does.
    fn best(&self, mut found: Vec<RoundedTaps>, of_zero_output: f64) -> Option<RoundedTaps> {
        let gamma_counts = self.error.problem.aim == Aim::WorstCase;
        if gamma_counts && found.iter().any(|found| self.keeps(found)) {
            found.retain(|found| self.keeps(found));
            let least = found.iter().map(|found| found.gamma).fold(f64::INFINITY, f64::min);
            let alike = least * (1.0 + self.error.problem.gamma_margin.max(SETTINGS.gamma_tie));
            let cap = alike.min(of_zero_output.max(least));
            found.retain(|found| found.gamma <= cap);
        }
        found.into_iter().min_by(|a, b| a.mean_square.total_cmp(&b.mean_square))
    }

    /// [`Self::quantise`] for each word length.
    pub(super) fn quantise_all(
        &self,
        all: &[WordLengths],
        fraction_bits: Option<i32>,
    ) -> Result<Vec<RoundedTaps>, DesignError> {
        let found: Vec<_> = all.par_iter().map(|bits| self.quantise(bits, fraction_bits)).collect();
        found.into_iter().collect()
    }

    /// Whether integers are no better than zero output, while the real taps are.
    ///
    /// # Errors
    /// [`DesignError::Linalg`] if a decomposition fails.
    pub(super) fn does_nothing(&self, found: &RoundedTaps) -> Result<bool, DesignError> {
        let (fixed_point, error) = (&found.fixed_point, &self.error);
        let zeros = fixed_point.integers.iter().map(|list| vec![0; list.len()]).collect();
        let zero_output = error.candidate(FixedPoint { integers: zeros, ..fixed_point.clone() })?;
        let (integers, real, zero_output) = match error.problem.aim {
            Aim::WorstCase => (found.gamma, error.real_gamma, zero_output.gamma),
            Aim::MeanSquare => {
                (found.mean_square.sqrt(), error.real_mean_square.sqrt(), zero_output.mean_square.sqrt())
            }
        };
        Ok(integers >= zero_output * (1.0 - SETTINGS.least_effect_of_integers)
            && real < zero_output * (1.0 - SETTINGS.least_effect_of_real_taps))
    }

    /// Whether the mean square is as small as it should be.
    pub(super) fn keeps(&self, found: &RoundedTaps) -> bool {
        found.mean_square <= self.most_mean_square
    }

    /// What integers lose whose scale was fixed to `fraction_bits`, or chosen.
    ///
    /// # Errors
    /// [`DesignError::Linalg`] if a decomposition fails.
    pub(super) fn loss(
        &self,
        found: &RoundedTaps,
        fraction_bits: Option<i32>,
    ) -> Result<WordLoss, DesignError> {
        let bits = found.fixed_point.bits.clone();
        Ok(WordLoss {
            fraction_bits: found.fixed_point.fraction_bits,
            loss_db: self.loss_db(found.gamma),
            mean_square_loss_db: self.mean_square_loss_db(found),
            rounded_loss_db: self.loss_db(self.rounded(&bits, fraction_bits)?),
            bits,
        })
    }

    fn loss_db(&self, gamma: f64) -> f64 {
        let TapError { real_gamma, least_gamma, .. } = self.error;
        20.0 * decades(gamma.max(least_gamma), real_gamma.max(least_gamma))
    }

    pub(super) fn mean_square_loss_db(&self, found: &RoundedTaps) -> f64 {
        10.0 * decades(found.mean_square, self.error.real_mean_square)
    }

    /// Estimate of gamma of the real taps, each rounded by itself at the finest scale at which all fit.
    pub(super) fn rounded(&self, bits: &WordLengths, fraction_bits: Option<i32>) -> Result<f64, DesignError> {
        let finest = fraction_bits.unwrap_or_else(|| self.finest_that_fits(bits));
        self.error.gamma(&LatticeSearch::new(&self.error, bits, finest).rounded())
    }

    /// The most fraction bits, within their limits, with which each rounded tap fits its bits. Taps that are
    /// zero at every scale, because of their bits, do not count.
    pub(super) fn finest_that_fits(&self, bits: &WordLengths) -> i32 {
        let finest = |(n, &tap): (usize, &f64)| {
            let span = IntegerSpan::of(bits, n);
            let fits = |scale: &i32| span.contains((tap * f64::from(*scale).exp2()).round_ties_even());
            let found = || (-MAX_FRACTION_BITS..=MAX_FRACTION_BITS).rev().find(fits);
            span.reaches(tap).then(|| found().unwrap_or(-MAX_FRACTION_BITS))
        };
        let taps = self.error.problem.taps.iter();
        taps.flat_map(|filter| filter.iter().enumerate().filter_map(finest)).min().unwrap_or(0)
    }
}
