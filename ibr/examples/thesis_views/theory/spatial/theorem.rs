//! Theorem 4.3: the mean absolute error of a virtual view of an unoccluded scene of space.

use super::triangles::PlaneSmoothness;
use super::{PaintedSurface, parameters_at, see};
use crate::theory::delaunay::{PoissonDelaunay, superposed_grids};
use crate::theory::flat::{ErrorBound, Errors};
use hybank_ibr::camera::Camera;
use nalgebra::{Matrix2, Vector2};

/// Nodes per side at which suprema and means over the window are taken.
const NODES: usize = 40;

/// Step of the differences of the virtual image, in pixels.
const STEP: f64 = 0.02;

/// A scene, the cameras that see it, and the virtual camera.
#[derive(Clone, Copy)]
pub(crate) struct SpatialRig<'a> {
    /// The surface.
    pub(crate) scene: &'a dyn PaintedSurface,
    /// The actual cameras.
    pub(crate) cameras: &'a [Camera],
    /// The virtual camera.
    pub(crate) view: &'a Camera,
    /// The part of the virtual image that is judged: its two corners, in pixels.
    pub(crate) window: (Vector2<f64>, Vector2<f64>),
}

impl SpatialRig<'_> {
    /// The parameters of a pixel of the virtual view; the origin if it sees nothing.
    pub(super) fn parameters(&self, pixel: Vector2<f64>) -> Vector2<f64> {
        parameters_at(self.scene, self.view, pixel, Vector2::zeros()).unwrap_or_default()
    }

    /// f_v at a pixel.
    pub(crate) fn intensity(&self, pixel: Vector2<f64>) -> f64 {
        self.scene.at(self.parameters(pixel)).texture
    }

    /// Samples of each camera per square pixel of the virtual view: |det J_i| / |det J_v|.
    pub(crate) fn densities(&self, pixel: Vector2<f64>) -> Vec<f64> {
        let s = self.scene.at(self.parameters(pixel));
        let area = |camera: &Camera| see(camera, &s).2.determinant().abs();
        let stretch = area(self.view);
        self.cameras.iter().map(|camera| area(camera) / stretch).collect()
    }

    /// Displacement in the virtual view of the sample that camera i takes of the point at a pixel with the
    /// depth error delta. For unit focal lengths it is at most
    ///
    /// ```text
    /// |delta| |(S - C_i) x (S - C_v)| / (d_i d_v d^_v)
    /// ```
    pub(crate) fn jitter(&self, camera: usize, pixel: Vector2<f64>, delta: f64) -> Vector2<f64> {
        let s = self.scene.at(self.parameters(pixel)).point;
        let (x, y, d) = self.cameras[camera].project(&s);
        let (u, v, _) = self.view.project(&self.cameras[camera].unproject(x, y, d + delta));
        Vector2::new(u, v) - pixel
    }

    pub(super) fn grid(&self, side: usize) -> impl Iterator<Item = Vector2<f64>> + use<> {
        let (low, span) = (self.window.0, self.window.1 - self.window.0);
        let part = move |k: usize| (k as f64 + 0.5) / side as f64;
        (0..side * side).map(move |k| low + Vector2::new(span.x * part(k % side), span.y * part(k / side)))
    }

    /// B_v: the largest jitter per unit of depth error, for errors up to `depth_error`.
    pub(crate) fn jitter_factor(&self, depth_error: f64) -> f64 {
        let delta = depth_error.max(1e-9);
        let worst = |i: usize, pixel| {
            [delta, -delta].map(|d| self.jitter(i, pixel, d).norm()).into_iter().fold(0.0, f64::max)
        };
        let of_pixel = |pixel| (0..self.cameras.len()).map(|i| worst(i, pixel)).fold(0.0, f64::max);
        self.grid(NODES / 2).map(of_pixel).fold(0.0, f64::max) / delta
    }

    /// Suprema of the gradient and the Hessian of the virtual image, by differences.
    pub(crate) fn smoothness(&self) -> PlaneSmoothness {
        let mut limits = PlaneSmoothness { slope: 0.0, curvature: 0.0 };
        for pixel in self.grid(NODES) {
            let (gradient, hessian) = self.derivatives(pixel);
            let (m, d) = principal(&hessian);
            limits.slope = limits.slope.max(gradient.norm());
            limits.curvature = limits.curvature.max(m.abs() + d);
        }
        limits
    }

    /// Gradient and Hessian of f_v at a pixel.
    pub(crate) fn derivatives(&self, pixel: Vector2<f64>) -> (Vector2<f64>, Matrix2<f64>) {
        let f = |dx: f64, dy: f64| self.intensity(pixel + Vector2::new(dx, dy) * STEP);
        let here = f(0.0, 0.0);
        let (left, right, up, down) = (f(-1.0, 0.0), f(1.0, 0.0), f(0.0, -1.0), f(0.0, 1.0));
        let mixed = (f(1.0, 1.0) - f(1.0, -1.0) - f(-1.0, 1.0) + f(-1.0, -1.0)) / 4.0;
        let (across, along) = (left - 2.0 * here + right, up - 2.0 * here + down);
        let gradient = Vector2::new(right - left, down - up) / (2.0 * STEP);
        (gradient, Matrix2::new(across, mixed, mixed, along) / (STEP * STEP))
    }

    /// Theorem 4.3, for linear interpolation on Delaunay triangles:
    ///
    /// ```text
    /// MAE <= (3 K / (2 pi)) <1 / lambda> + E_T + E_D B_v sup|grad f_v|
    /// ```
    ///
    /// half the mean squared circumradius over the window, times K. An expectation, as Theorem 3.1 is.
    pub(crate) fn bound(&self, errors: Errors) -> ErrorBound {
        let PlaneSmoothness { slope, curvature } = self.smoothness();
        ErrorBound {
            sampling: curvature / 2.0 * self.mean(|p| p.mean_squared_radius()),
            texture: errors.texture,
            depth: errors.depth * self.jitter_factor(errors.depth) * slope,
        }
    }

    /// What the theorem bounds, estimated for exact inputs: the mean of k / (pi lambda) N / (N + 1), with k
    /// the curvature that counts of the Hessian with the eigenvalues m + d and m - d,
    ///
    /// ```text
    /// k = (|m|^3 + (0.424 |d|)^3)^(1/3)
    /// ```
    ///
    /// The error is half the trace of the Hessian times M = sum b_k (p_k - x)(p_k - x)', which is positive
    /// semidefinite: for |d| <= |m| its mean is that of |m|, and for a saddle, m = 0, the share
    /// E|M11 - M22| / E(M11 + M22) = 0.424 of it. The cubes join the two within 3 %.
    pub(crate) fn estimate(&self) -> f64 {
        let local = |pixel: Vector2<f64>| {
            let hessian = self.derivatives(pixel).1;
            let (m, d) = principal(&hessian);
            let curvature = (m.abs().powi(3) + (SADDLE * d).powi(3)).cbrt();
            let density = self.densities(pixel).iter().sum();
            curvature * PoissonDelaunay { density }.mean_quadratic_error()
        };
        let sum: f64 = self.grid(NODES).map(local).sum();
        sum / (NODES * NODES) as f64 * superposed_grids(self.cameras.len(), 2)
    }

    fn mean(&self, g: impl Fn(PoissonDelaunay) -> f64) -> f64 {
        let at = |pixel| g(PoissonDelaunay { density: self.densities(pixel).iter().sum() });
        self.grid(NODES / 2).map(at).sum::<f64>() / (NODES / 2).pow(2) as f64
    }
}

/// E|M11 - M22| / E(M11 + M22) over the plane, for the typical triangle.
const SADDLE: f64 = 0.424;

/// Half the sum and half the difference, which is not negative, of the eigenvalues of a symmetric matrix.
fn principal(matrix: &Matrix2<f64>) -> (f64, f64) {
    let half = (matrix[(0, 0)] - matrix[(1, 1)]) / 2.0;
    (matrix.trace() / 2.0, half.hypot(matrix[(0, 1)]))
}
