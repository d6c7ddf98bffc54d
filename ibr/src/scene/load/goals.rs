//! The virtual views of a scene: one, a list, or paths.

use super::{Loaded, Loader};
use crate::files::InputError;
use crate::scene::spec::SceneKind;
use crate::scene::{TargetSpec, ViewSpec};

/// Most virtual views of a scene.
pub const MOST_FRAMES: usize = 9999;

/// One `[virtual]` table.
pub(super) struct Goal {
    pub(super) target: TargetSpec,
    /// How messages call it.
    pub(super) name: String,
}

impl Loader<'_> {
    /// The tables, at least one.
    pub(super) fn goals(&self) -> Loaded<Vec<Goal>> {
        if self.spec.frames() > MOST_FRAMES {
            return Err(self.incomplete(format!(
                "the scene has more than {MOST_FRAMES} virtual views; render them in parts"
            )));
        }
        let none = [TargetSpec::default()];
        let targets = if self.spec.targets.is_empty() { &none } else { self.spec.targets.as_slice() };
        let goal = |(k, target): (usize, &TargetSpec)| {
            let name = match targets.len() {
                1 => "[virtual]".into(),
                _ => format!("[[virtual]] number {}", k + 1),
            };
            Goal { target: target.clone(), name }
        };
        Ok(targets.iter().enumerate().map(goal).collect())
    }

    /// Refuses keys of another kind of scene than this, and two keys for one thing, instead of ignoring one.
    pub(super) fn keys_of(&self, views: &[&ViewSpec], goals: &[Goal], kind: SceneKind) -> Loaded<()> {
        self.keys_of_table("the top of the file", kind, self.spec)?;
        for view in views {
            self.keys_of_table(&view.named(), kind, view)?;
        }
        goals.iter().try_for_each(|Goal { target, name }| {
            let given = self.keys_of_table(name, kind, target)?;
            match TargetSpec::EITHER.iter().find(|pair| pair.iter().all(|key| given.contains_key(*key))) {
                Some([one, other]) => Err(self.incomplete(format!(
                    "{name} has both `{one}` and `{other}`; remove the one that is not meant"
                ))),
                None => Ok(()),
            }
        })
    }

    /// The virtual views of all tables: `start` gives the view of a table, `on_the_way` that at a share of
    /// its path.
    pub(super) fn along<T>(
        &self,
        goals: &[Goal],
        start: impl Fn(&Goal) -> Loaded<T>,
        on_the_way: impl Fn(&Goal, &T, f64) -> Loaded<T>,
    ) -> Loaded<Vec<T>> {
        let mut all = Vec::new();
        for goal in goals {
            let (first, shares) = (start(goal)?, self.shares(goal)?);
            if shares.is_empty() {
                all.push(first);
                continue;
            }
            for share in shares {
                all.push(on_the_way(goal, &first, share)?);
            }
        }
        Ok(all)
    }

    /// Shares of the way at which the views of a path lie; none if there is no path.
    fn shares(&self, goal: &Goal) -> Loaded<Vec<f64>> {
        let Goal { target, name } = goal;
        match (target.frames, target.has_end()) {
            (None, false) => Ok(Vec::new()),
            (Some(frames), true) if (2..=MOST_FRAMES).contains(&frames) => {
                Ok((0..frames).map(|k| k as f64 / (frames - 1) as f64).collect())
            }
            (Some(frames), true) => {
                Err(self.incomplete(format!("{name} frames = {frames}: a path has 2 to {MOST_FRAMES} views")))
            }
            (Some(_), false) => Err(self.incomplete(format!(
                "{name} has `frames` but no end of the path: `to_position`, `to_camera`, `to_camera_of` or `to_between`"
            ))),
            (None, true) => Err(
                self.incomplete(format!("{name} has the end of a path; say with `frames` how many views it has"))
            ),
        }
    }

    /// What the tables say of all views, from those that say it.
    fn common<T: PartialEq + Copy>(
        &self,
        goals: &[Goal],
        key: &str,
        of: impl Fn(&TargetSpec) -> Option<T>,
    ) -> Loaded<Option<T>> {
        let mut said = goals.iter().filter_map(|goal| Some((goal, of(&goal.target)?)));
        let Some((_, first)) = said.next() else { return Ok(None) };
        match said.find(|(_, other)| *other != first) {
            Some((goal, _)) => Err(self.incomplete(format!(
                "{} has another `{key}` than the virtual views before it; all of a scene have one",
                goal.name
            ))),
            None => Ok(Some(first)),
        }
    }

    /// The registration offset of the virtual views in pixels.
    pub(super) fn offset(&self, goals: &[Goal]) -> Loaded<f64> {
        Ok(self.common(goals, "offset", |target| target.offset)?.unwrap_or(0.0))
    }

    /// The size of the virtual views: that of the scene, or the default.
    pub(super) fn size(&self, goals: &[Goal], own: (usize, usize)) -> Loaded<(usize, usize)> {
        let (w, h) = self.common(goals, "size", |target| target.size)?.map_or(own, |[w, h]| (w, h));
        let pixels = w.saturating_mul(h);
        let refused = |reason: String| -> InputError {
            self.incomplete(format!("the virtual view has {w} x {h} pixels: {reason}"))
        };
        if pixels == 0 {
            return Err(refused("both sides of its size must be at least one pixel".into()));
        }
        if pixels > self.options.max_pixels {
            let most = self.options.max_pixels;
            return Err(refused(format!(
                "more than the limit of {most}; make it smaller, or allow so many with --max-pixels"
            )));
        }
        Ok((w, h))
    }
}
