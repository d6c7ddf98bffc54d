//! `hybank-ibr bound`: the error of the virtual views, predicted from the inputs alone.

mod report;

use super::arguments::BoundArguments;
use super::output::{self, Encoded};
use super::outputs::{Outputs, Part, check_files};
use super::progress::Progress;
use super::{heat, inputs};
use crate::analysis::{Predicted, Predictor, ViewError};
use crate::cli::failure::{Failure, failed};
use crate::files::refuse_pixels_without_memory;
use crate::image::{Image, Levels};
use crate::pipeline::{RenderError, Watch};
use crate::scene::{Kind, Scene, SourceView};
use report::Summary;
use std::path::Path;

pub(super) fn run(arguments: &BoundArguments) -> Result<(), Failure> {
    arguments.scene.check()?;
    let outputs = Outputs::of(&[(Part::Map, arguments.map.as_ref())]);
    outputs.check(Levels::Eight)?;
    let progress = Progress::new(3);
    progress.step("reading");
    let (scene, files) = read(arguments, outputs, &|share| progress.within(share))?;
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
        for (frame, (camera, outputs)) in cameras.iter().zip(&files).enumerate() {
            let predicted = predictor.at(camera, size).map_err(named)?;
            let mut summary = Summary::new(&predicted, predictor.agreement(), &scene.outliers);
            summary.measure(&predicted, truth.as_ref(), arguments.scene.truth.as_deref())?;
            for (_, path) in &outputs.parts {
                let (encoded, white) = map(&predicted, path)?;
                summary.white = white;
                written.extend(output::begin(&[encoded], arguments.force)?);
            }
            summaries.push(summary);
            progress.within((frame + 1) as f64 / cameras.len() as f64);
        }
        output::commit(written)?;
        drop(progress);
        inputs::warn_of_contradictions(predictor.agreement(), &scene.kind);
        report::print(summaries, predictor.agreement(), arguments.scene.json)
    }
}

/// The scene, and the files of each of its virtual views.
fn read(
    arguments: &BoundArguments,
    outputs: Outputs,
    watch: Watch<'_>,
) -> Result<(Scene, Vec<Outputs>), Failure> {
    let source = arguments.scene.source()?;
    let files = outputs.of_frames(source.frames(&arguments.scene));
    check_files(&files, None, &source, &arguments.scene, arguments.force)?;
    let scene = arguments.scene.load(&source, true, watch)?;
    arguments.scene.refuse_what_has_no_prediction(&scene)?;
    Ok((scene, files))
}

/// A picture of the estimate and the estimate that is white in it, or the three numbers of every pixel as a
/// float map.
fn map<'a>(predicted: &ViewError, path: &'a Path) -> Result<(Encoded<'a>, Option<f32>), Failure> {
    let size = predicted.rendering.image.size();
    // A picture or three numbers per pixel, and the file.
    refuse_pixels_without_memory(path, size, 36.0).map_err(failed)?;
    heat::encoded(&predicted.estimate, size, path, || {
        let pixels = predicted.local_limit.iter().zip(&predicted.expected).zip(&predicted.estimate);
        let data = pixels.flat_map(|((limit, expected), estimate)| [*limit, *expected, *estimate]).collect();
        Image::from_values(size, 3, data)
    })
}
