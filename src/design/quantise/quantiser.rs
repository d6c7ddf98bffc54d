//! The search at all scales that come into question, and the choice among what it finds.

use super::super::DesignError;
use super::super::error_grid::ErrorGrid;
use super::super::error_system::by_lag;
use super::forms::Forms;
use super::lattice::Span;
use super::search::{Candidate, Search};
use super::{Subject, WordLoss};
use crate::bank::FixedPoint;
use crate::spec::{MAX_FRACTION_BITS, WordLengths};

/// Differences of gamma that do not matter beside the mean square: 0.001 dB.
pub(super) const INDIFFERENT: f64 = 1e-4;

/// Integers found, and what they cost as far as a grid tells.
#[derive(Debug, Clone)]
pub(super) struct Quantised {
    /// The integers with their scale.
    pub(super) fixed_point: FixedPoint,
    /// gamma of the integers, estimated.
    pub(super) gamma: f64,
    /// The mean square of the error and of the converters' noise at the output, a tick.
    pub(super) mean_square: f64,
    /// gamma of the real taps each rounded by itself, at the finest scale at which they fit.
    pub(super) rounded: f64,
}

impl Quantised {
    /// Smaller in gamma, or where that is next to equal in the mean square.
    pub(super) fn is_better(&self, other: &Self, gamma_margin: f64) -> bool {
        let alike = 1.0 + gamma_margin.max(INDIFFERENT);
        self.gamma * alike < other.gamma
            || self.gamma < other.gamma * alike && self.mean_square < other.mean_square
    }
}

/// The search for integers near the taps of one bank.
pub(super) struct Quantiser<'a> {
    pub(super) subject: Subject<'a>,
    pub(super) ratio: usize,
    pub(super) grid: ErrorGrid<'a>,
    pub(super) forms: Forms,
    /// gamma of the real taps, estimated.
    pub(super) real: f64,
    /// Their mean square.
    real_square: f64,
}

impl<'a> Quantiser<'a> {
    /// Prepares the front ends.
    ///
    /// # Errors
    /// [`DesignError::Lti`] if the plant is not stable, [`DesignError::Linalg`] if a decomposition fails.
    pub(super) fn new(subject: Subject<'a>) -> Result<Self, DesignError> {
        let ratio = subject.plant.wanted;
        let lags = by_lag(subject.taps, ratio);
        let grid = ErrorGrid::new(subject.plant, lags.len())?;
        let forms = Forms::new(grid.points());
        let real = grid.peaks(&lags)?.estimate;
        let real_square = grid.mean_square(&lags) + output_noise(subject.noise, subject.taps);
        Ok(Self { subject, ratio, grid, forms, real, real_square })
    }

    /// The best integers found of the given bits; `fraction_bits` fixes their scale.
    ///
    /// # Errors
    /// [`DesignError::Linalg`] if a decomposition fails.
    pub(super) fn quantise(
        &self,
        bits: &WordLengths,
        fraction_bits: Option<i32>,
    ) -> Result<Quantised, DesignError> {
        let finest = fraction_bits.unwrap_or_else(|| self.finest_that_fits(bits));
        let fitting = Search::new(self, bits, finest);
        let rounded = self.gamma(&fitting.rounded())?;
        let mut found = fitting.run()?;
        if fraction_bits.is_none() && finest < MAX_FRACTION_BITS {
            found.extend(Search::new(self, bits, finest + 1).run()?);
        }
        let least = found.iter().map(|found| found.gamma).fold(f64::INFINITY, f64::min);
        let cap = least * (1.0 + self.subject.gamma_margin.max(INDIFFERENT));
        let good = found.into_iter().filter(|found| found.gamma <= cap);
        let kindest = good.min_by(|a, b| a.mean_square.total_cmp(&b.mean_square));
        let Candidate { fixed_point, gamma, mean_square } = kindest.ok_or(DesignError::NoTaps)?;
        Ok(Quantised { fixed_point, gamma, mean_square, rounded })
    }

    pub(super) fn candidate(&self, fixed_point: FixedPoint) -> Result<Candidate, DesignError> {
        let taps = fixed_point.taps();
        let lags = by_lag(&taps, self.ratio);
        let mean_square = self.grid.mean_square(&lags) + output_noise(self.subject.noise, &taps);
        Ok(Candidate { gamma: self.grid.peaks(&lags)?.estimate, mean_square, fixed_point })
    }

    fn gamma(&self, fixed_point: &FixedPoint) -> Result<f64, DesignError> {
        Ok(self.grid.peaks(&by_lag(&fixed_point.taps(), self.ratio))?.estimate)
    }

    /// [`Self::quantise`] for each of several, on as many threads.
    pub(super) fn quantise_all(
        &self,
        all: &[WordLengths],
        fraction_bits: Option<i32>,
    ) -> Result<Vec<Quantised>, DesignError> {
        std::thread::scope(|scope| {
            let search = |bits| scope.spawn(move || self.quantise(bits, fraction_bits));
            let threads: Vec<_> = all.iter().map(search).collect();
            let joined = threads.into_iter().map(|thread| thread.join());
            joined.map(|result| result.unwrap_or_else(|panic| std::panic::resume_unwind(panic))).collect()
        })
    }

    pub(super) fn loss(&self, found: &Quantised) -> WordLoss {
        WordLoss {
            bits: found.fixed_point.bits.clone(),
            fraction_bits: found.fixed_point.fraction_bits,
            loss_db: 20.0 * decades(found.gamma, self.real),
            mean_square_loss_db: 10.0 * decades(found.mean_square, self.real_square),
            rounded_loss_db: 20.0 * decades(found.rounded, self.real),
        }
    }

    /// The most fraction bits, within their limits, with which no rounded tap leaves its bits. A tap that its bits make zero
    /// at any scale has no say.
    pub(super) fn finest_that_fits(&self, bits: &WordLengths) -> i32 {
        let spans = self.subject.taps.iter().flat_map(|filter| {
            filter
                .iter()
                .enumerate()
                .map(|(n, &tap)| (tap, Span::of(bits, n)))
                .filter(|(tap, span)| span.reaches(*tap))
        });
        let heard: Vec<(f64, Span)> = spans.collect();
        let fits = |scale: i32| {
            let factor = f64::from(scale).exp2();
            heard.iter().all(|(tap, span)| span.contains((tap * factor).round_ties_even()))
        };
        let widest = (0..self.subject.taps[0].len()).map(|n| bits.bits(n)).max().unwrap_or(0) as i32;
        let most = heard.iter().fold(0.0f64, |most, (tap, _)| most.max(tap.abs()));
        let magnitude = if most == 0.0 { 0 } else { most.log2().floor() as i32 };
        let within = |scale: i32| scale.clamp(-MAX_FRACTION_BITS, MAX_FRACTION_BITS);
        // At the coarsest of these all taps are below one half, and fit.
        let (coarsest, finest) = (within(-2 - magnitude), within(widest - 1 - magnitude));
        (coarsest..=finest).rev().find(|&scale| fits(scale)).unwrap_or(coarsest)
    }
}

/// `sum_i noise_i |f_i|^2`.
fn output_noise(noise: &[f64], taps: &[Vec<f64>]) -> f64 {
    noise
        .iter()
        .zip(taps)
        .map(|(power, filter)| power * filter.iter().map(|tap| tap * tap).sum::<f64>())
        .sum()
}

/// log10(a / b); infinite if only b is zero.
pub(super) fn decades(a: f64, b: f64) -> f64 {
    if a == b { 0.0 } else { (a / b).log10() }
}
