//! Poles of a real filter and the partial fractions that they stand for.

use crate::linalg::{Complex, Mat};

/// Least -Re(p) / |p| of a pole that is found: the response of a sharper one is not seen in a measurement.
const LEAST_DAMPING: f64 = 1e-6;

/// A real pole, or a pair of conjugate ones.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Pole {
    Real(f64),
    /// The one with the positive imaginary part.
    Pair(Complex<f64>),
}

/// Poles as they are known before anything else is: lightly damped, spread evenly over the band up to
/// `most`.
///
/// Source: Gustavsen and Semlyen 1999, section 3.2.
pub(super) fn starting_poles(order: usize, most: f64) -> Vec<Pole> {
    let pairs = order / 2;
    let place = |k: usize| most * (k as f64 + 0.5) / pairs as f64;
    let mut poles: Vec<Pole> =
        (0..pairs).map(|k| Pole::Pair(Complex::new(-0.01 * place(k), place(k)))).collect();
    if order % 2 == 1 {
        poles.push(Pole::Real(-most));
    }
    poles
}

/// Poles from eigenvalues: conjugates become pairs, and those in the right half-plane are mirrored.
pub(super) fn from_eigenvalues(values: &[Complex<f64>]) -> Vec<Pole> {
    let stable = |p: Complex<f64>| Complex::new(-p.re.abs().max(LEAST_DAMPING * p.norm()), p.im);
    let upper = values.iter().filter(|p| p.im >= 0.0);
    upper.map(|&p| if p.im == 0.0 { Pole::Real(stable(p).re) } else { Pole::Pair(stable(p)) }).collect()
}

/// States of all poles.
pub(super) fn order(poles: &[Pole]) -> usize {
    poles.iter().map(|pole| if matches!(pole, Pole::Real(_)) { 1 } else { 2 }).sum()
}

/// The real partial fractions at s: 1/(s - p), and for a pair the sum of both and j times their difference.
pub(super) fn fractions(poles: &[Pole], s: Complex<f64>) -> Vec<Complex<f64>> {
    let mut all = Vec::with_capacity(order(poles));
    for pole in poles {
        match pole {
            Pole::Real(p) => all.push((s - p).inv()),
            Pole::Pair(p) => {
                let (one, other) = ((s - p).inv(), (s - p.conj()).inv());
                all.extend([one + other, Complex::<f64>::i() * (one - other)]);
            }
        }
    }
    all
}

/// (A, b) with c (sI - A)^-1 b = sum of c_n times fraction n.
pub(super) fn state_equations(poles: &[Pole]) -> (Mat, Mat) {
    let n = order(poles);
    let (mut a, mut b) = (Mat::zeros(n, n), Mat::zeros(n, 1));
    let mut k = 0;
    for pole in poles {
        match pole {
            Pole::Real(p) => {
                (a[(k, k)], b[(k, 0)]) = (*p, 1.0);
                k += 1;
            }
            Pole::Pair(p) => {
                (a[(k, k)], a[(k + 1, k + 1)]) = (p.re, p.re);
                (a[(k, k + 1)], a[(k + 1, k)]) = (p.im, -p.im);
                b[(k, 0)] = 2.0;
                k += 2;
            }
        }
    }
    (a, b)
}
