//! The mean square as a function of the integers: quadratic, and of each phase of the output on its own.

use super::lattice::{Span, closest};
use super::problem::{RIDGE, Tap, TapError};
use crate::bank::{FixedPoint, signed_digits};
use crate::design::DesignError;
use crate::design::filters::{polyphase, response};
use crate::linalg::{self, CMat, Complex, Mat};
use crate::lmi::sampled::Point;
use crate::spec::MAX_BITS;

/// Changes that lower the mean square, one after the other.
const MOST_CHANGES: usize = 1000;
/// A change must lower the mean square by this share.
const LEAST_GAIN: f64 = 1e-9;

/// What another integer may take.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Digits {
    /// Any digits.
    Any,
    /// No more canonical signed digits than the integer before.
    NoMore,
}

/// The integers of one phase.
#[derive(Clone)]
pub(super) struct Phase {
    taps: Vec<Tap>,
    spans: Vec<Span>,
    integers: Vec<i64>,
    /// Half the second derivatives, and half the first ones at these integers.
    form: Mat,
    slopes: Vec<f64>,
}

/// Another integer in place of one.
#[derive(Debug, Clone, Copy)]
pub(super) struct Change {
    tap: usize,
    to: i64,
    /// What it adds to the mean square.
    pub(super) cost: f64,
    /// Digits that it saves.
    pub(super) saved: i64,
}

/// Where the mean square of a phase is least.
struct Optimum {
    /// The form, a little above that of the mean square.
    form: Mat,
    /// L with `L L'` = form.
    factor: Mat,
    centre: Vec<f64>,
}

impl Phase {
    /// One integer by a power of two, which keeps to its bits.
    pub(super) fn changes(&self, digits: Digits) -> impl Iterator<Item = Change> + '_ {
        (0..self.taps.len()).flat_map(move |tap| {
            let (own, span) = (self.integers[tap], self.spans[tap]);
            let powers = (0..MAX_BITS).flat_map(|k| [1_i64 << k, -(1_i64 << k)]);
            let change = move |by: i64| {
                let saved = i64::from(signed_digits(own)) - i64::from(signed_digits(own + by));
                Change { tap, to: own + by, cost: self.cost(tap, by as f64), saved }
            };
            let fits = move |by: &i64| span.contains((own + by) as f64);
            let is_allowed = move |change: &Change| digits == Digits::Any || change.saved >= 0;
            powers.filter(fits).map(change).filter(is_allowed)
        })
    }

    fn cost(&self, tap: usize, by: f64) -> f64 {
        by * (2.0 * self.slopes[tap] + by * self.form[(tap, tap)])
    }

    /// Makes a change; what it costs without the others.
    pub(super) fn make(&mut self, change: &Change) -> f64 {
        let by = (change.to - self.integers[change.tap]) as f64;
        let cost = self.cost(change.tap, by);
        self.integers[change.tap] = change.to;
        self.slopes
            .iter_mut()
            .zip(self.form.column(change.tap).iter())
            .for_each(|(slope, x)| *slope += by * x);
        cost
    }

    /// The real taps of least mean square.
    fn optimum(&self) -> Result<Optimum, DesignError> {
        let mut form = self.form.clone();
        (0..self.taps.len()).for_each(|i| form[(i, i)] += RIDGE * form[(i, i)] + f64::MIN_POSITIVE);
        let factor = linalg::cholesky(&form)?;
        let slopes = Mat::from_column_slice(self.slopes.len(), 1, &self.slopes);
        let from = linalg::solve(&form, &slopes);
        let centre = self.integers.iter().zip(from.iter()).map(|(x, from)| *x as f64 - from).collect();
        Ok(Optimum { form, factor, centre })
    }

    /// Changes that save digits, with what they cost if all other taps follow as real ones.
    pub(super) fn savings(&self) -> Result<Vec<Change>, DesignError> {
        let Optimum { form, centre, .. } = self.optimum()?;
        let inverse = linalg::inverse(&form);
        let far = |tap: usize, integer: i64| (integer as f64 - centre[tap]).powi(2) / inverse[(tap, tap)];
        let followed = |change: Change| {
            let cost = far(change.tap, change.to) - far(change.tap, self.integers[change.tap]);
            Change { cost, ..change }
        };
        Ok(self.changes(Digits::NoMore).filter(|change| change.saved > 0).map(followed).collect())
    }

    /// Integers close to the real taps of least mean square, if these are better; what they cost.
    fn near_optimum(&mut self) -> Result<f64, DesignError> {
        let Optimum { factor, centre, .. } = self.optimum()?;
        let near = closest(&factor, &centre, &self.spans);
        let by = Mat::from_iterator(
            near.len(),
            1,
            near.iter().zip(&self.integers).map(|(x, own)| x - *own as f64),
        );
        let bent = &self.form * &by;
        let cost: f64 = by
            .iter()
            .zip(&self.slopes)
            .zip(bent.iter())
            .map(|((by, slope), bent)| by * (2.0 * slope + bent))
            .sum();
        if cost >= 0.0 {
            return Ok(0.0);
        }
        self.integers = near.iter().map(|x| *x as i64).collect();
        self.slopes.iter_mut().zip(bent.iter()).for_each(|(slope, x)| *slope += x);
        Ok(cost)
    }

    /// [`Self::near_optimum`] of all integers but one that was changed.
    pub(super) fn near_optimum_beside(&mut self, change: &Change) -> Result<f64, DesignError> {
        let kept = Span { least: change.to as f64, most: change.to as f64 };
        let span = std::mem::replace(&mut self.spans[change.tap], kept);
        let cost = self.near_optimum();
        self.spans[change.tap] = span;
        cost
    }

    /// Canonical signed digits of all integers.
    pub(super) fn digits(&self) -> u32 {
        self.integers.iter().map(|integer| signed_digits(*integer)).sum()
    }

    /// The change that lowers the mean square most, again and again, until none lowers it by `least`; what
    /// all of them cost.
    pub(super) fn improve(&mut self, least: f64, digits: Digits) -> f64 {
        let mut cost = 0.0;
        for _ in 0..MOST_CHANGES {
            let best = self.changes(digits).min_by(|a, b| a.cost.total_cmp(&b.cost));
            let Some(best) = best.filter(|change| change.cost < -least) else { break };
            cost += self.make(&best);
        }
        cost
    }
}

/// All phases.
pub(super) struct Phases {
    pub(super) all: Vec<Phase>,
    pub(super) mean_square: f64,
}

impl Phases {
    /// Of integers with their mean square.
    pub(super) fn new(error: &TapError<'_>, words: &FixedPoint, mean_square: f64) -> Self {
        let ratio = error.ratio;
        let (step, taps) = (words.step(), words.taps());
        let lags = polyphase(&taps, ratio);
        let error_at = |point: &Point| point.error(&response(&lags, point.omega));
        let errors: Vec<CMat> = error.points.iter().map(error_at).collect();
        let weights = error.grid.mean_weights();
        let correlations = error.forms.correlations(&weights, lags.len());
        let noise = |i: usize| error.problem.noise.get(i).copied().unwrap_or(0.0);
        let slope = |phase: usize, tap: &Tap| {
            let points = error.points.iter().zip(&errors).zip(&weights).filter(|(_, weight)| **weight > 0.0);
            let products = points.map(|((point, error), weight)| {
                let phasor = Complex::from_polar(*weight, -point.omega * tap.lag as f64);
                let product: Complex<f64> = error
                    .row(phase)
                    .iter()
                    .zip(point.h.row(tap.channel).iter())
                    .map(|(e, h)| e * (phasor * h).conj())
                    .sum();
                product.re
            });
            noise(tap.channel) * taps[tap.channel][phase + tap.lag * ratio] - products.sum::<f64>()
        };
        let phase = |phase: usize| {
            let taps = Tap::of_phase(phase, error, &words.bits);
            let own = |a: usize| noise(taps[a].channel);
            let form = Mat::from_fn(taps.len(), taps.len(), |a, b| {
                step * step * (correlations.between(taps[a], taps[b]) + if a == b { own(a) } else { 0.0 })
            });
            Phase {
                spans: taps.iter().map(|tap| Span::of(&words.bits, phase + tap.lag * ratio)).collect(),
                integers: taps
                    .iter()
                    .map(|tap| words.integers[tap.channel][phase + tap.lag * ratio])
                    .collect(),
                slopes: taps.iter().map(|tap| step * slope(phase, tap)).collect(),
                form,
                taps,
            }
        };
        let all = (0..ratio.min(taps[0].len())).map(phase).collect();
        Self { all, mean_square }
    }

    /// Less than this is no gain.
    pub(super) fn least_gain(&self) -> f64 {
        LEAST_GAIN * self.mean_square
    }

    /// Integers close to the real taps of least mean square.
    ///
    /// # Errors
    /// [`DesignError::Linalg`] if a decomposition fails.
    pub(super) fn near_optimum(&mut self) -> Result<(), DesignError> {
        for phase in &mut self.all {
            self.mean_square += phase.near_optimum()?;
        }
        self.improve(Digits::Any);
        Ok(())
    }

    /// Lowers the mean square by single changes.
    pub(super) fn improve(&mut self, digits: Digits) {
        let least = self.least_gain();
        self.mean_square += self.all.iter_mut().map(|phase| phase.improve(least, digits)).sum::<f64>();
    }

    /// The integers in the words of others.
    pub(super) fn fixed_point(&self, start: &FixedPoint) -> FixedPoint {
        let mut words = start.clone();
        for (p, phase) in self.all.iter().enumerate() {
            for (tap, integer) in phase.taps.iter().zip(&phase.integers) {
                words.integers[tap.channel][p + tap.lag * self.all.len()] = *integer;
            }
        }
        words
    }
}
