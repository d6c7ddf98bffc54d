//! Scenes of a rectified rig: positions and disparities.

use super::{Goal, Inputs, Loaded, Loader, each};
use crate::depth::Measure;
use crate::scene::spec::SceneKind;
use crate::scene::{Kind, SourceView, ViewSpec};
use hybank_core::messages::Quoted;
use std::path::Path;

impl Loader<'_> {
    pub(super) fn rectified(
        &self,
        views: &[&ViewSpec],
        left_out: Option<&ViewSpec>,
        goals: &[Goal],
    ) -> Loaded<Inputs> {
        self.keys_of(views, goals, SceneKind::Rectified)?;
        let positions = match left_out {
            Some(view) => vec![self.virtual_position(view.position, "[virtual]")?],
            None => self.positions(goals)?,
        };
        let one = |view: &&ViewSpec| {
            let position = self.need(view.position, view, "position", SceneKind::Rectified)?;
            let position = self.finite(position, &view.named())?;
            let no_points = || {
                let map = view.disparity.as_deref().unwrap_or(Path::new(""));
                self.incomplete(format!(
                    "{} has disparity = \"{}\", points of a world, which a rectified rig does not have; give it a map or \"matched\"",
                    view.named(),
                    Quoted(map)
                ))
            };
            self.read(view, Measure::Disparity, |_| Ok(position), |_, _, _| Err(no_points()))
        };
        let sources = each(views, one)?;
        let first = sources[0].image.size();
        for (view, source) in views.iter().zip(&sources) {
            source.image.same_size(&view.named(), first, &views[0].named())?;
        }
        self.no_other_size(goals, first)?;
        let is_matched = views.iter().any(|view| !view.is_stored());
        let (views, hidden) = self.whole(views, sources, Measure::Disparity)?;
        let notes = note_of_exchange(&views).filter(|_| is_matched).into_iter().collect();
        let numbers = (0..views.len()).collect();
        Ok(Inputs { kind: Kind::Rectified { views, positions }, numbers, hidden, notes })
    }

    /// A rectified virtual view is as large as the views.
    fn no_other_size(&self, goals: &[Goal], views: (usize, usize)) -> Loaded<()> {
        let (width, height) = self.size(goals, views)?;
        if (width, height) == views {
            return Ok(());
        }
        Err(self.incomplete(format!(
            "the virtual view has `size` = [{width}, {height}], but that of a rectified scene has the size of its views, {} x {} pixels; remove `size`",
            views.0, views.1
        )))
    }

    fn virtual_position(&self, position: Option<f64>, goal: &str) -> Loaded<f64> {
        let position = position.ok_or_else(|| {
            self.incomplete(format!("{goal} needs a `position` on the line of the rectified rig"))
        })?;
        self.finite(position, "the virtual view")
    }

    /// The positions, with those of the paths that begin there.
    fn positions(&self, goals: &[Goal]) -> Loaded<Vec<f64>> {
        let start = |goal: &Goal| self.virtual_position(goal.target.position, &goal.name);
        self.along(goals, start, |goal, from, share| {
            let end = goal.target.to_position.ok_or_else(|| {
                let name = &goal.name;
                self.incomplete(format!(
                    "{name} needs `to_position` for a path on the line of the rectified rig"
                ))
            })?;
            Ok(from + (self.finite(end, "the end of the path")? - from) * share)
        })
    }
}

/// That photographs seem to be exchanged: nearly all disparities are negative.
fn note_of_exchange(views: &[SourceView<f64>]) -> Option<String> {
    let is_negative = |view: &SourceView<f64>| {
        let negative = view.map.data().iter().filter(|v| **v < 0.0).count();
        negative as f64 > 0.9 * view.map.data().len() as f64
    };
    views.iter().all(is_negative).then(|| {
        "nearly all disparities are negative, as if the photographs were exchanged; exchange their positions".into()
    })
}
