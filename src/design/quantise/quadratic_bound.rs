//! Lower bounds of gamma that are quadratic in the taps.
//!
//! For Hermitian positive semidefinite weights Lambda_k whose traces sum to one,
//!
//! ```text
//! gamma(f)^2 >= sum_k tr( Lambda_k K_k K_k* ) = least + |L' (f - c)|^2,   K_k = W_k - sum_u f_u G_u(k),
//! ```
//!
//! because the largest singular value bounds every weighted mean of the error. G_u is the response of a
//! tap of value one. All phases are coupled, in contrast to `forms`.

use super::problem::TapError;
use crate::linalg::{self, CMat, Complex, Mat};

/// Added to the diagonal relative to each entry, because the form is singular for equal channels.
const RIDGE: f64 = 1e-13;
/// Fraction of the weights that a step replaces.
const PACE: f64 = 0.3;
/// Points whose share of the new weights is below this get none.
const NEGLIGIBLE: f64 = 1e-3;

/// A tap that may differ from zero.
#[derive(Debug, Clone, Copy)]
pub(super) struct Unknown {
    pub(super) channel: usize,
    /// Number of the tap at the fast rate.
    pub(super) tap: usize,
}

/// The error at the points of a grid as an affine function of a few taps.
pub(super) struct AffineErrors {
    pub(super) unknowns: Vec<Unknown>,
    points: Vec<AffinePoint>,
    ratio: usize,
}

/// W, M x q, and below one another the rows that the taps multiply, one per unknown.
struct AffinePoint {
    w: CMat,
    rows: CMat,
}

/// One weight per point, M x M.
#[derive(Clone)]
pub(super) struct Weights(Vec<CMat>);

/// `gamma^2 >= least + |L' (f - centre)|^2`.
pub(super) struct QuadraticBound {
    pub(super) factor: Mat,
    pub(super) centre: Vec<f64>,
    pub(super) least: f64,
}

impl AffineErrors {
    pub(super) fn new(error: &TapError<'_>, unknowns: Vec<Unknown>) -> Self {
        let ratio = error.ratio;
        let points = error.points.iter().map(|point| {
            let row = |u: usize, c: usize| {
                let Unknown { channel, tap } = unknowns[u];
                Complex::from_polar(1.0, -point.omega * (tap / ratio) as f64) * point.h[(channel, c)]
            };
            AffinePoint { w: point.w.clone(), rows: CMat::from_fn(unknowns.len(), point.h.ncols(), row) }
        });
        Self { points: points.collect(), unknowns, ratio }
    }

    /// Number of points.
    pub(super) fn count(&self) -> usize {
        self.points.len()
    }

    /// K at point `k`.
    pub(super) fn at(&self, k: usize, taps: &[f64]) -> CMat {
        let AffinePoint { w, rows } = &self.points[k];
        let mut error = w.clone();
        for (u, &value) in taps.iter().enumerate().filter(|(_, value)| **value != 0.0) {
            let phase = self.unknowns[u].tap % self.ratio;
            for c in 0..error.ncols() {
                error[(phase, c)] -= rows[(u, c)] * value;
            }
        }
        error
    }

    /// A bound of how far taps of at most `most` each can lower the gain at point `k`.
    pub(super) fn reach(&self, k: usize, most: f64) -> f64 {
        most * self.points[k].rows.row_iter().map(|row| row.norm()).sum::<f64>()
    }

    /// Equal weights at all points and in all directions.
    pub(super) fn uniform(&self) -> Weights {
        let share = Complex::new(1.0 / (self.count() * self.ratio) as f64, 0.0);
        Weights(vec![CMat::from_diagonal_element(self.ratio, self.ratio, share); self.count()])
    }

    /// Moves `weights` towards the worst points and directions of the error of `taps`, which exceeds
    /// `floor`.
    pub(super) fn emphasise(&self, weights: &Weights, taps: &[f64], floor: f64) -> Option<Weights> {
        let errors: Vec<CMat> = (0..self.count()).map(|k| self.at(k, taps)).collect();
        let gains: Vec<f64> =
            errors.iter().map(linalg::largest_singular_value).collect::<Result<_, _>>().ok()?;
        let worst = gains.iter().copied().fold(0.0, f64::max);
        let shares: Vec<f64> =
            gains.iter().map(|gain| ((gain - floor) / (worst - floor)).max(0.0).powi(2)).collect();
        let total: f64 = shares.iter().sum();
        if !(worst > floor && total.is_finite()) {
            return None;
        }
        let mut moved: Vec<CMat> =
            weights.0.iter().map(|weight| weight * Complex::from(1.0 - PACE)).collect();
        for (k, share) in shares.iter().enumerate().filter(|(_, share)| **share > NEGLIGIBLE) {
            let direction = linalg::svd(&errors[k]).ok()?.u.column(0).into_owned();
            moved[k] += &direction * direction.adjoint() * Complex::from(PACE * share / total);
        }
        Some(Weights(moved))
    }

    /// The bound that `weights` give; none if rounding errors make the form indefinite.
    pub(super) fn bound(&self, weights: &Weights) -> Option<QuadraticBound> {
        let size = self.unknowns.len();
        let (mut form, mut slope, mut constant) = (Mat::zeros(size, size), Mat::zeros(size, 1), 0.0);
        for (AffinePoint { w, rows }, weight) in self.points.iter().zip(&weights.0) {
            let weighted = weight * w;
            constant += weighted.iter().zip(w.iter()).map(|(a, b)| a.re * b.re + a.im * b.im).sum::<f64>();
            let products = rows * rows.adjoint();
            let against = weighted * rows.adjoint();
            for (u, a) in self.unknowns.iter().enumerate() {
                let phase = a.tap % self.ratio;
                slope[u] += against[(phase, u)].re;
                for (v, b) in self.unknowns.iter().enumerate() {
                    form[(u, v)] += (products[(u, v)] * weight[(b.tap % self.ratio, phase)]).re;
                }
            }
        }
        (0..size).for_each(|u| form[(u, u)] += RIDGE * form[(u, u)] + f64::MIN_POSITIVE);
        let factor = linalg::cholesky(&form).ok()?;
        let half = factor.solve_lower_triangular(&slope)?;
        let centre = factor.transpose().solve_upper_triangular(&half)?;
        let least = (constant - half.norm_squared()).max(0.0);
        let finite = least.is_finite() && centre.iter().all(|x| x.is_finite());
        finite.then(|| QuadraticBound { factor, centre: centre.iter().copied().collect(), least })
    }
}
