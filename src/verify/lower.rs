//! The lower end: what no bank can do, shown by tones at which the samples do not say enough.
//!
//! At a point z of the unit circle let Gamma = [G_w; G_h] [..]* be the Gram matrix of the M wanted and the N measured samples'
//! responses, and K = G_w - F G_h. For every direction a of the wanted samples and every combination b of all samples,
//!
//! ```text
//! ||a|| ||b* G|| ||K|| >= Re a* K G* b = Re a* (Gamma b)_w - Re a* F (Gamma b)_h.
//! ```
//!
//! *Any bank*: if (Gamma b)_h = 0 the filters have no part in it. The best such b = [a; b_h] gives a* S a >= for the Schur
//! complement S of Gamma_hh, the part of the wanted samples that the measured ones leave unexplained.
//!
//! *Banks of a given length*: F_{p,i}(z) = sum_j f_i[p + j M] z^-j. Several tones together bind all taps if
//! r_{p,i,j} = sum over tones of Re conj(a_p) z^-j (Gamma b)_{h,i} = 0. What is left of r is taken away by adding to the tones a
//! continuous spectrum in the span of the samples themselves: it costs at most |r| / sqrt(lambda) in the root of its energy, lambda
//! the least eigenvalue of the covariance matrix of the samples that the taps of one output see (for white noise at the input).

use super::ball::{self, Ball, Matrix};
use super::positive;
use super::spectrum::{self, Complex};
use super::tick::Tick;
use crate::bank::{SynthesisFilters, Tone};

/// A gain that the bank itself has: `||K|| >= ||a* K(z)|| / ||a||`.
pub(super) fn gain(tick: &Tick, filters: &SynthesisFilters, ratio: usize, tone: &Tone) -> Option<f64> {
    let z = Complex::unit(tone.half);
    let wanted = Complex::column(&tone.wanted);
    let through = spectrum::filter_response(filters, ratio, &z).adjoint().product(&wanted);
    let all = wanted.above(&Complex::zeros(through.re.nrows(), 1).minus(&through));
    root_of_quotient(energy(&spectrum::gram(tick, &z), &all), wanted.square())
}

/// b* Gamma b.
fn energy(gram: &Complex, b: &Complex) -> Ball {
    b.inner(&gram.product(b))
}

/// A lower bound of sqrt(a / b), unless nothing is known.
fn root_of_quotient(a: Ball, b: Ball) -> Option<f64> {
    let value = (Ball::from((a / b).lower().max(0.0))).sqrt().lower();
    value.is_finite().then(|| value.max(0.0))
}

/// A bound for any bank, causal or not, of any length: sqrt(a* S a / a* a) at the tone. `channels` are those that
/// can be told apart.
pub(super) fn unexplained(tick: &Tick, ratio: usize, channels: &[usize], tone: &Tone) -> Option<f64> {
    let gram = spectrum::gram(tick, &Complex::unit(tone.half));
    let measured: Vec<usize> = channels.iter().map(|i| ratio + i).collect();
    let all: Vec<usize> = (0..ratio).chain(measured.iter().copied()).collect();
    let wanted = Complex::column(&tone.wanted);
    let known = gram.select(&measured, &measured).realified();
    let cross = gram.select(&measured, &(0..ratio).collect::<Vec<_>>()).product(&wanted);
    let least = least_eigenvalue(&known)?;
    let factor = positive::cholesky(&known.map(Ball::mid))?;
    let right: Vec<_> = cross.re.iter().chain(&cross.im).map(|x| (-*x).mid()).collect();
    let solution = factor.solve(&right);
    let n = measured.len();
    let part = |start: usize| Matrix::from_fn(n, 1, |i, _| Ball::exactly(solution[start + i]));
    let b = wanted.above(&Complex { re: part(0), im: part(n) });
    let gram = gram.select(&all, &all);
    // The best b_h lowers the energy once more, by r* Gamma_hh^-1 r of the residual r of the one found.
    let residual = gram.product(&b).rows(ratio, n).square();
    let missed = residual / Ball::from(least);
    root_of_quotient(energy(&gram, &b) - missed, wanted.square())
}

/// A proven lower bound of the least eigenvalue, within a factor of ten.
fn least_eigenvalue(m: &Matrix) -> Option<f64> {
    let size = (0..m.nrows()).map(|i| m[(i, i)].nearest()).fold(0.0, f64::max);
    (1..29).map(|k| size * 0.1f64.powi(k)).find(|&least| positive::exceeds(m, least))
}

/// A bound for all FIR banks with `length` taps a channel, from `tones` that together see none of the taps.
pub(super) fn of_length(
    tick: &Tick,
    ratio: usize,
    channels: &[usize],
    length: usize,
    tones: &[Tone],
) -> Option<f64> {
    let covariance = Covariance::new(tick)?;
    let seen = covariance.of_taps(tick, ratio, channels, length.div_ceil(ratio));
    let mut tally = Tally::new(ratio, length, channels);
    tones.iter().for_each(|tone| tally.add(tick, tone));
    let added = (tally.seen() / Ball::from(least_eigenvalue(&seen)?)).sqrt().upper();
    let wanted = covariance.of_wanted(tick, ratio).sqrt().upper();
    let reached = tally.value.lower() - 1.001 * added * wanted;
    let paid = (tally.size.upper() + 1.001 * (ratio as f64).sqrt() * added) * (1.0 + 1e-14);
    let bound = reached / paid * (1.0 - 1e-14);
    bound.is_finite().then(|| bound.max(0.0))
}

/// Sums over tones.
struct Tally {
    ratio: usize,
    length: usize,
    /// Rows of the measured samples that can be told apart.
    measured: Vec<usize>,
    /// sum Re a* (Gamma b)_w.
    value: Ball,
    /// sum ||a|| ||b* G||.
    size: Ball,
    /// r, for each lag the M x N taps.
    residual: Vec<Matrix>,
}

impl Tally {
    fn new(ratio: usize, length: usize, channels: &[usize]) -> Self {
        let measured: Vec<usize> = channels.iter().map(|i| ratio + i).collect();
        let residual = vec![ball::zeros(ratio, measured.len()); length.div_ceil(ratio)];
        Self { ratio, length, measured, value: Ball::ZERO, size: Ball::ZERO, residual }
    }

    fn add(&mut self, tick: &Tick, tone: &Tone) {
        let z = Complex::unit(tone.half);
        let a = Complex::column(&tone.wanted);
        let b = a.above(&Complex::column(&tone.measured));
        let image = spectrum::gram(tick, &z).product(&b);
        self.value = self.value + a.inner(&image.rows(0, self.ratio));
        self.size = self.size + (a.square() * b.inner(&image)).sqrt();
        // a_p conj((Gamma b)_i) z^j is the conjugate of what r sums; its real part is the same.
        let mut turned = a.product(&image.select(&self.measured, &[0]).adjoint());
        for lag in &mut self.residual {
            *lag = ball::add(lag, &turned.re);
            turned = turned.times(&z);
        }
    }

    /// |r|^2 over the taps that there are.
    fn seen(&self) -> Ball {
        let entries = self.residual.iter().enumerate().flat_map(|(lag, r)| {
            let taps = self.length.saturating_sub(lag * self.ratio).min(self.ratio);
            r.rows(0, taps).iter().copied().collect::<Vec<Ball>>()
        });
        entries.fold(Ball::ZERO, |sum, x| sum + x * x)
    }
}

/// Second moments of the samples for white noise of unit density at the input.
struct Covariance {
    /// Of the analog state.
    state: Matrix,
    /// e^{A M}.
    transition: Matrix,
}

impl Covariance {
    /// X = E X E' + G by doubling; what is left after 2^k steps is at most ||E^(2^k)||^2 of the whole.
    fn new(tick: &Tick) -> Option<Self> {
        let n = tick.order();
        let mut state = tick.gram.view((0, 0), (n, n)).into_owned();
        let mut power = tick.transition.clone();
        for _ in 0..64 {
            let size = ball::row_sum(&power) * ball::row_sum(&power.transpose());
            if size < 1e-40 {
                let rest = 1.01 * ball::row_sum(&state) * size;
                let state = state.map(|x| x.widened(rest));
                return Some(Self { state, transition: tick.transition.clone() });
            }
            state = ball::add(&state, &ball::congruence(&power, &state));
            power = ball::product(&power, &power);
        }
        None
    }

    /// E s_a[k + lag] s_b[k], samples counted at the tick in which they are taken.
    fn entry(&self, tick: &Tick, (a, b): (usize, usize), lags: usize) -> Vec<Ball> {
        let n = tick.order();
        let (row_a, row_b) = (tick.readouts.rows(a, 1).into_owned(), tick.readouts.rows(b, 1).into_owned());
        let before = ball::product_transposed(&self.state, &row_b);
        let mut values = vec![ball::product(&row_a, &before)[(0, 0)] + tick.gram[(n + a, n + b)]];
        let mut common = ball::add(
            &ball::product(&self.transition, &before),
            &tick.gram.view((0, n + b), (n, 1)).into_owned(),
        );
        for _ in 1..=lags {
            values.push(ball::product(&row_a, &common)[(0, 0)]);
            common = ball::product(&self.transition, &common);
        }
        values
    }

    /// Covariance matrix of the samples of `channels` over `lags` ticks.
    fn of_taps(&self, tick: &Tick, ratio: usize, channels: &[usize], lags: usize) -> Matrix {
        let late = |i: usize| tick.ticks_late[ratio + channels[i]];
        let span = lags + (0..channels.len()).map(late).max().unwrap_or(0);
        let mut matrix = ball::zeros(channels.len() * lags, channels.len() * lags);
        for a in 0..channels.len() {
            for b in 0..channels.len() {
                let values = self.entry(tick, (ratio + channels[a], ratio + channels[b]), span);
                for (j, k) in (0..lags).flat_map(|j| (0..lags).map(move |k| (j, k))) {
                    // Sample j ticks back, taken late(a) ticks earlier still.
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

    /// Mean square of the M wanted samples of a tick together.
    fn of_wanted(&self, tick: &Tick, ratio: usize) -> Ball {
        (0..ratio).fold(Ball::ZERO, |sum, p| sum + self.entry(tick, (p, p), 0)[0])
    }
}
