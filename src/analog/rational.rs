//! Numerator over denominator: factored where the roots reproduce the coefficients, else kept as
//! polynomials.

use crate::linalg::{Complex, Mat, eigenvalues};

use super::AnalogError;
use super::roots::RootSet;
use super::section::Realisation;
use super::zpk::{Zpk, times_power};
use crate::units::{RadiansPerFastPeriod, Seconds};

/// Largest relative error of any coefficient reproduced from the roots for which the polynomial is replaced
/// by its roots. Single roots of a multiple pole have far larger errors (the m-th root of rounding), but
/// these cancel in the product.
const FACTOR_TOLERANCE: f64 = 1e-13;

/// `num(s) / den(s)` in normalised time, coefficients in descending powers, `den[0] = 1`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Rational {
    num: Vec<f64>,
    den: Vec<f64>,
}

impl Rational {
    /// From coefficients for s in rad/s: strips leading zeros, divides by the leading coefficient of `den`
    /// and normalises by the fast period `h`. Each list must hold a nonzero coefficient.
    pub(super) fn new(num: &[f64], den: &[f64], h: Seconds) -> Self {
        let (num, den) = (without_leading_zeros(num), without_leading_zeros(den));
        let (lead, n) = (den[0], den.len() - 1);
        let scale = |coefficients: &[f64]| -> Vec<f64> {
            // The coefficient of s^k is divided by h^k, and all by the lead's h^n.
            let power = |i: usize| (n + 1 + i) as i64 - coefficients.len() as i64;
            coefficients.iter().enumerate().map(|(i, &x)| times_power(x / lead, h.0, power(i))).collect()
        };
        Self { num: scale(num), den: scale(den) }
    }

    /// Degree of the denominator.
    pub(super) fn order(&self) -> usize {
        self.den.len() - 1
    }

    /// Value at `s`, by Horner's rule.
    pub(super) fn response(&self, s: Complex<f64>) -> Complex<f64> {
        let horner = |p: &[f64]| p.iter().fold(Complex::new(0.0, 0.0), |acc, &c| acc * s + c);
        horner(&self.num) / horner(&self.den)
    }

    /// Poles as eigenvalues of the balanced companion matrix.
    pub(super) fn poles(&self) -> Result<Vec<Complex<f64>>, AnalogError> {
        polynomial_roots(&self.den)
    }

    /// Zeros, poles and gain, if they reproduce the coefficients to [`FACTOR_TOLERANCE`].
    pub(super) fn factored(&self) -> Result<Option<Zpk<RadiansPerFastPeriod>>, AnalogError> {
        let poles = polynomial_roots(&self.den)?;
        let gain = self.num[0];
        let monic: Vec<f64> = self.num.iter().map(|x| x / gain).collect();
        let zeros = polynomial_roots(&monic)?;
        let faithful = reproduces(&poles, &self.den) && reproduces(&zeros, &monic);
        Ok(faithful.then(|| Zpk::new(zeros, poles, gain)))
    }

    /// Controllable canonical form in time measured by the natural frequency.
    pub(super) fn realise(&self) -> Realisation {
        let n = self.order();
        let w = natural_frequency(&self.den);
        let scaled = |p: &[f64], k: usize| -> f64 {
            // Coefficient of s^k in units of w; the power is that of den, so the quotient is kept.
            let degree = p.len() - 1;
            if k > degree { 0.0 } else { times_power(p[degree - k], w, k as i64 - n as i64) }
        };
        let a = Mat::from_fn(n, n, |i, j| {
            if i + 1 == n {
                -w * scaled(&self.den, j)
            } else if j == i + 1 {
                w
            } else {
                0.0
            }
        });
        let b = Mat::from_fn(n, 1, |i, _| if i + 1 == n { w } else { 0.0 });
        let d = scaled(&self.num, n);
        let c = Mat::from_fn(1, n, |_, j| scaled(&self.num, j) - d * scaled(&self.den, j));
        Realisation { a, b, c, d }
    }
}

fn without_leading_zeros(values: &[f64]) -> &[f64] {
    let start = values.iter().position(|&x| x != 0.0).unwrap_or(values.len());
    &values[start..]
}

/// |constant coefficient|^(1/n) of a monic polynomial, or a bound on its roots where that is zero.
fn natural_frequency(monic: &[f64]) -> f64 {
    let n = monic.len() - 1;
    let w = |k: usize| monic[k].abs().powf(1.0 / k as f64);
    let mean = if n == 0 { 1.0 } else { w(n) };
    if mean > 0.0 { mean } else { (1..=n).map(w).fold(0.0, f64::max).max(f64::MIN_POSITIVE) }
}

/// Roots of a monic polynomial in descending powers.
fn polynomial_roots(monic: &[f64]) -> Result<Vec<Complex<f64>>, AnalogError> {
    let significant = monic.iter().rposition(|&x| x != 0.0).unwrap_or(0);
    let at_zero = monic.len() - 1 - significant;
    let monic = &monic[..=significant];
    let mut roots = match *monic {
        [_] => Vec::new(),
        [_, c0] => vec![Complex::new(-c0, 0.0)],
        [_, c1, c0] => quadratic_roots(c1, c0),
        _ => companion_roots(monic)?,
    };
    roots.extend(std::iter::repeat_n(Complex::new(0.0, 0.0), at_zero));
    Ok(roots)
}

/// Roots of s^2 + b s + c without cancellation; a double root is returned as such.
fn quadratic_roots(b: f64, c: f64) -> Vec<Complex<f64>> {
    let half = -0.5 * b;
    // b^2/4 - c with one rounding: the product's own rounding error is added back.
    let square = half * half;
    let discriminant = (square - c) + half.mul_add(half, -square);
    // A discriminant within the rounding of the coefficients stands for a double root, in any unit of time.
    if discriminant.abs() <= 8.0 * f64::EPSILON * square {
        return vec![half.into(); 2];
    }
    if discriminant < 0.0 {
        let im = (-discriminant).sqrt();
        return vec![Complex::new(half, im), Complex::new(half, -im)];
    }
    let larger = half + discriminant.sqrt().copysign(half);
    let smaller = if larger == 0.0 { 0.0 } else { c / larger };
    vec![larger.into(), smaller.into()]
}

fn companion_roots(monic: &[f64]) -> Result<Vec<Complex<f64>>, AnalogError> {
    let n = monic.len() - 1;
    let w = natural_frequency(monic);
    let coefficient = |k: usize| times_power(monic[k], w, -(k as i64));
    let companion = Mat::from_fn(n, n, |i, j| match i {
        0 => -coefficient(j + 1),
        _ if j + 1 == i => 1.0,
        _ => 0.0,
    });
    Ok(eigenvalues(&companion)?.into_iter().map(|z| z * w).collect())
}

/// Whether the product of (s - roots) has the given coefficients to [`FACTOR_TOLERANCE`].
fn reproduces(roots: &[Complex<f64>], monic: &[f64]) -> bool {
    let Ok(set) = RootSet::new(roots, "root") else { return false };
    let mut product = vec![1.0];
    for r in &set.real {
        product = convolve(&product, &[1.0, -r]);
    }
    for (re, im) in &set.upper {
        product = convolve(&product, &[1.0, -2.0 * re, re * re + im * im]);
    }
    product.iter().zip(monic).all(|(x, y)| (x - y).abs() <= FACTOR_TOLERANCE * y.abs())
}

fn convolve(p: &[f64], q: &[f64]) -> Vec<f64> {
    let mut product = vec![0.0; p.len() + q.len() - 1];
    for (i, x) in p.iter().enumerate() {
        for (j, y) in q.iter().enumerate() {
            product[i + j] += x * y;
        }
    }
    product
}
