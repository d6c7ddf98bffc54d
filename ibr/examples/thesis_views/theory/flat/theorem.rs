//! Theorem 3.1: the mean absolute error of a virtual view of an unoccluded scene of the plane.

use super::{FlatCamera, PaintedCurve, cross};
use crate::theory::periodic::PeriodicSets;
use crate::theory::piecewise_linear::Smoothness;

/// Nodes at which suprema and means over the curve are taken.
const NODES: usize = 4000;

/// Bounds of the errors of the inputs.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Errors {
    /// E_T, of intensities.
    pub(crate) texture: f64,
    /// E_D, of depths along the rays of the actual cameras.
    pub(crate) depth: f64,
}

/// A bound of the mean absolute error, by cause.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ErrorBound {
    /// Too few samples.
    pub(crate) sampling: f64,
    /// Errors of intensity.
    pub(crate) texture: f64,
    /// Errors of depth.
    pub(crate) depth: f64,
}

impl ErrorBound {
    /// The sum.
    pub(crate) fn total(&self) -> f64 {
        self.sampling + self.texture + self.depth
    }
}

/// A scene, the cameras that see it, and the virtual camera.
#[derive(Clone, Copy)]
pub(crate) struct FlatRig<'a> {
    /// The curve.
    pub(crate) scene: &'a dyn PaintedCurve,
    /// The actual cameras.
    pub(crate) cameras: &'a [FlatCamera],
    /// The virtual camera.
    pub(crate) view: FlatCamera,
    /// The part of the curve that is judged, from one parameter to another.
    pub(crate) window: (f64, f64),
}

/// Intensity of the virtual image f_v around one pixel, by the pixel.
struct Virtual {
    slope: f64,
    curvature: f64,
    /// |H_v'|, virtual pixels per unit of u.
    stretch: f64,
}

impl FlatRig<'_> {
    fn parameters(&self) -> impl Iterator<Item = f64> + use<> {
        let (a, b) = self.window;
        (0..NODES).map(move |k| a + (b - a) * (k as f64 + 0.5) / NODES as f64)
    }

    fn virtual_at(&self, u: f64) -> Virtual {
        let c = self.scene.at(u);
        let h = self.view.see(&c);
        let slope = c.texture[1] / h.first;
        let curvature = (c.texture[2] - slope * h.second) / (h.first * h.first);
        Virtual { slope, curvature, stretch: h.first.abs() }
    }

    /// Samples of each camera per virtual pixel around the point of parameter u: |H_i'| / |H_v'|.
    pub(crate) fn densities(&self, u: f64) -> Vec<f64> {
        let c = self.scene.at(u);
        let stretch = self.view.see(&c).first.abs();
        self.cameras.iter().map(|camera| camera.see(&c).first.abs() / stretch).collect()
    }

    /// lambda_x, samples per virtual pixel.
    pub(crate) fn density(&self, u: f64) -> f64 {
        self.densities(u).iter().sum()
    }

    /// Mean over the pixels of the virtual view of a function of u.
    fn mean(&self, g: impl Fn(f64) -> f64) -> f64 {
        let (sum, pixels) = self.parameters().fold((0.0, 0.0), |(sum, pixels), u| {
            let stretch = self.virtual_at(u).stretch;
            (sum + stretch * g(u), pixels + stretch)
        });
        sum / pixels
    }

    fn largest(&self, g: impl Fn(f64) -> f64) -> f64 {
        self.parameters().map(g).fold(0.0, f64::max)
    }

    /// Displacement in the virtual view, in pixels, of the sample that camera i takes at u with the depth
    /// error delta (thesis Prop. 3.3, exact):
    ///
    /// ```text
    /// mu = delta det(M_v) ((S - C_i) x (S - C_v)) / (d_i d_v d^_v)
    /// ```
    pub(crate) fn jitter(&self, camera: usize, u: f64, delta: f64) -> f64 {
        let (s, c) = (self.scene.at(u).point, self.cameras[camera].centre());
        let (d, d_v) = (self.cameras[camera].project(&s).1, self.view.project(&s).1);
        let moved = self.view.project(&(s + (s - c) * (delta / d))).1;
        let area = cross(&(s - c), &(s - self.view.centre()));
        delta * self.view.determinant() * area / (d * d_v * moved)
    }

    /// B_v: the largest jitter per unit of depth error, for errors up to `depth_error`.
    pub(crate) fn jitter_factor(&self, depth_error: f64) -> f64 {
        let delta = depth_error.max(1e-9);
        let worst = |i: usize, u: f64| self.jitter(i, u, delta).abs().max(self.jitter(i, u, -delta).abs());
        let of_point = |u| (0..self.cameras.len()).map(|i| worst(i, u)).fold(0.0, f64::max);
        self.largest(of_point) / delta
    }

    /// Suprema of the derivatives of the virtual image over the window.
    pub(crate) fn smoothness(&self) -> Smoothness {
        let slope = self.largest(|u| self.virtual_at(u).slope.abs());
        Smoothness { slope, curvature: self.largest(|u| self.virtual_at(u).curvature.abs()) }
    }

    /// Theorem 3.1, for linear interpolation between the propagated samples:
    ///
    /// ```text
    /// MAE <= (3/4) sup|f_v''| <lambda_x^-2> + E_T + E_D B_v sup|f_v'|
    /// ```
    ///
    /// An expectation over independent, uniform phases of the cameras.
    pub(crate) fn image_space(&self, errors: Errors) -> ErrorBound {
        let Smoothness { slope, curvature } = self.smoothness();
        ErrorBound {
            sampling: 0.75 * curvature * self.mean(|u| self.density(u).powi(-2)),
            texture: errors.texture,
            depth: errors.depth * self.jitter_factor(errors.depth) * slope,
        }
    }

    /// What Theorem 3.1 bounds, estimated for exact inputs: the mean of |f_v''| lambda E\[D^3\] / 12 with
    /// the exact moments of as many cameras as there are.
    pub(crate) fn estimate(&self) -> f64 {
        self.mean(|u| {
            let periods = self.densities(u).iter().map(|d| 1.0 / d).collect();
            let moment = |sets: PeriodicSets| sets.density() * sets.moment(3) / 12.0;
            self.virtual_at(u).curvature.abs() * PeriodicSets::new(periods).map_or(f64::NAN, moment)
        })
    }
}

/// Mean of |w e_1 + (1 - w) e_2| for w uniform in \[0, 1\] and e_k uniform in \[-1, 1\]: (1/2 + ln 2) / 3.
///
/// For w >= 1/2 the mean over e_1 and e_2 is (3 w^2 + (1 - w)^2) / (6 w). The share of E_T that the error
/// of linear interpolation has on average.
pub(crate) const UNIFORM_ERROR_SHARE: f64 = (0.5 + std::f64::consts::LN_2) / 3.0;
