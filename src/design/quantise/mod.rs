//! Taps for fixed-point hardware: integers times a power of two, chosen for the least gamma (not for the least distance
//! from the taps of the optimum).
//!
//! Rounding each tap by itself throws away what the front ends allow: noise in the taps matters only where the channels carry
//! signal. So the integers are looked for
//! 1. as the closest point of a lattice, in the sense of the mean square that a change of taps adds to the error (`forms`, `lattice`),
//!    the more weighted the frequencies at which the last integers were worst (Lawson's method, as for minimax approximation);
//! 2. by descent from the best of these, on the worst case itself (`descent`).
//!
//! The scale is the finest power of two at which the taps fit their bits, or one step finer with the largest taps cut off. Of all
//! integers found on the way, those whose gamma is next to the least are equally good in this sense; among them the least
//! mean-square error decides, with the converters' noise at the output.

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
/// Differences of gamma that do not matter beside the mean square: 0.001 dB.
const INDIFFERENT: f64 = 1e-4;

/// Integers found, and what they cost as far as a grid tells.
#[derive(Debug, Clone)]
pub struct Quantised {
    /// The integers with their scale.
    pub fixed_point: FixedPoint,
    /// gamma of the integers, estimated.
    pub gamma: f64,
    /// The mean square of the error and of the converters' noise at the output, a tick.
    pub mean_square: f64,
    /// gamma of the real taps each rounded by itself, at the finest scale at which they fit.
    pub rounded: f64,
}

impl Quantised {
    /// Smaller in gamma, or where that is next to equal in the mean square.
    fn is_better(&self, other: &Self, slack: f64) -> bool {
        let alike = 1.0 + slack.max(INDIFFERENT);
        self.gamma * alike < other.gamma
            || self.gamma < other.gamma * alike && self.mean_square < other.mean_square
    }
}

/// Taps to be made integers.
#[derive(Debug, Clone, Copy)]
pub struct Subject<'a> {
    /// The front ends.
    pub plant: &'a BlockedPlant,
    /// Filters of one length, one a channel.
    pub taps: &'a [Vec<f64>],
    /// Power of each channel's noise.
    pub noise: &'a [f64],
    /// Relative excess of gamma that may go into the mean square.
    pub slack: f64,
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
    /// The mean-square error over that of the real taps in decibels.
    pub mean_square_loss_db: f64,
    /// `loss_db` of the real taps rounded one by one, at the finest scale at which they fit.
    pub rounded_loss_db: f64,
}

/// Bits more or fewer that a study looks at.
const NEIGHBOURS: [i32; 5] = [-2, -1, 0, 1, 2];

/// The best integers found near the filters of `subject`, whose norm is `real_gamma`, and what the neighbouring word lengths
/// cost.
///
/// # Errors
/// As [`Quantiser`]; [`DesignError::AllZero`] if at the scale given nothing is left of the taps.
pub fn quantise(
    subject: Subject<'_>,
    real_gamma: f64,
    bits: &WordLengths,
    fraction_bits: Option<i32>,
) -> Result<(FixedPoint, WordStudy), DesignError> {
    let quantiser = Quantiser::new(subject)?;
    let all: Vec<WordLengths> = NEIGHBOURS.into_iter().filter_map(|more| bits.widened(more)).collect();
    let mut found = quantiser.quantise_all(&all, fraction_bits)?;
    // What fits few bits fits more.
    for k in 1..found.len() {
        if found[k - 1].is_better(&found[k], subject.slack) {
            let fixed_point = FixedPoint { bits: all[k].clone(), ..found[k - 1].fixed_point.clone() };
            found[k] = Quantised { fixed_point, rounded: found[k].rounded, ..found[k - 1] };
        }
    }
    let words = found.iter().map(|found| quantiser.loss(found)).collect();
    let asked = found.into_iter().find(|found| found.fixed_point.bits == *bits).ok_or(DesignError::NoTaps)?;
    let silent = asked.fixed_point.integers.iter().flatten().all(|&integer| integer == 0);
    match fraction_bits {
        Some(fraction_bits) if silent && subject.taps.iter().flatten().any(|&tap| tap != 0.0) => {
            Err(DesignError::AllZero { fraction_bits, fitting: quantiser.finest_that_fits(bits) })
        }
        _ => Ok((asked.fixed_point, WordStudy { real_gamma, words })),
    }
}

/// The search for integers near the taps of one bank.
pub struct Quantiser<'a> {
    subject: Subject<'a>,
    ratio: usize,
    grid: ErrorGrid<'a>,
    forms: Forms,
    /// gamma of the real taps, estimated.
    real: f64,
    /// Their mean square.
    real_square: f64,
}

/// Integers as doubles, a list a channel.
type Integers = Vec<Vec<f64>>;

impl<'a> Quantiser<'a> {
    /// Prepares the front ends.
    ///
    /// # Errors
    /// [`DesignError::Lti`] if the plant is not stable.
    pub fn new(subject: Subject<'a>) -> Result<Self, DesignError> {
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
    pub fn quantise(&self, bits: &WordLengths, fraction_bits: Option<i32>) -> Result<Quantised, DesignError> {
        let finest = fraction_bits.unwrap_or_else(|| self.finest_that_fits(bits));
        let fitting = Search::new(self, bits, finest);
        let rounded = self.gamma(&fitting.rounded())?;
        let mut found = fitting.run()?;
        if fraction_bits.is_none() && finest < MAX_FRACTION_BITS {
            found.extend(Search::new(self, bits, finest + 1).run()?);
        }
        let least = found.iter().map(|found| found.gamma).fold(f64::INFINITY, f64::min);
        let cap = least * (1.0 + self.subject.slack.max(INDIFFERENT));
        let good = found.into_iter().filter(|found| found.gamma <= cap);
        let kindest = good.min_by(|a, b| a.mean_square.total_cmp(&b.mean_square));
        let Candidate { fixed_point, gamma, mean_square } = kindest.ok_or(DesignError::NoTaps)?;
        Ok(Quantised { fixed_point, gamma, mean_square, rounded })
    }

    fn candidate(&self, fixed_point: FixedPoint) -> Result<Candidate, DesignError> {
        let taps = fixed_point.taps();
        let lags = by_lag(&taps, self.ratio);
        let mean_square = self.grid.mean_square(&lags) + output_noise(self.subject.noise, &taps);
        Ok(Candidate { gamma: self.grid.peaks(&lags)?.estimate, mean_square, fixed_point })
    }

    fn gamma(&self, fixed_point: &FixedPoint) -> Result<f64, DesignError> {
        Ok(self.grid.peaks(&by_lag(&fixed_point.taps(), self.ratio))?.estimate)
    }

    /// [`Self::quantise`] for each of several, on as many threads.
    fn quantise_all(
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

    fn loss(&self, found: &Quantised) -> WordLoss {
        WordLoss {
            bits: found.fixed_point.bits.clone(),
            fraction_bits: found.fixed_point.fraction_bits,
            loss_db: 20.0 * decades(found.gamma, self.real),
            mean_square_loss_db: 10.0 * decades(found.mean_square, self.real_square),
            rounded_loss_db: 20.0 * decades(found.rounded, self.real),
        }
    }

    /// The most fraction bits with which no rounded tap leaves its bits.
    fn finest_that_fits(&self, bits: &WordLengths) -> i32 {
        let fits = |scale: i32| {
            let factor = f64::from(scale).exp2();
            self.subject.taps.iter().all(|filter| {
                filter
                    .iter()
                    .enumerate()
                    .all(|(n, tap)| span(bits, n).contains((tap * factor).round_ties_even()))
            })
        };
        // A tap of no bits fits nowhere unless it vanishes; then the others decide.
        let most = self.subject.taps.iter().flatten().fold(0.0f64, |most, tap| most.max(tap.abs()));
        let widest = (0..self.subject.taps[0].len()).map(|n| bits.bits(n)).max().unwrap_or(0) as i32;
        if most == 0.0 {
            return widest - 1;
        }
        let start = widest - 1 - most.log2().floor() as i32;
        let start = start.clamp(1 - MAX_FRACTION_BITS, MAX_FRACTION_BITS);
        (start - widest..=start).rev().find(|&scale| fits(scale)).unwrap_or(start - 1)
    }
}

/// Integers that were looked at.
struct Candidate {
    fixed_point: FixedPoint,
    gamma: f64,
    mean_square: f64,
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
fn decades(a: f64, b: f64) -> f64 {
    if a == b { 0.0 } else { (a / b).log10() }
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
        let centre: Integers = quantiser
            .subject
            .taps
            .iter()
            .map(|filter| filter.iter().map(|tap| tap * factor).collect())
            .collect();
        let spans = (0..centre[0].len()).map(|n| span(bits, n)).collect();
        Self { quantiser, bits, fraction_bits, centre, spans }
    }

    /// All candidates: the rounded taps, those of the rounds, and what a descent makes of the best of these.
    fn run(&self) -> Result<Vec<Candidate>, DesignError> {
        let mut found = vec![self.quantiser.candidate(self.rounded())?];
        self.follow_the_peaks(&mut found)?;
        let start = found.iter().min_by(|a, b| a.gamma.total_cmp(&b.gamma)).ok_or(DesignError::NoTaps)?;
        found.push(self.quantiser.candidate(self.descended(&start.fixed_point)?)?);
        Ok(found)
    }

    fn descended(&self, start: &FixedPoint) -> Result<FixedPoint, DesignError> {
        let points = self.quantiser.grid.points();
        let integers = start.integers.iter().map(|list| list.iter().map(|&x| x as f64).collect()).collect();
        let lags = by_lag(&start.taps(), self.quantiser.ratio);
        let real = self.quantiser.real;
        let descent = Descent::new(points, &self.spans, start.step(), integers, &lags, real)?;
        Ok(self.fixed_point(&descent.run(NEGLIGIBLE)?))
    }

    fn rounded(&self) -> FixedPoint {
        let round = |filter: &Vec<f64>| {
            filter.iter().zip(&self.spans).map(|(tap, span)| span.nearest(*tap)).collect()
        };
        self.fixed_point(&self.centre.iter().map(round).collect())
    }

    /// Closest lattice points with weights that grow where the last one was worst.
    fn follow_the_peaks(&self, found: &mut Vec<Candidate>) -> Result<(), DesignError> {
        let real = self.quantiser.real;
        let mut weights = vec![1.0; self.quantiser.grid.points().len()];
        for _ in 0..ROUNDS {
            let candidate = self.quantiser.candidate(self.fixed_point(&self.closest(&weights)?))?;
            let lags = by_lag(&candidate.fixed_point.taps(), self.quantiser.ratio);
            let room = candidate.gamma - real;
            found.push(candidate);
            if room <= NEGLIGIBLE * real {
                break;
            }
            for (weight, gain) in weights.iter_mut().zip(self.quantiser.grid.gains(&lags)?) {
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
