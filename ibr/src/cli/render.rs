//! `hybank-ibr render`: a scene file in, an image and its figures out.

use super::arguments::RenderArguments;
use super::failure::{self, Failure};
use super::output;
use super::progress::Progress;
use super::summary::{Figures, Summary};
use crate::files;
use crate::image::{Image, quality, read_image_within};
use crate::interpolate::Cover;
use crate::pipeline::uncalibrated::{UncalibratedRendering, UncalibratedSettings};
use crate::pipeline::{RenderSettings, Rendering, calibrated, rectified, uncalibrated};
use crate::propagate::{CalibratedView, RectifiedView};
use crate::scene::{self, Kind, LoadOptions, Scene};
use crate::uncalibrated::chirality::Handedness;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// A rendering with the region that is compared, unless that is the whole image.
struct Rendered {
    rendering: Rendering,
    hull: Option<Vec<bool>>,
    geometry: Option<uncalibrated::GeometryReport>,
}

pub(super) fn run(arguments: &RenderArguments) -> Result<(), Failure> {
    check(arguments)?;
    let progress = Progress::new(4);
    progress.step("reading");
    let start = Instant::now();
    let scene = read(arguments)?;
    let preparation = start.elapsed().as_secs_f64();
    let truth = truth(arguments)?;
    progress.step("rendering");
    let start = Instant::now();
    let done = render(&scene, arguments).map_err(|e| e.in_file(&arguments.scene))?;
    let mut summary = Summary::new(&done.rendering, start.elapsed().as_secs_f64(), scene.filled);
    summary.preparation_seconds = preparation;
    summary.geometry = done.geometry.clone();
    progress.step("comparing");
    if let (Some(truth), Some(path)) = (&truth, &arguments.truth) {
        compare(&mut summary, &done, truth, path)?;
    }
    progress.step("writing");
    let mask = arguments.mask.as_ref().map(|path| (mask_image(&done.rendering), path));
    let mut images = vec![(&done.rendering.image, arguments.output.as_path())];
    images.extend(mask.iter().map(|(mask, path)| (mask, path.as_path())));
    output::write_images(&images, arguments.force)?;
    drop(progress);
    warn(&done);
    report(&summary, arguments)
}

/// Checks that need no file.
fn check(arguments: &RenderArguments) -> Result<(), Failure> {
    let standard = output::is_standard(&arguments.output);
    if standard && arguments.json {
        return Err(Failure::Usage(
            "-o - and --json both want standard output; give the image a file".into(),
        ));
    }
    if arguments.depth_step == 0 {
        return Err(Failure::Usage("--depth-step 0: the step must be at least 1".into()));
    }
    if arguments.mask.as_deref().is_some_and(output::is_standard) {
        return Err(Failure::Usage("--mask -: the mask cannot go to standard output; give it a file".into()));
    }
    if arguments.mask.as_ref() == Some(&arguments.output) {
        let path = arguments.output.display();
        return Err(Failure::Usage(format!(
            "-o and --mask both name {path}; give the mask a file of its own"
        )));
    }
    let inputs = [Some(arguments.scene.as_path()), arguments.truth.as_deref()];
    refuse_overlaps(arguments, &inputs.into_iter().flatten().collect::<Vec<_>>())?;
    output::name_leftovers(&outputs(arguments));
    for path in [Some(&arguments.output), arguments.mask.as_ref()].into_iter().flatten() {
        output::refuse_existing(path, arguments.force)?;
        output::refuse_format(path)?;
    }
    Ok(())
}

/// Outputs are different files, and none of them is an input.
fn refuse_overlaps(arguments: &RenderArguments, inputs: &[&Path]) -> Result<(), Failure> {
    hybank::files::refuse_overlaps(&outputs(arguments), inputs).map_err(Failure::input)
}

/// The files that are written.
fn outputs(arguments: &RenderArguments) -> Vec<&Path> {
    let outputs = [Some(arguments.output.as_path()), arguments.mask.as_deref()];
    outputs.into_iter().flatten().filter(|path| !output::is_standard(path)).collect()
}

fn truth(arguments: &RenderArguments) -> Result<Option<Image>, Failure> {
    let read = |path| read_image_within(path, arguments.max_pixels);
    arguments.truth.as_deref().map(read).transpose().map_err(Failure::input)
}

fn read(arguments: &RenderArguments) -> Result<Scene, Failure> {
    let (path, text) = if output::is_standard(&arguments.scene) {
        let text = files::text(std::io::stdin().lock())
            .map_err(|e| Failure::Input(format!("standard input: {e}")))?;
        (PathBuf::from("<stdin>"), text)
    } else {
        let path = arguments.scene.clone();
        let text = files::read_text(&path)
            .map_err(|source| Failure::input(scene::SceneError::Read { path: path.clone(), source }))?;
        (path, text)
    };
    let options = LoadOptions {
        view: arguments.view.clone(),
        depth_step: arguments.depth_step,
        densify: arguments.densify(),
        fill: !arguments.drop_unknown,
        max_pixels: arguments.max_pixels,
    };
    let spec = scene::parse(&text, &path).map_err(Failure::input)?;
    let files = spec.files(path.parent().unwrap_or(Path::new("")));
    refuse_overlaps(arguments, &files.iter().map(PathBuf::as_path).collect::<Vec<_>>())?;
    scene::load(&spec, &path, &options).map_err(Failure::input)
}

fn render(scene: &Scene, arguments: &RenderArguments) -> Result<Rendered, Failure> {
    let settings = arguments.settings(scene.offset);
    let whole = |rendering| Rendered { rendering, hull: None, geometry: None };
    match &scene.kind {
        Kind::Rectified { views, position } => {
            let views: Vec<RectifiedView<'_>> = views
                .iter()
                .map(|v| RectifiedView { image: &v.image, disparity: &v.disparity, position: v.position })
                .collect();
            rectified::render(&views, *position, &settings).map(whole).map_err(Failure::input)
        }
        Kind::Calibrated { views, camera, size } => {
            let views: Vec<CalibratedView<'_>> = views
                .iter()
                .map(|v| CalibratedView { image: &v.image, depth: &v.depth, camera: v.camera })
                .collect();
            calibrated::render(&views, camera, *size, &settings).map(whole).map_err(Failure::input)
        }
        Kind::Uncalibrated { .. } => render_uncalibrated(&scene.kind, &settings, arguments),
    }
}

fn render_uncalibrated(
    kind: &Kind,
    settings: &RenderSettings,
    arguments: &RenderArguments,
) -> Result<Rendered, Failure> {
    let Kind::Uncalibrated { images, tracks, target, size } = kind else {
        return Err(Failure::input("the scene has calibrated views"));
    };
    let images: Vec<&Image> = images.iter().collect();
    let mut special = UncalibratedSettings::default();
    special.robust.seed = arguments.seed;
    let run = |special: &UncalibratedSettings| {
        uncalibrated::render(&images, tracks, target, *size, settings, special).map_err(Failure::input)
    };
    let mut done: UncalibratedRendering = run(&special)?;
    if arguments.reverse_order {
        special.handedness = Some(match done.hand {
            Handedness::Kept => Handedness::Reversed,
            Handedness::Reversed => Handedness::Kept,
        });
        done = run(&special)?;
    }
    let geometry = Some(done.geometry);
    Ok(Rendered { rendering: done.rendering, hull: Some(done.region), geometry })
}

/// Figures of merit over the region of the rendering, and over the whole image if the two differ.
fn compare(summary: &mut Summary, done: &Rendered, truth: &Image, path: &Path) -> Result<(), Failure> {
    let named = |e: &dyn std::fmt::Display| Failure::Input(format!("{}: {e}", path.display()));
    let image = &done.rendering.image;
    let whole = quality::compare(image, truth, None).map_err(|e| named(&e))?;
    let Some(hull) = &done.hull else {
        whole.iter().for_each(|q| summary.compare(q));
        return Ok(());
    };
    summary.compared_on = "hull";
    let within = quality::compare(image, truth, Some(hull)).map_err(|e| named(&e))?;
    within.iter().for_each(|q| summary.compare(q));
    summary.whole_image = whole.map(|q| Figures { psnr: q.psnr, ssim: q.ssim, mae: q.mae });
    Ok(())
}

/// White seen, grey crack, black disocclusion.
fn mask_image(rendering: &Rendering) -> Image {
    let (width, height) = rendering.image.size();
    let mut image = Image::filled(width, height, 1, 0.0);
    for (pixel, cover) in image.data_mut().iter_mut().zip(&rendering.mask) {
        *pixel = match cover {
            Cover::Seen => 255.0,
            Cover::Crack => 128.0,
            Cover::Disocclusion => 0.0,
        };
    }
    image
}

/// Warnings on stderr about what the figures of merit alone do not show.
fn warn(done: &Rendered) {
    let warn = |text: String| failure::say(&format!("hybank-ibr: warning: {text}\n"));
    let coverage = done.rendering.coverage();
    if coverage < 0.5 && done.hull.is_none() {
        warn(format!("only {:.1} % of the image is covered by samples", 100.0 * coverage));
    }
    if let Some(c) = done.rendering.report.convergence.filter(|c| !c.reached) {
        warn(format!(
            "the plane fit stopped after {} steps at a relative residual of {:.1e}",
            c.steps, c.residual
        ));
    }
    if let Some(g) = done.geometry.as_ref().filter(|g| g.order_agreement < 0.75) {
        warn(format!(
            "only {:.0} % of the metric guesses agree on the order of depth; if near objects appear behind far ones, use --reverse-order",
            100.0 * g.order_agreement
        ));
    }
}

fn report(summary: &Summary, arguments: &RenderArguments) -> Result<(), Failure> {
    if arguments.json {
        let json = serde_json::to_string(summary).map_err(Failure::input)?;
        return output::print(&(json + "\n"));
    }
    if output::is_standard(&arguments.output) {
        failure::say(&summary.text());
        return Ok(());
    }
    output::print(&summary.text())
}
