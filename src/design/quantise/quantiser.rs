//! The search at all scales in question, and the choice among its candidates. Real taps that are smaller
//! than the optimal ones and cost some gamma are tried too, because few bits hold them with a finer step.

use super::enumeration::Enumeration;
use super::lattice::Span;
use super::phases::Phases;
use super::problem::{Candidate, QuantisationProblem, TapError};
use super::search::Search;
use super::{WordLoss, decades};
use crate::bank::FixedPoint;
use crate::design::DesignError;
use crate::design::filters::{impulse_responses, polyphase};
use crate::design::methods::tap_lags;
use crate::lmi::sampled::{MeanSquareObjective, Problem, mean_square_under_cap};
use crate::spec::{MAX_BITS, MAX_FRACTION_BITS, WordLengths};
use std::ops::RangeInclusive;
use std::sync::OnceLock;
use std::thread::ScopedJoinHandle;

/// Relative difference of gamma below which the mean square decides: 0.001 dB.
pub(super) const GAMMA_TIE: f64 = 1e-4;
/// Relative excess over the gamma of the real taps from which more scales are searched: 0.05 dB.
const LOSS_FOR_MORE_SCALES: f64 = 5.8e-3;
/// Integers that lower the gamma of zero output by less than this share do no better than zero output.
const LEAST_EFFECT_OF_INTEGERS: f64 = 1e-6;
/// Real taps that lower it by more than this share have an effect, which integers should have too.
const LEAST_EFFECT_OF_REAL_TAPS: f64 = 1e-3;
/// Scales of few taps that are searched beyond the finest one that holds the optimal taps.
const MAX_FINER_SCALES: i32 = 40;

impl Candidate {
    /// Whether gamma is smaller, or about equal with a smaller mean square.
    pub(super) fn is_better(&self, other: &Self, gamma_margin: f64) -> bool {
        let alike = 1.0 + gamma_margin.max(GAMMA_TIE);
        self.gamma * alike < other.gamma
            || self.gamma < other.gamma * alike && self.mean_square < other.mean_square
    }
}

/// The search for integers near the taps of one bank.
pub(super) struct Quantiser<'a> {
    pub(super) error: TapError<'a>,
    /// The mean square that integers should keep to; infinite where only gamma counts.
    pub(super) most_mean_square: f64,
    /// Computed when first needed.
    smaller: OnceLock<Result<Vec<SmallerTaps>, DesignError>>,
}

impl<'a> Quantiser<'a> {
    /// Samples the plant.
    ///
    /// # Errors
    /// [`DesignError::Lti`] if the plant is not stable, [`DesignError::Linalg`] if a decomposition fails.
    pub(super) fn new(problem: QuantisationProblem<'a>) -> Result<Self, DesignError> {
        let error = TapError::new(problem)?;
        Ok(Self { error, most_mean_square: f64::INFINITY, smaller: OnceLock::new() })
    }

    /// The best integers of the given bits; `fraction_bits` fixes their scale.
    ///
    /// # Errors
    /// [`DesignError::Linalg`] if a decomposition fails.
    pub(super) fn quantise(
        &self,
        bits: &WordLengths,
        fraction_bits: Option<i32>,
    ) -> Result<Candidate, DesignError> {
        let finest = fraction_bits.unwrap_or_else(|| self.finest_that_fits(bits));
        let fitting = Search::new(self.error.problem.taps, &self.error, bits, finest);
        let zero_output = self.error.candidate(fitting.zero_output())?;
        let mut found = vec![zero_output.clone()];
        found.extend(fitting.run()?);
        if fraction_bits.is_none() && finest < MAX_FRACTION_BITS {
            found.extend(Search::new(self.error.problem.taps, &self.error, bits, finest + 1).run()?);
        }
        let is_worse = least_gamma(&found) > self.error.real_gamma * (1.0 + LOSS_FOR_MORE_SCALES);
        if is_worse && !self.error.problem.stop.is_due() {
            match fraction_bits {
                None => self.search_finer_scales(bits, finest, &mut found)?,
                Some(scale) => self.search_few_taps(bits, scale..=scale, &mut found)?,
            }
        }
        if self.most_mean_square.is_finite() {
            found.extend(self.improved(&found)?);
        }
        Ok(self.best(found).unwrap_or(zero_output))
    }

    /// From the candidate of least mean square, one near the real taps of least mean square.
    fn improved(&self, found: &[Candidate]) -> Result<Option<Candidate>, DesignError> {
        let least = found.iter().min_by(|a, b| a.mean_square.total_cmp(&b.mean_square));
        let improved = |start: &Candidate| {
            let mut phases = Phases::new(&self.error, &start.fixed_point, start.mean_square);
            phases.near_optimum()?;
            self.error.candidate(phases.fixed_point(&start.fixed_point))
        };
        least.map(improved).transpose()
    }

    /// The candidate of least mean square: of those of about the least gamma that keep to the mean square
    /// that is allowed, or of all where none does.
    fn best(&self, mut found: Vec<Candidate>) -> Option<Candidate> {
        let keeps = |found: &Candidate| found.mean_square <= self.most_mean_square;
        if found.iter().any(keeps) {
            found.retain(keeps);
            let cap = least_gamma(&found) * (1.0 + self.error.problem.gamma_margin.max(GAMMA_TIE));
            found.retain(|found| found.gamma <= cap);
        }
        found.into_iter().min_by(|a, b| a.mean_square.total_cmp(&b.mean_square))
    }

    /// Adds candidates with steps finer than those that hold the optimal taps: near smaller taps, and from
    /// the enumeration of few taps.
    fn search_finer_scales(
        &self,
        bits: &WordLengths,
        finest: i32,
        found: &mut Vec<Candidate>,
    ) -> Result<(), DesignError> {
        let mut last = finest;
        let smaller = self.smaller.get_or_init(|| smaller_taps(&self.error));
        for smaller in smaller.as_ref().map_err(DesignError::clone)? {
            let scale = self.finest_that_holds(&smaller.taps, bits);
            if least_gamma(found) <= smaller.gamma {
                break;
            }
            if scale > last {
                for scale in [scale, scale + 1].into_iter().filter(|&scale| scale <= MAX_FRACTION_BITS) {
                    found.extend(Search::new(&smaller.taps, &self.error, bits, scale).run()?);
                }
                last = scale;
            }
        }
        let coarsest = (finest - 1).max(-MAX_FRACTION_BITS);
        self.search_few_taps(bits, coarsest..=(finest + MAX_FINER_SCALES).min(MAX_FRACTION_BITS), found)
    }

    /// Adds the best integers of a bank of few taps.
    fn search_few_taps(
        &self,
        bits: &WordLengths,
        scales: RangeInclusive<i32>,
        found: &mut Vec<Candidate>,
    ) -> Result<(), DesignError> {
        let Some(enumeration) = Enumeration::new(&self.error, bits) else { return Ok(()) };
        for fraction_bits in scales {
            let bar = least_gamma(found);
            if !enumeration.may_reach(fraction_bits, bar)? {
                break;
            }
            for integers in enumeration.better_than(bar, fraction_bits)? {
                found.push(self.error.candidate(FixedPoint {
                    bits: bits.clone(),
                    fraction_bits,
                    integers,
                })?);
            }
        }
        Ok(())
    }

    /// [`Self::quantise`] for each word length, on one thread each where threads can be had.
    pub(super) fn quantise_all(
        &self,
        all: &[WordLengths],
        fraction_bits: Option<i32>,
    ) -> Result<Vec<Candidate>, DesignError> {
        std::thread::scope(|scope| {
            let begin = |bits| {
                let search = move || self.quantise(bits, fraction_bits);
                (bits, std::thread::Builder::new().spawn_scoped(scope, search))
            };
            let searches: Vec<_> = all.iter().map(begin).collect();
            let end = |(bits, thread): (&WordLengths, std::io::Result<ScopedJoinHandle<'_, _>>)| match thread
            {
                Ok(thread) => thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)),
                Err(_) => self.quantise(bits, fraction_bits),
            };
            searches.into_iter().map(end).collect()
        })
    }

    /// Whether integers are no better than zero output, while the real taps are.
    ///
    /// # Errors
    /// [`DesignError::Linalg`] if a decomposition fails.
    pub(super) fn does_nothing(&self, found: &Candidate) -> Result<bool, DesignError> {
        let fixed_point = &found.fixed_point;
        let zeros = fixed_point.integers.iter().map(|list| vec![0; list.len()]).collect();
        let zero_output = self.error.gamma(&FixedPoint { integers: zeros, ..fixed_point.clone() })?;
        Ok(found.gamma >= zero_output * (1.0 - LEAST_EFFECT_OF_INTEGERS)
            && self.error.real_gamma < zero_output * (1.0 - LEAST_EFFECT_OF_REAL_TAPS))
    }

    /// Whether the mean square is as small as it should be.
    pub(super) fn keeps(&self, found: &Candidate) -> bool {
        found.mean_square <= self.most_mean_square
    }

    /// The bits with which rounding adds, on average, the mean square that is left: step^2 / 12 times the
    /// power that each tap sees.
    pub(super) fn bits_by_rounding(&self) -> u32 {
        let taps = self.error.problem.taps;
        let seen: f64 =
            self.error.powers().iter().zip(taps).map(|(power, taps)| power * taps.len() as f64).sum();
        let left = self.most_mean_square - self.error.real_mean_square;
        let most = taps.iter().flatten().fold(0.0f64, |most, tap| most.max(tap.abs()));
        let magnitude = (most / (12.0 * left / seen).sqrt()).log2();
        magnitude.ceil().clamp(0.0, f64::from(MAX_BITS)) as u32 + 1
    }

    /// What integers lose whose scale was fixed to `fraction_bits`, or chosen.
    ///
    /// # Errors
    /// [`DesignError::Linalg`] if a decomposition fails.
    pub(super) fn loss(
        &self,
        found: &Candidate,
        fraction_bits: Option<i32>,
    ) -> Result<WordLoss, DesignError> {
        let bits = found.fixed_point.bits.clone();
        Ok(WordLoss {
            fraction_bits: found.fixed_point.fraction_bits,
            loss_db: 20.0 * decades(found.gamma, self.error.real_gamma),
            mean_square_loss_db: self.mean_square_loss_db(found),
            rounded_loss_db: 20.0 * decades(self.rounded(&bits, fraction_bits)?, self.error.real_gamma),
            bits,
        })
    }

    pub(super) fn mean_square_loss_db(&self, found: &Candidate) -> f64 {
        10.0 * decades(found.mean_square, self.error.real_mean_square)
    }

    /// Estimate of gamma of the real taps, each rounded by itself at the finest scale at which all fit.
    pub(super) fn rounded(&self, bits: &WordLengths, fraction_bits: Option<i32>) -> Result<f64, DesignError> {
        let finest = fraction_bits.unwrap_or_else(|| self.finest_that_fits(bits));
        self.error.gamma(&Search::new(self.error.problem.taps, &self.error, bits, finest).rounded())
    }

    /// The most fraction bits, within their limits, with which each rounded tap fits its bits. Taps that are
    /// zero at every scale, because of their bits, do not count.
    pub(super) fn finest_that_fits(&self, bits: &WordLengths) -> i32 {
        self.finest_that_holds(self.error.problem.taps, bits)
    }

    /// [`Self::finest_that_fits`] for other taps.
    fn finest_that_holds(&self, taps: &[Vec<f64>], bits: &WordLengths) -> i32 {
        let spans = taps.iter().flat_map(|filter| {
            filter
                .iter()
                .enumerate()
                .map(|(n, &tap)| (tap, Span::of(bits, n)))
                .filter(|(tap, span)| span.reaches(*tap))
        });
        let nonzero: Vec<(f64, Span)> = spans.collect();
        let fits = |scale: i32| {
            let factor = f64::from(scale).exp2();
            nonzero.iter().all(|(tap, span)| span.contains((tap * factor).round_ties_even()))
        };
        let widest = (0..taps[0].len()).map(|n| bits.bits(n)).max().unwrap_or(0) as i32;
        let most = nonzero.iter().fold(0.0f64, |most, (tap, _)| most.max(tap.abs()));
        let magnitude = if most == 0.0 { 0 } else { most.log2().floor() as i32 };
        let within = |scale: i32| scale.clamp(-MAX_FRACTION_BITS, MAX_FRACTION_BITS);
        // At the coarsest of these scales all taps are below one half, so they fit.
        let (coarsest, finest) = (within(-2 - magnitude), within(widest - 1 - magnitude));
        (coarsest..=finest).rev().find(|&scale| fits(scale)).unwrap_or(coarsest)
    }
}

fn least_gamma(found: &[Candidate]) -> f64 {
    found.iter().map(|found| found.gamma).fold(f64::INFINITY, f64::min)
}

/// gamma of the smaller taps over that of the optimal ones, in decibels.
const LOSSES_DB: [f64; 12] = [0.02, 0.1, 0.3, 1.0, 2.0, 4.0, 7.0, 11.0, 16.0, 24.0, 36.0, 60.0];
/// Weight of the mean-square error relative to that of the taps.
const ERROR_WEIGHT: f64 = 1e-6;
/// Relative accuracy of that mean square: these taps only begin the search for integers.
const MEAN_SQUARE_ACCURACY: f64 = 1e-3;

/// Taps with the gamma that they were allowed.
struct SmallerTaps {
    gamma: f64,
    taps: Vec<Vec<f64>>,
}

/// For each of some gammas below that of zero output the taps of least Euclidean norm, the largest taps
/// first.
///
/// # Errors
/// [`DesignError::Linalg`] if a decomposition fails.
fn smaller_taps(error: &TapError<'_>) -> Result<Vec<SmallerTaps>, DesignError> {
    let zero_output = zero_output(error);
    let caps = LOSSES_DB.map(|db| error.real_gamma * 10f64.powf(db / 20.0));
    caps.into_iter()
        .take_while(|cap| *cap < zero_output)
        .map_while(|cap| under_cap(error, cap).transpose())
        .collect()
}

/// An upper bound of the gamma of zero taps.
fn zero_output(error: &TapError<'_>) -> f64 {
    error.points.iter().map(|point| point.w.norm()).fold(0.0, f64::max)
}

/// `None` if gamma is zero up to rounding: no cap lies above it.
fn under_cap(error: &TapError<'_>, cap: f64) -> Result<Option<SmallerTaps>, DesignError> {
    let (length, channels) = (error.problem.taps[0].len(), error.problem.taps.len());
    let (points, mut weights) = error.grid.coarse();
    weights.iter_mut().for_each(|weight| *weight *= ERROR_WEIGHT);
    let lags = tap_lags(error.ratio, length);
    let problem = Problem::new(points, lags);
    let objective = MeanSquareObjective { weights, noise: vec![1.0; channels] };
    let start = polyphase(error.problem.taps, error.ratio);
    let is_due = || error.problem.stop.is_due();
    let found = mean_square_under_cap(&problem, &objective, cap, &start, MEAN_SQUARE_ACCURACY, &is_due)?;
    Ok(found.map(|found| SmallerTaps { gamma: cap, taps: impulse_responses(&found.taps, length) }))
}
