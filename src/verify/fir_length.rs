//! Lower bounds for all FIR banks of one length, by dual witnesses that together bind all taps.
//!
//! With the words of [`super::lower`], let F_{p,i}(z) = sum_j f_i[p + j M] z^-j. Several witnesses together
//! bind all taps if `r_{p,i,j} = sum over witnesses of Re conj(a_p) z^-j (Gamma b)_{h,i} = 0`.
//!
//! A remaining r is removed by adding a continuous spectrum in the span of the samples themselves. Let s be
//! the samples that the taps of output p weight, for white noise of unit density at the input, and C_p
//! their covariance. With v_p = C_p^-1 r_p, the correlation of the error of output p with v_p' s is that of
//! the reference with v_p' s less f_p' r_p. The energy of all v_p' s together is q = sum over p of
//! r_p' C_p^-1 r_p. So the witnesses and these combinations bind all taps, and by Cauchy's inequality
//!
//! ```text
//! (sum ||a|| ||b* G|| + sqrt(M q)) ||K|| >= sum Re a* (Gamma b)_w - sqrt(q E |reference|^2).
//! ```
//!
//! The witnesses are rounded to doubles. Rounding moves r only in directions that are strong in C, because
//! C is the mean of Gamma_hh over all frequencies. So q is tiny even if C has eigenvalues far below 1e-30,
//! as for long filters; then numbers of 512 bits are needed to see that C is positive definite.

use super::ball::{self, Ball, ComplexMatrix, Matrix};
use super::covariance::{Covariance, TapSamples};
use super::positive;
use super::slow_period::SlowPeriod;
use super::spectrum;
use crate::arithmetic::Number;
use crate::bank::DualWitness;

/// Covers the roundings of a handful of operations in double precision.
const FEW_ROUNDINGS: f64 = 1e-14;

/// A bound for all FIR banks with `length` taps per channel, from `witnesses` whose sum does not depend on
/// the taps; `None` if the precision of F does not suffice.
pub(super) fn of_length<F: Number>(
    period: &SlowPeriod<F>,
    ratio: usize,
    channels: &[usize],
    length: usize,
    witnesses: &[DualWitness],
) -> Option<f64> {
    let covariance = Covariance::new(period)?;
    let measured = covariance.of_taps(period, TapSamples { ratio, channels, lags: length.div_ceil(ratio) });
    let units = positive::scales(&measured);
    let measured = Matrices::new(positive::scaled(&measured, &units), ratio, length)?;
    let mut sums = BindingSums::new(ratio, length, channels);
    witnesses.iter().for_each(|witness| sums.add(period, witness));
    let added = measured.energy(&sums.residual, &units).sqrt().upper();
    let reference = covariance.of_reference(period, ratio).sqrt().upper();
    let reached = sums.value.lower() - positive::SUM_OUTWARD * added * reference;
    let paid =
        (sums.size.upper() + positive::SUM_OUTWARD * (ratio as f64).sqrt() * added) * (1.0 + FEW_ROUNDINGS);
    let bound = reached / paid * (1.0 - FEW_ROUNDINGS);
    bound.is_finite().then(|| bound.max(0.0))
}

/// The covariance of the samples that taps weight, and of those without the last lag, which some outputs do
/// not have.
struct Matrices<F> {
    whole: positive::Definite<F>,
    short: Option<positive::Definite<F>>,
    /// Outputs that have a tap at the last lag.
    outputs: usize,
}

impl<F: Number> Matrices<F> {
    fn new(covariance: Matrix<F>, ratio: usize, length: usize) -> Option<Self> {
        let lags = length.div_ceil(ratio);
        let outputs = length - (lags - 1) * ratio;
        let rest = covariance.nrows() / lags * (lags - 1);
        let short = covariance.view((0, 0), (rest, rest)).into_owned();
        let short = if outputs < ratio && rest > 0 { Some(positive::Definite::new(short)?) } else { None };
        Some(Self { whole: positive::Definite::new(covariance)?, short, outputs })
    }

    /// q, for the residuals of all lags.
    fn energy(&self, residual: &[Matrix<F>], units: &[f64]) -> Ball<F> {
        let channels = residual[0].ncols();
        let column = |p: usize, count: usize| {
            let entry = |row: usize| residual[row / channels][(p, row % channels)] * Ball::from(units[row]);
            Matrix::from_fn(count, 1, |row, _| entry(row))
        };
        let of = |p: usize| match &self.short {
            Some(short) if p >= self.outputs => short.inverse_form(&column(p, short.order())),
            None if p >= self.outputs => Ball::ZERO,
            _ => self.whole.inverse_form(&column(p, self.whole.order())),
        };
        (0..residual[0].nrows()).fold(Ball::ZERO, |sum, p| sum + of(p))
    }
}

/// Sums over witnesses.
struct BindingSums<F> {
    ratio: usize,
    /// Rows of the distinct measured samples.
    measured: Vec<usize>,
    /// sum Re a* (Gamma b)_w.
    value: Ball<F>,
    /// sum ||a|| ||b* G||.
    size: Ball<F>,
    /// r, for each lag the M x N taps.
    residual: Vec<Matrix<F>>,
}

impl<F: Number> BindingSums<F> {
    fn new(ratio: usize, length: usize, channels: &[usize]) -> Self {
        let measured: Vec<usize> = channels.iter().map(|i| ratio + i).collect();
        let residual = vec![ball::zeros(ratio, measured.len()); length.div_ceil(ratio)];
        Self { ratio, measured, value: Ball::ZERO, size: Ball::ZERO, residual }
    }

    fn add(&mut self, period: &SlowPeriod<F>, witness: &DualWitness) {
        let z = spectrum::unit(witness.half);
        let a: ComplexMatrix<F> = spectrum::column(&witness.reference);
        let b = ball::above(&a, &spectrum::column(&witness.measured));
        let image = spectrum::gram_times(period, z, &b);
        self.value += spectrum::inner(&a, &image.rows(0, self.ratio).into_owned());
        self.size += (spectrum::square(&a) * spectrum::inner(&b, &image)).sqrt();
        // a_p conj((Gamma b)_i) z^j is the conjugate of what r sums; its real part is the same.
        let samples = ball::select(&image, &self.measured, &[0]);
        let mut turned = ball::product(&a, &spectrum::adjoint(&samples));
        for lag in &mut self.residual {
            *lag += turned.map(|x| x.re);
            turned = turned.map(|x| x * z);
        }
    }
}
