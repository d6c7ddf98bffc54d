//! `hybank-ibr bound`: the error of the virtual views, predicted from the inputs alone.

mod chart;
mod files;
mod report;

use super::arguments::BoundArguments;
use super::inputs;
use super::output;
use super::outputs::{Outputs, check_files};
use super::progress::Progress;
use crate::analysis::{Advice, Predicted, Predictor, ViewError};
use crate::cli::failure::{Failure, failed};
use crate::image::{Image, Levels};
use crate::pipeline::{RenderError, Watch};
use crate::scene::{Kind, Scene, SourceView};
use report::{Frames, Summary};

pub(super) fn run(arguments: &BoundArguments) -> Result<(), Failure> {
    check(arguments)?;
    let progress = Progress::new(3);
    progress.step("reading");
    let (scene, files) = read(arguments, &|share| progress.within(share))?;
    let truth = arguments.scene.truth()?;
    progress.step("calibrating");
    let job = Job { arguments, scene: &scene, files, truth, progress };
    match &scene.kind {
        Kind::Rectified { views, positions } => job.predict(views, positions, views[0].image.size()),
        Kind::Calibrated { views, cameras, size } => job.predict(views, cameras, *size),
        Kind::Uncalibrated { .. } => Err(failed(RenderError::NoViews)),
    }
}

/// What was asked for and read.
struct Job<'a> {
    arguments: &'a BoundArguments,
    scene: &'a Scene,
    /// Those of each virtual view.
    files: Vec<Outputs>,
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
        let Self { arguments, scene, files, truth, progress } = self;
        let named = |e: RenderError| failed(e).in_file(&arguments.scene.file);
        let views: Vec<_> = views.iter().map(SourceView::view).collect();
        let predictor = Predictor::new(&views, &arguments.scene.settings(scene.offset)).map_err(named)?;
        progress.step("predicting");
        let (mut summaries, mut written) = (Vec::new(), Vec::new());
        let mut worst: Option<(usize, f64, ViewError)> = None;
        for (frame, (camera, outputs)) in cameras.iter().zip(&files).enumerate() {
            let predicted = predictor.at(camera, size).map_err(named)?;
            let mut summary = Summary::new(&predicted, predictor.agreement(), &scene.outliers);
            summary.measure(&predicted, truth.as_ref(), arguments.scene.truth.as_deref())?;
            let (encoded, white) = files::encoded(outputs, &predicted, truth.as_ref())?;
            summary.white = white;
            written.extend(output::begin(&encoded, arguments.force)?);
            summaries.push(summary);
            let estimate = predicted.totals().estimate;
            if worst.as_ref().is_none_or(|(_, largest, _)| estimate > *largest) {
                worst = Some((frame, estimate, predicted));
            }
            progress.within((frame + 1) as f64 / (cameras.len() + 1) as f64);
        }
        let Some((worst, _, now)) = worst else { return Err(failed(RenderError::NoViews)) };
        summaries[worst].advice = Some(Advice::on(&predictor, &cameras[worst], size, &now).map_err(named)?);
        output::commit(written)?;
        drop(progress);
        inputs::warn_of_contradictions(predictor.agreement(), &scene.kind);
        Frames { summaries, worst }.print(predictor.agreement(), arguments.scene.json)
    }
}

/// Checks that need no file.
fn check(arguments: &BoundArguments) -> Result<(), Failure> {
    arguments.scene.check()?;
    arguments.outputs().check(Levels::Eight, &arguments.scene, arguments.force)
}

/// The scene, and the files of each of its virtual views.
fn read(arguments: &BoundArguments, watch: Watch<'_>) -> Result<(Scene, Vec<Outputs>), Failure> {
    let source = arguments.scene.source()?;
    let files = arguments.outputs().of_frames(source.frames(&arguments.scene));
    check_files(&files, None, &source, arguments.force)?;
    let scene = arguments.scene.load(&source, true, watch)?;
    arguments.scene.refuse_what_has_no_prediction(&scene)?;
    Ok((scene, files))
}
