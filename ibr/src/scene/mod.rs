//! Scenes: TOML files that list views (images, maps, cameras) and describe the virtual view.

mod folder;
mod load;
mod spec;

pub use folder::describe;
#[cfg(feature = "cli")]
pub(crate) use load::room_to_parse;
pub use load::{LoadOptions, MOST_FRAMES, complete, load, load_watched, parse};
pub use spec::{SceneSpec, TargetSpec, ViewSpec};

use crate::camera::middlebury::Calibration;
use crate::camera::{Camera, CameraError};
use crate::depth::{DepthError, DepthMap};
use crate::files::InputError;
use crate::image::{Image, ImageError};
use crate::pipeline::uncalibrated::Target;
use crate::propagate::View;
use crate::uncalibrated::Point;
use hybank::messages::Quoted;
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
    /// Share of the values of each map that contradicted their neighbours and the other views, and were
    /// replaced.
    pub outliers: Vec<f64>,
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
        views: Vec<SourceView<f64>>,
        /// Positions of the virtual views: one, or those of a path.
        positions: Vec<f64>,
    },
    /// Any calibrated cameras.
    Calibrated {
        /// The views.
        views: Vec<SourceView<Camera>>,
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

    /// The photographs of the views.
    pub fn images(&self) -> Vec<&Image> {
        match self {
            Self::Rectified { views, .. } => views.iter().map(|view| &view.image).collect(),
            Self::Calibrated { views, .. } => views.iter().map(|view| &view.image).collect(),
            Self::Uncalibrated { images, .. } => images.iter().collect(),
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

/// A view, read: the camera is the position on the line of a rectified rig, or a matrix.
#[derive(Debug, Clone, PartialEq)]
pub struct SourceView<P> {
    /// The image.
    pub image: Image,
    /// Its disparities or depths, dense.
    pub map: DepthMap,
    /// Its camera.
    pub camera: P,
}

impl<P: Copy> SourceView<P> {
    /// As the stages take it.
    pub fn view(&self) -> View<'_, P> {
        View { image: &self.image, map: &self.map, camera: self.camera }
    }
}

/// Errors of a scene.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// A camera of the scene.
    #[error("{}: {which}: {source}", Quoted(path))]
    Camera {
        /// The scene file.
        path: PathBuf,
        /// Which camera.
        which: String,
        /// The problem.
        source: CameraError,
    },
    /// A depth map of the scene.
    #[error("view \"{}\": {}: {source}", Quoted(view), Quoted(path))]
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
