//! `hybank-ibr evaluate`: views of a scene, each left out, rendered from the others and compared with its
//! photograph.

use super::arguments::EvaluateArguments;
use super::failure::{Failure, failed, usage};
use super::output;
use crate::analysis::Predictor;
use crate::image::{Image, Levels, quality};
use crate::pipeline::{Geometry, RenderError, Renderer, Rendering};
use crate::scene::{Kind, LoadOptions, Scene, SourceView, ViewSpec, each_left_out};
use hybank_core::messages::Quoted;
use indicatif::ProgressBar;
use serde::Serialize;
use std::path::PathBuf;

pub(super) fn run(arguments: &EvaluateArguments) -> Result<(), Failure> {
    arguments.scene.check()?;
    if arguments.scene.view.is_some() || arguments.scene.truth.is_some() {
        return usage("--view and --truth: every view that is left out is compared with its own photograph");
    }
    let source = arguments.scene.source(None)?;
    let views: Vec<&ViewSpec> = source.spec.view.iter().step_by(arguments.every).collect();
    let files = arguments.pictures(views.len())?;
    let names: Vec<String> = views.iter().map(|view| view.label()).collect();
    let options = LoadOptions { nearest: arguments.nearest, ..arguments.scene.options() };
    let (bar, mut found) = (ProgressBar::new(names.len() as u64), Vec::new());
    each_left_out(&source.spec, source.path(), &options, &names, |index, scene| {
        let (truth, hidden) = source.photograph(views[index], arguments.scene.max_pixels)?;
        let job = Job { arguments, scene: &scene, truth, hidden };
        let (rendering, predicted) = job.render()?;
        found.push(job.compare(&names[index], &rendering, predicted)?);
        if let Some(path) = files.get(index) {
            let picture = output::encoded(&rendering.image, path, Levels::Eight)?;
            output::write(&[picture], arguments.force)?;
        }
        bar.inc(1);
        Ok::<(), Failure>(())
    })?;
    bar.finish_and_clear();
    let summary = Summary::of(found);
    output::report(arguments.scene.json, &summary, || summary.text(), None)
}

impl EvaluateArguments {
    /// The files of the pictures, none if they are not asked for.
    fn pictures(&self, count: usize) -> Result<Vec<PathBuf>, Failure> {
        let Some(folder) = &self.pictures else { return Ok(Vec::new()) };
        let made = std::fs::create_dir_all(folder);
        made.map_err(|e| Failure::Input(format!("{}: {e}", Quoted(folder))))?;
        let files: Vec<PathBuf> =
            (0..count).map(|k| folder.join(format!("{:04}.png", k * self.every + 1))).collect();
        files.iter().try_for_each(|file| output::refuse_existing(file, self.force))?;
        Ok(files)
    }
}

/// One view that is left out.
struct Job<'a> {
    arguments: &'a EvaluateArguments,
    scene: &'a Scene,
    truth: Image,
    /// Its pixels that show no part of the scene.
    hidden: Vec<bool>,
}

/// What was found for one view.
#[derive(Debug, Serialize)]
struct Row {
    view: String,
    psnr: f64,
    ssim: f64,
    /// Mean absolute error, grey levels.
    mae: f64,
    /// The same as it is predicted; null without --predict.
    predicted: Option<f64>,
    coverage: f64,
}

impl Job<'_> {
    fn render(&self) -> Result<(Rendering, Option<f64>), Failure> {
        match &self.scene.kind {
            Kind::Rectified { views, positions } => self.at(views, &positions[0]),
            Kind::Calibrated { views, cameras, .. } => self.at(views, &cameras[0]),
            Kind::Uncalibrated { .. } => {
                Err(Failure::Input("a scene without cameras has no view that could be left out".into()))
            }
        }
    }

    fn at<P: Geometry>(
        &self,
        views: &[SourceView<P>],
        camera: &P,
    ) -> Result<(Rendering, Option<f64>), Failure> {
        let named = |e: RenderError| failed(e).in_file(&self.arguments.scene.file);
        let mut settings = self.arguments.scene.settings(self.scene.offset);
        settings.nearest = self.arguments.nearest;
        let (views, size): (Vec<_>, _) = (views.iter().map(SourceView::view).collect(), self.truth.size());
        let rendering =
            Renderer::new(&views, &settings).and_then(|r| r.render(camera, size)).map_err(named)?;
        let predicted = match self.arguments.predict {
            true => Some(Predictor::new(&views, &settings).and_then(|p| p.at(camera, size)).map_err(named)?),
            false => None,
        };
        Ok((rendering, predicted.map(|view| view.totals().estimate)))
    }

    fn compare(&self, name: &str, rendering: &Rendering, predicted: Option<f64>) -> Result<Row, Failure> {
        let shown: Vec<bool> = self.hidden.iter().map(|hidden| !hidden).collect();
        let region = (!shown.is_empty()).then_some(&shown[..]);
        let compared = quality::compare(&rendering.image, &self.truth, region);
        let compared = compared.map_err(|e| Failure::Input(format!("{}: {e}", Quoted(name))))?;
        let found = compared.ok_or_else(|| Failure::Input(format!("{}: it has no pixel", Quoted(name))))?;
        let (psnr, ssim, mae) = (found.psnr, found.ssim, found.mae);
        Ok(Row { view: name.into(), psnr, ssim, mae, predicted, coverage: rendering.coverage() })
    }
}

/// All views, and the means over them.
#[derive(Debug, Serialize)]
struct Summary {
    views: Vec<Row>,
    psnr: f64,
    ssim: f64,
    mae: f64,
    predicted: Option<f64>,
}

impl Summary {
    fn of(views: Vec<Row>) -> Self {
        let mean = |of: fn(&Row) -> f64| views.iter().map(of).sum::<f64>() / views.len().max(1) as f64;
        let (psnr, ssim, mae) = (mean(|row| row.psnr), mean(|row| row.ssim), mean(|row| row.mae));
        let predicted: Option<f64> = views.iter().map(|row| row.predicted).sum();
        let predicted = predicted.map(|sum| sum / views.len().max(1) as f64);
        Self { views, psnr, ssim, mae, predicted }
    }

    fn text(&self) -> String {
        let line = |psnr: f64, ssim: f64, mae: f64, predicted: Option<f64>, name: &str| {
            let predicted = predicted.map_or(String::new(), |mae| format!(" ({mae:.2} predicted)"));
            format!("PSNR {psnr:6.2} dB   SSIM {ssim:.4}   MAE {mae:.2}{predicted}   {name}\n")
        };
        let rows = self.views.iter().map(|row| line(row.psnr, row.ssim, row.mae, row.predicted, &row.view));
        let mean = format!("mean of {} views", self.views.len());
        rows.collect::<String>() + &line(self.psnr, self.ssim, self.mae, self.predicted, &mean)
    }
}
