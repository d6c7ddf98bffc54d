//! Pole refinement by variable projection: a descent on the error of the best output matrices as a function
//! of the dynamics.
//!
//! The output matrices are eliminated: `phi(a, b) = min over c, d of the error`. By the envelope theorem the
//! gradient of phi is that of the error with the optimal output matrices held fixed. For gamma it is
//! weighted with the dual matrices Y_l of the convex problem, scaled to nuclear norms that sum to one:
//! `d gamma = Re sum_l <Y_l, dK_l>` with `dK = -C (zI - a)^-1 (da x + db z^-lags H)`.
//!
//! Source: Golub and Pereyra, "Separable nonlinear least squares: the variable projection method", Inverse
//! Problems 19 (2003).

use super::Aim;
use super::descent::{Evaluated, descend};
use super::dynamics::Dynamics;
use super::dynamics::{mean_square, normalised};
use super::plant_samples::{PlantSamples, delay};
use crate::design::DesignError;
use crate::linalg::{self, CMat, Complex, Mat};
use crate::lti::gramian::controllability_root;
use crate::lti::{FrequencyResponse, StateSpace};

/// Relative accuracy of gamma during the descent.
const DESCENT_ACCURACY: f64 = 1e-6;
/// Poles keep this distance from the unit circle, unless the start is closer.
const STABILITY_MARGIN: f64 = 1e-3;

/// Dynamics with the error of their best output matrices at the sampled frequencies, infinite if unknown.
#[derive(Debug, Clone)]
pub(super) struct Refined {
    pub(super) dynamics: Dynamics,
    pub(super) error: f64,
    /// The first computation that failed, if one did. The descent goes no further there.
    pub(super) failure: Option<DesignError>,
}

/// Dynamics with a smaller error of the best output matrices, by at most `budget` evaluations.
pub(super) fn refined(
    aim: Aim,
    samples: &PlantSamples<'_>,
    start: &Dynamics,
    budget: usize,
) -> Result<Refined, DesignError> {
    if start.tail_order() == 0 || budget == 0 {
        return Ok(Refined { dynamics: start.clone(), error: f64::INFINITY, failure: None });
    }
    let (start, sizes) = normalised(samples.plant, start)?;
    let largest_radius = (1.0 - STABILITY_MARGIN).max(start.spectral_radius());
    let error_and_gradient = |dynamics: &Dynamics| match aim {
        Aim::WorstCase => worst_case_gradient(samples, dynamics),
        Aim::MeanSquare => mean_square_gradient(samples, dynamics),
    };
    // In units of the channels, so that neither their gains nor the unit of the signal matter.
    let (r, n) = start.b.shape();
    let units = Mat::from_fn(r * (r + n), 1, |k, _| if k < r * r { 1.0 } else { sizes[k / r - r] });
    let mut failure = None;
    let mut f = |x: &Mat| {
        let dynamics = unpacked(&start, &x.component_div(&units));
        if dynamics.spectral_radius() > largest_radius {
            return None;
        }
        match error_and_gradient(&dynamics) {
            Ok((value, gradient)) => Some((value, gradient.component_div(&units))),
            Err(error) => {
                failure.get_or_insert(error);
                None
            }
        }
    };
    let x = packed(&start.a, &start.b).component_mul(&units);
    let Some((value, gradient)) = f(&x) else {
        return Ok(Refined { dynamics: start, error: f64::INFINITY, failure });
    };
    let end = descend(&mut f, Evaluated { x, value, gradient }, budget);
    let dynamics = unpacked(&start, &end.x.component_div(&units));
    Ok(Refined { dynamics, error: end.value, failure })
}

fn packed(a: &Mat, b: &Mat) -> Mat {
    Mat::from_iterator(a.len() + b.len(), 1, a.iter().chain(b.iter()).copied())
}

fn unpacked(like: &Dynamics, x: &Mat) -> Dynamics {
    let (r, n) = like.b.shape();
    let (a, b) = x.as_slice().split_at(r * r);
    Dynamics { lags: like.lags, a: Mat::from_column_slice(r, r, a), b: Mat::from_column_slice(r, n, b) }
}

/// gamma of the best output matrices, and its gradient.
fn worst_case_gradient(samples: &PlantSamples<'_>, dynamics: &Dynamics) -> Result<(f64, Mat), DesignError> {
    let found = samples.worst_case(dynamics, DESCENT_ACCURACY)?;
    let (r, n) = dynamics.b.shape();
    let c = found.taps[0].columns(0, r).into_owned();
    // C (zI - a)^-1.
    let observed = FrequencyResponse::new(&StateSpace::new(
        dynamics.a.clone(),
        Mat::identity(r, r),
        c.clone(),
        Mat::zeros(c.nrows(), r),
    ));
    let driven = FrequencyResponse::new(&StateSpace::new(
        dynamics.a.clone(),
        dynamics.b.clone(),
        Mat::identity(r, r),
        Mat::zeros(r, n),
    ));
    let (mut da, mut db) = (Mat::zeros(r, r), Mat::zeros(r, n));
    let mut total = 0.0;
    for (sample, y) in samples.samples.iter().zip(&found.dual) {
        let omega = sample.omega;
        let nuclear: f64 = linalg::singular_values(y)?.iter().sum();
        if nuclear == 0.0 {
            continue;
        }
        total += nuclear;
        let input = &sample.h * delay(omega, dynamics.lags);
        let x = driven.at_frequency(omega) * &input;
        let weighted: CMat = observed.at_frequency(omega).adjoint() * y;
        da -= (&weighted * x.adjoint()).map(|z: Complex<f64>| z.re);
        db -= (weighted * input.adjoint()).map(|z| z.re);
    }
    if total == 0.0 {
        return Ok((found.gamma, Mat::zeros(r * (r + n), 1)));
    }
    Ok((found.gamma, packed(&da, &db) / total))
}

/// The H2 norm of the error of the best output matrices, and its gradient: with the Gramians P and Q of the
/// error system (A, B), d ||K||^2 = 2 <Q A P, dA> + 2 <Q B, dB>.
fn mean_square_gradient(samples: &PlantSamples<'_>, dynamics: &Dynamics) -> Result<(f64, Mat), DesignError> {
    let plant = samples.plant;
    let (outputs, norm) = mean_square(plant, dynamics)?;
    let error = plant.error_system(&dynamics.with_outputs(&outputs).realise());
    let square = |root: Mat| &root * root.transpose();
    let p = square(controllability_root(error.a(), error.b())?);
    let q = square(controllability_root(&error.a().transpose(), &error.c().transpose())?);
    let (da, db) = (&q * error.a() * p, q * error.b());
    let (n, r, channels) = (plant.system().order(), dynamics.tail_order(), dynamics.channels());
    let inner = da.view((n, n), (r, r)).into_owned();
    let outer = if dynamics.lags == 0 {
        let h = plant.system().select_outputs(0..plant.channels());
        da.view((n, 0), (r, n)) * h.c().transpose() + db.rows(n, r) * h.d().transpose()
    } else {
        da.view((n, n + r), (r, channels)).into_owned()
    };
    Ok((norm, packed(&inner, &outer) / norm))
}

#[cfg(test)]
mod tests;
