//! The gain of a bank at one frequency, a lower bound of its norm.
//!
//! At a point z of the unit circle let Gamma = [G_w; G_h] [..]* be the Gram matrix of the M reference and
//! the N measured samples' responses, so that K K* = [I, -F] Gamma [I, -F]*. For every direction a of the
//! reference samples, `||K|| >= ||a* K(z)|| / ||a||`.

use super::ball::{self, Ball};
use super::slow_period::SlowPeriod;
use super::spectrum::{self, adjoint, unit};
use crate::arithmetic::{ComplexBall, DoubleDouble, Float};
use hybank_core::bank::{GainWitness, SynthesisFilters};
use nalgebra::DMatrix;

/// The square of a lower bound of this bank's norm, from its gain at a frequency.
pub(super) fn square_of_gain<F: Float>(
    period: &SlowPeriod<F>,
    filters: &SynthesisFilters,
    ratio: usize,
    witness: &GainWitness,
) -> Ball<F> {
    let z = unit(witness.half);
    let weights = witness.reference.iter().map(|[re, im]| ComplexBall::new(Ball::from(*re), Ball::from(*im)));
    let reference = DMatrix::from_iterator(witness.reference.len(), 1, weights);
    let samples = error_samples(filters, ratio, z, &reference);
    let error = spectrum::gram_times(period, z, &samples);
    let energy = samples.iter().zip(&error).fold(Ball::ZERO, |sum, (x, y)| sum + (x.conj() * *y).re);
    energy / reference.iter().fold(Ball::ZERO, |sum, x| sum + x.norm_sqr())
}

/// K K* of this bank.
pub(super) fn error_gram<F: Float>(
    period: &SlowPeriod<F>,
    filters: &SynthesisFilters,
    ratio: usize,
    half: [f64; 2],
) -> DMatrix<ComplexBall<F>> {
    let z = unit(half);
    let all = error_samples(filters, ratio, z, &ball::identity(ratio));
    ball::product(&adjoint(&all), &spectrum::gram_times(period, z, &all))
}

/// [a; -F* a], the combination of all samples that makes a* e.
fn error_samples<F: Float>(
    filters: &SynthesisFilters,
    ratio: usize,
    z: ComplexBall<F>,
    a: &DMatrix<ComplexBall<F>>,
) -> DMatrix<ComplexBall<F>> {
    let through = ball::product(&adjoint(&spectrum::filter_response(filters, ratio, z)), a);
    ball::above(a, &through.map(|x| -x))
}

/// A lower bound of the root of `square`; `None` if it is unknown.
pub(super) fn root<F: Float>(square: Ball<F>) -> Option<f64> {
    // A witness of weight zero proves nothing, and NaN is not a bound; `max` would hide it.
    let square = square.lower();
    let value = Ball::<DoubleDouble>::from(square.max(0.0)).sqrt().lower();
    (square.is_finite() && value.is_finite()).then(|| value.max(0.0))
}
