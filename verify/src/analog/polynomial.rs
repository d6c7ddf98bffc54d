//! Roots of polynomials, enclosed in discs of which each holds one root.
//!
//! Approximations in 512 bits are the centres of Smith's discs: the discs around z_i with the radii
//! n |p(z_i)| / |a_n prod_j (z_i - z_j)| together hold all roots, and a disc that meets no other holds one
//! (B. T. Smith, *Error bounds for zeros of a polynomial based upon Gerschgorin's theorems*, J. ACM 17,
//! 1970).
//! The centres lie symmetric about the real axis, so the root of a real centre is real, and two conjugate
//! discs hold a conjugate pair.

use crate::arithmetic::{Ball, Cartesian, ComplexBall, Float, Float512, LongBall};
use hybank_linalg::{Complex, Mat};

use super::AnalogError;
use super::roots::RootSet;
use super::square_free::{SquareFreeFactor, square_free_factors};

/// What the search for roots tolerates.
struct Settings {
    /// Relative error of a coefficient of a square-free factor: two roundings.
    coefficient_error: f64,
    /// Relative correction from which the next approximation has all its digits, because each step triples
    /// them.
    converged_correction: f64,
    /// Relative change of the first approximations by which they lose their symmetry: two real ones could
    /// not become a conjugate pair otherwise.
    asymmetry: f64,
    /// Imaginary part over modulus of an approximation to a real root, far above the rounding of 512 bits.
    /// The discs decide whether it is real.
    real_root_tolerance: f64,
    /// Covers the rounding of the radii, which are computed with some hundred operations of 512 bits and
    /// then rounded to doubles.
    outward: f64,
}

/// Of every polynomial.
const SETTINGS: Settings = Settings {
    coefficient_error: 2.0 * Float512::ROUNDING,
    converged_correction: 1e-70,
    asymmetry: 1e-10,
    real_root_tolerance: 1e-100,
    outward: 1.0 + 1e-12,
};

/// Most steps of [`refined`]. From eigenvalues in doubles three are enough; the further ones are for
/// clusters, to which the eigenvalues are poor approximations.
const MAX_STEPS: usize = 100;

type LongComplex = Cartesian<Float512>;

/// The roots of the polynomial with these coefficients in descending powers, each as often as it occurs;
/// `what` names it in errors.
///
/// # Errors
/// [`AnalogError::RootsNotIsolated`] for roots that 512 bits do not tell apart.
pub(super) fn enclosed_roots(
    coefficients: &[f64],
    what: &'static str,
) -> Result<RootSet<LongBall>, AnalogError> {
    let significant = coefficients.iter().rposition(|&x| x != 0.0).map_or(0, |last| last + 1);
    let mut roots = RootSet::default();
    roots.real.resize(coefficients.len() - significant, Ball::ZERO);
    for SquareFreeFactor { coefficients, multiplicity } in square_free_factors(&coefficients[..significant]) {
        let simple = isolated(&coefficients).ok_or(AnalogError::RootsNotIsolated { what })?;
        for _ in 0..multiplicity {
            roots.real.extend(&simple.real);
            roots.upper.extend(&simple.upper);
        }
    }
    Ok(roots.sorted())
}

/// The simple roots of a polynomial.
pub(super) fn isolated(p: &[Float512]) -> Option<RootSet<LongBall>> {
    let centres = symmetric(refined(p, approximate_roots(p)?))?;
    let radii: Vec<f64> = (0..centres.len()).map(|i| radius(p, &centres, i)).collect();
    for (i, &z) in centres.iter().enumerate() {
        for (j, &other) in centres.iter().enumerate().take(i) {
            let apart = modulus(z - other).nearest() > (radii[i] + radii[j]) * SETTINGS.outward;
            if !apart {
                return None;
            }
        }
    }
    let mut roots = RootSet::default();
    for (z, &radius) in centres.iter().zip(&radii) {
        let part = |x| Ball::exactly(x).widened(radius);
        match (z.im == Float512::ZERO, z.im.nearest() > 0.0) {
            (true, _) => roots.real.push(part(z.re)),
            (_, true) => roots.upper.push((part(z.re), part(z.im))),
            _ => {}
        }
    }
    // A radius that is not a number has compared as not apart, except for a single root.
    radii.iter().all(|radius| radius.is_finite()).then_some(roots)
}

/// Eigenvalues of the companion matrix in the unit of their geometric mean, without symmetry.
fn approximate_roots(p: &[Float512]) -> Option<Vec<LongComplex>> {
    let n = p.len() - 1;
    let unit = (p[n].exponent() - p[0].exponent()) / (n as i64).max(1);
    let scaled = |k: usize| (p[k] / p[0]).scaled(-unit * k as i64).nearest();
    let companion = Mat::from_fn(n, n, |i, j| match i {
        0 => -scaled(j + 1),
        _ if j + 1 == i => 1.0,
        _ => 0.0,
    });
    let eigenvalues = hybank_linalg::eigenvalues(&companion).ok()?;
    let turned = |(i, z): (usize, Complex<f64>)| {
        let z = z * Complex::from_polar(1.0 + SETTINGS.asymmetry * i as f64, SETTINGS.asymmetry);
        LongComplex::new(Float512::from(z.re).scaled(unit), Float512::from(z.im).scaled(unit))
    };
    Some(eigenvalues.into_iter().enumerate().map(turned).collect())
}

/// Newton's steps for all roots at once, each deflated by the other roots (Ehrlich and Aberth).
fn refined(p: &[Float512], mut roots: Vec<LongComplex>) -> Vec<LongComplex> {
    for _ in 0..MAX_STEPS {
        let mut settled = true;
        for i in 0..roots.len() {
            let z = roots[i];
            let step = correction(p, &roots, i);
            let size = modulus(step).nearest();
            if size.is_finite() {
                roots[i] = z - step;
            }
            // NaN compares as not settled.
            settled &= size <= SETTINGS.converged_correction * modulus(z).nearest();
        }
        if settled {
            break;
        }
    }
    roots
}

fn correction(p: &[Float512], roots: &[LongComplex], i: usize) -> LongComplex {
    let z = roots[i];
    let (mut value, mut slope) = (real(Float512::ZERO), real(Float512::ZERO));
    for &coefficient in p {
        slope = slope * z + value;
        value = value * z + real(coefficient);
    }
    let newton = value / slope;
    let others = roots.iter().enumerate().filter(|&(j, _)| j != i);
    let repulsion = others.fold(real(Float512::ZERO), |sum, (_, &other)| sum + inverse(z - other));
    newton / (real(Float512::from(1.0)) - newton * repulsion)
}

fn real(x: Float512) -> LongComplex {
    LongComplex::new(x, Float512::ZERO)
}

fn inverse(z: LongComplex) -> LongComplex {
    z.conj().scaled(Float512::from(1.0) / z.norm_sqr())
}

fn modulus(z: LongComplex) -> Float512 {
    z.norm_sqr().sqrt()
}

/// The approximations with exact symmetry: real roots on the axis, the others in conjugate pairs. `None` if
/// some have no partner.
fn symmetric(roots: Vec<LongComplex>) -> Option<Vec<LongComplex>> {
    let is_real =
        |z: &LongComplex| z.im.nearest().abs() <= SETTINGS.real_root_tolerance * modulus(*z).nearest();
    let (real_ones, others): (Vec<LongComplex>, Vec<LongComplex>) = roots.into_iter().partition(is_real);
    let (upper, lower): (Vec<LongComplex>, Vec<LongComplex>) =
        others.into_iter().partition(|z| z.im.nearest() > 0.0);
    let real_ones = real_ones.into_iter().map(|z| real(z.re));
    let pairs = upper.iter().flat_map(|&z| [z, z.conj()]);
    (upper.len() == lower.len()).then(|| real_ones.chain(pairs).collect())
}

/// Smith's radius of the disc around centre `i`.
fn radius(p: &[Float512], centres: &[LongComplex], i: usize) -> f64 {
    let z = centres[i];
    let others = centres.iter().enumerate().filter(|&(j, _)| j != i);
    let denominator = others.fold(p[0], |product, (_, &other)| product * modulus(z - other));
    let size = residual(p, z) * Float512::from(centres.len() as f64);
    // What is no double is rounded up.
    (size / denominator).nearest().abs() * SETTINGS.outward + f64::MIN_POSITIVE
}

/// A bound of |p(z)|. It is computed in the unit of |z|, in which no power of z leaves the range of doubles.
fn residual(p: &[Float512], z: LongComplex) -> Float512 {
    let (n, unit) = (p.len() as i64 - 1, modulus(z).exponent());
    let power = |k: usize| unit * (n - k as i64);
    let size = (0..p.len()).filter(|&k| p[k] != Float512::ZERO).map(|k| p[k].exponent() + power(k)).max();
    let size = size.unwrap_or(0);
    let coefficient = |k: usize| {
        let x = p[k].scaled(power(k) - size);
        // The second number covers what is no double.
        Ball::exactly(x).widened(SETTINGS.coefficient_error * x.nearest().abs() + f64::MIN_POSITIVE)
    };
    let point = ComplexBall::new(Ball::exactly(z.re.scaled(-unit)), Ball::exactly(z.im.scaled(-unit)));
    let value =
        (0..p.len()).fold(ComplexBall::from(Ball::ZERO), |sum, k| sum * point + coefficient(k).into());
    Float512::from(value.re.magnitude() + value.im.magnitude()).scaled(size)
}
