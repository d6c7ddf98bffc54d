//! Scenes of general cameras: 3 x 4 matrices or COLMAP models, and depths.

use super::{Loaded, Loader, in_order};
use crate::camera::{Camera, colmap};
use crate::depth::Measure;
use crate::scene::{CalibratedSource, Kind, SceneError, TargetSpec, ViewSpec};
use nalgebra::Matrix3x4;
use rayon::prelude::*;
use std::path::{Path, PathBuf};

impl Loader<'_> {
    pub(super) fn calibrated(
        &self,
        views: &[&ViewSpec],
        left_out: Option<&ViewSpec>,
        target: &TargetSpec,
    ) -> Loaded<(Kind, usize)> {
        let one = |view: &&ViewSpec| {
            let others = [
                ("disparity", view.disparity.is_some()),
                ("disparity_scale", view.disparity_scale.is_some()),
                ("disparity_offset", view.disparity_offset.is_some()),
            ];
            self.no_other_kind(view, "calibrated", &others)?;
            let camera = self.camera_of(view)?;
            let map = self.need(view.depth.as_deref(), view, "depth", "calibrated")?;
            let (image, depth, filled) =
                self.image_with_map(view, map, view.depth_scale.unwrap_or(1.0), Measure::Depth)?;
            Ok((CalibratedSource { image, depth, camera }, filled))
        };
        let sources = in_order(views.par_iter().map(one).collect())?;
        let first = sources[0].0.image.size();
        let (camera, own) = match left_out {
            Some(view) => (self.camera_of(view)?, Some(self.image(&view.image)?.size())),
            None => self.target_camera(target)?,
        };
        let size = self.size(target, own.unwrap_or(first))?;
        let filled = sources.iter().map(|s| s.1).sum();
        let views = sources.into_iter().map(|s| s.0).collect();
        let cameras = if left_out.is_some() { vec![camera] } else { self.cameras(camera, target)? };
        Ok((Kind::Calibrated { views, cameras, size }, filled))
    }

    /// The camera, or those of the path that begins there.
    fn cameras(&self, from: Camera, target: &TargetSpec) -> Loaded<Vec<Camera>> {
        let shares = self.shares(target)?;
        if shares.is_empty() {
            return Ok(vec![from]);
        }
        let end = TargetSpec {
            camera: target.to_camera,
            colmap_image: target.to_colmap_image.clone(),
            ..TargetSpec::default()
        };
        if !(end.camera.is_some() || end.colmap_image.is_some()) {
            return Err(
                self.incomplete("[virtual] needs `to_camera` or `to_colmap_image` for a path of cameras")
            );
        }
        let (to, _) = self.target_camera(&end)?;
        let on_the_way = |t: f64| {
            from.towards(&to, t).map_err(|source| SceneError::Camera {
                path: self.path.into(),
                which: "the path of [virtual]".into(),
                source,
            })
        };
        shares.into_iter().map(on_the_way).collect()
    }

    fn matrix(&self, rows: &[[f64; 4]; 3], which: &str) -> Loaded<Camera> {
        let matrix = Matrix3x4::from_fn(|i, j| rows[i][j]);
        Camera::metric(matrix, self.spec.mirrored).map_err(|source| SceneError::Camera {
            path: self.path.into(),
            which: which.into(),
            source,
        })
    }

    pub(super) fn model_of(&self, view: &ViewSpec) -> Option<PathBuf> {
        view.colmap.as_ref().or(self.spec.colmap.as_ref()).map(|folder| self.file(folder))
    }

    fn camera_of(&self, view: &ViewSpec) -> Loaded<Camera> {
        match (&view.camera, self.model_of(view)) {
            (Some(rows), _) => self.matrix(rows, &format!("view {:?}", view.label())),
            (None, Some(folder)) => Ok(self.model_camera(&folder, &view.image.to_string_lossy())?.camera),
            (None, None) => self.need(None, view, "camera", "calibrated"),
        }
    }

    /// The camera of an image in a COLMAP model: by its path, or by the path's last part.
    fn model_camera(&self, folder: &Path, image: &str) -> Loaded<colmap::ModelCamera> {
        let model = colmap::read_model(folder)?;
        let last = |name: &str| name.rsplit('/').next().unwrap_or(name).to_string();
        let named = model
            .get(image)
            .or_else(|| model.iter().find(|(name, _)| last(name) == last(image)).map(|(_, camera)| camera));
        named.copied().ok_or_else(|| {
            let reason = format!("{}: the model has no image {image:?}", folder.display());
            self.incomplete(reason)
        })
    }

    fn target_camera(&self, target: &TargetSpec) -> Loaded<(Camera, Option<(usize, usize)>)> {
        if let Some(rows) = &target.camera {
            return Ok((self.matrix(rows, "[virtual]")?, None));
        }
        match (&target.colmap_image, &self.spec.colmap) {
            (Some(image), Some(folder)) => {
                let found = self.model_camera(&self.file(folder), image)?;
                Ok((found.camera, Some(found.size)))
            }
            _ => Err(self.incomplete(
                "[virtual] needs a `camera` (3 x 4), or `colmap_image` with a `colmap` folder at the top",
            )),
        }
    }
}
