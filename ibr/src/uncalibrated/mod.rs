//! Rendering from images and correspondences alone (thesis 2.5): the cameras are unknown.
//!
//! matches -> F (eight points, RANSAC) -> a pair of projective cameras -> points, chi and its order ->
//! chi on triangles in each view, whose edges the photographs choose -> the virtual camera -> the view.
//!
//! All geometry happens in a projective frame X_p = H X with an unknown 4 x 4 matrix H. Depth is replaced
//! by chi = -(X_p)_4 / (pi3_p . X_p), which along every viewing ray is an affine function of the true
//! inverse depth.

pub mod canonical;
pub mod chirality;
pub mod flips;
pub mod fundamental;
pub mod mesh;
pub mod metric;
pub mod normalise;
pub mod order;
pub(crate) mod random;
mod refine;
pub mod resection;
pub mod tracks;
pub mod triangulate;

use crate::camera::CameraError;

/// Sampson distance below which a match is an inlier of F, in pixels.
const EPIPOLAR: f64 = 1.0;

/// A position in an image, in pixels.
pub type Point = nalgebra::Vector2<f64>;

/// A correspondence: the same scene point in a first and a second image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Match {
    /// Position in the first image.
    pub first: Point,
    /// Position in the second image.
    pub second: Point,
}

/// Errors of estimating the geometry of the views.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GeometryError {
    /// Not enough correspondences.
    #[error("{found} {what} are too few, at least {needed} are needed; give more tracks")]
    TooFew {
        /// The objects of which there are too few.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// How many are needed.
        needed: usize,
    },
    /// All matches lie on one plane, or the camera only rotated.
    #[error(
        "the matches are planar: one homography explains {explained} of {matches} of them within {} px, so the fundamental matrix is not determined; add matches off the plane, or views with a baseline",
        EPIPOLAR
    )]
    Planar {
        /// Matches that the homography explains.
        explained: usize,
        /// Matches considered.
        matches: usize,
    },
    /// The matches do not determine the geometry.
    #[error(
        "the {what} is not determined by the matches (second smallest / largest singular value {ratio:e})"
    )]
    Degenerate {
        /// The object to be estimated.
        what: &'static str,
        /// Ratio of singular values.
        ratio: f64,
    },
    /// No model explains enough matches.
    #[error(
        "the best {what} explains only {inliers} of {matches} matches within {threshold} px; check the tracks"
    )]
    NoConsensus {
        /// The object to be estimated.
        what: &'static str,
        /// Matches that the model explains.
        inliers: usize,
        /// All matches.
        matches: usize,
        /// Threshold in pixels.
        threshold: f64,
    },
    /// A numerical routine failed.
    #[error("the {what} could not be computed: the values are not finite or the iteration did not converge")]
    Numerical {
        /// The object to be computed.
        what: &'static str,
    },
    /// A camera of the projective frame is singular.
    #[error("{which}: {source}")]
    Camera {
        /// Which camera.
        which: String,
        /// What is wrong with it.
        source: CameraError,
    },
}

pub(crate) fn homogeneous(p: &Point) -> nalgebra::Vector3<f64> {
    p.push(1.0)
}
