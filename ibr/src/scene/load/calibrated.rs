//! Scenes of general cameras: 3 x 4 matrices, COLMAP models or transforms files, and depths.

use super::{Goal, Loaded, Loader, in_order};
use crate::camera::Camera;
use crate::depth::Measure;
use crate::scene::{CalibratedSource, Kind, SceneError, ViewSpec};
use nalgebra::Matrix3x4;
use rayon::prelude::*;

type Matrix = [[f64; 4]; 3];

impl Loader<'_> {
    pub(super) fn calibrated(
        &self,
        views: &[&ViewSpec],
        left_out: Option<&ViewSpec>,
        goals: &[Goal],
    ) -> Loaded<(Kind, usize)> {
        let one = |view: &&ViewSpec| {
            let others = [
                ("disparity", view.disparity.is_some()),
                ("disparity_scale", view.disparity_scale.is_some()),
                ("disparity_offset", view.disparity_offset.is_some()),
            ];
            self.no_other_kind(view, "calibrated", &others)?;
            let map = self.need(view.depth.as_deref(), view, "depth", "calibrated")?;
            let (image, depth, filled) =
                self.image_with_map(view, map, view.depth_scale.unwrap_or(1.0), Measure::Depth)?;
            let camera = self.camera_of(view, image.size())?;
            Ok((CalibratedSource { image, depth, camera }, filled))
        };
        let sources = in_order(views.par_iter().map(one).collect())?;
        let first = sources[0].0.image.size();
        let (cameras, own) = match left_out {
            Some(view) => {
                let own = self.image(&view.image)?.size();
                (vec![self.camera_of(view, own)?], own)
            }
            None => self.cameras(goals, first)?,
        };
        let size = self.size(goals, own)?;
        let filled = sources.iter().map(|s| s.1).sum();
        let views = sources.into_iter().map(|s| s.0).collect();
        Ok((Kind::Calibrated { views, cameras, size }, filled))
    }

    /// The virtual cameras, and the size of the image whose camera the first is.
    fn cameras(&self, goals: &[Goal], first: (usize, usize)) -> Loaded<(Vec<Camera>, (usize, usize))> {
        let start = |goal: &Goal| {
            let target = &goal.target;
            self.target_camera(target.camera.as_ref(), target.colmap_image.as_deref(), goal, first)
        };
        let own = match goals.first().map(start).transpose()? {
            Some((_, Some(size))) => size,
            _ => first,
        };
        let cameras = self.along(
            goals,
            |goal| Ok(start(goal)?.0),
            |goal, from, share| {
                let to = self.end_of_path(goal, first)?;
                from.towards(&to, share).map_err(|source| SceneError::Camera {
                    path: self.path.into(),
                    which: format!("the path of {}", goal.name),
                    source,
                })
            },
        )?;
        Ok((cameras, own))
    }

    fn end_of_path(&self, goal: &Goal, first: (usize, usize)) -> Loaded<Camera> {
        let (rows, image) = (goal.target.to_camera.as_ref(), goal.target.to_colmap_image.as_deref());
        if rows.is_none() && image.is_none() {
            let name = &goal.name;
            return Err(self
                .incomplete(format!("{name} needs `to_camera` or `to_colmap_image` for a path of cameras")));
        }
        Ok(self.target_camera(rows, image, goal, first)?.0)
    }

    fn matrix(&self, rows: &Matrix, which: &str) -> Loaded<Camera> {
        let matrix = Matrix3x4::from_fn(|i, j| rows[i][j]);
        Camera::metric(matrix, self.spec.mirrored).map_err(|source| SceneError::Camera {
            path: self.path.into(),
            which: which.into(),
            source,
        })
    }

    fn camera_of(&self, view: &ViewSpec, size: (usize, usize)) -> Loaded<Camera> {
        match (&view.camera, self.source_of(view)) {
            (Some(rows), _) => self.matrix(rows, &format!("view {:?}", view.label())),
            (None, Some(source)) => {
                Ok(self.listed_camera(&source, &view.image.to_string_lossy(), size)?.camera)
            }
            (None, None) => self.need(None, view, "camera", "calibrated"),
        }
    }

    /// The camera of a matrix or of a listed image, and the size of that image.
    fn target_camera(
        &self,
        rows: Option<&Matrix>,
        image: Option<&str>,
        goal: &Goal,
        first: (usize, usize),
    ) -> Loaded<(Camera, Option<(usize, usize)>)> {
        if let Some(rows) = rows {
            return Ok((self.matrix(rows, &goal.name)?, None));
        }
        match (image, self.common_source()) {
            (Some(image), Some(source)) => {
                let found = self.listed_camera(&source, image, first)?;
                Ok((found.camera, Some(found.size)))
            }
            _ => Err(self.incomplete(format!(
                "{} needs a `camera` (3 x 4), or `colmap_image` with a `colmap` folder or a `transforms` file at the top",
                goal.name
            ))),
        }
    }
}
