//! Zeros, poles and gain: the form that filter theory thinks in.

use crate::linalg::Complex;

/// `gain * prod(s - zeros) / prod(s - poles)`.
///
/// A plain value without promises; [`StrictlyProper`](super::StrictlyProper) checks it. Complex
/// values are listed with their conjugates.
#[derive(Debug, Clone, PartialEq)]
pub struct Zpk {
    /// Finite zeros.
    pub zeros: Vec<Complex<f64>>,
    /// Poles.
    pub poles: Vec<Complex<f64>>,
    /// Leading coefficient.
    pub gain: f64,
}

impl Zpk {
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

    /// Stretches the frequency axis: `H(s / omega)`, so that what happened at 1 happens at `omega`.
    ///
    /// With `omega` = cutoff in rad/s it turns a prototype into a low-pass; with `omega` = h in
    /// seconds it turns rad/s into rad per fast period.
    pub fn stretched(&self, omega: f64) -> Self {
        let relative_degree = self.poles.len() as i64 - self.zeros.len() as i64;
        Self {
            zeros: self.zeros.iter().map(|z| z * omega).collect(),
            poles: self.poles.iter().map(|p| p * omega).collect(),
            gain: times_power(self.gain, omega, relative_degree),
        }
    }
}

/// `x * base^exponent` by repeated multiplication: no intermediate power can overflow or underflow
/// where the result does not.
pub(super) fn times_power(x: f64, base: f64, exponent: i64) -> f64 {
    let step = |y: f64| if exponent >= 0 { y * base } else { y / base };
    (0..exponent.unsigned_abs()).fold(x, |y, _| step(y))
}
