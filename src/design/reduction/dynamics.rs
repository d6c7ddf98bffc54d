//! A bank without its output matrices: an FIR head (a delay line of inputs) and a recursive tail at its end.
//!
//! Output matrices of least mean square for given dynamics. The error W - F H is affine in them, so that
//! one projection gives them.

use crate::design::DesignError;
use crate::design::plant::LiftedPlant;
use crate::linalg::{self, Mat};
use crate::lti::gramian::{balanced_when_driven, controllability_root};
use crate::lti::{FirWithTail, StateSpace};
use rand_core::Rng;
use rand_pcg::Pcg64;

/// States below this share of the output are rounding errors.
const ROUNDING_SHARE: f64 = 1e-12;
/// Slower poles than this rarely belong to a good bank of low order.
const LARGEST_RANDOM_POLE: f64 = 0.9;

/// The recursion `x+ = a x + b u[k - lags]` after a delay line of `lags` inputs.
#[derive(Debug, Clone)]
pub(super) struct Dynamics {
    /// Length of the FIR head in slow periods.
    pub(super) lags: usize,
    /// r x r.
    pub(super) a: Mat,
    /// r x N.
    pub(super) b: Mat,
}

impl Dynamics {
    /// The dynamics of `bank` with an FIR head of `lags` slow periods and balanced states, those with the
    /// largest effect first. `state_root` is a square root of the covariance of the bank's states when the
    /// plant drives it.
    pub(super) fn balanced(bank: &StateSpace, lags: usize, state_root: &Mat) -> Result<Self, DesignError> {
        let tail = FirWithTail::split(bank, lags).tail().clone();
        let floor = ROUNDING_SHARE * (tail.c() * state_root).norm();
        let tail = balanced_when_driven(&tail, state_root, floor)?;
        Ok(Self { lags, a: tail.a().clone(), b: tail.b().clone() })
    }

    /// `r` states with random couplings and poles of modulus at most [`LARGEST_RANDOM_POLE`].
    pub(super) fn random(lags: usize, r: usize, inputs: usize, generator: &mut Pcg64) -> Self {
        let mut uniform = || 2.0 * (generator.next_u64() >> 11) as f64 / (1u64 << 53) as f64 - 1.0;
        let radius = LARGEST_RANDOM_POLE * 0.5 * (1.0 + uniform());
        let a = Mat::from_fn(r, r, |_, _| uniform());
        let b = Mat::from_fn(r, inputs, |_, _| uniform());
        let size = linalg::spectral_radius(&a).unwrap_or(a.norm()).max(f64::MIN_POSITIVE);
        Self { lags, a: a * (radius / size), b }
    }

    /// Only the first `r` states of the tail, or all if there are fewer.
    pub(super) fn truncated(&self, r: usize) -> Self {
        let r = r.min(self.tail_order());
        let a = self.a.view((0, 0), (r, r)).into_owned();
        Self { lags: self.lags, a, b: self.b.rows(0, r).into_owned() }
    }

    /// With the states of the tail divided by `sizes`.
    pub(super) fn scaled(&self, sizes: &[f64]) -> Self {
        let a =
            Mat::from_fn(self.tail_order(), self.tail_order(), |i, j| self.a[(i, j)] * sizes[j] / sizes[i]);
        let b = Mat::from_fn(self.tail_order(), self.channels(), |i, j| self.b[(i, j)] / sizes[i]);
        Self { lags: self.lags, a, b }
    }

    /// r, the number of states of the tail.
    pub(super) fn tail_order(&self) -> usize {
        self.a.nrows()
    }

    /// N, the number of inputs.
    pub(super) fn channels(&self) -> usize {
        self.b.ncols()
    }

    /// The regressors of the output, `X = [x; u[k - lags]; ..; u[k]]`, as outputs of a system with the
    /// inputs u.
    pub(super) fn regressors(&self) -> StateSpace {
        let (r, n) = (self.tail_order(), self.channels());
        let all = Mat::identity(r + n * (self.lags + 1), r + n * (self.lags + 1));
        FirWithTail::with_outputs(&all, self.lags, &self.a, &self.b).realise()
    }

    /// The bank y = `outputs` X, with `outputs` the output matrices side by side, M x (r + N (lags + 1)).
    pub(super) fn with_outputs(&self, outputs: &Mat) -> FirWithTail {
        FirWithTail::with_outputs(outputs, self.lags, &self.a, &self.b)
    }

    /// Largest modulus of the poles, infinite if the eigenvalues do not converge.
    pub(super) fn spectral_radius(&self) -> f64 {
        linalg::spectral_radius(&self.a).unwrap_or(f64::INFINITY)
    }
}

/// Directions of the regressors below this share of the strongest are rounding errors.
const RANK_TOLERANCE: f64 = 1e-12;

/// Square root of the covariance of the states of `bank` when the plant drives it with white noise.
pub(super) fn state_covariance_root(plant: &LiftedPlant, bank: &StateSpace) -> Result<Mat, DesignError> {
    let error = plant.error_system(bank);
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
    let driven = plant.driving(&dynamics.regressors());
    let root = controllability_root(driven.a(), driven.b())?;
    let t = linalg::hstack(&[&(driven.c() * &root), driven.d()]);
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
