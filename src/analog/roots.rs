//! Real polynomials of degree zero to two in terms of their roots, and the sorting of root lists into them.

use crate::linalg::Complex;

use super::AnalogError;

/// Tolerance on conjugate roots, relative to their modulus: wide enough for values typed with 12 digits,
/// and narrow enough not to pair distinct roots.
const CONJUGATE_TOLERANCE: f64 = 1e-11;

/// A monic real polynomial of degree at most two, stored by its roots: near a root, the product of
/// differences is accurate while expanded coefficients cancel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Roots {
    /// The constant 1.
    None,
    /// s - r.
    One(f64),
    /// (s - r1) (s - r2).
    Two(f64, f64),
    /// (s - re)^2 + im^2 with im > 0.
    Conjugate {
        /// Real part of both roots.
        re: f64,
        /// Imaginary part of the upper root.
        im: f64,
    },
}

impl Roots {
    /// Degree of the polynomial.
    pub(super) fn count(self) -> usize {
        match self {
            Self::None => 0,
            Self::One(_) => 1,
            Self::Two(..) | Self::Conjugate { .. } => 2,
        }
    }

    /// Value at `s`.
    pub(super) fn eval(self, s: Complex<f64>) -> Complex<f64> {
        match self {
            Self::None => Complex::new(1.0, 0.0),
            Self::One(r) => s - r,
            Self::Two(r1, r2) => (s - r1) * (s - r2),
            Self::Conjugate { re, im } => (s - Complex::new(re, im)) * (s - Complex::new(re, -im)),
        }
    }

    /// The roots one by one.
    pub(super) fn list(self) -> Vec<Complex<f64>> {
        match self {
            Self::None => Vec::new(),
            Self::One(r) => vec![r.into()],
            Self::Two(r1, r2) => vec![r1.into(), r2.into()],
            Self::Conjugate { re, im } => vec![Complex::new(re, im), Complex::new(re, -im)],
        }
    }

    /// Geometric mean of the moduli; 1 for the constant.
    pub(super) fn natural_frequency(self) -> f64 {
        match self {
            Self::None => 1.0,
            Self::One(r) => r.abs(),
            Self::Two(r1, r2) => r1.abs().sqrt() * r2.abs().sqrt(),
            Self::Conjugate { re, im } => re.hypot(im),
        }
    }

    /// Quality factor of a pole pair; 1/2 and below for real ones.
    pub(super) fn quality(self) -> f64 {
        match self {
            Self::None | Self::One(_) => 0.0,
            Self::Two(r1, r2) => self.natural_frequency() / (r1 + r2).abs(),
            Self::Conjugate { re, .. } => self.natural_frequency() / (2.0 * re.abs()),
        }
    }
}

/// A list of roots split into the real ones and the conjugate pairs, each sorted.
///
/// The result does not depend on the order of the list, so two spellings of one filter are equal.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct RootSet {
    /// Real roots, ascending.
    pub(super) real: Vec<f64>,
    /// Upper roots (re, im > 0), by modulus and then real part.
    pub(super) upper: Vec<(f64, f64)>,
}

impl RootSet {
    /// Sorts `roots`; `what` names them in the error about a root without partner.
    pub(super) fn new(roots: &[Complex<f64>], what: &'static str) -> Result<Self, AnalogError> {
        let mut real: Vec<f64> = roots.iter().filter(|r| r.im == 0.0).map(|r| r.re).collect();
        let mut lower: Vec<Complex<f64>> = roots.iter().copied().filter(|r| r.im < 0.0).collect();
        let mut upper = Vec::new();
        for root in roots.iter().filter(|r| r.im > 0.0) {
            match take_partner(*root, &mut lower) {
                Some(partner) => upper.push((0.5 * (root.re + partner.re), 0.5 * (root.im - partner.im))),
                None => real.push(nearly_real(*root).ok_or(unpaired(what, *root))?),
            }
        }
        for root in lower {
            real.push(nearly_real(root).ok_or(unpaired(what, root))?);
        }
        real.sort_by(f64::total_cmp);
        let modulus = |z: &(f64, f64)| z.0.hypot(z.1);
        upper.sort_by(|a, b| modulus(a).total_cmp(&modulus(b)).then(a.0.total_cmp(&b.0)));
        Ok(Self { real, upper })
    }
}

/// Removes and returns the element of `lower` that is the conjugate of `root` within the tolerance.
fn take_partner(root: Complex<f64>, lower: &mut Vec<Complex<f64>>) -> Option<Complex<f64>> {
    let distance = |z: &Complex<f64>| (z.conj() - root).norm();
    let (index, nearest) = lower
        .iter()
        .enumerate()
        .min_by(|a, b| distance(a.1).total_cmp(&distance(b.1)))
        .map(|(i, z)| (i, *z))?;
    (distance(&nearest) <= CONJUGATE_TOLERANCE * root.norm()).then(|| lower.remove(index))
}

/// The real part of a root whose imaginary part is rounding error.
fn nearly_real(root: Complex<f64>) -> Option<f64> {
    (root.im.abs() <= CONJUGATE_TOLERANCE * root.re.abs()).then_some(root.re)
}

fn unpaired(what: &'static str, root: Complex<f64>) -> AnalogError {
    AnalogError::NotConjugate { what, re: root.re, im: root.im }
}
