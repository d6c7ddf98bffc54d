//! `hybank-ibr render`: a scene file in, an image and its figures out.

mod path;

use super::arguments::RenderArguments;
use super::failure::{self, Failure};
use super::output::{self, Encoded};
use super::progress::Progress;
use super::summary::{Figures, Summary};
use crate::files;
use crate::image::{Image, Levels, pfm, quality, read_image_within};
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
    if scene.kind.frames() > 1 {
        drop(progress);
        return path::run(&scene, preparation, arguments);
    }
    let truth = truth(arguments)?;
    progress.step("rendering");
    let (done, mut summary) = timed(&scene, 0, preparation, arguments)?;
    progress.step("comparing");
    if let (Some(truth), Some(path)) = (&truth, &arguments.truth) {
        compare(&mut summary, &done, truth, path)?;
    }
    progress.step("writing");
    let files = Outputs::of(arguments);
    output::write(&files.encoded(&done.rendering, arguments.bits)?, arguments.force)?;
    drop(progress);
    warn(&done, &scene.kind);
    report(&summary, arguments)
}

/// One virtual view of a scene, and its summary.
fn timed(
    scene: &Scene,
    frame: usize,
    preparation: f64,
    arguments: &RenderArguments,
) -> Result<(Rendered, Summary), Failure> {
    let start = Instant::now();
    let done = render(scene, frame, arguments).map_err(|e| e.in_file(&arguments.scene))?;
    let mut summary = Summary::new(&done.rendering, start.elapsed().as_secs_f64(), scene.filled);
    summary.preparation_seconds = preparation;
    summary.geometry = done.geometry.clone();
    Ok((done, summary))
}

/// The files of one view.
struct Outputs {
    view: PathBuf,
    mask: Option<PathBuf>,
    depth: Option<PathBuf>,
}

impl Outputs {
    /// Those that were asked for.
    fn of(arguments: &RenderArguments) -> Self {
        let RenderArguments { output, mask, depth, .. } = arguments;
        Self { view: output.clone(), mask: mask.clone(), depth: depth.clone() }
    }

    fn files(&self) -> impl Iterator<Item = &Path> {
        let all = [Some(&self.view), self.mask.as_ref(), self.depth.as_ref()];
        all.into_iter().flatten().map(PathBuf::as_path).filter(|path| !output::is_standard(path))
    }

    /// The contents of the files.
    fn encoded(&self, rendering: &Rendering, levels: Levels) -> Result<Vec<Encoded<'_>>, Failure> {
        let mut outputs = vec![output::encoded(&rendering.image, &self.view, levels)?];
        if let Some(path) = &self.mask {
            outputs.push(output::encoded(&mask_image(rendering), path, Levels::Eight)?);
        }
        if let Some(path) = &self.depth {
            let (width, height) = rendering.depth.size();
            let data = rendering.depth.data().to_vec();
            let bytes = pfm::encode(&pfm::FloatMap { width, height, channels: 1, data });
            outputs.push(Encoded { bytes, path });
        }
        Ok(outputs)
    }
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
    for (name, path) in [("mask", &arguments.mask), ("depth", &arguments.depth)] {
        let Some(path) = path else { continue };
        if output::is_standard(path) {
            return Err(Failure::Usage(format!(
                "--{name} -: the {name} cannot go to standard output; give it a file"
            )));
        }
        if *path == arguments.output {
            let path = path.display();
            return Err(Failure::Usage(format!(
                "-o and --{name} both name {path}; give the {name} a file of its own"
            )));
        }
    }
    if let Some(path) = arguments.depth.as_ref().filter(|path| path.extension().is_none_or(|e| e != "pfm")) {
        return Err(Failure::Usage(format!("--depth {}: depth is written as .pfm", path.display())));
    }
    let inputs = [Some(arguments.scene.as_path()), arguments.truth.as_deref()];
    refuse_overlaps(&[Outputs::of(arguments)], &inputs.into_iter().flatten().collect::<Vec<_>>())?;
    let outputs = Outputs::of(arguments);
    output::name_leftovers(&outputs.files().collect::<Vec<_>>());
    outputs.files().try_for_each(|path| output::refuse_existing(path, arguments.force))?;
    output::refuse_format(&arguments.output, arguments.bits)?;
    arguments.mask.iter().try_for_each(|path| output::refuse_format(path, Levels::Eight))
}

/// Outputs are different files, and none of them is an input.
fn refuse_overlaps(outputs: &[Outputs], inputs: &[&Path]) -> Result<(), Failure> {
    let files: Vec<&Path> = outputs.iter().flat_map(Outputs::files).collect();
    hybank::files::refuse_overlaps(&files, inputs).map_err(Failure::input)
}

fn truth(arguments: &RenderArguments) -> Result<Option<Image>, Failure> {
    let read = |path| read_image_within(path, arguments.max_pixels);
    arguments.truth.as_deref().map(read).transpose().map_err(Failure::input)
}

/// The name and the text of a scene file, `-` for standard input.
pub(super) fn scene_text(path: &Path) -> Result<(PathBuf, String), Failure> {
    if output::is_standard(path) {
        let text = files::text(std::io::stdin().lock())
            .map_err(|e| Failure::Input(format!("standard input: {e}")))?;
        return Ok((PathBuf::from("<stdin>"), text));
    }
    let path = path.to_owned();
    let text = files::read_text(&path)
        .map_err(|source| Failure::input(scene::SceneError::Read { path: path.clone(), source }))?;
    Ok((path, text))
}

fn read(arguments: &RenderArguments) -> Result<Scene, Failure> {
    let (path, text) = scene_text(&arguments.scene)?;
    let options = LoadOptions {
        view: arguments.view.clone(),
        depth_step: arguments.depth_step,
        densify: arguments.densify(),
        fill: !arguments.drop_unknown,
        max_pixels: arguments.max_pixels,
    };
    let spec = scene::parse(&text, &path).map_err(Failure::input)?;
    let files = spec.files(path.parent().unwrap_or(Path::new("")));
    let target = spec.target.as_ref().filter(|_| arguments.view.is_none());
    let outputs = match target.and_then(|t| t.frames) {
        Some(frames) => path::outputs(arguments, frames.min(scene::MOST_FRAMES)),
        None => vec![Outputs::of(arguments)],
    };
    refuse_overlaps(&outputs, &files.iter().map(PathBuf::as_path).collect::<Vec<_>>())?;
    scene::load(&spec, &path, &options).map_err(Failure::input)
}

/// The virtual view `frame` of a path; 0 without one.
fn render(scene: &Scene, frame: usize, arguments: &RenderArguments) -> Result<Rendered, Failure> {
    let settings = arguments.settings(scene.offset);
    let whole = |rendering| Rendered { rendering, hull: None, geometry: None };
    match &scene.kind {
        Kind::Rectified { views, positions } => {
            let views: Vec<RectifiedView<'_>> = views
                .iter()
                .map(|v| RectifiedView { image: &v.image, disparity: &v.disparity, position: v.position })
                .collect();
            rectified::render(&views, positions[frame], &settings).map(whole).map_err(Failure::input)
        }
        Kind::Calibrated { views, cameras, size } => {
            let views: Vec<CalibratedView<'_>> = views
                .iter()
                .map(|v| CalibratedView { image: &v.image, depth: &v.depth, camera: v.camera })
                .collect();
            calibrated::render(&views, &cameras[frame], *size, &settings).map(whole).map_err(Failure::input)
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
fn warn(done: &Rendered, kind: &Kind) {
    let warn = |text: String| failure::say(&format!("hybank-ibr: warning: {text}\n"));
    let coverage = done.rendering.coverage();
    if coverage < 0.5 && done.hull.is_none() {
        warn(format!("only {:.1} % of the image is covered by samples", 100.0 * coverage));
    }
    for pair in done.rendering.agreement.pairs.iter().filter(|p| p.is_poor()) {
        let suspects = match kind {
            Kind::Rectified { .. } => "positions (swapped?), disparity_scale and disparity_offset",
            _ => "cameras and depth_scale",
        };
        warn(format!(
            "views {} and {} agree in depth and colour at only {:.0} % of {} points; check their {suspects}",
            pair.views[0] + 1,
            pair.views[1] + 1,
            100.0 * pair.share,
            pair.points
        ));
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
