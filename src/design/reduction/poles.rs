//! Moving the poles: the error of the best readout as a function of the dynamics, and its gradient.
//!
//! What is read is eliminated: phi(a, b) = min over c, d of the error. By the envelope theorem the gradient of phi is that of the
//! error with the optimal readout held fixed; for the worst case it is weighted with the dual of the convex problem:
//! with Y_l of nuclear norm one in all, d gamma = Re sum <Y_l, dK_l>, dK = -C (zI - a)^-1 (da x + db z^-q H).

use super::descent::{Evaluated, descend};
use super::dynamics::Dynamics;
use super::readout::{Samples, delay, mean_square, normalised};
use crate::design::{DesignError, error_system};
use crate::linalg::{self, CMat, Complex, Mat};
use crate::lti::gramian::controllability_root;
use crate::lti::{FrequencyResponse, StateSpace};

/// Accuracy of gamma while the poles move.
const ACCURACY: f64 = 1e-6;
/// Poles are not moved closer to the unit circle than this, unless they have been.
const MARGIN: f64 = 1e-3;

/// What is to become small.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Aim {
    /// gamma.
    WorstCase,
    /// The H2 norm of the error.
    MeanSquare,
}

/// Dynamics whose best readout is better, by at most `budget` evaluations.
pub(super) fn moved(
    aim: Aim,
    samples: &Samples<'_>,
    start: &Dynamics,
    budget: usize,
) -> Result<Dynamics, DesignError> {
    if start.tail() == 0 || budget == 0 {
        return Ok(start.clone());
    }
    let (start, sizes) = normalised(samples.plant, start)?;
    let reach = (1.0 - MARGIN).max(start.radius());
    let slope = |dynamics: &Dynamics| match aim {
        Aim::WorstCase => worst_case_slope(samples, dynamics),
        Aim::MeanSquare => mean_square_slope(samples, dynamics),
    };
    // In units of the channels: neither their gains nor the signal's unit matter.
    let (r, n) = start.b.shape();
    let units = Mat::from_fn(r * (r + n), 1, |k, _| if k < r * r { 1.0 } else { sizes[k / r - r] });
    let mut f = |x: &Mat| {
        let dynamics = unpacked(&start, &x.component_div(&units));
        let inside = dynamics.radius() <= reach;
        let (value, gradient) = inside.then(|| slope(&dynamics).ok()).flatten()?;
        Some((value, gradient.component_div(&units)))
    };
    let x = packed(&start.a, &start.b).component_mul(&units);
    let Some((value, gradient)) = f(&x) else { return Ok(start) };
    let end = descend(&mut f, Evaluated { x, value, gradient }, budget);
    Ok(unpacked(&start, &end.x.component_div(&units)))
}

fn packed(a: &Mat, b: &Mat) -> Mat {
    Mat::from_iterator(a.len() + b.len(), 1, a.iter().chain(b.iter()).copied())
}

fn unpacked(like: &Dynamics, x: &Mat) -> Dynamics {
    let (r, n) = like.b.shape();
    let (a, b) = x.as_slice().split_at(r * r);
    Dynamics { ticks: like.ticks, a: Mat::from_column_slice(r, r, a), b: Mat::from_column_slice(r, n, b) }
}

/// gamma of the best readout, and its gradient.
fn worst_case_slope(samples: &Samples<'_>, dynamics: &Dynamics) -> Result<(f64, Mat), DesignError> {
    let found = samples.worst_case(dynamics, ACCURACY)?;
    let (r, n) = dynamics.b.shape();
    let c = found.readout.columns(0, r).into_owned();
    // C (zI - a)^-1.
    let seen = FrequencyResponse::new(&StateSpace::new(
        dynamics.a.clone(),
        Mat::identity(r, r),
        c.clone(),
        Mat::zeros(c.nrows(), r),
    )?);
    let reached = FrequencyResponse::new(&StateSpace::new(
        dynamics.a.clone(),
        dynamics.b.clone(),
        Mat::identity(r, r),
        Mat::zeros(r, n),
    )?);
    let (mut da, mut db) = (Mat::zeros(r, r), Mat::zeros(r, n));
    let mut total = 0.0;
    for ((w, h, _), y) in samples.points.iter().zip(&found.dual) {
        let nuclear: f64 = linalg::singular_values_c(y)?.iter().sum();
        if nuclear == 0.0 {
            continue;
        }
        total += nuclear;
        let input = h * delay(*w, dynamics.ticks);
        let x = reached.at_frequency(*w) * &input;
        let pull: CMat = seen.at_frequency(*w).adjoint() * y;
        da -= (&pull * x.adjoint()).map(|z: Complex<f64>| z.re);
        db -= (pull * input.adjoint()).map(|z| z.re);
    }
    if total == 0.0 {
        return Ok((found.gamma, Mat::zeros(r * (r + n), 1)));
    }
    Ok((found.gamma, packed(&da, &db) / total))
}

/// The H2 norm of the error of the best readout, and its gradient: with the Gramians P and Q of the error system (A, B),
/// d ||K||^2 = 2 <Q A P, dA> + 2 <Q B, dB>.
fn mean_square_slope(samples: &Samples<'_>, dynamics: &Dynamics) -> Result<(f64, Mat), DesignError> {
    let plant = samples.plant;
    let (readout, norm) = mean_square(plant, dynamics)?;
    let error = error_system::error_system(plant, &dynamics.read_by(&readout)?.realise()?)?;
    let square = |root: Mat| &root * root.transpose();
    let p = square(controllability_root(error.a(), error.b())?);
    let q = square(controllability_root(&error.a().transpose(), &error.c().transpose())?);
    let (da, db) = (&q * error.a() * p, q * error.b());
    let (n, r, channels) = (plant.system.order(), dynamics.tail(), dynamics.channels());
    let inner = da.view((n, n), (r, r)).into_owned();
    let outer = if dynamics.ticks == 0 {
        let h = plant.system.select_outputs(0..plant.measured)?;
        da.view((n, 0), (r, n)) * h.c().transpose() + db.rows(n, r) * h.d().transpose()
    } else {
        da.view((n, n + r), (r, channels)).into_owned()
    };
    Ok((norm, packed(&inner, &outer) / norm))
}

#[cfg(test)]
mod tests;
