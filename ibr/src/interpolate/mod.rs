//! Stage three: interpolation of the virtual image from the visible samples (thesis 2.3.3).
//!
//! [`rows`] fits one spline per row and needs samples on whole rows, as a rectified rig gives them;
//! [`plane`] fits the whole image and takes samples anywhere.

mod extend;
mod holes;
pub mod plane;
pub mod rows;

pub use holes::{Cover, HoleCount, HoleFill};

use crate::occlusion::DepthTest;
use crate::setting::{NOT_NEGATIVE, POSITIVE, SMOOTHING, SettingError};

/// Degree of the splines of the plane.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
#[non_exhaustive]
pub enum Degree {
    /// Linear B-splines.
    Linear,
    /// Cubic B-splines.
    Cubic,
}

/// Settings of the fit of rows. Intensities are 0 to 255, positions are in pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FitSettings {
    /// Weight of the squared slope at the samples, in px^2.
    pub lambda: f64,
    /// Weight of the squared differences of neighbouring coefficients; determines coefficients without
    /// samples.
    pub tau: f64,
    /// s0, the relative standard deviation of the depth at which the smoothing is halved: the weight of the
    /// slope at a sample is lambda V, V = 1 / (1 + var(depth / mean depth) / s0^2) over its neighbourhood.
    /// V is 1 on flat depth and 0 across an edge, which lets the image be steep there (thesis eq. 2.5).
    pub variation: f64,
}

impl Default for FitSettings {
    fn default() -> Self {
        Self { lambda: 0.1, tau: 0.05, variation: 0.02 }
    }
}

/// All settings of stage three.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Settings {
    /// The row fit.
    pub fit: FitSettings,
    /// The plane fit.
    pub plane: plane::PlaneSettings,
    /// What holes are filled with.
    pub fill: HoleFill,
    /// The depth test of stage two; it decides which depths belong to one surface.
    pub depth_test: DepthTest,
}

impl Settings {
    /// Refuses settings outside their range.
    ///
    /// # Errors
    /// [`SettingError`].
    pub fn check(&self) -> Result<(), SettingError> {
        SMOOTHING.check("lambda", self.fit.lambda)?;
        NOT_NEGATIVE.check("tau", self.fit.tau)?;
        POSITIVE.check("variation", self.fit.variation)?;
        POSITIVE.check("stiffness", self.plane.stiffness)?;
        NOT_NEGATIVE.check("noise stiffness", self.plane.noise_stiffness)?;
        POSITIVE.check("edge stiffness", self.plane.edge_stiffness)?;
        POSITIVE.check("tolerance", self.plane.tolerance)?;
        self.depth_test.check()
    }
}
