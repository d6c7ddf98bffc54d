//! Gauss-Legendre quadrature: exact for polynomials, and all terms of a positive integrand are positive.

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
