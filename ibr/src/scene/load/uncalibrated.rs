//! Scenes without cameras: images and tracks.

use super::{Loaded, Loader, in_order};
use crate::pipeline::uncalibrated::Target;
use crate::scene::{Kind, TargetSpec, ViewSpec};
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
        if left_out.is_none() && !self.shares(target)?.is_empty() {
            return Err(
                self.incomplete("a path needs cameras or positions; a scene of tracks alone has one view")
            );
        }
        let tracks = Tracks::read(&self.file(file))?;
        let virtual_column = match left_out {
            Some(view) => Some(self.column_in_order(view)?),
            None => target.from_tracks,
        };
        let columns = self.columns(views, virtual_column, tracks.columns())?;
        let images = in_order(views.par_iter().map(|v| self.image(&v.image)).collect())?;
        let pick = |row: &Vec<Option<Point>>| columns.iter().map(|c| row[c - 1]).collect();
        let goal = match (virtual_column, target.between) {
            (Some(column), _) => Target::Tracks(tracks.rows().iter().map(|row| row[column - 1]).collect()),
            (None, Some(between)) => Target::Between(between),
            (None, None) => {
                let reason =
                    "[virtual] needs `from_tracks` (a column of the tracks, from 1) or `between` (0 to 1)";
                return Err(self.incomplete(reason));
            }
        };
        let own = match left_out {
            Some(view) => self.image(&view.image)?.size(),
            None => images[0].size(),
        };
        let size = self.size(target, own)?;
        let tracks = tracks.rows().iter().map(pick).collect();
        Ok(Kind::Uncalibrated { images, tracks, target: goal, size })
    }

    /// The file of tracks, if there are at least two views and none has camera keys.
    fn matches_file<'a>(&'a self, views: &[&ViewSpec], target: &'a TargetSpec) -> Loaded<&'a Path> {
        let file = self.spec.matches.as_deref().or(target.matches.as_deref()).ok_or_else(|| {
            self.incomplete(
                "the views have neither `position` and `disparity`, nor `camera` and `depth`, and there is no `matches` file; give cameras or tracks",
            )
        })?;
        for view in views {
            let others = [
                ("disparity", view.disparity.is_some()),
                ("disparity_offset", view.disparity_offset.is_some()),
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

    /// Column of the view that is left out: its `column`, or its index among all views.
    fn column_in_order(&self, view: &ViewSpec) -> Loaded<usize> {
        let index = self.spec.view.iter().position(|v| v.label() == view.label());
        view.column.or(index.map(|i| i + 1)).ok_or_else(|| self.incomplete("a view without a column"))
    }

    /// Columns of the views: their `column`, or the remaining columns in order.
    fn columns(
        &self,
        views: &[&ViewSpec],
        virtual_column: Option<usize>,
        count: usize,
    ) -> Loaded<Vec<usize>> {
        let given: Vec<usize> = views.iter().filter_map(|v| v.column).chain(virtual_column).collect();
        let mut free = (1..=count).filter(|c| !given.contains(c));
        let columns: Vec<usize> = views.iter().filter_map(|v| v.column.or_else(|| free.next())).collect();
        let different = given.iter().enumerate().all(|(i, c)| !given[..i].contains(c));
        let known = given.iter().all(|c| (1..=count).contains(c));
        if different && known && columns.len() == views.len() {
            return Ok(columns);
        }
        let reason = format!(
            "the tracks have {count} columns, numbered from 1; {} views{} do not fit, each needs a column of its own",
            views.len(),
            virtual_column.map_or(String::new(), |w| format!(" and the virtual view's column {w}"))
        );
        Err(self.incomplete(reason))
    }
}
