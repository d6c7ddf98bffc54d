//! Scenes: TOML files that list views (images, maps, cameras) and describe the virtual view.

mod diagnosis;
mod folder;
mod load;
mod notes;
mod prepare;
mod register;
mod spec;
mod unknown;

pub use folder::{Described, describe};
pub(crate) use load::photograph;
pub use load::{LoadOptions, MOST_FRAMES, complete, each_left_out, load, parse};
pub use prepare::{Preparation, PrepareSettings, prepare};
pub use register::Registered;
pub use spec::{SceneSpec, TargetSpec, ViewSpec};
pub use unknown::Unknown;

use crate::camera::Camera;
use crate::depth::DepthMap;
use crate::image::Image;
use crate::pipeline::uncalibrated::Target;
use crate::propagate::View;
use crate::uncalibrated::Point;

/// A scene, read and checked.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// The kind of scene, with its views.
    pub kind: Kind,
    /// The name of each view that was read, or its image file.
    pub names: Vec<String>,
    /// Registration offset of the virtual view in pixels.
    pub offset: f64,
    /// Unknown depths that were filled from their neighbours.
    pub filled: usize,
    /// Share of the values of each map that contradicted their neighbours and the other views, and were
    /// replaced.
    pub outliers: Vec<f64>,
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
    /// Its disparities or depths: of a scene that was read, or after [`prepare`], dense and restored.
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
