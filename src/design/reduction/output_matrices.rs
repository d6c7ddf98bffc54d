//! Output matrices of least mean square for given dynamics. The error W - F H is affine in them, so that
//! one projection gives them.

use super::dynamics::Dynamics;
use crate::design::DesignError;
use crate::design::plant::LiftedPlant;
use crate::linalg::{self, Mat};
use crate::lti::StateSpace;
use crate::lti::gramian::controllability_root;

/// Directions of the regressors below this share of the strongest are rounding errors.
const RANK_TOLERANCE: f64 = 1e-12;

/// Square root of the covariance of the states of `bank` when the plant drives it with white noise.
pub(super) fn state_covariance_root(plant: &LiftedPlant, bank: &StateSpace) -> Result<Mat, DesignError> {
    let error = plant.error_system(bank)?;
    let root = controllability_root(error.a(), error.b())?;
    Ok(root.rows(plant.system().order(), bank.order()).into_owned())
}

/// The same dynamics with tail states of unit mean square, and the root mean squares of the channels.
pub(super) fn normalised(
    plant: &LiftedPlant,
    dynamics: &Dynamics,
) -> Result<(Dynamics, Vec<f64>), DesignError> {
    let (x, _) = covariance_roots(plant, dynamics)?;
    let size = |i: usize| Some(x.row(i).norm()).filter(|size| size.is_normal()).unwrap_or(1.0);
    let states: Vec<f64> = (0..dynamics.tail_order()).map(size).collect();
    let channels = (x.nrows() - dynamics.channels()..x.nrows()).map(size).collect();
    Ok((dynamics.scaled(&states), channels))
}

/// The output matrices of least mean square, with the H2 norm of their error.
pub(super) fn mean_square(plant: &LiftedPlant, dynamics: &Dynamics) -> Result<(Mat, f64), DesignError> {
    let (x, z) = covariance_roots(plant, dynamics)?;
    let outputs = projection(&x, &z)?;
    let error = (z - &outputs * x).norm();
    Ok((outputs, error))
}

/// Rows X and Z with the covariance `[X; Z] [X; Z]'` of the regressors and the reference.
fn covariance_roots(plant: &LiftedPlant, dynamics: &Dynamics) -> Result<(Mat, Mat), DesignError> {
    let driven = plant.driving(&dynamics.regressors()?)?;
    let root = controllability_root(driven.a(), driven.b())?;
    let t = linalg::hstack(&[&(driven.c() * &root), driven.d()])?;
    let regressors = driven.outputs() - plant.ratio();
    Ok((t.rows(0, regressors).into_owned(), t.rows(regressors, plant.ratio()).into_owned()))
}

/// F of least `||z - F x||`, and of these the least in units of the rows of x.
fn projection(x: &Mat, z: &Mat) -> Result<Mat, DesignError> {
    let scale: Vec<f64> =
        x.row_iter().map(|row| row.norm()).map(|s| if s > 0.0 { 1.0 / s } else { 0.0 }).collect();
    let mut unit = x.clone();
    unit.row_iter_mut().zip(&scale).for_each(|(mut row, s)| row *= *s);
    let svd = linalg::svd(&unit)?;
    let floor = RANK_TOLERANCE * svd.s.first().copied().unwrap_or(0.0);
    let mut components = z * &svd.v;
    components
        .column_iter_mut()
        .zip(&svd.s)
        .for_each(|(mut column, &s)| column *= if s > floor { 1.0 / s } else { 0.0 });
    let mut outputs = components * svd.u.transpose();
    outputs.column_iter_mut().zip(&scale).for_each(|(mut column, s)| column *= *s);
    Ok(outputs)
}
