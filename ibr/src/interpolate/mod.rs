//! Stage three: interpolation of the virtual image from the visible samples (thesis 2.3.3).
//!
//! [`rows`] fits one spline per row and needs samples on whole rows, as a rectified rig gives them;
//! [`plane`] fits the whole image and takes samples anywhere.

mod holes;
pub mod plane;
pub mod rows;

pub(crate) use holes::join_rows;
pub use holes::{Cover, HoleCount, HoleFill, HoleSettings};

use crate::occlusion::DepthTest;

/// Called with the share of a piece of work that is done, 0 to 1, from any thread and not necessarily in
/// order.
pub type Watch<'a> = &'a (dyn Fn(f64) + Sync);

/// Degree of the splines of the row fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Degree {
    /// Hats: piecewise linear.
    Linear,
    /// Cubic B-splines.
    Cubic,
}

/// How the smoothing weight follows the depth around a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Variation {
    /// V = 1 everywhere.
    Uniform,
    /// V_x = 1 / (1 + var(depth / mean depth) / s0^2) over the neighbourhood: 1 on flat depth, 0 across an
    /// edge, which lets the image be steep there (thesis eq. 2.5).
    Local {
        /// Relative standard deviation of the depth at which the smoothing is halved.
        s0: f64,
    },
}

/// Settings of the fit. Intensities are 0 to 255, positions are in pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FitSettings {
    /// Degree of the splines.
    pub degree: Degree,
    /// Weight of the squared slope at the samples, in px^2.
    pub lambda: f64,
    /// Weight of the squared differences of neighbouring coefficients; determines coefficients without
    /// samples.
    pub tau: f64,
    /// How lambda follows the depth.
    pub variation: Variation,
}

impl Default for FitSettings {
    fn default() -> Self {
        Self { degree: Degree::Cubic, lambda: 0.1, tau: 0.05, variation: Variation::Local { s0: 0.02 } }
    }
}

/// All settings of stage three.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Settings {
    /// The row fit.
    pub fit: FitSettings,
    /// The plane fit.
    pub plane: plane::PlaneSettings,
    /// Holes and their filling.
    pub holes: HoleSettings,
    /// The depth test of stage two; it decides which depths belong to one surface.
    pub depth_test: DepthTest,
}

/// Invalid settings or samples of the third stage.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum InterpolationError {
    /// A weight or length outside its range.
    #[error("{name} is {value}: it must be {rule}")]
    Setting {
        /// Name of the setting.
        name: &'static str,
        /// Value given.
        value: f64,
        /// The range in words.
        rule: &'static str,
    },
    /// A sample between two rows was given to the row fit.
    #[error(
        "sample {index} lies in row {row}: the row fit takes samples on whole rows only; use the plane fit"
    )]
    BetweenRows {
        /// Index of the sample.
        index: usize,
        /// Its row.
        row: f64,
    },
    /// A sample that is not finite.
    #[error("sample {index} has position ({x}, {y}) and depth {depth}; all must be finite numbers")]
    NotFinite {
        /// Index of the sample.
        index: usize,
        /// Its column.
        x: f64,
        /// Its row.
        y: f64,
        /// Its depth.
        depth: f32,
    },
    /// There is nothing to interpolate.
    #[error(
        "no sample falls on the virtual image of {width} x {height} pixels: the views and the virtual camera do not overlap"
    )]
    NoSamples {
        /// Width of the virtual image.
        width: usize,
        /// Height of the virtual image.
        height: usize,
    },
    /// The normal equations could not be solved.
    #[error("row {row}: {source}")]
    Fit {
        /// The row.
        row: usize,
        /// The solver's error.
        source: hybank::sampling::SamplingError,
    },
}

impl Settings {
    /// Refuses settings outside their range.
    ///
    /// # Errors
    /// [`InterpolationError::Setting`].
    pub fn check(&self) -> Result<(), InterpolationError> {
        let at_least_zero = |v: f64| v.is_finite() && v >= 0.0;
        let positive = |v: f64| v.is_finite() && v > 0.0;
        let s0 = match self.fit.variation {
            Variation::Local { s0 } => s0,
            Variation::Uniform => 1.0,
        };
        let rules: [(&'static str, f64, bool, &'static str); 7] = [
            ("lambda", self.fit.lambda, at_least_zero(self.fit.lambda), "a number >= 0"),
            ("tau", self.fit.tau, at_least_zero(self.fit.tau), "a number >= 0"),
            ("s0", s0, positive(s0), "a positive number"),
            ("gap", self.holes.gap, positive(self.holes.gap), "a positive number of pixels"),
            ("stiffness", self.plane.stiffness, positive(self.plane.stiffness), "a positive number"),
            (
                "edge stiffness",
                self.plane.edge_stiffness,
                positive(self.plane.edge_stiffness),
                "a positive number",
            ),
            ("tolerance", self.plane.tolerance, positive(self.plane.tolerance), "a positive number"),
        ];
        match rules.into_iter().find(|r| !r.2) {
            Some((name, value, _, rule)) => Err(InterpolationError::Setting { name, value, rule }),
            None => Ok(()),
        }
    }
}

/// Refuses samples that are not finite.
pub(crate) fn check_samples<const C: usize>(
    samples: &[crate::sample::Sample<C>],
) -> Result<(), InterpolationError> {
    let broken = |s: &crate::sample::Sample<C>| !(s.x.is_finite() && s.y.is_finite() && s.depth.is_finite());
    match samples.iter().position(broken) {
        Some(index) => {
            let s = &samples[index];
            Err(InterpolationError::NotFinite { index, x: s.x, y: s.y, depth: s.depth })
        }
        None => Ok(()),
    }
}
