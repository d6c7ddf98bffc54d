//! Scenes of a rectified rig: positions and disparities.

use super::{Loaded, Loader, in_order};
use crate::depth::Measure;
use crate::scene::{Kind, RectifiedSource, TargetSpec, ViewSpec};
use rayon::prelude::*;

impl Loader<'_> {
    pub(super) fn rectified(
        &self,
        views: &[&ViewSpec],
        left_out: Option<&ViewSpec>,
        target: &TargetSpec,
    ) -> Loaded<(Kind, usize)> {
        let position = left_out.map_or(target.position, |v| v.position).ok_or_else(|| {
            self.incomplete("[virtual] needs a `position` on the line of the rectified rig")
        })?;
        let position = self.finite(position, "the virtual view")?;
        let positions = match left_out {
            Some(_) => vec![position],
            None => self.positions(position, target)?,
        };
        let one = |view: &&ViewSpec| {
            let others = [
                ("camera", view.camera.is_some()),
                ("depth", view.depth.is_some()),
                ("depth_scale", view.depth_scale.is_some()),
                ("colmap", view.colmap.is_some()),
            ];
            self.no_other_kind(view, "rectified", &others)?;
            let position = self.need(view.position, view, "position", "rectified")?;
            let position = self.finite(position, &format!("view {:?}", view.label()))?;
            let map = self.need(view.disparity.as_deref(), view, "disparity", "rectified")?;
            let (image, disparity, filled) =
                self.image_with_map(view, map, view.disparity_scale.unwrap_or(1.0), Measure::Disparity)?;
            Ok((RectifiedSource { image, disparity, position }, filled))
        };
        let sources = in_order(views.par_iter().map(one).collect())?;
        let first = sources[0].0.image.size();
        for (view, (source, _)) in views.iter().zip(&sources) {
            let (name, first_name) =
                (format!("view {:?}", view.label()), format!("view {:?}", views[0].label()));
            source.image.same_size(&name, first, &first_name)?;
        }
        let filled = sources.iter().map(|s| s.1).sum();
        Ok((Kind::Rectified { views: sources.into_iter().map(|s| s.0).collect(), positions }, filled))
    }

    /// The position, or those of the path that begins there.
    fn positions(&self, from: f64, target: &TargetSpec) -> Loaded<Vec<f64>> {
        let shares = self.shares(target)?;
        if shares.is_empty() {
            return Ok(vec![from]);
        }
        let end = target.to_position.ok_or_else(|| {
            self.incomplete("[virtual] needs `to_position` for a path on the line of the rectified rig")
        })?;
        let to = self.finite(end, "the end of the path")?;
        Ok(shares.into_iter().map(|t| from + (to - from) * t).collect())
    }
}
