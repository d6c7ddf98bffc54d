//! First- and second-order sections and their state equations.

use crate::linalg::{Complex, Mat};

use super::roots::Roots;

/// `w^(p-z) prod(s - zeros) / prod(s - poles)` with p = 1 or 2 poles, z <= p zeros, and w the natural
/// frequency of the poles. The factor makes the section dimensionless, so its gain is about one in the pass
/// band for any unit of s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Section {
    pub(super) poles: Roots,
    pub(super) zeros: Roots,
}

/// x' = a x + b u, y = c x + d u with one input and one output.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Realisation {
    pub(super) a: Mat,
    pub(super) b: Mat,
    pub(super) c: Mat,
    pub(super) d: f64,
}

impl Section {
    /// The factor w^(p-z) that makes the section dimensionless.
    pub(super) fn scale(self) -> f64 {
        let w = self.poles.natural_frequency();
        (self.zeros.count()..self.poles.count()).fold(1.0, |scale, _| scale * w)
    }

    /// Value at `s`.
    pub(super) fn response(self, s: Complex<f64>) -> Complex<f64> {
        self.zeros.eval(s) / self.poles.eval(s) * self.scale()
    }

    /// Real state equations of one or two states.
    ///
    /// With poles (s - m1)(s - m2) + v^2 the states are w k / den and w (s - m1) / den: one formula covers
    /// a conjugate pair, two real poles and a double pole, and divides by nothing that could vanish. For a
    /// resonant pair k = v, so that both off-diagonal entries are v and the pole is exact; otherwise k = w.
    pub(super) fn realise(self) -> Realisation {
        let w = self.poles.natural_frequency();
        let (m1, m2, v) = match self.poles {
            Roots::None => return Realisation::wire(),
            Roots::One(p) => return first_order(p, self.zeros),
            Roots::Two(p1, p2) => (p1, p2, 0.0),
            Roots::Conjugate { re, im } => (re, re, im),
        };
        let k = if v >= 0.5 * w { v } else { w };
        let (c, d) = match self.zeros {
            Roots::None => ([w / k, 0.0], 0.0),
            Roots::One(z) => ([(m1 - z) / k, 1.0], 0.0),
            Roots::Two(z1, z2) => (biproper_row([m1, m2, v], [z1, z2, 0.0], [k, w]), 1.0),
            Roots::Conjugate { re, im } => (biproper_row([m1, m2, v], [re, re, im], [k, w]), 1.0),
        };
        Realisation {
            a: Mat::from_row_slice(2, 2, &[m1, k, -v * (v / k), m2]),
            b: Mat::from_column_slice(2, 1, &[0.0, w]),
            c: Mat::from_row_slice(1, 2, &c),
            d,
        }
    }
}

/// (s - p) in the denominator and at most one zero.
fn first_order(p: f64, zeros: Roots) -> Realisation {
    let w = p.abs();
    let (c, d) = match zeros {
        Roots::One(z) => ((p - z) / w, 1.0),
        _ => (1.0, 0.0),
    };
    let scalar = |x| Mat::from_element(1, 1, x);
    Realisation { a: scalar(p), b: scalar(w), c: scalar(c), d }
}

/// Output row of ((s - z1)(s - z2) + y^2) / ((s - m1)(s - m2) + v^2) - 1 for the states scaled by k and w.
/// The difference of squares is factored, since it would cancel for zeros next to poles.
fn biproper_row([m1, m2, v]: [f64; 3], [z1, z2, y]: [f64; 3], [k, w]: [f64; 2]) -> [f64; 2] {
    let constant = ((m1 - z1) / k) * ((m1 - z2) / w) + ((y - v) / k) * ((y + v) / w);
    [constant, (m1 - z1) / w + (m2 - z2) / w]
}

impl Realisation {
    /// No state, output = input.
    pub(super) fn wire() -> Self {
        Self { a: Mat::zeros(0, 0), b: Mat::zeros(0, 1), c: Mat::zeros(1, 0), d: 1.0 }
    }

    /// `self` followed by `next`.
    pub(super) fn then(&self, next: &Self) -> Self {
        let (n, k) = (self.a.nrows(), next.a.nrows());
        let mut a = Mat::zeros(n + k, n + k);
        a.view_mut((0, 0), (n, n)).copy_from(&self.a);
        a.view_mut((n, n), (k, k)).copy_from(&next.a);
        a.view_mut((n, 0), (k, n)).copy_from(&(&next.b * &self.c));
        let mut b = Mat::zeros(n + k, 1);
        b.view_mut((0, 0), (n, 1)).copy_from(&self.b);
        b.view_mut((n, 0), (k, 1)).copy_from(&(&next.b * self.d));
        let mut c = Mat::zeros(1, n + k);
        c.view_mut((0, 0), (1, n)).copy_from(&(&self.c * next.d));
        c.view_mut((0, n), (1, k)).copy_from(&next.c);
        Self { a, b, c, d: self.d * next.d }
    }
}
