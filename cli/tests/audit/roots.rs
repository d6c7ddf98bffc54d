//! All roots of a polynomial at once, to the full precision of its coefficients.

use super::real::{BITS, Complex, real};
use std::f64::consts::TAU;

/// Simple roots take about 30 steps. A double root converges by a factor of two per step, so it needs as
/// many steps as half of the bits; a triple root by 3/2.
const STEPS: usize = 700;

/// p(s) and p'(s), coefficients in descending powers.
fn with_derivative(polynomial: &[Complex], s: &Complex) -> [Complex; 2] {
    let mut pair = [Complex::zero(), Complex::zero()];
    for coefficient in polynomial {
        pair = [&(&pair[0] * s) + coefficient, &(&pair[1] * s) + &pair[0]];
    }
    pair
}

/// p(s).
pub(crate) fn value(polynomial: &[Complex], s: &Complex) -> Complex {
    polynomial.iter().fold(Complex::zero(), |sum, coefficient| &(&sum * s) + coefficient)
}

/// The coefficients of `leading` prod (s - root), descending powers.
pub(crate) fn expand(leading: Complex, roots: &[Complex]) -> Vec<Complex> {
    roots.iter().fold(vec![leading], |polynomial, root| {
        let mut next = polynomial.clone();
        next.push(Complex::zero());
        for (k, coefficient) in polynomial.iter().enumerate() {
            next[k + 1] = &next[k + 1] - &(coefficient * root);
        }
        next
    })
}

/// The roots, by the iteration of Ehrlich and Aberth (O. Aberth, "Iteration methods for finding all zeros of
/// a polynomial simultaneously", 1973).
pub(crate) fn roots(polynomial: &[Complex]) -> Vec<Complex> {
    let degree = polynomial.len() - 1;
    // Each coefficient over the leading one bounds the roots by the power that fits it.
    let scaled = |k: usize| (polynomial[k].size() / polynomial[0].size()).powf(1.0 / k as f64);
    let radius = (1..=degree).map(scaled).fold(0.0, f64::max);
    let start = |k: usize| {
        // Radii and angles without a symmetry that the iteration would keep.
        let (angle, size) = (TAU * (k as f64 + 0.37) / degree as f64, radius * (1.0 - 0.3 * k as f64 / 32.0));
        Complex::new(real(size * angle.cos()), real(size * angle.sin()))
    };
    let mut found: Vec<Complex> = (0..degree).map(start).collect();
    for _ in 0..STEPS {
        let mut change = 0.0f64;
        for k in 0..degree {
            let [value, derivative] = with_derivative(polynomial, &found[k]);
            if value.is_zero() || derivative.is_zero() {
                continue;
            }
            let newton = value.over(&derivative);
            let mut repulsion = Complex::zero();
            for other in (0..degree).filter(|other| *other != k) {
                let distance = &found[k] - &found[other];
                if !distance.is_zero() {
                    repulsion = &repulsion + &distance.inverse();
                }
            }
            let step = newton.over(&(&Complex::one() - &(&newton * &repulsion)));
            change = change.max(step.size() / found[k].size().max(f64::MIN_POSITIVE));
            found[k] = &found[k] - &step;
        }
        if change < 2f64.powi(24 - BITS as i32) {
            break;
        }
    }
    let again = expand(polynomial[0].clone(), &found);
    for (k, (one, other)) in polynomial.iter().zip(&again).enumerate() {
        let scale = radius.powi(k as i32) * polynomial[0].size();
        assert!((one - other).size() <= 1e-60 * scale, "the roots do not reproduce coefficient {k}");
    }
    found
}
