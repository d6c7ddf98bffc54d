//! A lower bound on the worst case that holds for any dual matrices, converged or not.
//!
//! For any matrices `Y_l` (M x q) and any taps F, by the duality of spectral and nuclear norm,
//!
//! ```text
//! gamma(F) sum_l ||Y_l||_* >= sum_l Re <Y_l, K_l(F)> = sum_l Re <Y_l, W_l> - sum_a r_a F_a,
//! r_{p,i,j} = sum_l Re <Y_l, e^{-i omega_l j} E_{p,i} H_l>.
//! ```
//!
//! Dual matrices of an optimum have r = 0. The residual that rounding errors leave is subtracted for all
//! taps within a stated radius.

use super::basis::Basis;
use super::prepare::Reduced;
use super::problem::{FrequencyPoint, SampledProblem};
use crate::lmi::settings::SETTINGS;
use crate::lti::FirMatrix;
use hybank_linalg::blocks::Batch;
use hybank_linalg::{CMat, Complex, LinalgError, Mat};

/// Thresholds tried between weak directions of tap space and rounding errors; the best bound counts.
const CUTS: [f64; 3] = [1e-14, 1e-12, 1e-9];

/// A lower bound on the optimum of `problem` from any dual matrices, one for each point (each M x q), for
/// all taps of at most this [`size`]. Uses nothing but the data and the inequality in the module's
/// text, less an estimate of the rounding errors of the sums.
pub(crate) fn lower_bound(problem: &SampledProblem, dual: &[CMat], radius: f64) -> Result<f64, LinalgError> {
    let mut nuclear = 0.0;
    for y in dual {
        nuclear += hybank_linalg::singular_values(y)?.iter().sum::<f64>();
    }
    let pairs = || dual.iter().zip(problem.points());
    let value: f64 = pairs().map(|(y, point)| y.dotc(&point.w).re).sum();
    let moduli: f64 = pairs().map(|(y, point)| y.norm() * point.w.norm()).sum();
    let depth = SETTINGS.rounding_per_operation + (problem.rows() * problem.inputs() + dual.len()) as f64;
    let charged = value - residual_norm(problem, dual) * radius - depth * f64::EPSILON * moduli;
    let bound = charged / nuclear;
    Ok(if bound.is_finite() { bound.max(0.0) } else { 0.0 })
}

/// Norm of `r_{p,i,j} / s_i` plus an estimate of its rounding error.
fn residual_norm(problem: &SampledProblem, dual: &[CMat]) -> f64 {
    let unit: Vec<f64> =
        strengths(problem).into_iter().map(|s| if s > 0.0 { 1.0 / s } else { 0.0 }).collect();
    let scaled = |point: &FrequencyPoint| point.h.map_with_location(|i, _, h| h * unit[i]);
    let scaled: Vec<CMat> = problem.points().iter().map(scaled).collect();
    let products: Vec<CMat> = dual.iter().zip(&scaled).map(|(y, h)| y * h.adjoint()).collect();
    let (lags, mut square) = (problem.max_lags(), 0.0);
    for j in 0..lags {
        let mut r = CMat::zeros(problem.rows(), problem.channels());
        for (product, point) in products.iter().zip(problem.points()) {
            r += product * Complex::from_polar(1.0, point.omega * j as f64);
        }
        let rows = (0..problem.rows()).filter(|&p| j < problem.lags()[p]);
        square += rows.map(|p| r.row(p).iter().map(|z| z.re * z.re).sum::<f64>()).sum::<f64>();
    }
    let moduli: f64 = dual.iter().zip(&scaled).map(|(y, h)| y.norm() * h.norm()).sum();
    let angle = problem.points().iter().map(|p| p.omega.abs()).fold(0.0, f64::max) * lags as f64;
    let depth = SETTINGS.rounding_per_operation + (problem.inputs() + products.len()) as f64 + angle;
    square.sqrt() + depth * f64::EPSILON * moduli * (lags as f64).sqrt()
}

fn strengths(problem: &SampledProblem) -> Vec<f64> {
    let norms = |i: usize| problem.points().iter().map(move |p| p.h.row(i).norm());
    (0..problem.channels()).map(|i| norms(i).fold(0.0, f64::max)).collect()
}

/// Size of the taps: `sqrt(sum_{p,i,j} (s_i F_j[p,i])^2)` with `s_i` the largest row norm of channel i over
/// the points.
fn size(problem: &SampledProblem, taps: &FirMatrix) -> f64 {
    let strength = strengths(problem);
    let square =
        |f: &Mat| -> f64 { strength.iter().enumerate().map(|(i, s)| (s * f.column(i).norm()).powi(2)).sum() };
    taps.lags().iter().map(square).sum::<f64>().sqrt()
}

/// The radius for which the bound is computed. Taps with a worst case below `gamma` satisfy `sum_l ||F
/// H_l||_F^2 <= sum_l (||W_l||_F + sqrt(M) gamma)^2`, which confines them if the map from taps to responses
/// is injective: then no others matter. Otherwise, or if that radius is very large, it is a thousand times
/// the size of the taps found or of unit gain.
pub(super) fn radius(
    problem: &SampledProblem,
    reduced: &Reduced,
    basis: &Basis,
    (taps, gamma): (&FirMatrix, f64),
) -> Result<f64, LinalgError> {
    let reference = problem.points().iter().map(|p| p.w.norm()).fold(0.0, f64::max);
    let stated = SETTINGS.radius_factor * size(problem, taps).max(reference);
    let spread = (problem.rows() as f64).sqrt() * gamma;
    let image = problem.points().iter().map(|p| (p.w.norm() + spread).powi(2)).sum::<f64>().sqrt();
    let confined = image * basis.inverse_norm() * mix_norm(problem, reduced)?;
    Ok(confined.min(stated))
}

/// Largest growth from reduced taps to the size of taps; infinite if channels had to be dropped.
fn mix_norm(problem: &SampledProblem, reduced: &Reduced) -> Result<f64, LinalgError> {
    let strength = strengths(problem);
    if reduced.mix.nrows() < strength.iter().filter(|s| **s > 0.0).count() {
        return Ok(f64::INFINITY);
    }
    let scaled = Mat::from_fn(reduced.mix.nrows(), strength.len(), |r, i| reduced.mix[(r, i)] * strength[i]);
    Ok(hybank_linalg::singular_values(&scaled)?.first().copied().unwrap_or(0.0))
}

/// The best bound that the dual iterate `z` (blocks of order M + k1) gives for taps within `radius`.
///
/// At an optimum `Z11` sits on the worst singular vectors, and `Y = [-Z12, Z11 W_rest]` in compressed
/// inputs is `Z11 K / gamma`, a subgradient. Its first part is made orthogonal to all taps.
pub(super) fn from_iterate(
    problem: &SampledProblem,
    reduced: &Reduced,
    basis: &Basis,
    z: &Batch,
    radius: f64,
) -> Result<f64, LinalgError> {
    let mut value = 0.0;
    for cut in CUTS {
        value = f64::max(value, lower_bound(problem, &dual_matrices(reduced, basis, z, cut), radius)?);
    }
    Ok(value)
}

fn dual_matrices(reduced: &Reduced, basis: &Basis, z: &Batch, cut: f64) -> Vec<CMat> {
    let (m, k1, k2) = (reduced.layout.rows, reduced.h.cols(), reduced.w_rest.cols());
    let mut image = Batch::zeros(z.count(), m, k1);
    for l in 0..z.count() {
        let (from, to) = (z.block(l), image.block_mut(l).data);
        (0..m * k1).for_each(|e| to[e] = -from.at(e % m, m + e / m));
    }
    basis.project_out(reduced, &mut image, cut);
    let mut rest = Batch::zeros(1, m, k2);
    let full = |l: usize| {
        let weight = z.block(l).part(0, 0, m, m);
        rest.block_mut(0).set_product(1.0, weight.plain(), reduced.w_rest.block(l).plain());
        let mut y = CMat::zeros(m, k1 + k2);
        y.columns_mut(0, k1).copy_from_slice(image.block(l).data);
        y.columns_mut(k1, k2).copy_from_slice(rest.as_slice());
        y * &reduced.inputs[l]
    };
    (0..z.count()).map(full).collect()
}
