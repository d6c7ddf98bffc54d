//! The files of a list of virtual views or of a path: numbered ones, or one film.

use super::Summary;
use crate::cli::arguments::RenderArguments;
use crate::cli::failure::{Failure, failed, usage};
use crate::cli::output::{self, Outputs, Part};
use crate::image::{Image, Levels, y4m};
use hybank_core::files::AtomicFile;
use hybank_program::{is_dash, print_bytes};
use serde::Serialize;
use std::io::Write;
use std::path::Path;

/// What `--json` prints of several views.
#[derive(Serialize)]
struct PathSummary<'a> {
    /// One summary per view, in their order.
    frames: &'a [Summary],
}

pub(super) fn report(
    summaries: &[Summary],
    files: &[Outputs],
    arguments: &RenderArguments,
) -> Result<(), Failure> {
    let (json, image) = (arguments.scene.json, Some(arguments.output.as_path()));
    match summaries {
        [one] => output::report(json, one, || one.text(), image),
        frames => output::report(json, &PathSummary { frames }, || text(frames, files, arguments), image),
    }
}

/// Whether so many views go into one film.
pub(super) fn is_film(path: &Path, frames: usize) -> bool {
    output::is_film(path) || frames > 1 && is_dash(path)
}

/// The files of every view, without the film.
pub(super) fn outputs(arguments: &RenderArguments, frames: usize) -> Vec<Outputs> {
    let mut files = arguments.outputs();
    if is_film(&arguments.output, frames) {
        files.parts.retain(|(part, _)| *part != Part::View);
    }
    files.of_frames(frames)
}

/// What several views, or files that are no film, have no use for.
pub(super) fn check(arguments: &RenderArguments, frames: usize) -> Result<(), Failure> {
    if arguments.fps.is_some() && !is_film(&arguments.output, frames) {
        return usage("--fps: only a film has a frame rate; write a .y4m file, or leave out --fps");
    }
    if frames < 2 {
        return Ok(());
    }
    if arguments.scene.truth.is_some() {
        return usage("--truth: there is one photograph, but the scene has several virtual views");
    }
    if !is_film(&arguments.output, frames) {
        return Ok(());
    }
    if arguments.alpha || arguments.bits == Levels::Sixteen {
        return usage(
            "--alpha and --bits 16: a film has 8 bits per value and no alpha channel; write .png files",
        );
    }
    Ok(())
}

/// A film that grows frame by frame: a file that appears when it is whole, or standard output.
pub(super) struct Film {
    pub(super) file: Option<AtomicFile>,
    fps: u32,
    begun: bool,
}

impl Film {
    pub(super) fn new(arguments: &RenderArguments) -> Result<Self, Failure> {
        let (path, fps) = (&arguments.output, arguments.fps.unwrap_or(25));
        if is_dash(path) {
            return Ok(Self { file: None, fps, begun: false });
        }
        let file = AtomicFile::create(path, arguments.force).map_err(failed)?;
        Ok(Self { file: Some(file), fps, begun: false })
    }

    pub(super) fn append(&mut self, image: &Image) -> Result<(), Failure> {
        let path = self.file.as_ref().map_or("standard output".into(), |file| file.name().to_string());
        let mut bytes = Vec::new();
        if !self.begun {
            bytes = y4m::header(image.size(), image.channels(), self.fps);
            self.begun = true;
        }
        y4m::append_frame(image, &mut bytes);
        match &mut self.file {
            Some(file) => file.write_all(&bytes).map_err(|e| Failure::Input(format!("{path}: {e}"))),
            None => print_bytes(&bytes),
        }
    }
}

fn text(summaries: &[Summary], files: &[Outputs], arguments: &RenderArguments) -> String {
    let line = |(number, (figures, files)): (usize, (&Summary, &Outputs))| {
        let coverage = 100.0 * figures.coverage;
        let name = match is_film(&arguments.output, summaries.len()) {
            true => format!("frame {}", number + 1),
            false => files.files().next().map_or(String::new(), |path| path.display().to_string()),
        };
        format!("{name}  coverage {coverage:.2} %, {:.3} s\n", figures.seconds)
    };
    let common = summaries.first().map_or(String::new(), Summary::common_lines);
    summaries.iter().zip(files).enumerate().map(line).collect::<String>() + &common
}
