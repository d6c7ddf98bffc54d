//! A-posteriori filtering in extended precision, for plants on which double precision leaves the optimum
//! open: a sample shortly after the beginning of the slow period, after a steep front end, has almost no
//! feedthrough.
//!
//! The covariance P of the prediction error follows the filtering Riccati difference equation from P = 0
//! (B. Hassibi, A. H. Sayed, T. Kailath, *Indefinite-Quadratic Estimation and Control*, SIAM 1999, section
//! 4.2). With `[x+; y; z] = [A; C_2; C_1] x + [B; D_2; D_1] w` and C = [C_2; C_1],
//!
//! ```text
//! [S   T']                                                            S = A P A' + B B'
//! [T   Re] = [A; C] P [A; C]' + [B; D] [B; D]' - diag(0, 0, gamma^2 I),    P+ = S - T' Re^-1 T.
//! ```
//!
//! No inverse of D D' occurs, so channels without feedthrough need no special case. About a covariance P_k
//! on the way the equation is regular: Delta = P - P_k satisfies
//!
//! ```text
//! Delta+ = F Delta (I + G Delta)^-1 F' + H,   F = A - T' Re^-1 C,  G = C' Re^-1 C,  H = P_{k+1} - P_k,
//! ```
//!
//! whose limit doubling reaches in a few steps.

use super::filtering::{RiccatiSolver, Trial, output_sizes};
use crate::design::DesignError;
use crate::design::plant::LiftedPlant;
use crate::lti::StateSpace;
use hybank_linalg::Mat;
use hybank_verify::arithmetic::Float;
use hybank_verify::arithmetic::dense::{self, product, riccati_limit, select, solve, symmetric};
use nalgebra::DMatrix as Matrix;
use std::ops::Range;

/// What the solver of extended precision takes for rounding.
struct Settings {
    /// Rounding moves no eigenvalue of a scaled semidefinite matrix this far below zero.
    semidefinite: f64,
    /// Share of white noise in the filter's states in the choice of coordinates, or 100 roundings if these
    /// are more. With it no driven state is unreachable.
    state_noise: f64,
    /// Relative change of the covariance in one more step of the difference equation beyond which digits
    /// were lost: half of those of a double.
    fixed_point_accuracy: f64,
    /// Part of a state's power per period below which its covariance counts as zero there: a state that the
    /// measurements determine.
    zero_covariance: f64,
}

/// Of every equation.
const SETTINGS: Settings =
    Settings { semidefinite: 1e-15, state_noise: 1e-40, fixed_point_accuracy: 1e-7, zero_covariance: 1e-10 };

/// The plant in extended precision.
pub(super) struct PreciseFiltering<F> {
    /// [A; C_2; C_1].
    system: Matrix<F>,
    /// [B; D_2; D_1] [B; D_2; D_1]'.
    input_gram: Matrix<F>,
    /// Number of states.
    order: usize,
    /// Number of measurements.
    measured: usize,
    /// Size of each measurement for white inputs.
    sizes: Vec<f64>,
    /// Slow periods after which every measurement depends on the input.
    start: usize,
}

/// One step of the difference equation.
struct RiccatiStep<F> {
    /// P+.
    next: Matrix<F>,
    /// Re.
    innovation: Matrix<F>,
    /// T, one row per output.
    cross: Matrix<F>,
}

impl<F: Float> PreciseFiltering<F> {
    pub(super) fn new(plant: &LiftedPlant) -> Result<Self, DesignError> {
        let system = plant.system();
        let measured = plant.channels();
        let stacked = |upper, lower| hybank_linalg::vstack(&[upper, lower]).map(F::from);
        let inputs = stacked(system.b(), system.d());
        Ok(Self {
            system: stacked(system.a(), system.c()),
            input_gram: symmetric(&product(&inputs, &inputs.transpose())),
            order: system.order(),
            measured,
            sizes: output_sizes(system)?.into_iter().take(measured).collect(),
            start: 1 + (0..measured).map(|channel| plant.chain(channel).len()).max().unwrap_or(0),
        })
    }

    /// The mean-square optimal filter, the limit for gamma to infinity.
    pub(super) fn h2(&self) -> Option<StateSpace> {
        self.filter(&self.covariance(None)?)
    }

    fn states(&self) -> Range<usize> {
        0..self.order
    }

    fn measurements(&self) -> Range<usize> {
        self.order..self.order + self.measured
    }

    fn references(&self) -> Range<usize> {
        self.order + self.measured..self.system.nrows()
    }

    /// The outputs that take part: the references only at a finite gamma.
    fn outputs(&self, gamma: Option<f64>) -> Vec<usize> {
        let references = gamma.map(|_| self.references()).unwrap_or_default();
        self.measurements().chain(references).collect()
    }

    fn rows(&self, rows: impl IntoIterator<Item = usize>) -> Matrix<F> {
        select(&self.system, &rows.into_iter().collect::<Vec<_>>(), &self.states().collect::<Vec<_>>())
    }

    /// Covariance of the worst-case (or mean-square) prediction error; `None` if it did not converge.
    fn covariance(&self, gamma: Option<f64>) -> Option<Matrix<F>> {
        let mut p = dense::zeros(self.order, self.order);
        for _ in 0..self.start {
            p = self.step(&p, gamma)?.next;
        }
        let RiccatiStep { next, innovation, cross } = self.step(&p, gamma)?;
        let c = self.rows(self.outputs(gamma));
        let weighted = solve(&innovation, &c)?;
        let f = self.rows(self.states()) - product(&cross.transpose(), &weighted);
        let g = symmetric(&product(&c.transpose(), &weighted));
        Some(&p + riccati_limit(&f, &g, &(next - &p))?)
    }

    /// [S, T'; T, Re] for the covariance `p`, states first; Re without gamma.
    fn gram(&self, p: &Matrix<F>) -> Matrix<F> {
        dense::congruence(&self.system, p) + &self.input_gram
    }

    /// The step from `p`. A measurement that is zero so far adds nothing.
    fn step(&self, p: &Matrix<F>, gamma: Option<f64>) -> Option<RiccatiStep<F>> {
        let mut gram = self.gram(p);
        let square = F::from(gamma.unwrap_or(0.0)) * F::from(gamma.unwrap_or(0.0));
        self.references().for_each(|i| gram[(i, i)] -= square);
        let (states, outputs): (Vec<usize>, Vec<usize>) = (self.states().collect(), self.outputs(gamma));
        let active: Vec<usize> = outputs.iter().copied().filter(|&i| gram[(i, i)] != F::ZERO).collect();
        let seen = select(&gram, &active, &states);
        let explained = product(&seen.transpose(), &solve(&select(&gram, &active, &active), &seen)?);
        Some(RiccatiStep {
            next: symmetric(&(select(&gram, &states, &states) - explained)),
            innovation: select(&gram, &outputs, &outputs),
            cross: select(&gram, &outputs, &states),
        })
    }

    /// Whether the covariance is semidefinite and the innovations have the inertia of an estimate that
    /// achieves gamma: positive for the measurements, negative for the references given these. `None` if
    /// digits were lost on the way, so that the signs say nothing.
    fn is_right(&self, covariance: &Matrix<F>, gamma: f64) -> Option<bool> {
        let RiccatiStep { next, innovation, .. } = self.step(covariance, Some(gamma))?;
        let change = |i: usize| (next[(i, i)] - covariance[(i, i)]).nearest().abs();
        let size = |i: usize| {
            covariance[(i, i)].nearest().abs() + SETTINGS.zero_covariance * self.input_gram[(i, i)].nearest()
        };
        let settled = self.states().all(|i| change(i) <= SETTINGS.fixed_point_accuracy * size(i));
        let pivots: Vec<f64> = dense::pivots(&innovation).into_iter().map(Float::nearest).collect();
        if !settled || !pivots.iter().all(|pivot| pivot.is_finite()) {
            return None;
        }
        let sign = |k: usize| if k < self.measured { 1.0 } else { -1.0 };
        let inertia = pivots.iter().enumerate().all(|(k, pivot)| sign(k) * pivot > 0.0);
        Some(inertia && is_semidefinite(covariance))
    }

    /// The central filter of a covariance: x+ = A x + K (y - C_2 x), z = C_1 x + D (y - C_2 x) with
    /// [K; D] = [A P C_2' + B D_2'; C_1 P C_2' + D_1 D_2'] (C_2 P C_2' + D_2 D_2')^-1.
    fn filter(&self, covariance: &Matrix<F>) -> Option<StateSpace> {
        let gram = self.gram(covariance);
        let measurements: Vec<usize> = self.measurements().collect();
        let others: Vec<usize> = self.states().chain(self.references()).collect();
        let cross = select(&gram, &measurements, &others);
        let gains = solve(&select(&gram, &measurements, &measurements), &cross)?.transpose();
        let closed = self.rows(others) - product(&gains, &self.rows(measurements));
        let (n, rest) = (self.order, closed.nrows() - self.order);
        let parts = |m: &Matrix<F>| (m.rows(0, n).into_owned(), m.rows(n, rest).into_owned());
        let ((a, c), (b, d)) = (parts(&closed), parts(&gains));
        self.realised(&a, &b, &c, &d)
    }

    /// The filter in double precision, in coordinates in which white measurements of their own size make its
    /// states white: rounding there is relative to the size of the signals.
    fn realised(&self, a: &Matrix<F>, b: &Matrix<F>, c: &Matrix<F>, d: &Matrix<F>) -> Option<StateSpace> {
        let driven = Matrix::from_fn(b.nrows(), b.ncols(), |i, j| b[(i, j)] * F::from(self.sizes[j]));
        let squares = symmetric(&product(&driven, &driven.transpose()));
        let mut gramian = riccati_limit(a, &dense::zeros(a.nrows(), a.nrows()), &squares)?;
        let noise = F::from(SETTINGS.state_noise.max(100.0 * F::ROUNDING));
        (0..gramian.nrows()).for_each(|i| gramian[(i, i)] = gramian[(i, i)] + gramian[(i, i)] * noise);
        let root = dense::cholesky(&gramian)?;
        let (a, b) = (dense::solve_lower(&root, &product(a, &root)), dense::solve_lower(&root, b));
        let filter = StateSpace::new(nearest(&a), nearest(&b), nearest(&product(c, &root)), nearest(d));
        (filter.spectral_radius().ok()? < 1.0).then_some(filter)
    }
}

impl<F: Float> RiccatiSolver for PreciseFiltering<F> {
    fn h_infinity(&self, gamma: f64) -> Trial {
        let Some(covariance) = self.covariance(Some(gamma)) else { return Trial::Unresolved };
        match self.is_right(&covariance, gamma) {
            None => Trial::Unresolved,
            Some(false) => Trial::Impossible,
            Some(true) => self.filter(&covariance).map_or(Trial::Unresolved, Trial::Achieved),
        }
    }
}

/// Whether a symmetric matrix, scaled to a unit diagonal, has no eigenvalue below
/// -[`Settings::semidefinite`].
fn is_semidefinite<F: Float>(m: &Matrix<F>) -> bool {
    let kept: Vec<usize> = (0..m.nrows()).filter(|&i| m[(i, i)].nearest() != 0.0).collect();
    if kept.iter().any(|&i| m[(i, i)].nearest() < 0.0) {
        return false;
    }
    let scale: Vec<F> = kept.iter().map(|&i| F::from(1.0) / m[(i, i)].sqrt()).collect();
    let scaled = Matrix::from_fn(kept.len(), kept.len(), |i, j| {
        let entry = m[(kept[i], kept[j])] * scale[i] * scale[j];
        if i == j { entry + F::from(SETTINGS.semidefinite) } else { entry }
    });
    dense::cholesky(&scaled).is_some()
}

fn nearest<F: Float>(m: &Matrix<F>) -> Mat {
    m.map(Float::nearest)
}

#[cfg(test)]
mod tests;
