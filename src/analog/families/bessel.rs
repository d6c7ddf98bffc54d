//! Bessel filters: zeros of the reverse Bessel polynomials.
//!
//! theta_0 = 1, theta_1 = s + 1, theta_n = (2n - 1) theta_(n-1) + s^2 theta_(n-2), and
//! theta_n' = theta_n - s theta_(n-1). Source: Grosswald, "Bessel polynomials" (1978).

use std::f64::consts::TAU;

use super::product_of_negatives;
use super::wide::WideComplex;
use crate::analog::{AnalogError, Zpk};
use crate::linalg::{Complex, LinalgError};

/// Simultaneous Newton steps; order 32 takes about 20.
const MAX_STEPS: usize = 200;

/// Bessel with `norm="phase"`: the magnitude falls asymptotically as a Butterworth filter of the same
/// order and cutoff; the phase is half way down at the cutoff. DC gain and leading coefficient are 1.
///
/// # Errors
/// [`AnalogError::Numerical`] if the roots do not converge, which orders up to [`MAX_ORDER`](crate::spec::MAX_ORDER)
/// have all been seen to do.
pub fn bessel(order: usize) -> Result<Zpk, AnalogError> {
    let roots = reverse_bessel_roots(order)?;
    // theta_n(0)^(1/n), the geometric mean of the roots, becomes the unit of frequency.
    let scale = product_of_negatives_root(&roots);
    let poles: Vec<Complex<f64>> = roots.iter().map(|r| r / scale).collect();
    Ok(Zpk { zeros: Vec::new(), gain: 1.0, poles })
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
        // Steps square the error: after one this small, rounding is all that is left. NaN is not small.
        let done = corrections.iter().zip(&roots).all(|(d, r)| d.norm() <= 1e-13 * r.norm());
        roots.iter_mut().zip(&corrections).for_each(|(r, d)| *r -= d);
        if done {
            return Ok(symmetric(roots));
        }
    }
    Err(LinalgError::NoConvergence { routine: "Bessel polynomial root", rows: n, cols: 1 }.into())
}

/// Points of a circle as large as the roots are in the mean, turned a little: from a set that is its own
/// mirror image two real estimates could never become a conjugate pair.
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

/// theta_n / theta_n' at `s`. The value cancels badly next to a root, so it is computed wide.
fn newton_step(n: usize, s: Complex<f64>) -> Complex<f64> {
    let wide = WideComplex::from(s);
    let square = wide * wide;
    let one = WideComplex::from(Complex::new(1.0, 0.0));
    let (mut previous, mut current) = (one, one + wide);
    for k in 2..=n {
        (previous, current) = (current, current.scaled(2.0 * k as f64 - 1.0) + square * previous);
    }
    let (theta, before) = (current.rounded(), previous.rounded());
    theta / (theta - s * before)
}

/// Upper roots with their exact conjugates; the one real root of an odd order stripped of its noise.
fn symmetric(roots: Vec<Complex<f64>>) -> Vec<Complex<f64>> {
    let noise = |r: &Complex<f64>| r.im.abs() <= 1e-9 * r.norm();
    let mut upper: Vec<Complex<f64>> = roots.iter().copied().filter(|r| !noise(r) && r.im > 0.0).collect();
    upper.sort_by(|a, b| a.im.total_cmp(&b.im));
    let real = roots.iter().filter(|r| noise(r)).map(|r| Complex::new(r.re, 0.0));
    real.chain(upper.iter().flat_map(|r| [*r, r.conj()])).collect()
}
