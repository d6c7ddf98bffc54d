//! A bank without its output matrices: the recursion `x+ = a x + b u`, by frequency-weighted balanced
//! truncation.
//!
//! Output matrices of least mean square for a given recursion. The error W - F H is affine in them, so that
//! one projection gives them.

use super::settings::SETTINGS;
use crate::design::DesignError;
use crate::design::plant::LiftedPlant;
use crate::lti::StateSpace;
use crate::lti::gramian::{balanced_when_driven, controllability_root};
use hybank_linalg::Mat;

/// The recursion `x+ = a x + b u`.
#[derive(Debug, Clone)]
pub(super) struct ReducedRecursion {
    /// r x r.
    a: Mat,
    /// r x N.
    b: Mat,
}

impl ReducedRecursion {
    /// That of the first `r` states of `system`, or of all if there are fewer.
    pub(super) fn of(system: &StateSpace, r: usize) -> Self {
        let r = r.min(system.order());
        Self { a: system.a().view((0, 0), (r, r)).into_owned(), b: system.b().rows(0, r).into_owned() }
    }

    /// The regressors of the output, `X = [x; u]`, as outputs of a system with the inputs u.
    pub(super) fn regressors(&self) -> StateSpace {
        let (r, n) = self.b.shape();
        self.with_outputs(&Mat::identity(r + n, r + n))
    }

    /// The bank y = `outputs` X, with `outputs` = [c d], M x (r + N).
    pub(super) fn with_outputs(&self, outputs: &Mat) -> StateSpace {
        let (r, n) = self.b.shape();
        let (c, d) = (outputs.columns(0, r).into_owned(), outputs.columns(r, n).into_owned());
        StateSpace::new(self.a.clone(), self.b.clone(), c, d)
    }
}

/// `bank` in states that are balanced when `plant` drives it, those with the largest effect first.
pub(super) fn balanced(plant: &LiftedPlant, bank: &StateSpace) -> Result<StateSpace, DesignError> {
    let state_root = state_covariance_root(plant, bank)?;
    let floor = SETTINGS.rounding_share * (bank.c() * &state_root).norm();
    Ok(balanced_when_driven(bank, &state_root, floor)?)
}

/// Square root of the covariance of the states of `bank` when the plant drives it with white noise.
fn state_covariance_root(plant: &LiftedPlant, bank: &StateSpace) -> Result<Mat, DesignError> {
    let error = plant.error_system(bank);
    let root = controllability_root(error.a(), error.b())?;
    Ok(root.rows(plant.system().order(), bank.order()).into_owned())
}

/// The bank of least mean-square error with this recursion.
pub(super) fn mean_square_bank(
    plant: &LiftedPlant,
    recursion: &ReducedRecursion,
) -> Result<StateSpace, DesignError> {
    let (x, z) = covariance_roots(plant, recursion)?;
    Ok(recursion.with_outputs(&projection(&x, &z)?))
}

/// Rows X and Z with the covariance `[X; Z] [X; Z]'` of the regressors and the reference.
fn covariance_roots(plant: &LiftedPlant, recursion: &ReducedRecursion) -> Result<(Mat, Mat), DesignError> {
    let driven = plant.driving(&recursion.regressors());
    let root = controllability_root(driven.a(), driven.b())?;
    let t = hybank_linalg::hstack(&[&(driven.c() * &root), driven.d()]);
    let regressors = driven.outputs() - plant.ratio();
    Ok((t.rows(0, regressors).into_owned(), t.rows(regressors, plant.ratio()).into_owned()))
}

/// F of least `||z - F x||`, and of these the least in units of the rows of x.
fn projection(x: &Mat, z: &Mat) -> Result<Mat, DesignError> {
    let scale: Vec<f64> =
        x.row_iter().map(|row| row.norm()).map(|s| if s > 0.0 { 1.0 / s } else { 0.0 }).collect();
    let mut unit = x.clone();
    unit.row_iter_mut().zip(&scale).for_each(|(mut row, s)| row *= *s);
    let svd = hybank_linalg::svd(&unit)?;
    let floor = SETTINGS.rank_tolerance * svd.s.first().copied().unwrap_or(0.0);
    let mut components = z * &svd.v;
    components
        .column_iter_mut()
        .zip(&svd.s)
        .for_each(|(mut column, &s)| column *= if s > floor { 1.0 / s } else { 0.0 });
    let mut outputs = components * svd.u.transpose();
    outputs.column_iter_mut().zip(&scale).for_each(|(mut column, s)| column *= *s);
    Ok(outputs)
}
