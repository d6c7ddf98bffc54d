//! `hybank-ibr bound`: the error of the virtual view, predicted from the inputs alone.

use super::arguments::BoundArguments;
use super::failure::Failure;
use super::memory::{self, Work};
use super::progress::Progress;
use super::{heat, output};
use crate::analysis::view::{self, Cause, Totals, ViewError};
use crate::image::{Image, Levels, quality};
use crate::partial::{Densify, Segmentwise};
use crate::pipeline::{RenderError, RenderSettings};
use crate::propagate::{CalibratedView, RectifiedView};
use crate::scene::{Kind, Scene};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Everything `--json` prints, in grey levels unless named.
#[derive(Debug, Serialize)]
struct Summary {
    totals: Totals,
    causes: Vec<CauseShare>,
    dominant: Cause,
    /// What makes the largest part smaller.
    remedy: &'static str,
    /// Views that were left out in turn to calibrate the estimate; 0 if typical weights were used.
    calibrated_on: usize,
    /// Standard deviation of the disparities' errors for a baseline of one, in pixels; of general cameras
    /// that of the relative errors of depth.
    disparity_noise: f64,
    /// Estimate that is white in the map.
    white: f32,
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
    /// Share of the pixels whose error is within the local bound, if there is one.
    within_local_bound: Option<f64>,
}

pub(super) fn run(arguments: &BoundArguments) -> Result<(), Failure> {
    check(arguments)?;
    let progress = Progress::new(3);
    progress.step("reading");
    let source = arguments.scene.source()?;
    source.refuse_overlaps(&arguments.map.iter().map(PathBuf::as_path).collect::<Vec<_>>())?;
    let scene = arguments.scene.load(&source, Densify::Segmentwise(Segmentwise::default()), true)?;
    refuse_unknown_cameras(&scene, &arguments.scene.file)?;
    memory::check(&scene, Work::Bound).map_err(|e| e.in_file(&arguments.scene.file))?;
    let truth = arguments.scene.truth()?;
    progress.step("predicting");
    let predicted = predict(&scene.kind, &arguments.scene.settings(scene.offset)).map_err(Failure::input)?;
    let measured = match (&truth, &arguments.scene.truth) {
        (Some(truth), Some(path)) => measure(&predicted, truth, path)?,
        _ => None,
    };
    progress.step("writing");
    let (map, white) = heat::map(&predicted.estimate, predicted.rendering.image.size());
    if let Some(path) = &arguments.map {
        output::write(&[output::encoded(&map, path, Levels::Eight)?], arguments.scene.force)?;
    }
    drop(progress);
    report(&Summary::new(&predicted, white, measured), arguments.scene.json)
}

fn check(arguments: &BoundArguments) -> Result<(), Failure> {
    arguments.scene.check()?;
    let Some(map) = &arguments.map else { return Ok(()) };
    if output::is_standard(map) {
        return Err(Failure::Usage("--map -: the map cannot go to standard output; give it a file".into()));
    }
    output::refuse_overlaps(&[map], &arguments.scene.inputs())?;
    output::name_leftovers(&[map]);
    output::refuse_existing(map, arguments.scene.force)?;
    output::refuse_format(map, Levels::Eight)
}

fn refuse_unknown_cameras(scene: &Scene, path: &Path) -> Result<(), Failure> {
    match &scene.kind {
        Kind::Uncalibrated { .. } => Err(Failure::Input(format!(
            "{}: bound predicts the errors of views with depth; the cameras of this scene are unknown",
            path.display()
        ))),
        _ => Ok(()),
    }
}

/// The error of the first virtual view.
fn predict(kind: &Kind, settings: &RenderSettings) -> Result<ViewError, RenderError> {
    match kind {
        Kind::Rectified { views, positions } => {
            let views: Vec<RectifiedView<'_>> = views
                .iter()
                .map(|v| RectifiedView { image: &v.image, disparity: &v.disparity, position: v.position })
                .collect();
            view::rectified(&views, positions.first().copied().unwrap_or(0.0), settings)
        }
        Kind::Calibrated { views, cameras, size } => {
            let views: Vec<CalibratedView<'_>> = views
                .iter()
                .map(|v| CalibratedView { image: &v.image, depth: &v.depth, camera: v.camera })
                .collect();
            let camera = cameras.first().ok_or(RenderError::NoViews)?;
            view::calibrated(&views, camera, *size, settings)
        }
        Kind::Uncalibrated { .. } => Err(RenderError::NoViews),
    }
}

fn measure(predicted: &ViewError, truth: &Image, path: &Path) -> Result<Option<Measured>, Failure> {
    let named = |e| Failure::Input(format!("{}: {e}", path.display()));
    let image = &predicted.rendering.image;
    let Some(found) = quality::compare(image, truth, None).map_err(named)? else { return Ok(None) };
    let within = predicted.within_local_bound(truth);
    let ratio = predicted.totals().estimate / found.mae;
    Ok(Some(Measured { mae: found.mae, psnr: found.psnr, ratio, within_local_bound: within }))
}

impl Summary {
    fn new(predicted: &ViewError, white: f32, measured: Option<Measured>) -> Self {
        let share = |(cause, error)| CauseShare { cause, error };
        let dominant = predicted.dominant();
        Self {
            totals: predicted.totals(),
            causes: Cause::ALL.into_iter().zip(predicted.causes).map(share).collect(),
            dominant,
            remedy: dominant.remedy(),
            calibrated_on: predicted.calibration.views,
            disparity_noise: predicted.calibration.disparity_noise,
            white,
            measured,
            rows: predicted.rows(),
        }
    }

    fn text(&self) -> String {
        let t = &self.totals;
        let mut lines = vec![
            format!("estimate  {:.2} grey levels of mean absolute error", t.estimate),
            format!("expected  {:.2} root mean square, a PSNR of {:.1} dB", t.expected, t.psnr),
        ];
        lines.extend(t.local_bound.map(|bound| {
            format!("bound     {bound:.2} in the mean, if slopes and residuals are nowhere larger than at the samples")
        }));
        let part = |c: &CauseShare| format!("{:?} {:.2}", c.cause, c.error).to_lowercase();
        lines.push(format!("causes    {}", self.causes.iter().map(part).collect::<Vec<_>>().join(", ")));
        lines.push(format!("next      {}", self.remedy));
        lines.push(match self.calibrated_on {
            0 => "weights   those of typical photographs: a single view cannot be left out".into(),
            views => format!("weights   calibrated on {views} views, each left out in turn"),
        });
        if let Some(m) = &self.measured {
            let within = |share: f64| format!("; {:.1} % of the pixels within the bound", 100.0 * share);
            lines.push(format!(
                "measured  MAE {:.2} (estimate / measured {:.2}), PSNR {:.2} dB{}",
                m.mae,
                m.ratio,
                m.psnr,
                m.within_local_bound.map_or(String::new(), within)
            ));
        }
        lines.join("\n") + "\n"
    }
}

fn report(summary: &Summary, json: bool) -> Result<(), Failure> {
    if json {
        let json = serde_json::to_string(summary).map_err(Failure::input)?;
        return output::print(&(json + "\n"));
    }
    output::print(&summary.text())
}
