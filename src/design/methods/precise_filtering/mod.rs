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
use crate::arithmetic::{Matrix, Number};
use crate::design::DesignError;
use crate::design::doubling::{gramian, riccati_limit};
use crate::design::plant::LiftedPlant;
use crate::linalg::Mat;
use crate::lti::StateSpace;
use std::ops::Range;

/// Rounding moves no eigenvalue of a scaled semidefinite matrix this far below zero.
const SEMIDEFINITE: f64 = 1e-15;
/// Share of white noise in the filter's states in the choice of coordinates, or 100 roundings if these are
/// more. With it no driven state is unreachable.
const STATE_NOISE: f64 = 1e-40;
/// Maximum number of states of a plant for 106 bits; a step then takes tens of milliseconds, and a trial
/// about a second unless a channel is delayed by many periods.
pub(super) const MOST_STATES_AT_106_BITS: usize = 96;
/// The same for 512 bits.
pub(super) const MOST_STATES_AT_512_BITS: usize = 40;
/// Relative change of the covariance in one more step of the difference equation beyond which digits were
/// lost.
const SETTLED: f64 = 1e-7;
/// Part of a state's power per period below which its covariance counts as zero there.
const KNOWN: f64 = 1e-10;

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
struct Step<F> {
    /// P+.
    next: Matrix<F>,
    /// Re.
    innovation: Matrix<F>,
    /// T, one row per output.
    cross: Matrix<F>,
}

impl<F: Number> PreciseFiltering<F> {
    pub(super) fn new(plant: &LiftedPlant) -> Result<Self, DesignError> {
        let system = plant.system();
        let measured = plant.channels();
        let inputs = stacked(system.b(), system.d());
        Ok(Self {
            system: stacked(system.a(), system.c()),
            input_gram: (&inputs * &inputs.transpose()).symmetric(),
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
        self.system.select_rows(&rows.into_iter().collect::<Vec<_>>())
    }

    /// Covariance of the worst-case (or mean-square) prediction error; `None` if it did not converge.
    fn covariance(&self, gamma: Option<f64>) -> Option<Matrix<F>> {
        let mut p = Matrix::zeros(self.order, self.order);
        for _ in 0..self.start {
            p = self.step(&p, gamma)?.next;
        }
        let Step { next, innovation, cross } = self.step(&p, gamma)?;
        let c = self.rows(self.outputs(gamma));
        let weighted = innovation.solve(&c)?;
        let f = &self.rows(self.states()) - &(&cross.transpose() * &weighted);
        let g = (&c.transpose() * &weighted).symmetric();
        Some(&p + &riccati_limit(&f, &g, &(&next - &p))?)
    }

    /// [S, T'; T, Re] for the covariance `p`, states first; Re without gamma.
    fn gram(&self, p: &Matrix<F>) -> Matrix<F> {
        &self.system.congruence(p) + &self.input_gram
    }

    /// The step from `p`. A measurement that is zero so far adds nothing.
    fn step(&self, p: &Matrix<F>, gamma: Option<f64>) -> Option<Step<F>> {
        let mut gram = self.gram(p);
        let square = F::from(gamma.unwrap_or(0.0)) * F::from(gamma.unwrap_or(0.0));
        self.references().for_each(|i| gram[(i, i)] = gram[(i, i)] - square);
        let (states, outputs): (Vec<usize>, Vec<usize>) = (self.states().collect(), self.outputs(gamma));
        let active: Vec<usize> = outputs.iter().copied().filter(|&i| gram[(i, i)] != F::ZERO).collect();
        let seen = gram.select(&active, &states);
        let explained = &seen.transpose() * &gram.select(&active, &active).solve(&seen)?;
        Some(Step {
            next: (&gram.select(&states, &states) - &explained).symmetric(),
            innovation: gram.select(&outputs, &outputs),
            cross: gram.select(&outputs, &states),
        })
    }

    /// Whether the covariance is semidefinite and the innovations have the inertia of an estimate that
    /// achieves gamma: positive for the measurements, negative for the references given these. `None` if
    /// digits were lost on the way, so that the signs say nothing.
    fn is_right(&self, covariance: &Matrix<F>, gamma: f64) -> Option<bool> {
        let Step { next, innovation, .. } = self.step(covariance, Some(gamma))?;
        let change = |i: usize| (next[(i, i)] - covariance[(i, i)]).nearest().abs();
        let size = |i: usize| covariance[(i, i)].nearest().abs() + KNOWN * self.input_gram[(i, i)].nearest();
        let settled = self.states().all(|i| change(i) <= SETTLED * size(i));
        let pivots: Vec<f64> = innovation.pivots().into_iter().map(Number::nearest).collect();
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
        let cross = gram.select(&measurements, &others);
        let gains = gram.select(&measurements, &measurements).solve(&cross)?.transpose();
        let closed = &self.rows(others) - &(&gains * &self.rows(measurements));
        let (states, references): (Vec<usize>, Vec<usize>) =
            (self.states().collect(), (self.order..closed.nrows()).collect());
        let part = |m: &Matrix<F>, rows: &[usize]| m.select_rows(rows);
        self.realised(
            &part(&closed, &states),
            &part(&gains, &states),
            &part(&closed, &references),
            &part(&gains, &references),
        )
    }

    /// The filter in double precision, in coordinates in which white measurements of their own size make its
    /// states white: rounding there is relative to the size of the signals.
    fn realised(&self, a: &Matrix<F>, b: &Matrix<F>, c: &Matrix<F>, d: &Matrix<F>) -> Option<StateSpace> {
        let driven = Matrix::from_fn(b.nrows(), b.ncols(), |i, j| b[(i, j)] * F::from(self.sizes[j]));
        let mut gramian = gramian(a, &driven)?;
        let noise = F::from(STATE_NOISE.max(100.0 * F::ROUNDING));
        (0..gramian.nrows()).for_each(|i| gramian[(i, i)] = gramian[(i, i)] + gramian[(i, i)] * noise);
        let root = gramian.cholesky()?;
        let (a, b) = (root.solve_lower(&(a * &root)), root.solve_lower(b));
        let filter = StateSpace::new(nearest(&a), nearest(&b), nearest(&(c * &root)), nearest(d)).ok()?;
        (filter.spectral_radius().ok()? < 1.0).then_some(filter)
    }
}

impl<F: Number> RiccatiSolver for PreciseFiltering<F> {
    fn h_infinity(&self, gamma: f64) -> Trial {
        let Some(covariance) = self.covariance(Some(gamma)) else { return Trial::Unresolved };
        match self.is_right(&covariance, gamma) {
            None => Trial::Unresolved,
            Some(false) => Trial::Impossible,
            Some(true) => self.filter(&covariance).map_or(Trial::Unresolved, Trial::Achieved),
        }
    }
}

/// [upper; lower].
fn stacked<F: Number>(upper: &Mat, lower: &Mat) -> Matrix<F> {
    let n = upper.nrows();
    Matrix::from_fn(n + lower.nrows(), upper.ncols(), |i, j| {
        F::from(if i < n { upper[(i, j)] } else { lower[(i - n, j)] })
    })
}

/// Whether a symmetric matrix, scaled to a unit diagonal, has no eigenvalue below -[`SEMIDEFINITE`].
fn is_semidefinite<F: Number>(m: &Matrix<F>) -> bool {
    let kept: Vec<usize> = (0..m.nrows()).filter(|&i| m[(i, i)].nearest() != 0.0).collect();
    if kept.iter().any(|&i| m[(i, i)].nearest() < 0.0) {
        return false;
    }
    let scale: Vec<F> = kept.iter().map(|&i| F::from(1.0) / m[(i, i)].sqrt()).collect();
    let scaled = Matrix::from_fn(kept.len(), kept.len(), |i, j| {
        let entry = m[(kept[i], kept[j])] * scale[i] * scale[j];
        if i == j { entry + F::from(SEMIDEFINITE) } else { entry }
    });
    scaled.cholesky().is_some()
}

fn nearest<F: Number>(m: &Matrix<F>) -> Mat {
    Mat::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)].nearest())
}

#[cfg(test)]
mod tests;
