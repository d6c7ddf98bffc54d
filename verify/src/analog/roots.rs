//! Real polynomials of degree zero to two in terms of their roots, and the sorting of root lists into them.

use crate::arithmetic::Real;
use hybank_linalg::Complex;

use super::AnalogError;

/// Tolerance on conjugate roots, relative to their modulus: wide enough for values typed with 12 digits,
/// and narrow enough not to pair distinct roots.
const CONJUGATE_TOLERANCE: f64 = 1e-11;

/// Distance of two roots, relative to their mean, up to which their doubles are one double root: the square
/// of half of it changes the polynomial on the imaginary axis by less than the rounding of its coefficients.
/// The roots of a double root that was written with rounding are about this far apart.
const DOUBLE_ROOT: f64 = 8e-8;

/// Relative difference of two frequencies that are one, so that rounding does not decide about the order of
/// roots and sections. The poles of a Butterworth filter have one modulus.
const SAME_FREQUENCY: f64 = 1e-9;

/// Steps of [`SAME_FREQUENCY`] in the logarithm of a ratio of frequencies, by which these are compared.
pub(super) fn steps(logarithm: f64) -> f64 {
    (logarithm / SAME_FREQUENCY).round()
}

/// A monic real polynomial of degree at most two, stored by its roots: near a root, the product of
/// differences is accurate while expanded coefficients cancel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Roots<T> {
    /// The constant 1.
    None,
    /// s - r.
    One(T),
    /// (s - r1) (s - r2).
    Two(T, T),
    /// (s - re)^2 + im^2 with im > 0.
    Conjugate {
        /// Real part of both roots.
        re: T,
        /// Imaginary part of the upper root.
        im: T,
    },
}

impl Roots<f64> {
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
}

impl<T: Real> Roots<T> {
    /// Degree of the polynomial.
    pub(super) fn count(self) -> usize {
        match self {
            Self::None => 0,
            Self::One(_) => 1,
            Self::Two(..) | Self::Conjugate { .. } => 2,
        }
    }

    /// Geometric mean of the moduli, rounded to a double; 1 for the constant.
    pub(super) fn natural_frequency(self) -> f64 {
        match self {
            Self::None => 1.0,
            Self::One(r) => r.to_double().abs(),
            Self::Two(r1, r2) => r1.to_double().abs().sqrt() * r2.to_double().abs().sqrt(),
            Self::Conjugate { re, im } => re.to_double().hypot(im.to_double()),
        }
    }

    /// Each root times a positive number.
    pub(super) fn scaled(self, by: T) -> Self {
        match self {
            Self::None => Self::None,
            Self::One(r) => Self::One(r * by),
            Self::Two(r1, r2) => Self::Two(r1 * by, r2 * by),
            Self::Conjugate { re, im } => Self::Conjugate { re: re * by, im: im * by },
        }
    }

    /// Quality factor of a pole pair; 1/2 and below for real ones.
    pub(super) fn quality(self) -> f64 {
        match self {
            Self::None | Self::One(_) => 0.0,
            Self::Two(r1, r2) => self.natural_frequency() / (r1.to_double() + r2.to_double()).abs(),
            Self::Conjugate { re, .. } => self.natural_frequency() / (2.0 * re.to_double().abs()),
        }
    }
}

/// A list of roots split into the real ones and the conjugate pairs, each sorted.
///
/// The result does not depend on the order of the list, so two spellings of one filter are equal.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct RootSet<T> {
    /// Real roots, ascending.
    pub(super) real: Vec<T>,
    /// Upper roots (re, im > 0), by modulus and then real part.
    pub(super) upper: Vec<(T, T)>,
}

impl<T> Default for RootSet<T> {
    fn default() -> Self {
        Self { real: Vec::new(), upper: Vec::new() }
    }
}

impl<T: Real> RootSet<T> {
    /// Sorts the written `roots`; `what` names them in the error about a root without partner. Conjugates
    /// that agree up to rounding stand for their mean, and a root that is real up to rounding for its real
    /// part.
    pub(super) fn new(roots: &[Complex<f64>], what: &'static str) -> Result<Self, AnalogError> {
        let mut real: Vec<f64> = roots.iter().filter(|r| r.im == 0.0).map(|r| r.re).collect();
        let mut lower: Vec<Complex<f64>> = roots.iter().copied().filter(|r| r.im < 0.0).collect();
        let mut upper = Vec::new();
        let mean = |x: f64, y: f64| T::from(0.5) * (T::from(x) + T::from(y));
        for root in roots.iter().filter(|r| r.im > 0.0) {
            match take_partner(*root, &mut lower) {
                Some(partner) => upper.push((mean(root.re, partner.re), mean(root.im, -partner.im))),
                None => real.push(nearly_real(*root).ok_or(unpaired(what, *root))?),
            }
        }
        for root in lower {
            real.push(nearly_real(root).ok_or(unpaired(what, root))?);
        }
        Ok(Self { real: real.into_iter().map(T::from).collect(), upper }.sorted())
    }

    /// In the order that the type promises.
    pub(super) fn sorted(mut self) -> Self {
        let double = |z: &(T, T)| Complex::new(z.0.to_double(), z.1.to_double());
        self.real.sort_by(|a, b| a.to_double().total_cmp(&b.to_double()));
        self.upper.sort_by(|a, b| {
            let (a, b) = (double(a), double(b));
            let rank = |z: Complex<f64>| steps(z.norm().ln());
            rank(a).total_cmp(&rank(b)).then(a.re.total_cmp(&b.re))
        });
        self
    }

    /// Number of roots.
    pub(super) fn count(&self) -> usize {
        self.real.len() + 2 * self.upper.len()
    }

    /// Each root times a positive number.
    pub(super) fn scaled(&self, by: T) -> Self {
        let upper = self.upper.iter().map(|&(re, im)| (re * by, im * by)).collect();
        Self { real: self.real.iter().map(|&r| r * by).collect(), upper }
    }

    /// The nearest doubles, real and imaginary part apart, so that the distance of a root from the axis
    /// keeps its accuracy; of two roots within [`DOUBLE_ROOT`], twice their mean.
    pub(super) fn rounded(&self) -> RootSet<f64> {
        let mut real: Vec<f64> = self.real.iter().map(|r| r.to_double()).collect();
        let mut upper = Vec::new();
        for (re, im) in self.upper.iter().map(|z| (z.0.to_double(), z.1.to_double())) {
            if im <= 0.5 * DOUBLE_ROOT * re.abs() { real.extend([re, re]) } else { upper.push((re, im)) }
        }
        real.sort_by(f64::total_cmp);
        for i in 1..real.len() {
            let mean = 0.5 * (real[i - 1] + real[i]);
            if real[i] - real[i - 1] <= DOUBLE_ROOT * mean.abs() {
                real[i - 1..=i].fill(mean);
            }
        }
        RootSet { real, upper }.sorted()
    }
}

/// `gain` prod(s - zeros) / prod(s - poles).
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Factors<T> {
    pub(super) zeros: RootSet<T>,
    pub(super) poles: RootSet<T>,
    pub(super) gain: T,
}

impl<T: Real> Factors<T> {
    /// H(s / scale): every zero and pole times `scale`, a positive number.
    pub(super) fn stretched(&self, scale: T) -> Self {
        let relative_degree = self.poles.count() as i64 - self.zeros.count() as i64;
        Self {
            zeros: self.zeros.scaled(scale),
            poles: self.poles.scaled(scale),
            gain: self.gain.times_power(scale, relative_degree),
        }
    }

    /// In doubles; see [`RootSet::rounded`].
    pub(super) fn rounded(&self) -> Factors<f64> {
        Factors { zeros: self.zeros.rounded(), poles: self.poles.rounded(), gain: self.gain.to_double() }
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
