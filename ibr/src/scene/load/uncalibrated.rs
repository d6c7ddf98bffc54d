//! Scenes without cameras: images and tracks.

use super::{Loaded, Loader, in_order};
use crate::image::read_image;
use crate::pipeline::uncalibrated::Target;
use crate::scene::{Kind, SceneError, TargetSpec, ViewSpec};
use crate::uncalibrated::Point;
use crate::uncalibrated::tracks::Tracks;
use rayon::prelude::*;
use std::path::Path;

impl Loader<'_> {
    pub(super) fn uncalibrated(
        &self,
        views: &[&ViewSpec],
        left_out: Option<&ViewSpec>,
        target: &TargetSpec,
    ) -> Loaded<Kind> {
        let file = self.matches_file(views, target)?;
        let tracks = Tracks::read(&self.file(file))?;
        let wanted = match left_out {
            Some(view) => Some(self.column_in_order(view)?),
            None => target.from_tracks,
        };
        let columns = self.columns(views, wanted, tracks.columns())?;
        let images = in_order(
            views.par_iter().map(|v| read_image(&self.file(&v.image)).map_err(SceneError::from)).collect(),
        )?;
        let pick = |row: &Vec<Option<Point>>| columns.iter().map(|c| row[c - 1]).collect();
        let goal = match (wanted, target.between) {
            (Some(column), _) => Target::Tracks(tracks.rows().iter().map(|row| row[column - 1]).collect()),
            (None, Some(between)) => Target::Between(between),
            (None, None) => {
                let reason =
                    "[virtual] needs `from_tracks` (a column of the tracks, from 1) or `between` (0 to 1)";
                return Err(self.incomplete(reason));
            }
        };
        let own = match left_out {
            Some(view) => read_image(&self.file(&view.image))?.size(),
            None => images[0].size(),
        };
        let size = self.size(target, own)?;
        let tracks = tracks.rows().iter().map(pick).collect();
        Ok(Kind::Uncalibrated { images, tracks, target: goal, size })
    }

    /// The file of tracks, if the views are two or more and say nothing of cameras.
    fn matches_file<'a>(&'a self, views: &[&ViewSpec], target: &'a TargetSpec) -> Loaded<&'a Path> {
        let file = self.spec.matches.as_deref().or(target.matches.as_deref()).ok_or_else(|| {
            self.incomplete(
                "the views have neither `position` and `disparity`, nor `camera` and `depth`, and there is no `matches` file: say where the cameras are or give tracks",
            )
        })?;
        for view in views {
            let others = [
                ("disparity", view.disparity.is_some()),
                ("depth", view.depth.is_some()),
                ("step", view.step.is_some()),
            ];
            self.no_other_kind(view, "matches-only", &others)?;
        }
        match views.len() {
            0 | 1 => {
                Err(self.incomplete(format!("{} view with tracks: at least two are needed", views.len())))
            }
            _ => Ok(file),
        }
    }

    /// Column of a view that is left out: its own, or its place among all views.
    fn column_in_order(&self, view: &ViewSpec) -> Loaded<usize> {
        let place = self.spec.view.iter().position(|v| v.label() == view.label());
        view.column.or(place.map(|p| p + 1)).ok_or_else(|| self.incomplete("a view without a column"))
    }

    /// Columns of the views: as they say, or in order with those passed over that are wanted or said by others.
    fn columns(&self, views: &[&ViewSpec], wanted: Option<usize>, there: usize) -> Loaded<Vec<usize>> {
        let said: Vec<usize> = views.iter().filter_map(|v| v.column).chain(wanted).collect();
        let mut free = (1..=there).filter(|c| !said.contains(c));
        let columns: Vec<usize> = views.iter().filter_map(|v| v.column.or_else(|| free.next())).collect();
        let different = said.iter().enumerate().all(|(i, c)| !said[..i].contains(c));
        let known = said.iter().all(|c| (1..=there).contains(c));
        if different && known && columns.len() == views.len() {
            return Ok(columns);
        }
        let reason = format!(
            "the tracks have {there} columns, numbered from 1; {} views{} do not fit, each needs a column of its own",
            views.len(),
            wanted.map_or(String::new(), |w| format!(" and the wanted column {w}"))
        );
        Err(self.incomplete(reason))
    }
}
