//! `hybank-ibr bound`: the error of the virtual views, predicted from the inputs alone.

mod chart;
mod files;
mod report;

use super::arguments::BoundArguments;
use super::failure::Failure;
use super::inputs;
use super::output;
use super::progress::Progress;
use crate::analysis::{Advice, Limits, Predicted, Predictor, ViewError};
use crate::image::Image;
use crate::pipeline::{RenderError, Watch};
use crate::scene::{self, Kind, Scene, SourceView};
use files::Outputs;
use hybank::messages::Quoted;
use report::{Frames, Summary};
use std::path::Path;

pub(super) fn run(arguments: &BoundArguments) -> Result<(), Failure> {
    let limits = check(arguments)?;
    let progress = Progress::new(3);
    progress.step("reading");
    let (scene, truth) = read(arguments, &|share| progress.within(share))?;
    progress.step("calibrating");
    let job = Job { arguments, scene: &scene, limits, truth, progress };
    match &scene.kind {
        Kind::Rectified { views, positions } => job.predict(views, positions, views[0].image.size()),
        Kind::Calibrated { views, cameras, size } => job.predict(views, cameras, *size),
        Kind::Uncalibrated { .. } => Err(Failure::input(RenderError::NoViews)),
    }
}

/// What was asked for and read.
struct Job<'a> {
    arguments: &'a BoundArguments,
    scene: &'a Scene,
    limits: Option<Limits>,
    truth: Option<Image>,
    progress: Progress,
}

impl Job<'_> {
    /// Predicts the views of `cameras`, writes their files and prints the report.
    fn predict<P: Predicted>(
        self,
        views: &[SourceView<P>],
        cameras: &[P],
        size: (usize, usize),
    ) -> Result<(), Failure> {
        let Self { arguments, scene, limits, truth, progress } = self;
        let named = |e: RenderError| Failure::input(e).in_file(&arguments.scene.file);
        let views: Vec<_> = views.iter().map(SourceView::view).collect();
        let predictor = Predictor::new(&views, &arguments.scene.settings(scene.offset)).map_err(named)?;
        progress.step("predicting");
        let (mut summaries, mut written) = (Vec::new(), Vec::new());
        let mut worst: Option<(usize, f64, ViewError)> = None;
        for (frame, camera) in cameras.iter().enumerate() {
            let predicted = predictor.at(camera, size, limits.as_ref()).map_err(named)?;
            let mut summary = Summary::new(&predicted, predictor.agreement(), &scene.outliers);
            summary.measure(&predicted, truth.as_ref(), arguments.scene.truth.as_deref())?;
            let outputs = Outputs::of(arguments, (cameras.len() > 1).then_some(frame));
            let (encoded, white) = outputs.encoded(&predicted, truth.as_ref())?;
            summary.white = white;
            written.extend(output::begin(&encoded, arguments.scene.force)?);
            summaries.push(summary);
            let estimate = predicted.totals().estimate;
            if worst.as_ref().is_none_or(|(_, largest, _)| estimate > *largest) {
                worst = Some((frame, estimate, predicted));
            }
            progress.within((frame + 1) as f64 / (cameras.len() + 1) as f64);
        }
        let Some((worst, _, now)) = worst else { return Err(Failure::input(RenderError::NoViews)) };
        summaries[worst].advice = Some(Advice::on(&predictor, &cameras[worst], size, &now).map_err(named)?);
        let written = output::commit(written)?;
        drop(progress);
        inputs::warn_of_contradictions(predictor.agreement(), &scene.kind);
        let printed = Frames { summaries, worst }.print(predictor.agreement(), arguments.scene.json);
        printed.map_err(|failure| failure.after_writing(&written))
    }
}

/// Checks that need no file, and the limits for a sure bound.
fn check(arguments: &BoundArguments) -> Result<Option<Limits>, Failure> {
    arguments.scene.check()?;
    let outputs = Outputs::of(arguments, None);
    outputs.check()?;
    output::refuse_overlaps(&outputs.files(), &arguments.scene.inputs())?;
    outputs.refuse_existing(arguments.scene.force)?;
    let limit = |name: &str, value: f64| match value.is_finite() && value >= 0.0 {
        true => Ok(value),
        false => Err(Failure::Usage(format!("{name} {value}: it must be a number that is not negative"))),
    };
    let Some(curvature) = arguments.curvature else { return Ok(None) };
    Ok(Some(Limits {
        curvature: limit("--curvature", curvature)?,
        intensity: limit("--intensity-error", arguments.intensity_error)?,
        disparity: limit("--disparity-error", arguments.disparity_error)?,
    }))
}

fn read(arguments: &BoundArguments, watch: Watch<'_>) -> Result<(Scene, Option<Image>), Failure> {
    let source = arguments.scene.source()?;
    let scene = arguments.scene.load(&source, true, watch)?;
    refuse_what_has_no_prediction(&scene, arguments)?;
    let frames = scene.kind.frames();
    let numbers = (0..frames.min(scene::MOST_FRAMES)).map(|frame| (frames > 1).then_some(frame));
    let all: Vec<Outputs> = numbers.map(|frame| Outputs::of(arguments, frame)).collect();
    source.check_outputs(&all.iter().flat_map(Outputs::files).collect::<Vec<_>>())?;
    all.iter().try_for_each(|outputs| outputs.refuse_existing(arguments.scene.force))?;
    Ok((scene, arguments.scene.truth()?))
}

fn refuse_what_has_no_prediction(scene: &Scene, arguments: &BoundArguments) -> Result<(), Failure> {
    let named = |path: &Path, reason: &str| Failure::Input(format!("{}: {reason}", Quoted(path)));
    let file = &arguments.scene.file;
    match &scene.kind {
        Kind::Uncalibrated { .. } => Err(named(
            file,
            "bound predicts the errors of views with depth; the cameras of this scene are unknown",
        )),
        Kind::Calibrated { .. } if arguments.curvature.is_some() => Err(Failure::Usage(
            "--curvature: the sure bound is that of the fit by rows, for rectified rigs; leave it out for \
             general cameras"
                .into(),
        )),
        kind if kind.frames() > 1 && arguments.scene.truth.is_some() => Err(Failure::Usage(
            "--truth: there is one photograph, but the scene has several virtual views; give it with --view \
             NAME, which predicts the place of one view"
                .into(),
        )),
        _ => Ok(()),
    }
}
