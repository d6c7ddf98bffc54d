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
//! *Any bank*: if (Gamma b)_h = 0, the right-hand side does not depend on the filters. The best such b =
//! [a; b_h] gives a* S a with the Schur complement S of Gamma_hh, the part of the reference samples that
//! cannot be estimated from the measured ones.
//!
//! *Banks of a given length*: F_{p,i}(z) = sum_j f_i[p + j M] z^-j. Several witnesses together bind all
//! taps if r_{p,i,j} = sum over witnesses of Re conj(a_p) z^-j (Gamma b)_{h,i} = 0. A remaining r is
//! removed by adding a continuous spectrum in the span of the samples themselves. The root of its energy is
//! at most |r| / sqrt(lambda). Here lambda is the least eigenvalue of the covariance matrix of the samples
//! that the taps of one output weight (for white noise at the input).
//!
//! The samples of a channel are counted in a unit in which they are of size one, so that gains do not enter lambda.

use super::ball::{self, Ball, Matrix};
use super::positive;
use super::slow_period::SlowPeriod;
use super::spectrum::{self, ComplexMatrix};
use crate::arithmetic::DoubleDouble;
use crate::bank::{DualWitness, SynthesisFilters};

/// A lower bound of the norm of this bank, from its gain at a frequency: `||K|| >= ||a* K(z)|| / ||a||`.
pub(super) fn gain(
    period: &SlowPeriod,
    filters: &SynthesisFilters,
    ratio: usize,
    witness: &DualWitness,
) -> Option<f64> {
    let z = ComplexMatrix::unit(witness.half);
    let reference = ComplexMatrix::column(&witness.reference);
    let through = spectrum::filter_response(filters, ratio, &z).adjoint().product(&reference);
    let all = reference.above(&ComplexMatrix::zeros(through.re.nrows(), 1).minus(&through));
    root_of_quotient(energy(&spectrum::gram(period, &z), &all), reference.square())
}

/// b* Gamma b.
fn energy(gram: &ComplexMatrix, b: &ComplexMatrix) -> Ball {
    b.inner(&gram.product(b))
}

/// A lower bound of sqrt(a / b); `None` if it is unknown.
fn root_of_quotient(a: Ball, b: Ball) -> Option<f64> {
    // A witness of weight zero proves nothing, and NaN is not a bound; `max` would hide it.
    let quotient = (a / b).lower();
    if !quotient.is_finite() || b.lower() <= 0.0 {
        return None;
    }
    let value = Ball::<DoubleDouble>::from(quotient.max(0.0)).sqrt().lower();
    value.is_finite().then(|| value.max(0.0))
}

/// A bound for any bank, causal or not, of any length: sqrt(a* S a / a* a) at the witness's frequency.
/// `channels` lists the distinct channels.
pub(super) fn unexplained(
    period: &SlowPeriod,
    ratio: usize,
    channels: &[usize],
    witness: &DualWitness,
) -> Option<f64> {
    let gram = spectrum::gram(period, &ComplexMatrix::unit(witness.half));
    let measured: Vec<usize> = channels.iter().map(|i| ratio + i).collect();
    let all: Vec<usize> = (0..ratio).chain(measured.iter().copied()).collect();
    let reference = ComplexMatrix::column(&witness.reference);
    let known = gram.select(&measured, &measured).realified();
    let cross = gram.select(&measured, &(0..ratio).collect::<Vec<_>>()).product(&reference);
    let units = positive::scales(&known);
    let least = least_eigenvalue(&positive::scaled(&known, &units))?;
    let factor = positive::cholesky(&known.map(Ball::mid))?;
    let right: Vec<_> = cross.re.iter().chain(&cross.im).map(|x| (-*x).mid()).collect();
    let solution = factor.solve(&right);
    let n = measured.len();
    let part = |start: usize| Matrix::from_fn(n, 1, |i, _| Ball::exactly(solution[start + i]));
    let b = reference.above(&ComplexMatrix { re: part(0), im: part(n) });
    let gram = gram.select(&all, &all);
    // The optimal b_h has less energy than the b_h found, by r* Gamma_hh^-1 r with the residual r.
    let residual = gram.product(&b).rows(ratio, n).with_rows_scaled(&units[..n]).square();
    let missed = residual / Ball::from(least);
    root_of_quotient(energy(&gram, &b) - missed, reference.square())
}

/// A proven lower bound of the least eigenvalue, within a factor of ten.
fn least_eigenvalue(m: &Matrix) -> Option<f64> {
    let size = (0..m.nrows()).map(|i| m[(i, i)].nearest()).fold(0.0, f64::max);
    (1..29).map(|k| size * 0.1f64.powi(k)).find(|&least| positive::exceeds(m, least))
}

/// A bound for all FIR banks with `length` taps per channel, from `witnesses` whose sum does not depend on
/// the taps.
pub(super) fn of_length(
    period: &SlowPeriod,
    ratio: usize,
    channels: &[usize],
    length: usize,
    witnesses: &[DualWitness],
) -> Option<f64> {
    let covariance = Covariance::new(period)?;
    let seen = covariance.of_taps(period, ratio, channels, length.div_ceil(ratio));
    let lags = length.div_ceil(ratio);
    let units = positive::scales(&seen);
    let units_of_channels: Vec<f64> = units.iter().step_by(lags).copied().collect();
    let mut sums = BindingSums::new(ratio, length, channels);
    witnesses.iter().for_each(|witness| sums.add(period, witness));
    let least = least_eigenvalue(&positive::scaled(&seen, &units))?;
    let added = (sums.seen(&units_of_channels) / Ball::from(least)).sqrt().upper();
    let reference = covariance.of_reference(period, ratio).sqrt().upper();
    let reached = sums.value.lower() - 1.001 * added * reference;
    let paid = (sums.size.upper() + 1.001 * (ratio as f64).sqrt() * added) * (1.0 + 1e-14);
    let bound = reached / paid * (1.0 - 1e-14);
    bound.is_finite().then(|| bound.max(0.0))
}

/// Sums over witnesses.
struct BindingSums {
    ratio: usize,
    length: usize,
    /// Rows of the distinct measured samples.
    measured: Vec<usize>,
    /// sum Re a* (Gamma b)_w.
    value: Ball,
    /// sum ||a|| ||b* G||.
    size: Ball,
    /// r, for each lag the M x N taps.
    residual: Vec<Matrix>,
}

impl BindingSums {
    fn new(ratio: usize, length: usize, channels: &[usize]) -> Self {
        let measured: Vec<usize> = channels.iter().map(|i| ratio + i).collect();
        let residual = vec![ball::zeros(ratio, measured.len()); length.div_ceil(ratio)];
        Self { ratio, length, measured, value: Ball::ZERO, size: Ball::ZERO, residual }
    }

    fn add(&mut self, period: &SlowPeriod, witness: &DualWitness) {
        let z = ComplexMatrix::unit(witness.half);
        let a = ComplexMatrix::column(&witness.reference);
        let b = a.above(&ComplexMatrix::column(&witness.measured));
        let image = spectrum::gram(period, &z).product(&b);
        self.value = self.value + a.inner(&image.rows(0, self.ratio));
        self.size = self.size + (a.square() * b.inner(&image)).sqrt();
        // a_p conj((Gamma b)_i) z^j is the conjugate of what r sums; its real part is the same.
        let mut turned = a.product(&image.select(&self.measured, &[0]).adjoint());
        for lag in &mut self.residual {
            *lag = ball::add(lag, &turned.re);
            turned = turned.times(&z);
        }
    }

    /// |r|^2 over the taps that there are, in the units of their channels.
    fn seen(&self, units: &[f64]) -> Ball {
        let entries = self.residual.iter().enumerate().flat_map(|(lag, r)| {
            let taps = self.length.saturating_sub(lag * self.ratio).min(self.ratio);
            let r = Matrix::from_fn(taps, units.len(), |p, i| r[(p, i)] * Ball::from(units[i]));
            r.iter().copied().collect::<Vec<Ball>>()
        });
        entries.fold(Ball::ZERO, |sum, x| sum + x * x)
    }
}

/// Second moments of the samples for white noise of unit density at the input.
pub(super) struct Covariance {
    /// Of the analog state.
    pub(super) state: Matrix,
    /// e^{A M}.
    transition: Matrix,
}

impl Covariance {
    /// X = E X E' + G by doubling; the remainder after 2^k steps is at most ||E^(2^k)||^2 of the whole.
    pub(super) fn new(period: &SlowPeriod) -> Option<Self> {
        let n = period.order();
        let mut state = period.gram.view((0, 0), (n, n)).into_owned();
        let mut power = period.transition.clone();
        for _ in 0..64 {
            let size = ball::row_sum(&power) * ball::row_sum(&power.transpose());
            if size < 1e-40 {
                let rest = 1.01 * ball::row_sum(&state) * size;
                let state = state.map(|x| x.widened(rest));
                return Some(Self { state, transition: period.transition.clone() });
            }
            state = ball::add(&state, &ball::congruence(&power, &state));
            power = ball::product(&power, &power);
        }
        None
    }

    /// E s_a[k + lag] s_b[k], samples counted at the period in which they are taken.
    fn entry(&self, period: &SlowPeriod, (a, b): (usize, usize), lags: usize) -> Vec<Ball> {
        let n = period.order();
        let (row_a, row_b) = (period.outputs.rows(a, 1).into_owned(), period.outputs.rows(b, 1).into_owned());
        let before = ball::product_transposed(&self.state, &row_b);
        let mut values = vec![ball::product(&row_a, &before)[(0, 0)] + period.gram[(n + a, n + b)]];
        let mut common = ball::add(
            &ball::product(&self.transition, &before),
            &period.gram.view((0, n + b), (n, 1)).into_owned(),
        );
        for _ in 1..=lags {
            values.push(ball::product(&row_a, &common)[(0, 0)]);
            common = ball::product(&self.transition, &common);
        }
        values
    }

    /// Covariance matrix of the samples of `channels` over `lags` periods.
    fn of_taps(&self, period: &SlowPeriod, ratio: usize, channels: &[usize], lags: usize) -> Matrix {
        let late = |i: usize| period.periods_late[ratio + channels[i]];
        let span = lags + (0..channels.len()).map(late).max().unwrap_or(0);
        let mut matrix = ball::zeros(channels.len() * lags, channels.len() * lags);
        for a in 0..channels.len() {
            for b in 0..channels.len() {
                let values = self.entry(period, (ratio + channels[a], ratio + channels[b]), span);
                for (j, k) in (0..lags).flat_map(|j| (0..lags).map(move |k| (j, k))) {
                    // Sample j periods back, taken late(a) periods earlier still.
                    let (from_a, from_b) = (j + late(a), k + late(b));
                    if from_b >= from_a {
                        let value = values[from_b - from_a];
                        matrix[(a * lags + j, b * lags + k)] = value;
                        matrix[(b * lags + k, a * lags + j)] = value;
                    }
                }
            }
        }
        matrix
    }

    /// Mean square of the M reference samples of a period together.
    fn of_reference(&self, period: &SlowPeriod, ratio: usize) -> Ball {
        (0..ratio).fold(Ball::ZERO, |sum, p| sum + self.entry(period, (p, p), 0)[0])
    }
}
