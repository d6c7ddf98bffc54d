//! The transfer function of a front end as a quotient of enclosed polynomials, for bounds of its modulus on
//! the imaginary axis.

use super::super::ball::{self, Ball, Matrix};
use super::super::front_ends::Equations;
use crate::arithmetic::BigFloat;

/// N(s) / D(s), coefficients in ascending powers of s, s in rad per fast period; D is monic.
#[derive(Debug, Clone)]
pub(super) struct Transfer {
    num: Vec<Ball>,
    den: Vec<Ball>,
}

impl Transfer {
    /// `gain` (c (s I - a)^-1 b + d), by the recursion of Faddeev and Le Verrier: M_0 = I,
    /// M_k = a M_{k-1} + d_k I, d_k = -tr(a M_{k-1}) / k; then D = s^n + sum_k d_k s^(n-k) and
    /// N = sum_k c M_k b s^(n-1-k) + d D. It loses many digits, so it runs with 512 bits.
    pub(super) fn new(filter: &Equations, gain: Ball<BigFloat>) -> Self {
        let Equations { a, b, c, d } = filter;
        let c = ball::scaled(c, gain);
        let n = a.nrows();
        let (mut num, mut den) = (vec![Ball::ZERO; n], vec![Ball::from(1.0); n + 1]);
        let mut power: Matrix<BigFloat> = ball::identity(n);
        for k in 1..=n {
            num[n - k] = ball::product(&c, &ball::product(&power, b))[(0, 0)].shortened();
            let next = ball::product(a, &power);
            let trace = (0..n).fold(Ball::ZERO, |sum, i| sum + next[(i, i)]);
            let coefficient = -(trace / Ball::from(k as f64));
            den[n - k] = coefficient.shortened();
            power = ball::add(&next, &ball::scaled(&ball::identity(n), coefficient));
        }
        if !d.is_zero() {
            let direct = (*d * gain).shortened();
            num = plus(&num, &den.iter().map(|&x| x * direct).collect::<Vec<_>>());
        }
        Self { num, den }
    }

    /// (theta^2 + theta) Phi with theta = s d/ds. For Phi(s / x), the second derivative with respect to x is
    /// this at s / x over x^2.
    pub(super) fn curvature(&self) -> Self {
        let (n, d) = (&self.num, &self.den);
        let (dn, dd) = (theta(n), theta(d));
        // theta (N / D) = N1 / D^2 and theta (N1 / D^2) = (theta N1 D - 2 N1 theta D) / D^3.
        let n1 = minus(&times(&dn, d), &times(n, &dd));
        let twice = times(&n1, &dd).into_iter().map(|x| x + x).collect::<Vec<_>>();
        let num = plus(&minus(&times(&theta(&n1), d), &twice), &times(&n1, d));
        Self { num, den: times(&times(d, d), d) }
    }

    /// An upper bound of |Phi(j u)|^2.
    pub(super) fn square(&self, u: Ball) -> f64 {
        (square(&self.num, u) / square(&self.den, u)).upper()
    }

    /// a_0, a_1, .. with |Phi(j u)| <= sum_p a_p |u|^-p for all |u| >= `from`; `None` where that is too
    /// close to the poles.
    pub(super) fn decay(&self, from: f64) -> Option<Vec<f64>> {
        let n = self.den.len() - 1;
        let lower = |(k, d): (usize, &Ball)| d.magnitude() * from.powi(k as i32 - n as i32);
        let rest: f64 = self.den[..n].iter().enumerate().map(lower).sum();
        let share = 1.0 - rest * (1.0 + 1e-10);
        let enough = share > 0.5;
        if !enough {
            return None;
        }
        let coefficient =
            |p: usize| self.num.get(n - p).map_or(0.0, |x| x.magnitude() / share * (1.0 + 1e-10));
        Some((0..=n).map(coefficient).collect())
    }
}

/// s d/ds of a polynomial.
fn theta(p: &[Ball]) -> Vec<Ball> {
    p.iter().enumerate().map(|(k, &x)| x * Ball::from(k as f64)).collect()
}

fn times(p: &[Ball], q: &[Ball]) -> Vec<Ball> {
    let mut product = vec![Ball::ZERO; (p.len() + q.len()).saturating_sub(1)];
    for (i, &x) in p.iter().enumerate() {
        for (j, &y) in q.iter().enumerate() {
            product[i + j] = product[i + j] + x * y;
        }
    }
    product
}

fn plus(p: &[Ball], q: &[Ball]) -> Vec<Ball> {
    let at = |v: &[Ball], k: usize| v.get(k).copied().unwrap_or(Ball::ZERO);
    (0..p.len().max(q.len())).map(|k| at(p, k) + at(q, k)).collect()
}

fn minus(p: &[Ball], q: &[Ball]) -> Vec<Ball> {
    plus(p, &q.iter().map(|&x| -x).collect::<Vec<_>>())
}

/// The product of two polynomials with bounds as coefficients, rounded up.
pub(super) fn product(p: &[f64], q: &[f64]) -> Vec<f64> {
    let mut product = vec![0.0; (p.len() + q.len()).saturating_sub(1)];
    for (i, x) in p.iter().enumerate() {
        for (j, y) in q.iter().enumerate() {
            product[i + j] += x * y;
        }
    }
    product.iter().map(|x| x * (1.0 + 1e-12)).collect()
}

/// |p(j u)|^2: the even coefficients make the real part, the odd ones the imaginary part.
fn square(p: &[Ball], u: Ball) -> Ball {
    let v = -(u * u);
    let part = |first: usize| {
        p.iter().skip(first).step_by(2).rev().fold(Ball::ZERO, |sum, &coefficient| sum * v + coefficient)
    };
    let (re, im) = (part(0), u * part(1));
    re * re + im * im
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analog::{StrictlyProper, enclosed};
    use crate::spec::FilterSpec;
    use crate::units::{RadiansPerFastPeriod, Seconds};

    /// (s/2 + 2) / (s^4 + 1.3 s^3 + 2 s^2 + 0.7 s + 0.1) in doubles, and enclosed with a gain.
    fn filter(gain: f64) -> (StrictlyProper, Transfer) {
        let spec = FilterSpec::TransferFunction { num: vec![0.5, 2.0], den: vec![1.0, 1.3, 2.0, 0.7, 0.1] };
        let equations = enclosed(None, &spec, Seconds(1.0)).unwrap();
        (StrictlyProper::new(&spec, Seconds(1.0)).unwrap(), Transfer::new(&equations, Ball::from(gain)))
    }

    #[test]
    fn moduli_are_those_of_the_response() {
        let (filter, transfer) = filter(-1.5);
        for u in [-40.0, -1.0, 0.0, 0.3, 1.4, 20.0] {
            let modulus = 1.5 * filter.response(RadiansPerFastPeriod(u)).norm();
            let square = transfer.square(Ball::from(u));
            assert!((square.sqrt() / modulus - 1.0).abs() < 1e-12, "{u}");
        }
        let decay = transfer.decay(30.0).unwrap();
        for u in [30.0, 100.0, 1e4] {
            let bound: f64 = decay.iter().enumerate().map(|(p, a)| a * f64::powi(u, -(p as i32))).sum();
            let modulus = 1.5 * filter.response(RadiansPerFastPeriod(u)).norm();
            assert!(modulus <= bound && bound <= 1.3 * modulus, "{u}: {modulus} {bound}");
        }
        // Relative degree 3: the terms of slower decay are exactly zero.
        assert!(decay[..3].iter().all(|a| *a == 0.0) && decay[3] > 0.0);
        assert!(transfer.decay(0.5).is_none());
    }

    /// Against second differences of Phi(j u / x) in x.
    #[test]
    fn the_curvature_is_the_second_derivative_in_the_cutoff() {
        let (filter, transfer) = filter(1.0);
        let curvature = transfer.curvature();
        for u in [0.2, 0.9, 1.5, 6.0] {
            let at = |x: f64| filter.response(RadiansPerFastPeriod(u / x));
            let step = 1e-4;
            let second = (at(1.0 + step) - at(1.0) * 2.0 + at(1.0 - step)) / (step * step);
            let found = curvature.square(Ball::from(u)).sqrt();
            assert!((found - second.norm()).abs() < 1e-5 * (1.0 + second.norm()), "{u}: {found} {second}");
        }
    }
}
