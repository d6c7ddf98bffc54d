//! First- and second-order sections and their state equations.

use nalgebra::DMatrix;

use crate::arithmetic::Real;
use hybank_linalg::Complex;

use super::roots::Roots;

/// `w^(p-z) prod(s - zeros) / prod(s - poles)` with p = 1 or 2 poles, z <= p zeros, and w the natural
/// frequency of the poles, a double. The factor makes the section dimensionless, so its gain is about one in
/// the pass band for any unit of s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Biquad<T> {
    pub(super) poles: Roots<T>,
    pub(super) zeros: Roots<T>,
}

/// x' = a x + b u, y = c x + d u with one input and one output.
#[derive(Debug, Clone, PartialEq)]
pub struct Realisation<T> {
    /// n x n.
    pub a: DMatrix<T>,
    /// n x 1.
    pub b: DMatrix<T>,
    /// 1 x n.
    pub c: DMatrix<T>,
    /// From input to output without delay.
    pub d: T,
}

impl Biquad<f64> {
    /// Value at `s`.
    pub(super) fn response(self, s: Complex<f64>) -> Complex<f64> {
        let scale: f64 = self.unscaled(1.0);
        self.zeros.eval(s) / self.poles.eval(s) / scale
    }
}

impl<T: Real> Biquad<T> {
    /// `gain` over the factor w^(p-z) that makes the section dimensionless.
    pub(super) fn unscaled(self, gain: T) -> T {
        let w = T::from(self.poles.natural_frequency());
        (self.zeros.count()..self.poles.count()).fold(gain, |gain, _| gain / w)
    }

    /// Real state equations of one or two states.
    ///
    /// With poles (s - m1)(s - m2) + v^2 the states are w k / den and w (s - m1) / den: one formula covers
    /// a conjugate pair, two real poles and a double pole, and divides by nothing that could vanish. For a
    /// resonant pair k = v, so that both off-diagonal entries are v and the pole is exact; otherwise k = w.
    pub(super) fn realise(self) -> Realisation<T> {
        let (zero, one, w) = (T::from(0.0), T::from(1.0), T::from(self.poles.natural_frequency()));
        let (m1, m2, v) = match self.poles {
            Roots::None => return Realisation::wire(),
            Roots::One(p) => return first_order(p, self.zeros),
            Roots::Two(p1, p2) => (p1, p2, zero),
            Roots::Conjugate { re, im } => (re, re, im),
        };
        let k = if v.to_double() >= 0.5 * w.to_double() { v } else { w };
        let (c, d) = match self.zeros {
            Roots::None => ([w / k, zero], zero),
            Roots::One(z) => ([(m1 - z) / k, one], zero),
            Roots::Two(z1, z2) => (biproper_row([m1, m2, v], [z1, z2, zero], [k, w]), one),
            Roots::Conjugate { re, im } => (biproper_row([m1, m2, v], [re, re, im], [k, w]), one),
        };
        Realisation {
            a: DMatrix::from_row_slice(2, 2, &[m1, k, -v * (v / k), m2]),
            b: DMatrix::from_column_slice(2, 1, &[zero, w]),
            c: DMatrix::from_row_slice(1, 2, &c),
            d,
        }
    }
}

/// (s - p) in the denominator and at most one zero.
fn first_order<T: Real>(p: T, zeros: Roots<T>) -> Realisation<T> {
    let w = T::from(p.to_double().abs());
    let (c, d) = match zeros {
        Roots::One(z) => ((p - z) / w, T::from(1.0)),
        _ => (T::from(1.0), T::from(0.0)),
    };
    let scalar = |x| DMatrix::from_element(1, 1, x);
    Realisation { a: scalar(p), b: scalar(w), c: scalar(c), d }
}

/// Output row of ((s - z1)(s - z2) + y^2) / ((s - m1)(s - m2) + v^2) - 1 for the states scaled by k and w.
/// The difference of squares is factored, since it would cancel for zeros next to poles.
fn biproper_row<T: Real>([m1, m2, v]: [T; 3], [z1, z2, y]: [T; 3], [k, w]: [T; 2]) -> [T; 2] {
    let constant = ((m1 - z1) / k) * ((m1 - z2) / w) + ((y - v) / k) * ((y + v) / w);
    [constant, (m1 - z1) / w + (m2 - z2) / w]
}

impl<T: Real> Realisation<T> {
    /// Number of states.
    pub fn order(&self) -> usize {
        self.a.nrows()
    }

    /// No state, output = input.
    pub(super) fn wire() -> Self {
        let empty = |rows, columns| DMatrix::from_element(rows, columns, T::from(0.0));
        Self { a: empty(0, 0), b: empty(0, 1), c: empty(1, 0), d: T::from(1.0) }
    }

    /// `self` followed by `next`.
    pub fn then(&self, next: &Self) -> Self {
        let (n, k) = (self.a.nrows(), next.a.nrows());
        let mut a = DMatrix::from_element(n + k, n + k, T::from(0.0));
        a.view_mut((0, 0), (n, n)).copy_from(&self.a);
        a.view_mut((n, n), (k, k)).copy_from(&next.a);
        a.view_mut((n, 0), (k, n)).copy_from(&DMatrix::from_fn(k, n, |i, j| next.b[i] * self.c[j]));
        let driven = next.b.map(|x| x * self.d);
        let b = DMatrix::from_iterator(n + k, 1, self.b.iter().chain(&driven).copied());
        let passed = self.c.map(|x| x * next.d);
        let c = DMatrix::from_iterator(1, n + k, passed.iter().chain(&next.c).copied());
        Self { a, b, c, d: self.d * next.d }
    }

    /// H(s / factor).
    pub(super) fn stretched(&self, factor: T) -> Self {
        Self { a: self.a.map(|x| x * factor), b: self.b.map(|x| x * factor), ..self.clone() }
    }

    /// The output times `gain`.
    pub(super) fn amplified(mut self, gain: T) -> Self {
        self.c.apply(|x| *x = *x * gain);
        Self { d: self.d * gain, ..self }
    }

    /// The nearest doubles.
    pub(super) fn rounded(&self) -> Realisation<f64> {
        let matrix = |m: &DMatrix<T>| m.map(T::to_double);
        Realisation { a: matrix(&self.a), b: matrix(&self.b), c: matrix(&self.c), d: self.d.to_double() }
    }
}
