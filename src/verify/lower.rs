//! Lower bounds that hold for every bank, proven by dual witnesses at frequencies where the samples do not
//! determine the reference.
//!
//! At a point z of the unit circle let Gamma = [G_w; G_h] [..]* be the Gram matrix of the M reference and
//! the N measured samples' responses, and K = G_w - F G_h. For every direction a of the reference samples
//! and every combination b of all samples,
//!
//! ```text
//! ||a|| ||b* G|| ||K|| >= Re a* K G* b = Re a* (Gamma b)_w - Re a* F (Gamma b)_h.
//! ```
//!
//! *Any bank*: if (Gamma b)_h = 0, the right-hand side does not depend on the filters. The best such
//! b = [a; b_h] gives a* S a with the Schur complement S of Gamma_hh, the part of the reference samples that
//! cannot be estimated from the measured ones.
//!
//! [`super::fir_length`] binds the taps of all banks of one length.

use super::ball::{self, Ball, ComplexMatrix, Matrix};
use super::positive;
use super::slow_period::SlowPeriod;
use super::spectrum;
use crate::arithmetic::{ComplexBall, DoubleDouble, Number, dense};
use crate::bank::{DualWitness, SynthesisFilters};
use std::ops::Range;

/// The square of a lower bound of this bank's norm, from its gain at a frequency: `||K|| >= ||a* K(z)|| /
/// ||a||`.
pub(super) fn square_of_gain<F: Number>(
    period: &SlowPeriod<F>,
    filters: &SynthesisFilters,
    ratio: usize,
    witness: &DualWitness,
) -> Ball<F> {
    let z = spectrum::unit(witness.half);
    let reference = spectrum::column(&witness.reference);
    let error = error_samples(filters, ratio, z, &reference);
    energy(&spectrum::gram(period, z), &error) / spectrum::square(&reference)
}

/// [a; -F* a], the combination of all samples that makes a* e.
fn error_samples<F: Number>(
    filters: &SynthesisFilters,
    ratio: usize,
    z: ComplexBall<F>,
    a: &ComplexMatrix<F>,
) -> ComplexMatrix<F> {
    let response = spectrum::filter_response(filters, ratio, z);
    ball::above(a, &ball::product(&spectrum::adjoint(&response), a).map(|x| -x))
}

/// K K* = [I, -F] Gamma [I, -F]* of this bank.
pub(super) fn error_gram<F: Number>(
    period: &SlowPeriod<F>,
    filters: &SynthesisFilters,
    ratio: usize,
    half: [f64; 2],
) -> ComplexMatrix<F> {
    let z = spectrum::unit(half);
    let all = error_samples(filters, ratio, z, &ball::identity(ratio));
    ball::product(&spectrum::adjoint(&all), &spectrum::gram_times(period, z, &all))
}

/// b* Gamma b.
fn energy<F: Number>(gram: &ComplexMatrix<F>, b: &ComplexMatrix<F>) -> Ball<F> {
    spectrum::inner(b, &ball::product(gram, b))
}

/// A lower bound of the root of `square`; `None` if it is unknown.
pub(super) fn root<F: Number>(square: Ball<F>) -> Option<f64> {
    // A witness of weight zero proves nothing, and NaN is not a bound; `max` would hide it.
    let square = square.lower();
    let value = Ball::<DoubleDouble>::from(square.max(0.0)).sqrt().lower();
    (square.is_finite() && value.is_finite()).then(|| value.max(0.0))
}

/// A bound for any bank, causal or not, of any length: sqrt(a* S a / a* a) at the witness's frequency.
/// `channels` lists the distinct channels.
pub(super) fn unexplained(
    period: &SlowPeriod,
    ratio: usize,
    channels: &[usize],
    witness: &DualWitness,
) -> Option<f64> {
    let gram = spectrum::gram(period, spectrum::unit(witness.half));
    let measured: Vec<usize> = channels.iter().map(|i| ratio + i).collect();
    let references: Vec<usize> = (0..ratio).collect();
    let all = [&references[..], &measured].concat();
    let reference = spectrum::column(&witness.reference);
    let known = spectrum::realified(&ball::select(&gram, &measured, &measured));
    let cross = ball::product(&ball::select(&gram, &measured, &references), &reference);
    let units = positive::scales(&known);
    let least = least_eigenvalue(&positive::scaled(&known, &units))?;
    let factor = dense::cholesky(&known.map(Ball::mid))?;
    let solution = dense::solve_factored(&factor, &spectrum::stacked(&cross).map(|x| (-x).mid()));
    let n = measured.len();
    let b = ball::above(&reference, &spectrum::unstacked(&solution.map(Ball::exactly)));
    let gram = ball::select(&gram, &all, &all);
    // The optimal b_h has less energy than the b_h found, by r* Gamma_hh^-1 r with the residual r.
    let residual = ball::product(&gram, &b).rows(ratio, n).into_owned();
    let residual = residual.map_with_location(|i, _, x| x.scaled(Ball::from(units[i])));
    let missed = spectrum::square(&residual) / Ball::from(least);
    root((energy(&gram, &b) - missed) / spectrum::square(&reference))
}

/// Powers of ten down to which a least eigenvalue is looked for: 106 bits resolve no smaller ones.
const EIGENVALUE_DECADES: Range<i32> = 1..29;

/// A proven lower bound of the least eigenvalue, within a factor of ten.
fn least_eigenvalue(m: &Matrix) -> Option<f64> {
    let size = (0..m.nrows()).map(|i| m[(i, i)].nearest()).fold(0.0, f64::max);
    EIGENVALUE_DECADES.map(|k| size * 0.1f64.powi(k)).find(|&least| positive::exceeds(m, least))
}
