//! First- and second-order sections: how zeros and poles are paired, ordered and realised.

use crate::linalg::{Complex, Mat};

use super::roots::{RootSet, Roots};

/// `w^(p-z) prod(s - zeros) / prod(s - poles)` with one or two poles, at most as many zeros, and
/// w the natural frequency of the poles: of size one in and below the band whatever the units.
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
    /// With poles (s - m1)(s - m2) + v^2 the states are w^2 / den and w (s - m1) / den: a
    /// conjugate pair, two real poles and a double pole are one formula without a division
    /// that could vanish.
    pub(super) fn realise(self) -> Realisation {
        let w = self.poles.natural_frequency();
        let (m1, m2, v) = match self.poles {
            Roots::None => return Realisation::wire(),
            Roots::One(p) => return first_order(p, self.zeros),
            Roots::Two(p1, p2) => (p1, p2, 0.0),
            Roots::Conjugate { re, im } => (re, re, im),
        };
        let (c, d) = match self.zeros {
            Roots::None => ([1.0, 0.0], 0.0),
            Roots::One(z) => ([(m1 - z) / w, 1.0], 0.0),
            Roots::Two(z1, z2) => (biproper_row(m1, m2, v, z1, z2, 0.0, w), 1.0),
            Roots::Conjugate { re, im } => (biproper_row(m1, m2, v, re, re, im, w), 1.0),
        };
        Realisation {
            a: Mat::from_row_slice(2, 2, &[m1, w, -v * (v / w), m2]),
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

/// Output row of ((s - z1)(s - z2) + y^2) / ((s - m1)(s - m2) + v^2) - 1. The difference of squares
/// is factored, because zeros next to poles cancel there.
fn biproper_row(m1: f64, m2: f64, v: f64, z1: f64, z2: f64, y: f64, w: f64) -> [f64; 2] {
    let constant = ((m1 - z1) / w) * ((m1 - z2) / w) + ((y - v) / w) * ((y + v) / w);
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

/// Pairs zeros with poles and orders the sections, low quality first.
///
/// The poles nearest to the imaginary axis choose first and take the nearest zeros, so that no
/// section resonates more than it has to. Needs at most as many zeros as poles.
pub(super) fn pair_sections(poles: &RootSet, zeros: &RootSet) -> Vec<Section> {
    let mut sections = pole_groups(poles, zeros.upper.len());
    let mut pairs: Vec<Roots> = zeros.upper.iter().map(|&(re, im)| Roots::Conjugate { re, im }).collect();
    for section in sections.iter_mut().filter(|s| s.poles.count() == 2) {
        if let Some(pair) = take_nearest(section.poles, &mut pairs) {
            section.zeros = pair;
        }
    }
    for &z in &zeros.real {
        attach_real_zero(&mut sections, z);
    }
    sections.reverse();
    sections
}

/// Sections without zeros, highest quality first; real poles are joined in twos as far as conjugate
/// zeros need them.
fn pole_groups(poles: &RootSet, zero_pairs: usize) -> Vec<Section> {
    let joined = 2 * zero_pairs.saturating_sub(poles.upper.len()).min(poles.real.len() / 2);
    let conjugate = poles.upper.iter().map(|&(re, im)| Roots::Conjugate { re, im });
    let twos = poles.real[..joined].chunks_exact(2).map(|p| Roots::Two(p[0], p[1]));
    let ones = poles.real[joined..].iter().map(|&p| Roots::One(p));
    let mut sections: Vec<Section> =
        conjugate.chain(twos).chain(ones).map(|poles| Section { poles, zeros: Roots::None }).collect();
    sections.sort_by(|a, b| b.poles.quality().total_cmp(&a.poles.quality()));
    sections
}

/// Removes and returns the pair of zeros with the natural frequency nearest to that of the poles.
fn take_nearest(poles: Roots, pairs: &mut Vec<Roots>) -> Option<Roots> {
    let w = poles.natural_frequency();
    let distance = |z: &Roots| (z.natural_frequency() - w).abs();
    let index = (0..pairs.len()).min_by(|&i, &j| distance(&pairs[i]).total_cmp(&distance(&pairs[j])))?;
    Some(pairs.remove(index))
}

/// Gives the real zero `z` to the section with room whose natural frequency is nearest.
fn attach_real_zero(sections: &mut [Section], z: f64) {
    let distance = |s: &Section| (s.poles.natural_frequency() - z.abs()).abs();
    let best = sections
        .iter_mut()
        .filter(|s| s.zeros.count() < s.poles.count())
        .min_by(|a, b| distance(a).total_cmp(&distance(b)));
    if let Some(section) = best {
        section.zeros = match section.zeros {
            Roots::One(other) => Roots::Two(other, z),
            _ => Roots::One(z),
        };
    }
}
