//! Bessel filters: zeros of the reverse Bessel polynomials.
//!
//! theta_0 = 1, theta_1 = s + 1, theta_n = (2n - 1) theta_(n-1) + s^2 theta_(n-2), and
//! theta_n' = theta_n - s theta_(n-1). Source: Grosswald, "Bessel polynomials" (1978).

use std::f64::consts::TAU;

use super::complex::ComplexDoubleDouble;
use super::product_of_negatives;
use crate::analog::{AnalogError, Cutoffs, Zpk};
use crate::linalg::{Complex, LinalgError};

/// Most simultaneous Newton steps; order 32 takes about 20.
const MAX_STEPS: usize = 200;

/// Bessel with `norm="phase"`: the magnitude falls asymptotically as a Butterworth filter of the same order
/// and cutoff; the phase at the cutoff is half of its total change. DC gain and leading coefficient are 1.
///
/// # Errors
/// [`AnalogError::Numerical`] if the roots do not converge. The tests cover all orders up to
/// [`MAX_ORDER`](crate::spec::MAX_ORDER).
pub fn bessel(order: usize) -> Result<Zpk<Cutoffs>, AnalogError> {
    let roots = reverse_bessel_roots(order)?;
    // theta_n(0)^(1/n), the geometric mean of the roots, becomes the unit of frequency.
    let scale = product_of_negatives_root(&roots);
    let poles: Vec<Complex<f64>> = roots.iter().map(|r| r / scale).collect();
    Ok(Zpk::new(Vec::new(), poles, 1.0))
}

/// prod(-roots)^(1/n), by logarithms since the product itself grows as (2n)!.
fn product_of_negatives_root(roots: &[Complex<f64>]) -> f64 {
    let n = roots.len().max(1) as f64;
    if roots.len() <= 32 {
        return product_of_negatives(roots).powf(1.0 / n);
    }
    (roots.iter().map(|r| r.norm().ln()).sum::<f64>() / n).exp()
}

/// Zeros of theta_n, conjugate pairs with equal bits.
fn reverse_bessel_roots(n: usize) -> Result<Vec<Complex<f64>>, AnalogError> {
    let mut roots = starting_values(n);
    for _ in 0..MAX_STEPS {
        let corrections: Vec<Complex<f64>> = (0..roots.len()).map(|i| correction(n, &roots, i)).collect();
        // Convergence is quadratic: after a step this small only rounding errors are left. NaN compares as
        // not small.
        let done = corrections.iter().zip(&roots).all(|(d, r)| d.norm() <= 1e-13 * r.norm());
        roots.iter_mut().zip(&corrections).for_each(|(r, d)| *r -= d);
        if done {
            return Ok(symmetric(roots));
        }
    }
    Err(LinalgError::NoConvergence { routine: "Bessel polynomial root", rows: n, cols: 1 }.into())
}

/// Points on a circle whose radius is the mean modulus of the roots, rotated by a small angle: from a set
/// that is its own mirror image, two real estimates could never become a conjugate pair.
fn starting_values(n: usize) -> Vec<Complex<f64>> {
    let log_product: f64 = (1..=n).map(|k| (2.0 * k as f64 - 1.0).ln()).sum();
    let radius = (log_product / n.max(1) as f64).exp();
    (0..n).map(|i| Complex::from_polar(radius, TAU * (i as f64 + 0.3) / n as f64)).collect()
}

/// Newton's correction for root `i`, deflated by the other roots (Ehrlich and Aberth).
fn correction(n: usize, roots: &[Complex<f64>], i: usize) -> Complex<f64> {
    let s = roots[i];
    let newton = newton_step(n, s);
    let others: Complex<f64> =
        roots.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, r)| (s - r).inv()).sum();
    newton / (Complex::new(1.0, 0.0) - newton * others)
}

/// theta_n / theta_n' at `s`, in double-double arithmetic because theta_n cancels near a root.
fn newton_step(n: usize, s: Complex<f64>) -> Complex<f64> {
    let wide = ComplexDoubleDouble::from(s);
    let square = wide * wide;
    let one = ComplexDoubleDouble::from(Complex::new(1.0, 0.0));
    let (mut previous, mut current) = (one, one + wide);
    for k in 2..=n {
        (previous, current) = (current, current.scaled(2.0 * k as f64 - 1.0) + square * previous);
    }
    let (theta, before) = (current.rounded(), previous.rounded());
    theta / (theta - s * before)
}

/// Upper roots with their exact conjugates; the real root of an odd order without its imaginary rounding
/// error.
fn symmetric(roots: Vec<Complex<f64>>) -> Vec<Complex<f64>> {
    let is_real = |r: &Complex<f64>| r.im.abs() <= 1e-9 * r.norm();
    let mut upper: Vec<Complex<f64>> = roots.iter().copied().filter(|r| !is_real(r) && r.im > 0.0).collect();
    upper.sort_by(|a, b| a.im.total_cmp(&b.im));
    let real = roots.iter().filter(|r| is_real(r)).map(|r| Complex::new(r.re, 0.0));
    real.chain(upper.iter().flat_map(|r| [*r, r.conj()])).collect()
}
