//! Scenes without cameras: images and tracks.

use super::{Goal, Inputs, Loaded, Loader, each};
use crate::pipeline::uncalibrated::Target;
use crate::scene::spec::SceneKind;
use crate::scene::{Kind, ViewSpec};
use crate::uncalibrated::Point;
use crate::uncalibrated::tracks::Tracks;
use std::collections::BTreeSet;
use std::path::Path;

impl Loader<'_> {
    pub(super) fn uncalibrated(
        &self,
        views: &[&ViewSpec],
        left_out: Option<(usize, &ViewSpec)>,
        goals: &[Goal],
    ) -> Loaded<Inputs> {
        let file = self.matches_file(views)?;
        self.keys_of(views, goals, SceneKind::MatchesOnly)?;
        let tracks = Tracks::read(&self.file(file))?;
        let virtual_columns = match left_out {
            Some((index, view)) => vec![view.column.unwrap_or(index + 1)],
            None => goals.iter().filter_map(|goal| goal.target.from_tracks).collect(),
        };
        let columns = self.columns(views, &virtual_columns, tracks.columns())?;
        let images = each(views, |view| self.image(&view.image))?;
        let pick = |row: &Vec<Option<Point>>| columns.iter().map(|c| row[c - 1]).collect();
        let in_column =
            |column: usize| Target::Tracks(tracks.rows().iter().map(|row| row[column - 1]).collect());
        let targets = match left_out {
            Some(_) => virtual_columns.into_iter().map(in_column).collect(),
            None => self.targets(goals, in_column)?,
        };
        let own = match left_out {
            Some((_, view)) => self.image(&view.image)?.size(),
            None => images[0].size(),
        };
        let size = self.size(goals, own)?;
        let tracks = tracks.rows().iter().map(pick).collect();
        let kind = Kind::Uncalibrated { images, tracks, targets, size };
        Ok(Inputs { kind, numbers: (0..views.len()).collect(), hidden: Vec::new(), notes: Vec::new() })
    }

    /// What the goals ask for; `in_column` gives the positions in a column of the tracks.
    fn targets(&self, goals: &[Goal], in_column: impl Fn(usize) -> Target) -> Loaded<Vec<Target>> {
        let start = |goal: &Goal| match (goal.target.from_tracks, goal.target.between) {
            (Some(column), _) => Ok(in_column(column)),
            (None, Some(between)) => Ok(Target::Between(between)),
            (None, None) => Err(self.incomplete(format!(
                "{} needs `from_tracks` (a column of the tracks, from 1) or `between` (0 to 1)",
                goal.name
            ))),
        };
        self.along(goals, start, |goal, from, share| match (from, goal.target.to_between) {
            (Target::Between(from), Some(to)) => Ok(Target::Between(from + (to - from) * share)),
            _ => Err(self.incomplete(format!(
                "{} has the end of a path; in a scene of tracks alone a path goes from `between` to `to_between`",
                goal.name
            ))),
        })
    }

    /// The file of tracks, if there are at least two views.
    fn matches_file(&self, views: &[&ViewSpec]) -> Loaded<&Path> {
        let file = self.spec.matches.as_deref().ok_or_else(|| {
            self.incomplete(
                "the views have neither `position` and `disparity`, nor `camera` and `depth`, and there is no `matches` file; give cameras or tracks",
            )
        })?;
        match views.len() {
            0 | 1 => {
                Err(self.incomplete(format!("{} view with tracks: at least two are needed", views.len())))
            }
            _ => Ok(file),
        }
    }

    /// Columns of the views: their `column`, or the remaining columns in order.
    fn columns(&self, views: &[&ViewSpec], virtual_columns: &[usize], count: usize) -> Loaded<Vec<usize>> {
        let given: Vec<usize> =
            views.iter().filter_map(|v| v.column).chain(virtual_columns.iter().copied()).collect();
        let different: BTreeSet<usize> = given.iter().copied().collect();
        let mut free = (1..=count).filter(|c| !different.contains(c));
        let columns: Vec<usize> = views.iter().filter_map(|v| v.column.or_else(|| free.next())).collect();
        let known = given.iter().all(|c| (1..=count).contains(c));
        if different.len() == given.len() && known && columns.len() == views.len() {
            return Ok(columns);
        }
        let and = match virtual_columns {
            [] => String::new(),
            [one] => format!(" and the virtual view's column {one}"),
            many => format!(" and the virtual views' columns {many:?}"),
        };
        let reason = format!(
            "the tracks have {count} columns, numbered from 1; {} views{and} do not fit, each needs a column of its own",
            views.len(),
        );
        Err(self.incomplete(reason))
    }
}
