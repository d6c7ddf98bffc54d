//! `hybank-ibr render`: a scene file in, images and their figures out.

mod concerns;
mod metric;
mod outputs;
mod path;

use super::arguments::RenderArguments;
use super::failure::{self, Failure};
use super::inputs;
use super::memory::{self, Work};
use super::output;
use super::progress::Progress;
use super::summary::{Figures, Summary};
use crate::image::{Image, quality};
use crate::pipeline::uncalibrated::{Target, UncalibratedSettings};
use crate::pipeline::{RenderSettings, Rendering, Watch, calibrated, rectified, uncalibrated};
use crate::scene::{self, CalibratedSource, Kind, RectifiedSource, Scene};
use concerns::Concerns;
use outputs::Outputs;
use std::path::Path;
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
    check_nearest(&scene.kind, arguments)?;
    let method = arguments.settings(scene.offset).method;
    memory::check(&scene, Work::Render(method)).map_err(|e| e.in_file(&arguments.scene.file))?;
    if scene.kind.frames() > 1 {
        drop(progress);
        return path::run(&scene, preparation, arguments);
    }
    let truth = arguments.scene.truth()?;
    progress.step("rendering");
    let (done, mut summary) = timed(&scene, 0, preparation, arguments, &|share| progress.within(share))?;
    progress.step("comparing");
    if let (Some(truth), Some(path)) = (&truth, &arguments.scene.truth) {
        compare(&mut summary, &done, truth, path)?;
    }
    progress.step("writing");
    let files = Outputs::of(arguments);
    let (encoded, white) = files.encoded(&done.rendering, truth.as_ref(), arguments.fps)?;
    summary.error_white = white;
    output::write(&encoded, arguments.scene.force)?;
    drop(progress);
    let mut concerns = Concerns::default();
    concerns.add(&done);
    concerns.warn(&scene.kind);
    report(&summary, arguments)
}

/// One virtual view of a scene, and its summary.
fn timed(
    scene: &Scene,
    frame: usize,
    preparation: f64,
    arguments: &RenderArguments,
    watch: Watch<'_>,
) -> Result<(Rendered, Summary), Failure> {
    let start = Instant::now();
    let named = |e: Failure| e.of_view(frame, scene.kind.frames()).in_file(&arguments.scene.file);
    let done = render(scene, frame, arguments, watch).map_err(named)?;
    let mut summary = Summary::new(&done.rendering, start.elapsed().as_secs_f64(), scene.filled);
    summary.preparation_seconds = preparation;
    summary.geometry = done.geometry.clone();
    summary.depths = metric::depths(scene, arguments.depth.is_some());
    Ok((done, summary))
}

/// Checks that need no file.
fn check(arguments: &RenderArguments) -> Result<(), Failure> {
    if output::is_standard(&arguments.output) && arguments.scene.json {
        return Err(Failure::Usage(
            "-o - and --json both want standard output; give the image a file".into(),
        ));
    }
    if arguments.nearest == Some(0) {
        return Err(Failure::Usage("--nearest 0: at least one view must be used".into()));
    }
    arguments.scene.check()?;
    let outputs = Outputs::of(arguments);
    outputs.check()?;
    let files: Vec<&Path> = outputs.files().collect();
    output::refuse_overlaps(&files, &arguments.scene.inputs())?;
    output::name_leftovers(&files);
    files.iter().try_for_each(|path| output::refuse_existing(path, arguments.scene.force))
}

/// Refuses a choice of the nearest views where no camera is known, and warns of one that is none.
fn check_nearest(kind: &Kind, arguments: &RenderArguments) -> Result<(), Failure> {
    let Some(count) = arguments.nearest else { return Ok(()) };
    if let Kind::Uncalibrated { .. } = kind {
        return Err(Failure::Usage(format!(
            "--nearest {count}: the cameras of this scene are unknown, so no view is known to be nearer; name \
             fewer views in the scene instead"
        )));
    }
    let views = kind.views();
    if count > views {
        inputs::warn(&format!("--nearest {count}: there are {views} views to render from, and all are used"));
    }
    Ok(())
}

fn read(arguments: &RenderArguments) -> Result<Scene, Failure> {
    let source = arguments.scene.source()?;
    let frames: usize = match arguments.scene.view {
        Some(_) => 1,
        None => source.spec.targets.iter().map(|t| t.frames.unwrap_or(1).min(scene::MOST_FRAMES)).sum(),
    };
    let all = match frames {
        0 | 1 => vec![Outputs::of(arguments)],
        _ => path::outputs(arguments, frames.min(scene::MOST_FRAMES)),
    };
    let film = Some(arguments.output.as_path()).filter(|path| frames > 1 && path::is_film(path));
    let film = film.filter(|path| !output::is_standard(path));
    source.refuse_overlaps(&all.iter().flat_map(Outputs::files).chain(film).collect::<Vec<_>>())?;
    arguments.scene.load(&source, arguments.densify, !arguments.drop_unknown)
}

/// The virtual view `frame` of a list or path; 0 if there is one.
fn render(
    scene: &Scene,
    frame: usize,
    arguments: &RenderArguments,
    watch: Watch<'_>,
) -> Result<Rendered, Failure> {
    let settings = arguments.settings(scene.offset);
    let whole = |rendering| Rendered { rendering, hull: None, geometry: None };
    match &scene.kind {
        Kind::Rectified { views, positions } => {
            let views: Vec<_> = views.iter().map(RectifiedSource::view).collect();
            let done = rectified::render_watched(&views, positions[frame], &settings, watch);
            done.map(|rendering| whole(metric::in_millimetres(rendering, scene))).map_err(Failure::input)
        }
        Kind::Calibrated { views, cameras, size } => {
            let views: Vec<_> = views.iter().map(CalibratedSource::view).collect();
            let done = calibrated::render_watched(&views, &cameras[frame], *size, &settings, watch);
            done.map(whole).map_err(Failure::input)
        }
        Kind::Uncalibrated { targets, .. } => {
            render_uncalibrated(&scene.kind, &targets[frame], &settings, (arguments, watch))
        }
    }
}

fn render_uncalibrated(
    kind: &Kind,
    target: &Target,
    settings: &RenderSettings,
    (arguments, watch): (&RenderArguments, Watch<'_>),
) -> Result<Rendered, Failure> {
    let Kind::Uncalibrated { images, tracks, size, .. } = kind else {
        return Err(Failure::input("the scene has calibrated views"));
    };
    let images: Vec<&Image> = images.iter().collect();
    let mut special = UncalibratedSettings::default();
    special.robust.seed = arguments.seed;
    special.plane.degree = settings.interpolation.plane.degree;
    special.reverse_order = arguments.reverse_order;
    let done = uncalibrated::render_watched(&images, tracks, target, *size, settings, &special, watch)
        .map_err(Failure::input)?;
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

fn report(summary: &Summary, arguments: &RenderArguments) -> Result<(), Failure> {
    if arguments.scene.json {
        let json = serde_json::to_string(summary).map_err(Failure::input)?;
        return output::print(&(json + "\n"));
    }
    if output::is_standard(&arguments.output) {
        failure::say(&summary.text());
        return Ok(());
    }
    output::print(&summary.text())
}
