//! Images with their cameras, as files of other programs list them.

use super::colmap::read_model;
use super::names::{self, Found, NameError};
use super::transforms::parse_transforms;
use super::{Camera, Lens, camera_path};
use crate::files::{self, CHECK_THE_PATH, InputError};
use hybank_core::messages::Quoted;
use nalgebra::{Matrix3, Matrix3x4};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The images of a COLMAP model or of a transforms file.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraList {
    pub(super) path: PathBuf,
    /// The images in their order.
    pub frames: Vec<Frame>,
    /// The numbers of the images by their file names without extension.
    by_stem: BTreeMap<String, Vec<usize>>,
}

/// An image, its pose and the inner parameters of its camera.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Its path.
    pub image: PathBuf,
    /// Its depth map, if the list has one.
    pub depth: Option<PathBuf>,
    /// The image that is black where the photograph shows what is no part of the scene.
    pub mask: Option<PathBuf>,
    /// Its number in the list, from 1; the one by which a COLMAP model calls it.
    pub(crate) id: u64,
    /// World to camera, with x to the right, y down and z forwards.
    pub(super) pose: Matrix3x4<f64>,
    pub(super) inner: Inner,
}

/// The inner parameters of a camera in pixels, with pixel centres at half-integers. A transforms file gives
/// them once for all frames, or in each frame.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
pub(super) struct Inner {
    pub(super) camera_angle_x: Option<f64>,
    pub(super) camera_angle_y: Option<f64>,
    pub(super) fl_x: Option<f64>,
    pub(super) fl_y: Option<f64>,
    pub(super) cx: Option<f64>,
    pub(super) cy: Option<f64>,
    pub(super) w: Option<f64>,
    pub(super) h: Option<f64>,
    pub(super) k1: Option<f64>,
    pub(super) k2: Option<f64>,
    pub(super) k3: Option<f64>,
    pub(super) k4: Option<f64>,
    pub(super) p1: Option<f64>,
    pub(super) p2: Option<f64>,
    pub(super) is_fisheye: Option<bool>,
}

impl Frame {
    /// Whether the list has the size of the image.
    pub(crate) fn has_size(&self) -> bool {
        self.inner.w.is_some() && self.inner.h.is_some()
    }
}

/// A path of a list; Windows writes backslashes between its parts.
pub(super) fn portable(path: &str) -> PathBuf {
    path.replace('\\', "/").into()
}

/// A camera of a list with the size of its image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ListedCamera {
    /// The metric camera, in pixels with centres at integers.
    pub camera: Camera,
    /// Width and height of the image in pixels.
    pub size: (usize, usize),
}

impl CameraList {
    pub(super) fn new(path: PathBuf, frames: Vec<Frame>) -> Self {
        let mut by_stem: BTreeMap<String, Vec<usize>> = BTreeMap::new();
        for (number, frame) in frames.iter().enumerate() {
            let stem = names::stem_of(&frame.image.to_string_lossy()).to_owned();
            by_stem.entry(stem).or_default().push(number);
        }
        Self { path, frames, by_stem }
    }

    /// The cameras of a file or a folder: a COLMAP model, `transforms.json`, or a camera path of nerfstudio.
    ///
    /// # Errors
    /// [`InputError`].
    pub fn read(path: &Path) -> Result<Self, InputError> {
        if path.is_dir() {
            return read_model(path);
        }
        let text = files::read_text(path, CHECK_THE_PATH)?;
        match camera_path::is_path(&text) {
            true => camera_path::parse_path(&text, path),
            false => parse_transforms(&text, path),
        }
    }

    /// The file that lists the images.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The frame of an image, by the rule of [`names::find`].
    ///
    /// # Errors
    /// [`NameError`].
    pub fn find(&self, image: &str) -> Result<(&Frame, Found), NameError> {
        // Only these can fit. If there is none, the message names the images that are most like it.
        let fitting = self.by_stem.get(names::stem_of(image)).map(Vec::as_slice);
        let all = || (0..self.frames.len()).collect();
        let numbers = fitting.map_or_else(all, <[usize]>::to_vec);
        let images: Vec<_> = numbers.iter().map(|k| self.frames[*k].image.to_string_lossy()).collect();
        let found = names::find(&images, image)?;
        let index = numbers[found.index];
        Ok((&self.frames[index], Found { index, ..found }))
    }

    /// The camera of a frame. `fallback` is the size of its image if the list does not give it.
    ///
    /// # Errors
    /// [`InputError`], with the image.
    pub fn camera(&self, frame: &Frame, fallback: (usize, usize)) -> Result<ListedCamera, InputError> {
        let inner = &frame.inner;
        let given = inner.w.zip(inner.h).map(|(w, h)| (w as usize, h as usize));
        let size = given.unwrap_or(fallback);
        let (w, h) = (size.0 as f64, size.1 as f64);
        let from_angle = |side: f64, angle: Option<f64>| angle.map(|a| 0.5 * side / (0.5 * a).tan());
        let fx = inner.fl_x.or_else(|| from_angle(w, inner.camera_angle_x)).unwrap_or(w);
        let fy = inner.fl_y.or_else(|| from_angle(h, inner.camera_angle_y)).unwrap_or(fx);
        let (cx, cy) = (inner.cx.unwrap_or(0.5 * w) - 0.5, inner.cy.unwrap_or(0.5 * h) - 0.5);
        let k = Matrix3::new(fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0);
        let camera = Camera::metric(k * frame.pose, false).map_err(|source| {
            InputError::content(&self.path, format!(": image \"{}\"", Quoted(&frame.image)), source)
        })?;
        let bend = |v: Option<f64>| v.unwrap_or(0.0);
        let radial = [bend(inner.k1), bend(inner.k2)];
        let tangential = [bend(inner.p1), bend(inner.p2)];
        let bent = radial.iter().chain(&tangential).any(|b| *b != 0.0);
        let lens = bent.then(|| Lens::new([fx, fy], [cx, cy], radial, tangential));
        Ok(ListedCamera { camera: lens.map_or(camera, |lens| camera.with_lens(lens)), size })
    }

    /// A frame that has no depth.
    pub fn without_depth(&self, frame: &Frame) -> InputError {
        let at = format!(": frame {} (\"{}\")", frame.id, Quoted(&frame.image));
        let reason = "it has no `depth_file_path`, and views are rendered from images with depth; give the scene \
                      [[view]] tables with `image` and `depth`";
        InputError::content(&self.path, at, reason)
    }
}
