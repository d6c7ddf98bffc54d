//! The static nonlinearity of a converter from what sines leave of its samples.

use super::nonlinearity_table::TableFit;
use crate::linalg::Mat;
use crate::linalg::least_squares::NormalEquations;
use crate::runtime::Nonlinearity;

/// A curve has to lower what is left of the parts left out by so many standard errors of that.
const CLEAR_GAIN: f64 = 2.0;

/// What curve is fitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CurveKind {
    /// A polynomial up to this order.
    Order(usize),
    /// A value for each code.
    Table,
}

/// The fit of a curve of some kind, in parts of which each is left out in turn.
#[derive(Debug, Clone)]
pub enum CurveFit {
    /// Of a polynomial.
    Polynomial(PolynomialFit),
    /// Of a table.
    Table(TableFit),
}

impl CurveFit {
    /// Without any samples.
    pub fn new(kind: CurveKind) -> Self {
        match kind {
            CurveKind::Order(order) => Self::Polynomial(PolynomialFit::new(order)),
            CurveKind::Table => Self::Table(TableFit::default()),
        }
    }

    /// Adds a part: samples x, and what sines leave of them.
    pub fn add(&mut self, part: impl Iterator<Item = (f64, f64)>) {
        match self {
            Self::Polynomial(fit) => fit.add(part),
            Self::Table(fit) => fit.add(part),
        }
    }

    /// Adds the parts of another fit of the same kind.
    pub fn join(&mut self, other: &Self) {
        match (self, other) {
            (Self::Polynomial(fit), Self::Polynomial(other)) => fit.parts.extend_from_slice(&other.parts),
            (Self::Table(fit), Self::Table(other)) => fit.join(other),
            _ => {}
        }
    }

    /// The curve; none if it does not leave clearly less of the parts left out than a line does.
    pub fn curve(&self) -> Nonlinearity {
        match self {
            Self::Polynomial(fit) => Nonlinearity::Polynomial(fit.curve()),
            Self::Table(fit) => fit.curve(),
        }
    }
}

/// Whether a curve leaves clearly less of the parts left out than a line does.
pub(super) fn is_clearly_less(line: &[f64], left: &[f64]) -> bool {
    let gains: Vec<f64> = line.iter().zip(left).map(|(line, left)| line - left).collect();
    let mean = gains.iter().sum::<f64>() / gains.len() as f64;
    let spread = gains.iter().map(|gain| (gain - mean).powi(2)).sum::<f64>();
    gains.iter().sum::<f64>() > CLEAR_GAIN * spread.sqrt()
}

/// The equations of a curve sum of a_k T_k(x), k = 2 .. K, in parts of which each is left out in turn. What
/// a fit of sines takes of the curve, its constant and the part along x, is free.
#[derive(Debug, Clone)]
pub struct PolynomialFit {
    order: usize,
    parts: Vec<NormalEquations>,
}

impl PolynomialFit {
    /// Up to the order K.
    fn new(order: usize) -> Self {
        Self { order, parts: Vec::new() }
    }

    fn add(&mut self, part: impl Iterator<Item = (f64, f64)>) {
        let mut equations = NormalEquations::new(self.order + 1);
        for (x, left) in part {
            equations.add(&chebyshev(x, self.order), left);
        }
        self.parts.push(equations);
    }

    /// a_2, a_3, .. of the order that leaves least of the parts left out; none if that is not less than a
    /// line leaves.
    fn curve(&self) -> Vec<f64> {
        let line = self.left_out(1);
        let judged = (2..=self.order).map(|order| (order, self.left_out(order)));
        let total = |left: &[f64]| left.iter().sum::<f64>();
        let best = judged.min_by(|a, b| total(&a.1).total_cmp(&total(&b.1)));
        let solved = best
            .filter(|(_, left)| is_clearly_less(&line, left))
            .and_then(|(order, _)| self.solved(order, None));
        solved.map_or_else(Vec::new, |all| all.iter().skip(2).copied().collect())
    }

    /// What a curve of the other parts leaves of each part; infinity where they do not determine it.
    fn left_out(&self, order: usize) -> Vec<f64> {
        let left = |(k, part): (usize, &NormalEquations)| {
            let Some(a) = self.solved(order, Some(k)) else { return f64::INFINITY };
            let part = leading(part, order);
            part.squares - 2.0 * part.projection.dot(&a) + a.dot(&(&part.gram * &a))
        };
        self.parts.iter().enumerate().map(left).collect()
    }

    /// The coefficients from T_0 on of all parts but one.
    fn solved(&self, order: usize, without: Option<usize>) -> Option<Mat> {
        let mut sum = NormalEquations::new(order + 1);
        let parts = self.parts.iter().enumerate().filter(|(k, _)| Some(*k) != without);
        for part in parts.map(|(_, part)| leading(part, order)) {
            sum.gram += &part.gram;
            sum.projection += &part.projection;
        }
        sum.solve().ok()
    }
}

/// The equations of the first coefficients.
fn leading(part: &NormalEquations, order: usize) -> NormalEquations {
    let count = order + 1;
    NormalEquations {
        gram: part.gram.view((0, 0), (count, count)).into_owned(),
        projection: part.projection.view((0, 0), (count, 1)).into_owned(),
        ..*part
    }
}

/// T_0 .. T_K at x.
fn chebyshev(x: f64, order: usize) -> Vec<f64> {
    let x = x.clamp(-1.0, 1.0);
    let mut all = vec![1.0, x];
    (2..=order).for_each(|k| all.push(2.0 * x * all[k - 1] - all[k - 2]));
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// A curve in noise is found with the order that it has, and none in noise alone.
    #[test]
    fn a_curve_is_found_and_noise_is_none() {
        let truth = [3e-3, -1e-3, 0.0, 5e-4];
        let mut dice = Random(3);
        let mut fit = |curve: &[f64]| {
            let mut fit = PolynomialFit::new(9);
            for _ in 0..8 {
                let one = |n: usize| {
                    let x = 0.9 * (0.37 * n as f64).sin();
                    let values = chebyshev(x, curve.len() + 1);
                    let moved: f64 = curve.iter().zip(&values[2..]).map(|(a, t)| a * t).sum();
                    (x, moved + 1e-4 * dice.sample())
                };
                fit.add((0..1000).map(one).collect::<Vec<_>>().into_iter());
            }
            fit.curve()
        };
        let found = fit(&truth);
        assert!(found.len() >= truth.len(), "{found:?}");
        let errors = found.iter().enumerate().map(|(k, a)| a - truth.get(k).unwrap_or(&0.0));
        assert!(errors.into_iter().all(|error| error.abs() < 1e-5), "{found:?}");
        assert_eq!(fit(&[0.0]), [0.0; 0]);
    }
}
