//! Gauss-Legendre quadrature: exact for polynomials, and all terms of a positive integrand are positive.

use std::ops::Range;

/// Nodes and weights on \[0, 1\] for n >= 1 points; exact for polynomials of degree 2 n - 1.
///
/// Newton's method on the Legendre polynomial from the asymptotic location of each root (Abramowitz and
/// Stegun 25.4.29, 22.16.6).
pub(super) fn gauss_legendre(n: usize) -> Vec<(f64, f64)> {
    (0..n).map(|i| node(n, i)).collect()
}

fn node(n: usize, i: usize) -> (f64, f64) {
    let mut x = (std::f64::consts::PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
    let mut slope = 1.0;
    // Convergence is quadratic from a start that is good to 1e-2 of the spacing; six steps exhaust doubles.
    for _ in 0..6 {
        let (value, derivative) = legendre(n, x);
        slope = derivative;
        x -= value / slope;
    }
    ((1.0 - x) / 2.0, 1.0 / ((1.0 - x * x) * slope * slope))
}

/// P_n(x) and P_n'(x), |x| < 1.
fn legendre(n: usize, x: f64) -> (f64, f64) {
    let (mut before, mut value) = (1.0, x);
    for k in 2..=n {
        let k = k as f64;
        (before, value) = (value, ((2.0 * k - 1.0) * x * value - (k - 1.0) * before) / k);
    }
    (value, n as f64 * (x * value - before) / (x * x - 1.0))
}

/// The integral of a smooth function over a range: 8 points in each of `panels` equal parts.
pub(super) fn integral(f: impl Fn(f64) -> f64, range: Range<f64>, panels: usize) -> f64 {
    let rule = gauss_legendre(8);
    let width = (range.end - range.start) / panels as f64;
    let part = |p: usize| rule.iter().map(|(t, w)| w * f(range.start + width * (p as f64 + t))).sum::<f64>();
    width * (0..panels).map(part).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_are_integrated_exactly() {
        for n in [1, 2, 3, 7, 20, 64, 151] {
            let rule = gauss_legendre(n);
            for k in [0, 1, n, 2 * n - 1] {
                let got: f64 = rule.iter().map(|(t, w)| w * t.powi(k as i32)).sum();
                assert!((got * (k as f64 + 1.0) - 1.0).abs() < 1e-12, "{n} {k} {got}");
            }
        }
    }

    #[test]
    fn smooth_functions_are_integrated() {
        let got = integral(|x| (3.0 * x).sin(), 0.2..1.9, 4);
        assert!((got - ((0.6_f64).cos() - (5.7_f64).cos()) / 3.0).abs() < 1e-13);
    }
}
