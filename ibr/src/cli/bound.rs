//! `hybank-ibr bound`: the error of the virtual views, predicted from the inputs alone.

use super::arguments::BoundArguments;
use super::failure::{Failure, failed};
use super::inputs;
use super::output::{self, Encoded, Outputs, Part, check_files};
use crate::analysis::{Cause, Predictor, Totals, ViewError};
use crate::image::{Image, Levels, pfm, quality};
use crate::pipeline::{Agreement, Geometry, RenderError};
use crate::scene::{Kind, Scene, SourceView};
use hybank_core::messages::Quoted;
use serde::Serialize;
use std::path::Path;

pub(super) fn run(arguments: &BoundArguments) -> Result<(), Failure> {
    arguments.scene.check()?;
    let outputs = Outputs::of(&[(Part::Map, arguments.map.as_ref())]);
    outputs.check(Levels::Eight, arguments.force)?;
    let (scene, files) = read(arguments, outputs)?;
    let truth = arguments.scene.truth()?;
    let job = Job { arguments, scene: &scene, files, truth };
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
}

impl Job<'_> {
    /// Predicts the views of `cameras`, writes their files and prints the report.
    fn predict<P: Geometry>(
        self,
        views: &[SourceView<P>],
        cameras: &[P],
        size: (usize, usize),
    ) -> Result<(), Failure> {
        let Self { arguments, scene, files, truth } = self;
        let named = |e: RenderError| failed(e).in_file(&arguments.scene.file);
        let views: Vec<_> = views.iter().map(SourceView::view).collect();
        let predictor = Predictor::new(&views, &arguments.scene.settings(scene.offset)).map_err(named)?;
        let mut summaries = Vec::new();
        for (camera, outputs) in cameras.iter().zip(&files) {
            let predicted = predictor.at(camera, size).map_err(named)?;
            let mut summary = Summary::new(&predicted, &predictor.agreement, &scene.outliers);
            summary.measure(&predicted, truth.as_ref(), arguments.scene.truth.as_deref())?;
            for (_, path) in &outputs.parts {
                let estimate = Image::from_values(size, 1, predicted.estimate.clone());
                output::write(&[Encoded { bytes: pfm::encode(&estimate), path }], arguments.force)?;
            }
            summaries.push(summary);
        }
        inputs::warn_of_contradictions(&predictor.agreement, &scene.kind);
        print(summaries, &predictor.agreement, arguments.scene.json)
    }
}

/// The scene, and the files of each of its virtual views.
fn read(arguments: &BoundArguments, outputs: Outputs) -> Result<(Scene, Vec<Outputs>), Failure> {
    let source = arguments.scene.source(None)?;
    let files = outputs.of_frames(source.frames(&arguments.scene));
    check_files(&files, None, &source, &arguments.scene, arguments.force)?;
    let scene = arguments.scene.load(&source, None, None)?;
    arguments.scene.refuse_what_has_no_prediction(&scene)?;
    Ok((scene, files))
}

/// The prediction for one virtual view, in grey levels unless named.
#[derive(Debug, Serialize)]
struct Summary {
    totals: Totals,
    causes: Vec<CauseShare>,
    dominant: Cause,
    /// What makes the largest part smaller; to check the inputs, if they contradict each other.
    remedy: &'static str,
    /// Share of the depths that were outliers.
    outliers: f64,
    /// Whether the views fit each other; null if there is nothing to compare.
    inputs_agree: Option<bool>,
    /// Views that were left out in turn to calibrate the estimate; 0 if typical weights were used.
    calibrated_on: usize,
    /// Standard deviation of the disparities' errors for a baseline of one, in pixels; of general cameras
    /// that of the relative errors of depth.
    disparity_noise: f64,
    measured: Option<Measured>,
    rows: Vec<Totals>,
}

#[derive(Debug, Serialize)]
struct CauseShare {
    cause: Cause,
    /// Mean over the view.
    error: f64,
}

/// The comparison with a photograph.
#[derive(Debug, Serialize)]
struct Measured {
    mae: f64,
    psnr: f64,
    /// Estimate divided by the measured mean absolute error.
    ratio: f64,
}

/// What to do first where the inputs contradict each other.
const CHECK_FIRST: &str =
    "check the inputs first: the views contradict each other, and the prediction is that of these inputs";

/// What to do first where depths are outliers.
const MEND_DEPTH_FIRST: &str = "depth without outliers: those were replaced by guesses from their neighbours, which err most at outlines";

/// Share of outliers from which on they are what to mend first.
const MANY_OUTLIERS: f64 = 0.01;

impl Summary {
    fn new(predicted: &ViewError, agreement: &Agreement, outliers: &[f64]) -> Self {
        let outliers = outliers.iter().sum::<f64>() / outliers.len().max(1) as f64;
        let share = |(cause, error)| CauseShare { cause, error };
        let dominant = predicted.dominant();
        let inputs_agree = agreement.worst().map(|pair| !pair.is_poor());
        Self {
            totals: predicted.totals(),
            causes: Cause::ALL.into_iter().zip(predicted.causes).map(share).collect(),
            dominant,
            remedy: match inputs_agree {
                Some(false) => CHECK_FIRST,
                _ if outliers >= MANY_OUTLIERS => MEND_DEPTH_FIRST,
                _ => dominant.remedy(),
            },
            outliers,
            inputs_agree,
            calibrated_on: predicted.calibration.views,
            disparity_noise: predicted.calibration.disparity_noise,
            measured: None,
            rows: predicted.rows(),
        }
    }

    /// Compares the prediction with a photograph, if there is one.
    fn measure(
        &mut self,
        predicted: &ViewError,
        truth: Option<&Image>,
        path: Option<&Path>,
    ) -> Result<(), Failure> {
        let (Some(truth), Some(path)) = (truth, path) else { return Ok(()) };
        let named = |e| Failure::Input(format!("{}: {e}", Quoted(path)));
        let image = &predicted.rendering.image;
        let Some(found) = quality::compare(image, truth, None).map_err(named)? else { return Ok(()) };
        self.measured =
            Some(Measured { mae: found.mae, psnr: found.psnr, ratio: self.totals.estimate / found.mae });
        Ok(())
    }

    fn text(&self, agreement: &Agreement) -> String {
        let t = &self.totals;
        let mut lines = vec![
            format!("estimate  {:.2} grey levels of mean absolute error", t.estimate),
            format!("expected  {:.2} root mean square, a PSNR of {:.1} dB", t.expected, t.psnr),
        ];
        let part = |c: &CauseShare| format!("{:?} {:.2}", c.cause, c.error).to_lowercase();
        lines.push(format!("causes    {}", self.causes.iter().map(part).collect::<Vec<_>>().join(", ")));
        if self.outliers >= MANY_OUTLIERS {
            lines.push(format!("outliers  {:.1} % of the depths", 100.0 * self.outliers));
        }
        lines.push(format!("next      {}", self.remedy));
        lines.push(inputs::weights_line(self.calibrated_on));
        lines.extend(inputs::line(agreement));
        lines.extend(self.measured.as_ref().map(measured));
        lines.join("\n") + "\n"
    }
}

fn measured(m: &Measured) -> String {
    format!("measured  MAE {:.2} (estimate / measured {:.2}), PSNR {:.2} dB", m.mae, m.ratio, m.psnr)
}

/// The predictions for all virtual views of a scene.
#[derive(Debug, Serialize)]
struct Frames {
    #[serde(rename = "frames")]
    summaries: Vec<Summary>,
    /// The view with the largest estimate, by number from 0.
    worst: usize,
}

/// Prints one view, or a line for each of several and the worst of them.
fn print(summaries: Vec<Summary>, agreement: &Agreement, json: bool) -> Result<(), Failure> {
    if let [one] = summaries.as_slice() {
        return output::report(json, one, || one.text(agreement), None);
    }
    let estimates = summaries.iter().map(|summary| summary.totals.estimate).enumerate();
    // The first of equal ones.
    let worst = estimates.rev().max_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(worst, _)| worst);
    let frames = Frames { summaries, worst };
    output::report(json, &frames, || frames.text(agreement), None)
}

impl Frames {
    fn text(&self, agreement: &Agreement) -> String {
        let line =
            |(k, s): (usize, &Summary)| format!("view {:4}  estimate {:.2}\n", k + 1, s.totals.estimate);
        let mut text: String = self.summaries.iter().enumerate().map(line).collect();
        text += &format!("The largest, view {}:\n", self.worst + 1);
        text + &self.summaries[self.worst].text(agreement)
    }
}
