//! Scenes: TOML files that list views (images, maps, cameras) and describe the virtual view.

mod load;
mod spec;

pub use load::{LoadOptions, MOST_FRAMES, complete, load, parse};
pub use spec::{SceneSpec, TargetSpec, ViewSpec};

use crate::camera::middlebury::Calibration;
use crate::camera::{Camera, CameraError};
use crate::depth::{DepthError, DepthMap};
use crate::files::InputError;
use crate::image::{Image, ImageError};
use crate::pipeline::uncalibrated::Target;
use crate::propagate::{CalibratedView, RectifiedView};
use crate::uncalibrated::Point;
use std::path::PathBuf;

/// A scene, read and checked.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// The kind of scene, with its views.
    pub kind: Kind,
    /// Registration offset of the virtual view in pixels.
    pub offset: f64,
    /// Unknown depths that were filled from their neighbours.
    pub filled: usize,
    /// The calibration file of a rectified rig, which gives its disparities a unit.
    pub calibration: Option<Calibration>,
    /// What was decided on reading; it is reported to the user.
    pub notes: Vec<String>,
}

/// The three situations of the thesis.
#[derive(Debug, Clone, PartialEq)]
pub enum Kind {
    /// Cameras on a line parallel to the image rows.
    Rectified {
        /// The views.
        views: Vec<RectifiedSource>,
        /// Positions of the virtual views: one, or those of a path.
        positions: Vec<f64>,
    },
    /// Any calibrated cameras.
    Calibrated {
        /// The views.
        views: Vec<CalibratedSource>,
        /// The virtual cameras: one, or those of a path.
        cameras: Vec<Camera>,
        /// Width and height of the virtual view.
        size: (usize, usize),
    },
    /// Images and tracks only.
    Uncalibrated {
        /// The images.
        images: Vec<Image>,
        /// Positions of the tracks in the images.
        tracks: Vec<Vec<Option<Point>>>,
        /// The virtual views: one, or those of a path.
        targets: Vec<Target>,
        /// Width and height of the virtual view.
        size: (usize, usize),
    },
}

impl Kind {
    /// Views to render from.
    pub fn views(&self) -> usize {
        match self {
            Self::Rectified { views, .. } => views.len(),
            Self::Calibrated { views, .. } => views.len(),
            Self::Uncalibrated { images, .. } => images.len(),
        }
    }

    /// Virtual views to render.
    pub fn frames(&self) -> usize {
        match self {
            Self::Rectified { positions, .. } => positions.len(),
            Self::Calibrated { cameras, .. } => cameras.len(),
            Self::Uncalibrated { targets, .. } => targets.len(),
        }
    }
}

/// A view of a rectified rig.
#[derive(Debug, Clone, PartialEq)]
pub struct RectifiedSource {
    /// The image.
    pub image: Image,
    /// Its disparity, dense.
    pub disparity: DepthMap,
    /// Position along the baseline.
    pub position: f64,
}

impl RectifiedSource {
    /// As the stages take it.
    pub fn view(&self) -> RectifiedView<'_> {
        RectifiedView { image: &self.image, disparity: &self.disparity, position: self.position }
    }
}

/// A view of a general rig.
#[derive(Debug, Clone, PartialEq)]
pub struct CalibratedSource {
    /// The image.
    pub image: Image,
    /// Its depth, dense.
    pub depth: DepthMap,
    /// Its camera.
    pub camera: Camera,
}

impl CalibratedSource {
    /// As the stages take it.
    pub fn view(&self) -> CalibratedView<'_> {
        CalibratedView { image: &self.image, depth: &self.depth, camera: self.camera }
    }
}

/// Errors of a scene.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// A camera of the scene.
    #[error("{}: {which}: {source}", path.display())]
    Camera {
        /// The scene file.
        path: PathBuf,
        /// Which camera.
        which: String,
        /// The problem.
        source: CameraError,
    },
    /// A depth map of the scene.
    #[error("view {view:?}: {}: {source}", path.display())]
    Depth {
        /// The view.
        view: String,
        /// The map.
        path: PathBuf,
        /// The problem.
        source: DepthError,
    },
    /// An image of the scene.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// The scene file, its tracks, or a file of its cameras.
    #[error(transparent)]
    Input(#[from] InputError),
}
