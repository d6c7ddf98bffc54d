//! `hybank-ibr place`: the views of a scene from which the virtual view has the least predicted error.

use super::arguments::PlaceArguments;
use super::failure::{Failure, failed, usage};
use super::progress::Progress;
use super::{inputs, output};
use crate::analysis::{Choice, Predicted, Predictor};
use crate::image::{Image, quality};
use crate::pipeline::{Agreement, RenderError};
use crate::propagate::View;
use crate::scene::{Kind, Scene, SourceView};
use hybank_core::messages::{Quoted, counted};
use serde::Serialize;

/// Error of a virtual view of which a set of views shows nothing: the range of intensities.
const NOTHING_SHOWN: f64 = 255.0;

pub(super) fn run(arguments: &PlaceArguments) -> Result<(), Failure> {
    arguments.scene.check()?;
    if arguments.choose == 0 {
        return usage("--choose 0: at least one view must be chosen");
    }
    let progress = Progress::new(3);
    progress.step("reading");
    let source = arguments.scene.source()?;
    let scene = arguments.scene.load(&source, true, &|share| progress.within(share))?;
    arguments.scene.refuse_what_has_no_prediction(&scene)?;
    if arguments.choose > scene.names.len() {
        let (choose, views) = (arguments.choose, scene.names.len());
        let views = counted(views, "view");
        return usage(format!("--choose {choose}: the scene has {views} to choose from"));
    }
    let truth = arguments.scene.truth()?;
    let job = Job { arguments, scene: &scene, truth, progress };
    match &scene.kind {
        Kind::Rectified { views, positions } => job.choose(views, positions, views[0].image.size()),
        Kind::Calibrated { views, cameras, size } => job.choose(views, cameras, *size),
        Kind::Uncalibrated { .. } => Err(failed(RenderError::NoViews)),
    }
}

/// What was asked for and read.
struct Job<'a> {
    arguments: &'a PlaceArguments,
    scene: &'a Scene,
    truth: Option<Image>,
    progress: Progress,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Summary {
    chosen: Set,
    /// As many views at even distances in the list.
    even: Set,
    all: Set,
    /// Sets of so many views that were tried, and whether these are all.
    tried: usize,
    exhaustive: bool,
    /// Views that were left out in turn to calibrate the estimates; 0 if typical weights were used.
    calibrated_on: usize,
    /// Whether the views fit each other; null if there is nothing to compare.
    inputs_agree: Option<bool>,
}

/// Some views, and the mean absolute error of the virtual views from them in grey levels.
#[derive(Serialize)]
struct Set {
    /// By number from 0.
    views: Vec<usize>,
    names: Vec<String>,
    estimate: f64,
    /// The error against --truth.
    measured: Option<f64>,
}

impl Job<'_> {
    fn choose<P: Predicted>(
        self,
        sources: &[SourceView<P>],
        cameras: &[P],
        size: (usize, usize),
    ) -> Result<(), Failure> {
        let named = |e: RenderError| failed(e).in_file(&self.arguments.scene.file);
        let settings = self.arguments.scene.settings(self.scene.offset);
        let sources: Vec<_> = sources.iter().map(SourceView::view).collect();
        self.progress.step("calibrating");
        let predictor = Predictor::new(&sources, &settings).map_err(named)?;
        let views = predictor.views();
        self.progress.step("choosing");
        let estimate = |some: &[View<'_, P>], camera| predictor.estimate_from(some, camera, size);
        let frames = cameras.len() as f64;
        // What no view shows is an error, as it is of `bound`.
        let all = cameras.iter().map(|camera| estimate(&views, camera)).sum::<Result<f64, RenderError>>();
        let all = all.map_err(named)? / frames;
        let mean = |chosen: &[usize]| {
            let some = selected(&views, chosen);
            let of_frame = |camera| match estimate(&some, camera) {
                Err(RenderError::NoOverlap { .. }) => Ok(NOTHING_SHOWN),
                other => other,
            };
            Ok::<f64, RenderError>(cameras.iter().map(of_frame).sum::<Result<f64, RenderError>>()? / frames)
        };
        let count = self.arguments.choose;
        let watch = |share| self.progress.within(share);
        let choice = Choice::least(views.len(), count, mean, &watch).map_err(named)?;
        let Some(choice) = choice else { return Err(failed(RenderError::NoViews)) };
        let set = |chosen: Vec<usize>, estimate: f64| {
            let some = selected(&sources, &chosen);
            let render = || cameras[0].render(&some, size, &settings).map_err(named);
            Ok::<Set, Failure>(Set {
                names: selected(&self.scene.names, &chosen),
                estimate,
                measured: self.measured(|| Ok(render()?.image))?,
                views: chosen,
            })
        };
        let even = evenly(views.len(), count);
        let of_even = mean(&even).map_err(named)?;
        let summary = Summary {
            chosen: set(choice.views, choice.error)?,
            even: set(even, of_even)?,
            all: set((0..views.len()).collect(), all)?,
            tried: choice.tried,
            exhaustive: choice.is_exhaustive,
            calibrated_on: predictor.calibration().views,
            inputs_agree: predictor.agreement().worst().map(|pair| !pair.is_poor()),
        };
        drop(self.progress);
        inputs::warn_of_contradictions(predictor.agreement(), &self.scene.kind);
        output::report(self.arguments.scene.json, &summary, || summary.text(predictor.agreement()), None)
    }

    /// The error of a rendered view against the photograph, if there is one.
    fn measured(&self, render: impl Fn() -> Result<Image, Failure>) -> Result<Option<f64>, Failure> {
        let (Some(truth), Some(path)) = (&self.truth, &self.arguments.scene.truth) else { return Ok(None) };
        let compared = quality::compare(&render()?, truth, None);
        let found = compared.map_err(|e| Failure::Input(format!("{}: {e}", Quoted(path))))?;
        Ok(found.map(|quality| quality.mae))
    }
}

fn selected<T: Clone>(all: &[T], numbers: &[usize]) -> Vec<T> {
    numbers.iter().map(|number| all[*number].clone()).collect()
}

/// The numbers of `count` out of `all` views at even distances, with the first and the last of them; one
/// alone is in the middle.
fn evenly(all: usize, count: usize) -> Vec<usize> {
    match count {
        1 => vec![(all - 1) / 2],
        _ => (0..count).map(|k| (2 * k * (all - 1) + count - 1) / (2 * (count - 1))).collect(),
    }
}

impl Summary {
    fn text(&self, agreement: &Agreement) -> String {
        let (tried, views) = (counted(self.tried, "set"), counted(self.chosen.views.len(), "view"));
        let mut lines = vec![
            format!("chosen    {}, from {}", self.chosen.error(), self.chosen.names.join(", ")),
            format!("even      {}, from {}", self.even.error(), self.even.names.join(", ")),
            format!("all       {}, from {}", self.all.error(), counted(self.all.views.len(), "view")),
            match self.exhaustive {
                true => format!("searched  all {tried} of {views}"),
                false => format!("searched  {tried} of {views}, by greedy choices and exchanges"),
            },
            inputs::weights_line(self.calibrated_on),
        ];
        lines.extend(inputs::line(agreement));
        lines.join("\n") + "\n"
    }
}

impl Set {
    fn error(&self) -> String {
        let measured = self.measured.map(|measured| format!(" (measured {measured:.2})"));
        format!("{:.2}{} grey levels", self.estimate, measured.unwrap_or_default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn even_views_reach_both_ends() {
        assert_eq!(evenly(5, 3), [0, 2, 4]);
        assert_eq!(evenly(6, 4), [0, 2, 3, 5]);
        assert_eq!((evenly(6, 1), evenly(2, 2), evenly(1, 1)), (vec![2], vec![0, 1], vec![0]));
    }
}
