//! `hybank-ibr render`: a scene file in, images and their figures out.

mod concerns;
mod outputs;
mod path;
mod ready;

use super::arguments::RenderArguments;
use super::failure::{Failure, PROGRAM, failed, of_view, usage};
use super::output::{self, Outputs, check_files};
use super::summary::Summary;
use crate::image::{Image, quality};
use crate::interpolate::HoleFill;
use crate::scene::{Kind, Scene};
use concerns::Concerns;
use hybank_core::messages::Quoted;
use hybank_program::is_dash;
use indicatif::ProgressBar;
use path::Film;
use ready::{Ready, Rendered};
use std::path::Path;
use std::time::Instant;

pub(super) fn run(arguments: &RenderArguments) -> Result<(), Failure> {
    check(arguments)?;
    let start = Instant::now();
    let (scene, files) = read(arguments)?;
    check_kind(&scene.kind, arguments)?;
    check_nearest(&scene.kind, arguments)?;
    let frames = files.len();
    let truth = arguments.scene.truth()?;
    let mut film = path::is_film(&arguments.output, frames).then(|| Film::new(arguments)).transpose()?;
    let (mut summaries, mut concerns) = (Vec::new(), Concerns::default());
    let ready = Ready::new(&scene, arguments).map_err(|e| e.in_file(&arguments.scene.file))?;
    let preparation = start.elapsed().as_secs_f64();
    let bar = ProgressBar::new(frames as u64);
    for (frame, files) in files.iter().enumerate() {
        let (done, mut summary) = timed(&scene, &ready, frame, preparation, arguments)?;
        if let (Some(truth), Some(path)) = (&truth, &arguments.scene.truth) {
            compare(&mut summary, &done, truth, path)?;
        }
        concerns.add(&done);
        film.as_mut().map_or(Ok(()), |film| film.append(&done.rendering.image))?;
        output::write(&arguments.encoded(files, &done.rendering)?, arguments.force)?;
        summaries.push(summary);
        bar.inc(1);
    }
    bar.finish_and_clear();
    film.and_then(|film| film.file).map_or(Ok(()), |file| file.commit()).map_err(failed)?;
    concerns.warn(&scene.kind);
    path::report(&summaries, &files, arguments)
}

/// One virtual view of a scene, and its summary.
fn timed(
    scene: &Scene,
    ready: &Ready<'_>,
    frame: usize,
    preparation: f64,
    arguments: &RenderArguments,
) -> Result<(Rendered, Summary), Failure> {
    let start = Instant::now();
    let named = |e: Failure| of_view(e, frame, scene.kind.frames()).in_file(&arguments.scene.file);
    let done = ready.render(frame).map_err(named)?;
    let mut summary = Summary::new(&done.rendering, start.elapsed().as_secs_f64(), scene.filled);
    summary.preparation_seconds = preparation;
    summary.geometry = done.geometry.clone();
    summary.depths = outputs::unit_of_depths(&scene.kind, arguments.depth.is_some());
    Ok((done, summary))
}

/// Checks that need no file.
fn check(arguments: &RenderArguments) -> Result<(), Failure> {
    if is_dash(&arguments.output) && arguments.scene.json {
        return usage("-o - and --json both want standard output; give the image a file");
    }
    if arguments.nearest == Some(0) {
        return usage("--nearest 0: at least one view must be used");
    }
    if arguments.cameras.is_some() && arguments.scene.view.is_some() {
        return usage("--cameras and --view both say which views are rendered; leave one out");
    }
    arguments.scene.check()?;
    arguments.check_outputs()
}

/// Refuses options that only other kinds of scenes have a use for.
fn check_kind(kind: &Kind, arguments: &RenderArguments) -> Result<(), Failure> {
    let has_cameras = !matches!(kind, Kind::Uncalibrated { .. });
    let is_general = matches!(kind, Kind::Calibrated { .. });
    let unused = [
        ("--seed", "a scene without cameras", arguments.seed.is_some() && has_cameras),
        ("--degree", "a scene of general cameras", arguments.degree.is_some() && !is_general),
        ("--unknown", "a scene with depth", arguments.unknown.is_some() && !has_cameras),
        ("--depth-step", "a scene with depth", arguments.scene.depth_step > 1 && !has_cameras),
        ("--keep-cameras", "a scene with cameras", arguments.scene.keep_cameras && !has_cameras),
        ("--keep-exposure", "a scene with cameras", arguments.scene.keep_exposure && !has_cameras),
        ("--fill bridge", "a scene with cameras", arguments.fill == HoleFill::Bridge && !has_cameras),
    ];
    match unused.iter().find(|(.., is_unused)| *is_unused) {
        Some((option, needs, _)) => {
            usage(format!("{option}: it is for {needs}; leave it out of this rendering"))
        }
        None => Ok(()),
    }
}

/// Refuses a choice of the nearest views where no camera is known, and warns of one that is none.
fn check_nearest(kind: &Kind, arguments: &RenderArguments) -> Result<(), Failure> {
    let Some(count) = arguments.nearest else { return Ok(()) };
    if let Kind::Uncalibrated { .. } = kind {
        return usage(format!(
            "--nearest {count}: the cameras of this scene are unknown, so no view is known to be nearer; name \
             fewer views in the scene instead"
        ));
    }
    let views = kind.images().len();
    if count > views {
        PROGRAM.warn(&format!("--nearest {count}: there are {views} views to render from, and all are used"));
    }
    Ok(())
}

/// The scene, and the files of each of its virtual views.
fn read(arguments: &RenderArguments) -> Result<(Scene, Vec<Outputs>), Failure> {
    let source = arguments.scene.source(arguments.cameras.as_deref())?;
    let frames = source.frames(&arguments.scene);
    path::check(arguments, frames)?;
    let files = path::outputs(arguments, frames);
    let film = Some(arguments.output.as_path()).filter(|path| path::is_film(path, frames));
    check_files(&files, film.filter(|path| !is_dash(path)), &source, &arguments.scene, arguments.force)?;
    Ok((arguments.scene.load(&source, arguments.unknown, arguments.nearest)?, files))
}

/// Figures of merit over the region of the rendering, and over the whole image if the two differ.
fn compare(summary: &mut Summary, done: &Rendered, truth: &Image, path: &Path) -> Result<(), Failure> {
    let named = |e: &dyn std::fmt::Display| Failure::Input(format!("{}: {e}", Quoted(path)));
    let image = &done.rendering.image;
    let whole = quality::compare(image, truth, None).map_err(|e| named(&e))?;
    let Some(hull) = &done.hull else {
        whole.iter().for_each(|q| summary.compare(q));
        return Ok(());
    };
    summary.compared_on = "hull";
    let within = quality::compare(image, truth, Some(hull)).map_err(|e| named(&e))?;
    within.iter().for_each(|q| summary.compare(q));
    summary.whole_image = whole;
    Ok(())
}
