//! Integers at one scale: closest lattice points with weights on the worst frequencies, then a descent.

use super::descent::Descent;
use super::lattice::{IntegerSpan, closest};
use super::problem::{RoundedTaps, Tap, TapError};
use super::settings::SETTINGS;
use crate::design::DesignError;
use crate::lti::FirMatrix;
use hybank_core::bank::FixedPoint;
use hybank_core::spec::WordLengths;

/// Rounds of reweighting: with one, banks of `filters/` lose up to 2 dB more.
const ROUNDS: usize = 12;
/// Integers as doubles, one list per channel.
type Integers = Vec<Vec<f64>>;

/// The search at one scale.
pub(super) struct LatticeSearch<'a> {
    error: &'a TapError<'a>,
    bits: &'a WordLengths,
    fraction_bits: i32,
    /// The real taps of least gamma, in units of the step.
    centre: Integers,
    spans: Vec<IntegerSpan>,
}

impl<'a> LatticeSearch<'a> {
    pub(super) fn new(error: &'a TapError<'a>, bits: &'a WordLengths, fraction_bits: i32) -> Self {
        let centre = in_steps(error.problem.taps, fraction_bits);
        let spans = (0..centre[0].len()).map(|n| IntegerSpan::of(bits, n)).collect();
        Self { error, bits, fraction_bits, centre, spans }
    }

    /// All candidates: zero output, the rounded taps, those of the rounds of reweighting, and the end of a
    /// descent from the best of these.
    pub(super) fn run(&self) -> Result<Vec<RoundedTaps>, DesignError> {
        let mut found =
            vec![self.error.candidate(self.zero_output())?, self.error.candidate(self.rounded())?];
        self.reweighted(&mut found)?;
        let least = found.iter().min_by(|a, b| a.gamma.total_cmp(&b.gamma));
        let start = least.map_or_else(|| self.rounded(), |candidate| candidate.fixed_point.clone());
        found.push(self.error.candidate(self.descended(&start)?)?);
        Ok(found)
    }

    /// The candidate close to the real `taps` of least mean square, in which the noise of the converters
    /// counts.
    pub(super) fn near_least_square(&self, taps: &[Vec<f64>]) -> Result<RoundedTaps, DesignError> {
        let centre = in_steps(taps, self.fraction_bits);
        let closest = self.closest(&centre, &self.error.grid.mean_weights(), self.error.problem.noise)?;
        self.error.candidate(self.fixed_point(&closest))
    }

    fn descended(&self, start: &FixedPoint) -> Result<FixedPoint, DesignError> {
        let points = &self.error.points;
        let integers = start.integers.iter().map(|list| list.iter().map(|&x| x as f64).collect()).collect();
        let fir = FirMatrix::polyphase(&start.taps(), self.error.ratio);
        let real = self.error.real_gamma;
        let descent = Descent::new(points, &self.spans, start.step(), integers, &fir, real)?;
        Ok(self.fixed_point(&descent.run(SETTINGS.negligible_loss, self.error.problem.stop)?))
    }

    /// All taps zero.
    pub(super) fn zero_output(&self) -> FixedPoint {
        self.fixed_point(&self.centre.iter().map(|list| vec![0.0; list.len()]).collect())
    }

    /// The taps rounded one by one, clipped to their bits.
    pub(super) fn rounded(&self) -> FixedPoint {
        let round = |filter: &Vec<f64>| {
            filter.iter().zip(&self.spans).map(|(tap, span)| span.nearest(*tap)).collect()
        };
        self.fixed_point(&self.centre.iter().map(round).collect())
    }

    /// Closest lattice points, with weights that grow at the frequencies where the last point was worst
    /// (Lawson).
    fn reweighted(&self, found: &mut Vec<RoundedTaps>) -> Result<(), DesignError> {
        let real = self.error.real_gamma;
        let mut weights = vec![1.0; self.error.points.len()];
        for _ in (0..ROUNDS).take_while(|_| !self.error.problem.stop.is_due()) {
            let candidate =
                self.error.candidate(self.fixed_point(&self.closest(&self.centre, &weights, &[])?))?;
            let fir = FirMatrix::polyphase(&candidate.fixed_point.taps(), self.error.ratio);
            let excess_of_worst = candidate.gamma - real;
            found.push(candidate);
            if excess_of_worst <= SETTINGS.negligible_loss * real {
                break;
            }
            for (weight, gain) in weights.iter_mut().zip(self.error.grid.gains(&fir)?) {
                let excess = ((gain - real) / excess_of_worst).max(0.0);
                *weight = (1.0 - SETTINGS.replaced_share) * *weight
                    + SETTINGS.replaced_share * SETTINGS.emphasis * excess * excess;
            }
        }
        Ok(())
    }

    /// The integers closest to `centre` in the mean-square sense with these weights and noise, phase by
    /// phase.
    fn closest(&self, centre: &Integers, weights: &[f64], noise: &[f64]) -> Result<Integers, DesignError> {
        let ratio = self.error.ratio;
        let lags = self.spans.len().div_ceil(ratio);
        let correlations = self.error.forms.correlations(weights, lags);
        let mut integers = centre.clone();
        for phase in 0..ratio.min(self.spans.len()) {
            let taps = Tap::of_phase(phase, self.error, self.bits);
            let at = |tap: &Tap| phase + tap.lag * ratio;
            let centre: Vec<f64> = taps.iter().map(|tap| centre[tap.channel][at(tap)]).collect();
            let spans: Vec<IntegerSpan> = taps.iter().map(|tap| self.spans[at(tap)]).collect();
            let found = closest(&correlations.factor(&taps, noise)?, &centre, &spans);
            for (tap, integer) in taps.iter().zip(found) {
                integers[tap.channel][at(tap)] = integer;
            }
        }
        Ok(integers)
    }

    fn fixed_point(&self, integers: &Integers) -> FixedPoint {
        FixedPoint {
            bits: self.bits.clone(),
            fraction_bits: self.fraction_bits,
            integers: integers.iter().map(|list| list.iter().map(|&x| x as i64).collect()).collect(),
        }
    }
}

/// Real taps in units of the step.
fn in_steps(taps: &[Vec<f64>], fraction_bits: i32) -> Integers {
    let factor = f64::from(fraction_bits).exp2();
    taps.iter().map(|filter| filter.iter().map(|tap| tap * factor).collect()).collect()
}
