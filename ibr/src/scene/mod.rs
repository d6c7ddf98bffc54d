//! Scenes: TOML files that say which images, maps and cameras belong together and what is wanted.

mod load;
mod spec;

pub use load::{LoadOptions, load, parse};
pub use spec::{SceneSpec, TargetSpec, ViewSpec};

use crate::camera::{Camera, CameraError, colmap::ColmapError};
use crate::depth::{DepthError, DepthMap};
use crate::image::{Image, ImageError};
use crate::partial::PartialError;
use crate::pipeline::uncalibrated::Target;
use crate::uncalibrated::Point;
use crate::uncalibrated::tracks::TrackError;
use std::path::PathBuf;

/// A scene with everything read and checked.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// What kind of scene it is, with its views.
    pub kind: Kind,
    /// Registration offset of the wanted view in pixels.
    pub offset: f64,
    /// Unknown depths that were filled from their neighbours.
    pub filled: usize,
}

/// The three situations of the thesis.
#[derive(Debug, Clone, PartialEq)]
pub enum Kind {
    /// Cameras on a line parallel to the image rows.
    Rectified {
        /// The views.
        views: Vec<RectifiedSource>,
        /// Where the wanted view is taken from.
        position: f64,
    },
    /// Any calibrated cameras.
    Calibrated {
        /// The views.
        views: Vec<CalibratedSource>,
        /// The wanted camera.
        camera: Camera,
        /// Width and height of the wanted view.
        size: (usize, usize),
    },
    /// Images and tracks only.
    Uncalibrated {
        /// The images.
        images: Vec<Image>,
        /// Places of the tracks in the images.
        tracks: Vec<Vec<Option<Point>>>,
        /// The wanted view.
        target: Target,
        /// Width and height of the wanted view.
        size: (usize, usize),
    },
}

/// A view of a rectified rig.
#[derive(Debug, Clone, PartialEq)]
pub struct RectifiedSource {
    /// The image.
    pub image: Image,
    /// Its disparity, dense.
    pub disparity: DepthMap,
    /// Place on the line.
    pub position: f64,
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

/// Why a scene could not be used.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The scene file cannot be opened.
    #[error("{}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The scene file is not a scene.
    #[error("{}: {reason}", path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// Line, column and what was expected.
        reason: String,
    },
    /// The scene contradicts itself or leaves something out.
    #[error("{}: {reason}", path.display())]
    Incomplete {
        /// The scene file.
        path: PathBuf,
        /// What is missing, and where.
        reason: String,
    },
    /// No view of the wanted name.
    #[error("{}: there is no view {name:?}; the views are {known}", path.display())]
    NoSuchView {
        /// The scene file.
        path: PathBuf,
        /// The name asked for.
        name: String,
        /// The names there are.
        known: String,
    },
    /// A camera of the scene.
    #[error("{}: {which}: {source}", path.display())]
    Camera {
        /// The scene file.
        path: PathBuf,
        /// Which camera.
        which: String,
        /// What is wrong with it.
        source: CameraError,
    },
    /// A depth map of the scene.
    #[error("view {view:?}: {}: {source}", path.display())]
    Depth {
        /// The view.
        view: String,
        /// The map.
        path: PathBuf,
        /// What is wrong with it.
        source: DepthError,
    },
    /// A coarse depth map of the scene.
    #[error("view {view:?}: {}: {source}", path.display())]
    Partial {
        /// The view.
        view: String,
        /// The map.
        path: PathBuf,
        /// What is wrong with it.
        source: PartialError,
    },
    /// An image of the scene.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// The tracks of the scene.
    #[error(transparent)]
    Tracks(#[from] TrackError),
    /// A COLMAP model of the scene.
    #[error(transparent)]
    Colmap(#[from] ColmapError),
}
