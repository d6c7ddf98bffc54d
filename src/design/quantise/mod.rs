//! Taps for fixed-point hardware: integers times a power of two, chosen for the least gamma (not for the least distance
//! from the taps of the optimum).
//!
//! Rounding each tap by itself throws away what the front ends allow: noise in the taps matters only where the channels carry
//! signal. So the integers are looked for
//! 1. as the closest point of a lattice, in the sense of the mean square that a change of taps adds to the error ([`forms`], [`lattice`]),
//!    the more weighted the frequencies at which the last integers were worst (Lawson's method, as for minimax approximation);
//! 2. by descent from the best of these, on the worst case itself ([`descent`]).
//!
//! The scale is the finest power of two at which the taps fit their bits, or one step finer with the largest taps cut off,
//! whichever ends with the smaller gamma.

mod descent;
mod forms;
mod lattice;

use super::DesignError;
use super::equivalence::BlockedPlant;
use super::error_grid::ErrorGrid;
use super::error_system::by_lag;
use crate::bank::FixedPoint;
use crate::spec::{MAX_FRACTION_BITS, WordLengths};
use descent::Descent;
use forms::{Forms, Tap};
use lattice::{Span, closest};

/// Rounds in which the weights follow the worst frequencies.
const ROUNDS: usize = 12;
/// Part of the weights that a round replaces.
const PACE: f64 = 0.2;
/// Weight of the worst frequency, relative to the even weights of the beginning.
const EMPHASIS: f64 = 3.0;
/// Relative excess over the gamma of the real taps that is as good as none: 0.0002 dB.
const NEGLIGIBLE: f64 = 2e-5;

/// Integers found, and what they cost as far as a grid tells.
#[derive(Debug, Clone)]
pub struct Quantised {
    /// The integers with their scale.
    pub fixed_point: FixedPoint,
    /// gamma of the integers, estimated.
    pub gamma: f64,
    /// gamma of the real taps each rounded by itself at the same scale, estimated.
    pub rounded: f64,
}

/// What integer taps cost, beside those of fewer and of more bits.
#[derive(Debug, Clone, serde::Serialize)]
pub struct WordStudy {
    /// gamma of the real taps, exact.
    pub real_gamma: f64,
    /// From fewer to more bits.
    pub words: Vec<WordLoss>,
}

/// What taps of some word length cost.
#[derive(Debug, Clone, serde::Serialize)]
pub struct WordLoss {
    /// Bits of the taps.
    pub bits: WordLengths,
    /// Taps are integers times two to the minus this.
    pub fraction_bits: i32,
    /// gamma over that of the real taps in decibels, estimated on a grid of frequencies.
    pub loss_db: f64,
    /// The same with the real taps rounded one by one.
    pub rounded_loss_db: f64,
}

/// Bits more or fewer that a study looks at.
const NEIGHBOURS: [i32; 5] = [-2, -1, 0, 1, 2];

/// The best integers found near the filters `taps[i]` of the norm `real_gamma`, and what the neighbouring word lengths cost.
/// With the scale fixed by `fraction_bits`, neighbours keep the place of their leading bit.
///
/// # Errors
/// As [`Quantiser`].
pub fn quantise(
    plant: &BlockedPlant,
    taps: &[Vec<f64>],
    real_gamma: f64,
    bits: &WordLengths,
    fraction_bits: Option<i32>,
) -> Result<(FixedPoint, WordStudy), DesignError> {
    let quantiser = Quantiser::new(plant, taps)?;
    let all: Vec<(WordLengths, Option<i32>)> = NEIGHBOURS
        .into_iter()
        .filter_map(|more| {
            let scale =
                fraction_bits.map(|fixed| (fixed + more).clamp(-MAX_FRACTION_BITS, MAX_FRACTION_BITS));
            Some((bits.widened(more)?, scale))
        })
        .collect();
    let found = quantiser.quantise_all(&all)?;
    let words = found.iter().map(|found| quantiser.loss(found)).collect();
    let asked = found.into_iter().find(|found| found.fixed_point.bits == *bits).ok_or(DesignError::NoTaps)?;
    Ok((asked.fixed_point, WordStudy { real_gamma, words }))
}

/// The search for integers near the taps of one bank.
pub struct Quantiser<'a> {
    taps: &'a [Vec<f64>],
    ratio: usize,
    grid: ErrorGrid<'a>,
    forms: Forms,
    /// gamma of the real taps, estimated.
    real: f64,
}

/// Integers as doubles, a list a channel.
type Integers = Vec<Vec<f64>>;

impl<'a> Quantiser<'a> {
    /// For the filters `taps[i]`, all of one length, on `plant`.
    ///
    /// # Errors
    /// [`DesignError::Lti`] if the plant is not stable.
    pub fn new(plant: &'a BlockedPlant, taps: &'a [Vec<f64>]) -> Result<Self, DesignError> {
        let ratio = plant.wanted;
        let lags = by_lag(taps, ratio);
        let grid = ErrorGrid::new(plant, lags.len())?;
        let forms = Forms::new(grid.points());
        let real = grid.peaks(&lags)?.estimate;
        Ok(Self { taps, ratio, grid, forms, real })
    }

    /// The best integers found of the given bits; `fraction_bits` fixes their scale.
    ///
    /// # Errors
    /// [`DesignError::Linalg`] if a decomposition fails.
    pub fn quantise(&self, bits: &WordLengths, fraction_bits: Option<i32>) -> Result<Quantised, DesignError> {
        let finest = self.finest_that_fits(bits);
        let scales = fraction_bits.map_or_else(|| vec![finest, finest + 1], |fixed| vec![fixed]);
        let mut best: Option<Quantised> = None;
        for scale in scales {
            let found = Search::new(self, bits, scale.min(MAX_FRACTION_BITS)).run()?;
            if best.as_ref().is_none_or(|best| found.gamma < best.gamma) {
                best = Some(found);
            }
        }
        best.ok_or(DesignError::NoTaps)
    }

    /// [`Self::quantise`] for each of several, on as many threads.
    fn quantise_all(&self, all: &[(WordLengths, Option<i32>)]) -> Result<Vec<Quantised>, DesignError> {
        std::thread::scope(|scope| {
            let search = |(bits, scale): &'_ (WordLengths, Option<i32>)| {
                let (bits, scale) = (bits.clone(), *scale);
                scope.spawn(move || self.quantise(&bits, scale))
            };
            let threads: Vec<_> = all.iter().map(search).collect();
            let joined = threads.into_iter().map(|thread| thread.join());
            joined.map(|result| result.unwrap_or_else(|panic| std::panic::resume_unwind(panic))).collect()
        })
    }

    fn loss(&self, found: &Quantised) -> WordLoss {
        let decibels =
            |gamma: f64| if self.real > 0.0 { 20.0 * (gamma / self.real).log10() } else { f64::INFINITY };
        WordLoss {
            bits: found.fixed_point.bits.clone(),
            fraction_bits: found.fixed_point.fraction_bits,
            loss_db: decibels(found.gamma),
            rounded_loss_db: decibels(found.rounded),
        }
    }

    /// The most fraction bits with which no rounded tap leaves its bits.
    fn finest_that_fits(&self, bits: &WordLengths) -> i32 {
        let fits = |scale: i32| {
            let factor = f64::from(scale).exp2();
            self.taps.iter().all(|filter| {
                filter
                    .iter()
                    .enumerate()
                    .all(|(n, tap)| span(bits, n).contains((tap * factor).round_ties_even()))
            })
        };
        // A tap of no bits fits nowhere unless it vanishes; then the others decide.
        let most = self.taps.iter().flatten().fold(0.0f64, |most, tap| most.max(tap.abs()));
        let widest = (0..self.taps[0].len()).map(|n| bits.bits(n)).max().unwrap_or(0) as i32;
        if most == 0.0 {
            return widest - 1;
        }
        let start = widest - 1 - most.log2().floor() as i32;
        let start = start.clamp(1 - MAX_FRACTION_BITS, MAX_FRACTION_BITS);
        (start - widest..=start).rev().find(|&scale| fits(scale)).unwrap_or(start - 1)
    }
}

fn span(bits: &WordLengths, tap: usize) -> Span {
    let (least, most) = bits.span(tap);
    Span { least: least as f64, most: most as f64 }
}

/// One scale.
struct Search<'a> {
    quantiser: &'a Quantiser<'a>,
    bits: &'a WordLengths,
    fraction_bits: i32,
    /// The taps in steps.
    centre: Integers,
    spans: Vec<Span>,
}

impl<'a> Search<'a> {
    fn new(quantiser: &'a Quantiser<'a>, bits: &'a WordLengths, fraction_bits: i32) -> Self {
        let factor = f64::from(fraction_bits).exp2();
        let centre: Integers =
            quantiser.taps.iter().map(|filter| filter.iter().map(|tap| tap * factor).collect()).collect();
        let spans = (0..centre[0].len()).map(|n| span(bits, n)).collect();
        Self { quantiser, bits, fraction_bits, centre, spans }
    }

    fn run(&self) -> Result<Quantised, DesignError> {
        let rounded = self.rounded();
        let rounded_gamma = self.gamma(&rounded)?;
        let mut best = (rounded_gamma, rounded);
        self.follow_the_peaks(&mut best)?;
        let points = self.quantiser.grid.points();
        let lags = self.lags(&best.1);
        let step = (-f64::from(self.fraction_bits)).exp2();
        let real = self.quantiser.real;
        let lower = Descent::new(points, &self.spans, step, best.1.clone(), &lags, real)?.run(NEGLIGIBLE)?;
        let gamma = self.gamma(&lower)?;
        if gamma < best.0 {
            best = (gamma, lower);
        }
        Ok(Quantised { fixed_point: self.fixed_point(&best.1), gamma: best.0, rounded: rounded_gamma })
    }

    fn rounded(&self) -> Integers {
        let round = |filter: &Vec<f64>| {
            filter.iter().zip(&self.spans).map(|(tap, span)| span.nearest(*tap)).collect()
        };
        self.centre.iter().map(round).collect()
    }

    /// Closest lattice points with weights that grow where the last one was worst.
    fn follow_the_peaks(&self, best: &mut (f64, Integers)) -> Result<(), DesignError> {
        let real = self.quantiser.real;
        let mut weights = vec![1.0; self.quantiser.grid.points().len()];
        for _ in 0..ROUNDS {
            let integers = self.closest(&weights)?;
            let gains = self.quantiser.grid.gains(&self.lags(&integers))?;
            let gamma = self.gamma(&integers)?;
            if gamma < best.0 {
                *best = (gamma, integers);
            }
            let room = gamma - real;
            if room <= NEGLIGIBLE * real {
                break;
            }
            for (weight, gain) in weights.iter_mut().zip(gains) {
                let excess = ((gain - real) / room).max(0.0);
                *weight = (1.0 - PACE) * *weight + PACE * EMPHASIS * excess * excess;
            }
        }
        Ok(())
    }

    /// The closest integers in the mean-square sense with these weights, phase by phase.
    fn closest(&self, weights: &[f64]) -> Result<Integers, DesignError> {
        let ratio = self.quantiser.ratio;
        let lags = self.spans.len().div_ceil(ratio);
        let correlations = self.quantiser.forms.correlations(weights, lags);
        let mut integers = self.centre.clone();
        for phase in 0..ratio.min(self.spans.len()) {
            let taps = self.taps_of(phase);
            let at = |tap: &Tap| phase + tap.lag * ratio;
            let centre: Vec<f64> = taps.iter().map(|tap| self.centre[tap.channel][at(tap)]).collect();
            let spans: Vec<Span> = taps.iter().map(|tap| self.spans[at(tap)]).collect();
            let found = closest(&correlations.factor(&taps)?, &centre, &spans);
            for (tap, integer) in taps.iter().zip(found) {
                integers[tap.channel][at(tap)] = integer;
            }
        }
        Ok(integers)
    }

    /// The taps of a phase, in the order of time; those with few bits last, where they are decided first and the others
    /// can make up for what they cannot do.
    fn taps_of(&self, phase: usize) -> Vec<Tap> {
        let ratio = self.quantiser.ratio;
        let lags = (self.spans.len() - phase).div_ceil(ratio);
        let mut taps: Vec<Tap> = (0..lags)
            .flat_map(|lag| (0..self.centre.len()).map(move |channel| Tap { channel, lag }))
            .collect();
        taps.sort_by_key(|tap| std::cmp::Reverse(self.bits.bits(phase + tap.lag * ratio)));
        taps
    }

    fn gamma(&self, integers: &Integers) -> Result<f64, DesignError> {
        Ok(self.quantiser.grid.peaks(&self.lags(integers))?.estimate)
    }

    fn lags(&self, integers: &Integers) -> Vec<crate::linalg::Mat> {
        by_lag(&self.fixed_point(integers).taps(), self.quantiser.ratio)
    }

    fn fixed_point(&self, integers: &Integers) -> FixedPoint {
        FixedPoint {
            bits: self.bits.clone(),
            fraction_bits: self.fraction_bits,
            integers: integers.iter().map(|list| list.iter().map(|&x| x as i64).collect()).collect(),
        }
    }
}

#[cfg(test)]
mod tests;
