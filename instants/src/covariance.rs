//! A covariance as a function of the time between two samples.

use hybank_linalg::{CMat, Complex, Mat};
use std::f64::consts::{PI, TAU};

/// Points of the table per period of the highest frequency. Interpolation by twelve points errs by 2e-15 of
/// the power there.
const POINTS_PER_PERIOD: f64 = 48.0;
/// Points of an interpolation, half of them on each side.
const ORDER: usize = 12;
/// Coefficients of the polynomial between two points: 64 bytes, a line of the cache. In place of the
/// interpolation it errs by 1e-16 of the power.
const COEFFICIENTS: usize = 8;
/// Values from one time for which phasors are computed to the next; those between are turned, so that
/// products do not collect rounding errors.
const RENEWAL: usize = 128;
/// Terms that are summed at a time, for the sake of memory.
const TERMS: usize = 512;

/// `c(t) = sum_q p_q Re(z_q e^{2 pi j f_q t})` for |t| up to a limit, as polynomials between points of time.
#[derive(Debug, Clone)]
pub(super) struct Covariance {
    /// Time of the first polynomial.
    first: f64,
    /// Polynomials per unit of time.
    density: f64,
    polynomials: Vec<Polynomial>,
}

/// Coefficients of the powers of x from -1 to 1, from the lowest on.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
struct Polynomial([f64; COEFFICIENTS]);

impl Covariance {
    /// One for each of some sets of amplitudes p z at the `frequencies` f, in cycles per unit of time, for
    /// times up to `longest`.
    pub(super) fn several(frequencies: &[f64], amplitudes: &[Vec<Complex<f64>>], longest: f64) -> Vec<Self> {
        let highest = frequencies.iter().copied().fold(0.0, f64::max);
        let density = POINTS_PER_PERIOD * highest;
        // Half of an interpolation lies beyond either end.
        let half = (longest * density).ceil() as usize + ORDER / 2 + 1;
        let first = -(half as f64) / density;
        let are_even = amplitudes.iter().flatten().all(|amplitude| amplitude.im == 0.0);
        let begin = if are_even { half } else { 0 };
        let times =
            Times { first: first + begin as f64 / density, step: 1.0 / density, count: 2 * half + 1 - begin };
        let economy = Economy::new();
        let table = |mut values: Vec<f64>| {
            values.splice(0..0, std::iter::repeat_n(0.0, begin));
            for k in 0..begin {
                values[k] = values[2 * half - k];
            }
            let polynomials = values.windows(ORDER).map(|values| economy.polynomial(values)).collect();
            Self { first: first + (ORDER / 2 - 1) as f64 / density, density, polynomials }
        };
        times.sums(frequencies, amplitudes).into_iter().map(table).collect()
    }

    /// c(t).
    ///
    /// # Panics
    /// For times beyond the limit.
    pub(super) fn at(&self, t: f64) -> f64 {
        let mut value = [t];
        self.of_times(&mut value);
        value[0]
    }

    /// c of each of some times, in their place. Those in a row that lie between the same two points have one
    /// polynomial, and are computed together.
    ///
    /// # Panics
    /// As [`Covariance::at`].
    pub(super) fn of_times(&self, times: &mut [f64]) {
        times.iter_mut().for_each(|t| *t = (*t - self.first) * self.density);
        let mut rest = times;
        while let Some(first) = rest.first() {
            // Below 0 it is the largest number.
            let number = *first as i64 as usize;
            let begin = number as f64;
            let is_here = |place: &&f64| (0.0..1.0).contains(&(**place - begin));
            let count = rest.iter().take_while(is_here).count().max(1);
            let (places, others) = rest.split_at_mut(count);
            let Polynomial([a, b, c, d, e, f, g, h]) = self.polynomials[number];
            for place in places {
                let x = 2.0 * (*place - begin) - 1.0;
                let (square, fourth) = (x * x, x * x * x * x);
                *place = (a + b * x) + (c + d * x) * square + ((e + f * x) + (g + h * x) * square) * fourth;
            }
            rest = others;
        }
    }
}

/// From twelve values to the polynomial of eight coefficients that meets their interpolation at eight
/// Chebyshev points between the middle ones.
struct Economy([[f64; ORDER]; COEFFICIENTS]);

impl Economy {
    fn new() -> Self {
        let angle = |k: usize| PI * (k as f64 + 0.5) / COEFFICIENTS as f64;
        let weights: Vec<[f64; ORDER]> =
            (0..COEFFICIENTS).map(|k| lagrange(0.5 + 0.5 * angle(k).cos())).collect();
        let mut coefficients = [[0.0; ORDER]; COEFFICIENTS];
        // T_n and the one before it.
        let (mut now, mut before) = ([0.0; COEFFICIENTS], [0.0; COEFFICIENTS]);
        now[0] = 1.0;
        for n in 0..COEFFICIENTS {
            let norm = if n == 0 { 1.0 } else { 2.0 } / COEFFICIENTS as f64;
            for (k, weights) in weights.iter().enumerate() {
                let at = norm * (n as f64 * angle(k)).cos();
                for (row, power) in coefficients.iter_mut().zip(now) {
                    row.iter_mut().zip(weights).for_each(|(entry, weight)| *entry += power * at * weight);
                }
            }
            let factor = if n == 0 { 1.0 } else { 2.0 };
            let next: [f64; COEFFICIENTS] = std::array::from_fn(|power| {
                factor * if power == 0 { 0.0 } else { now[power - 1] } - before[power]
            });
            (before, now) = (now, next);
        }
        Self(coefficients)
    }

    fn polynomial(&self, values: &[f64]) -> Polynomial {
        Polynomial(self.0.map(|row| row.iter().zip(values).map(|(weight, value)| weight * value).sum()))
    }
}

/// Times at equal distances.
struct Times {
    first: f64,
    step: f64,
    count: usize,
}

impl Times {
    /// The sums of terms at these times, for each set of amplitudes. A time is one of few and a step of few
    /// more, and a term the product of two phasors, so the sums are products of matrices.
    fn sums(&self, frequencies: &[f64], amplitudes: &[Vec<Complex<f64>>]) -> Vec<Vec<f64>> {
        let begins: Vec<f64> =
            (0..self.count).step_by(RENEWAL).map(|n| self.first + n as f64 * self.step).collect();
        let mut sums = vec![Mat::zeros(RENEWAL, begins.len()); amplitudes.len()];
        for start in (0..frequencies.len()).step_by(TERMS) {
            let frequencies = &frequencies[start..frequencies.len().min(start + TERMS)];
            let mut turns = Mat::zeros(RENEWAL, 2 * frequencies.len());
            for (q, frequency) in frequencies.iter().enumerate() {
                let turn = Complex::from_polar(1.0, TAU * frequency * self.step);
                let mut turned = Complex::from(1.0);
                for n in 0..RENEWAL {
                    (turns[(n, 2 * q)], turns[(n, 2 * q + 1)]) = (turned.re, -turned.im);
                    turned *= turn;
                }
            }
            let phasors = CMat::from_fn(frequencies.len(), begins.len(), |q, begin| {
                Complex::from_polar(1.0, TAU * frequencies[q] * begins[begin])
            });
            for (sums, amplitudes) in sums.iter_mut().zip(amplitudes) {
                let phasor = |row: usize, begin: usize| {
                    let phasor = amplitudes[start + row / 2] * phasors[(row / 2, begin)];
                    if row.is_multiple_of(2) { phasor.re } else { phasor.im }
                };
                sums.gemm(1.0, &turns, &Mat::from_fn(2 * frequencies.len(), begins.len(), phasor), 1.0);
            }
        }
        sums.iter().map(|sums| sums.as_slice()[..self.count].to_vec()).collect()
    }
}

/// The weights of the values at -5, -4, .., 6 for the polynomial through them at x in [0, 1).
fn lagrange(x: f64) -> [f64; ORDER] {
    /// 1 / prod_{n != m} (m - n) for the twelve points.
    const SCALES: [f64; ORDER] = [
        -1.0 / 39916800.0,
        1.0 / 3628800.0,
        -1.0 / 725760.0,
        1.0 / 241920.0,
        -1.0 / 120960.0,
        1.0 / 86400.0,
        -1.0 / 86400.0,
        1.0 / 120960.0,
        -1.0 / 241920.0,
        1.0 / 725760.0,
        -1.0 / 3628800.0,
        1.0 / 39916800.0,
    ];
    let distance = |m: usize| x - (m as f64 - 5.0);
    let mut weights = SCALES;
    let mut below = 1.0;
    for (m, weight) in weights.iter_mut().enumerate() {
        *weight *= below;
        below *= distance(m);
    }
    let mut above = 1.0;
    for (m, weight) in weights.iter_mut().enumerate().rev() {
        *weight *= above;
        above *= distance(m);
    }
    weights
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against the sum itself, over 40 periods of the highest frequency.
    #[test]
    fn the_table_is_the_sum() {
        // Real amplitudes make an even function.
        for phase in [1.3, 0.0] {
            check_table(phase);
        }
    }

    fn check_table(phase: f64) {
        let frequencies: Vec<f64> = (0..50).map(|q| 0.37 * (f64::from(q) + 0.5) / 50.0).collect();
        let amplitudes: Vec<Complex<f64>> =
            (0..50).map(|q| Complex::from_polar(0.02, phase * f64::from(q))).collect();
        let table =
            &Covariance::several(&frequencies, &[vec![Complex::ONE; 50], amplitudes.clone()], 108.0)[1];
        let mut worst = 0.0_f64;
        for k in 0..=4000 {
            let t = -108.0 + 0.054 * f64::from(k);
            let terms = frequencies.iter().zip(&amplitudes);
            let sum: f64 = terms.map(|(f, z)| (z * Complex::from_polar(1.0, TAU * f * t)).re).sum();
            worst = worst.max((table.at(t) - sum).abs());
        }
        assert!(worst < 4e-14, "{worst:e}");
    }

    #[test]
    fn the_weights_reproduce_polynomials() {
        for x in [0.0, 0.25, 0.5, 0.999] {
            for power in 0..12 {
                let sum: f64 = lagrange(x).iter().zip(-5..).map(|(w, n)| w * f64::from(n).powi(power)).sum();
                assert!((sum - x.powi(power)).abs() < 1e-7, "{x}^{power}: {sum}");
            }
        }
    }
}
