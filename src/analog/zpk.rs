//! Zeros, poles and gain.

use std::f64::consts::TAU;
use std::marker::PhantomData;

use crate::linalg::Complex;
use crate::spec::Passband;
use crate::units::{Hertz, RadiansPerFastPeriod, RadiansPerSecond, Seconds};

/// The unit of s of a prototype: multiples of its cutoff, which lies at |s| = 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cutoffs;

/// `gain * prod(s - zeros) / prod(s - poles)` with s in the unit `U`: [`Cutoffs`] for prototypes,
/// [`RadiansPerSecond`] for physical filters, [`RadiansPerFastPeriod`] for normalised ones.
///
/// A plain value: [`StrictlyProper`](super::StrictlyProper) checks it. Complex values are listed with their
/// conjugates.
#[derive(Debug, Clone, PartialEq)]
pub struct Zpk<U> {
    /// Finite zeros.
    pub zeros: Vec<Complex<f64>>,
    /// Poles.
    pub poles: Vec<Complex<f64>>,
    /// Leading coefficient.
    pub gain: f64,
    unit: PhantomData<U>,
}

impl Zpk<Cutoffs> {
    /// The prototype moved to `passband`, in normalised time.
    pub fn moved(&self, passband: Passband, fast_period: Seconds) -> Zpk<RadiansPerFastPeriod> {
        match passband {
            Passband::LowPass { cutoff } => self.low_pass(cutoff, fast_period),
            Passband::BandPass { low, high } => self.band_pass(low, high, fast_period),
        }
    }

    /// The low-pass H(s' / w') in normalised time, with w' = 2 pi f h for the cutoff f.
    pub fn low_pass(&self, cutoff: Hertz, fast_period: Seconds) -> Zpk<RadiansPerFastPeriod> {
        self.stretched(TAU * cutoff.0 * fast_period.0)
    }

    /// The band-pass H((s'^2 + w1 w2) / (s' (w2 - w1))) in normalised time, with w = 2 pi f h for the edges
    /// f: two roots for every root of the prototype, and a zero at 0 for every pole without a zero.
    pub fn band_pass(&self, low: Hertz, high: Hertz, fast_period: Seconds) -> Zpk<RadiansPerFastPeriod> {
        let center = TAU * (low.0.sqrt() * high.0.sqrt()) * fast_period.0;
        let width = TAU * (high.0 - low.0) * fast_period.0;
        let moved = |roots: &[Complex<f64>]| -> Vec<Complex<f64>> {
            roots.iter().flat_map(|root| band_pass_roots(root * (0.5 * width), center)).collect()
        };
        let excess = self.poles.len().saturating_sub(self.zeros.len());
        let mut zeros = moved(&self.zeros);
        zeros.resize(zeros.len() + excess, Complex::default());
        Zpk::new(zeros, moved(&self.poles), times_power(self.gain, width, excess as i64))
    }
}

impl Zpk<RadiansPerSecond> {
    /// The same filter in normalised time, H(s' / h).
    pub fn normalised(&self, fast_period: Seconds) -> Zpk<RadiansPerFastPeriod> {
        self.stretched(fast_period.0)
    }
}

impl<U> Zpk<U> {
    /// From zeros, poles and leading coefficient, in that order.
    pub fn new(zeros: Vec<Complex<f64>>, poles: Vec<Complex<f64>>, gain: f64) -> Self {
        Self { zeros, poles, gain, unit: PhantomData }
    }

    /// Value at the complex frequency `s`.
    pub fn response(&self, s: Complex<f64>) -> Complex<f64> {
        let mut value = Complex::new(self.gain, 0.0);
        // Zeros and poles alternate, so that the running product stays near its final size.
        for (i, pole) in self.poles.iter().enumerate() {
            if let Some(zero) = self.zeros.get(i) {
                value *= s - zero;
            }
            value /= s - pole;
        }
        self.zeros.iter().skip(self.poles.len()).fold(value, |v, zero| v * (s - zero))
    }

    /// H(s / scale): every zero and pole times `scale`. The unit of s changes with it.
    fn stretched<V>(&self, scale: f64) -> Zpk<V> {
        let relative_degree = self.poles.len() as i64 - self.zeros.len() as i64;
        Zpk::new(
            self.zeros.iter().map(|z| z * scale).collect(),
            self.poles.iter().map(|p| p * scale).collect(),
            times_power(self.gain, scale, relative_degree),
        )
    }
}

/// The roots u +- j sqrt(w^2 - u^2) of s^2 - 2 u s + w^2, where both parts of each keep their relative
/// accuracy, however near a narrow band puts them to j w: the discriminant is a product of differences, the
/// larger root a sum without cancellation, and the smaller one follows from the product w^2.
fn band_pass_roots(u: Complex<f64>, w: f64) -> [Complex<f64>; 2] {
    let q = u / w;
    let square = Complex::new((1.0 - q.re) * (1.0 + q.re) + q.im * q.im, -2.0 * q.re * q.im);
    let root = square.sqrt() * w;
    let turned = Complex::new(-root.im, root.re);
    let is_opposed = u.re * turned.re + u.im * turned.im < 0.0;
    let larger = if is_opposed { u - turned } else { u + turned };
    // A real u within the circle gives a pair of equal size, which has to be conjugate to the last bit.
    let smaller = if u.im == 0.0 && square.re > 0.0 { larger.conj() } else { w / larger * w };
    [larger, smaller]
}

/// `x * base^exponent` by repeated multiplication, so that no intermediate value overflows or underflows
/// unless the result does.
pub(super) fn times_power(x: f64, base: f64, exponent: i64) -> f64 {
    let step = |y: f64| if exponent >= 0 { y * base } else { y / base };
    (0..exponent.unsigned_abs()).fold(x, |y, _| step(y))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// H'(s h) = H(s) for nine decades of fast periods on both sides of a second.
        #[test]
        fn normalising_keeps_the_response(decade in -9.0..9.0f64, w in 0.01..100.0f64) {
            let h = Seconds(10f64.powf(decade));
            let poles = vec![Complex::new(-1.0, 2.0), Complex::new(-1.0, -2.0), Complex::new(-3.0, 0.0)];
            let filter = Zpk::<RadiansPerSecond>::new(vec![Complex::new(-5.0, 0.0)], poles, 7.0);
            let (s, normalised) = (Complex::new(0.0, w), filter.normalised(h));
            let (a, b) = (filter.response(s), normalised.response(s * h.0));
            prop_assert!((a - b).norm() < 1e-12 * a.norm(), "{} {}", a, b);
        }

        /// A prototype with cutoff f is its prototype at the cutoff, whatever the unit of time.
        #[test]
        fn the_cutoff_lies_where_it_should(decade in -9.0..9.0f64, f in 0.01..100.0f64) {
            let h = Seconds(10f64.powf(decade));
            let prototype = super::super::families::butterworth(4);
            let w = Hertz(f).angular().per_fast_period(h);
            let at_cutoff = prototype.low_pass(Hertz(f), h).response(Complex::new(0.0, w.0));
            prop_assert!((at_cutoff.norm() - 0.5f64.sqrt()).abs() < 1e-12);
        }
    }
}
