//! Rendering a list of virtual views or those on a path: numbered files, which appear together, or one film.

use super::concerns::Concerns;
use super::{Outputs, Summary, outputs, timed};
use crate::cli::arguments::RenderArguments;
use crate::cli::failure::{self, Failure};
use crate::cli::output;
use crate::cli::progress::Progress;
use crate::image::{FrameRate, Image, Levels, y4m};
use crate::scene::Scene;
use hybank::files::AtomicFile;
use serde::Serialize;
use std::io::Write;
use std::path::Path;

/// What `--json` prints.
#[derive(Serialize)]
struct PathSummary {
    /// One summary per view, in their order.
    frames: Vec<Summary>,
}

pub(super) fn run(scene: &Scene, preparation: f64, arguments: &RenderArguments) -> Result<(), Failure> {
    let frames = scene.kind.frames();
    check(arguments)?;
    let files = outputs(arguments, frames);
    for file in files.iter().flat_map(Outputs::files) {
        output::refuse_existing(file, arguments.scene.force)?;
    }
    let mut film = is_film(&arguments.output).then(|| Film::new(arguments)).transpose()?;
    let progress = Progress::new(frames as u64 + 1);
    let (mut summary, mut written) = (PathSummary { frames: Vec::new() }, Vec::new());
    let mut concerns = Concerns::default();
    for (frame, files) in files.iter().enumerate() {
        progress.step("rendering");
        let watch = |share| progress.within(share);
        let (done, figures) = timed(scene, frame, preparation, arguments, &watch)?;
        concerns.add(&done);
        film.as_mut().map_or(Ok(()), |film| film.append(&done.rendering.image))?;
        let (encoded, _) = files.encoded(&done.rendering, None, arguments.fps)?;
        let mut files = output::begin(&encoded, arguments.scene.force)?;
        // Closed: a long path has more files than a process may have open.
        files.iter_mut().try_for_each(AtomicFile::seal).map_err(Failure::input)?;
        written.extend(files);
        summary.frames.push(figures);
    }
    progress.step("writing");
    written.extend(film.and_then(|film| film.file));
    output::commit(written)?;
    drop(progress);
    concerns.warn(&scene.kind);
    report(&summary, &files, arguments)
}

fn report(summary: &PathSummary, files: &[Outputs], arguments: &RenderArguments) -> Result<(), Failure> {
    if arguments.scene.json {
        let json = serde_json::to_string(summary).map_err(Failure::input)?;
        return output::print(&(json + "\n"));
    }
    if output::is_standard(&arguments.output) {
        failure::say(&text(summary, files, arguments));
        return Ok(());
    }
    output::print(&text(summary, files, arguments))
}

/// Whether the views go into one film.
pub(super) fn is_film(path: &Path) -> bool {
    output::is_standard(path) || outputs::is_film(path)
}

/// The files of every view, without the film.
pub(super) fn outputs(arguments: &RenderArguments, frames: usize) -> Vec<Outputs> {
    let one = |frame| {
        let files = Outputs::of(arguments);
        let files = if is_film(&arguments.output) { files.beside_film() } else { files };
        files.numbered(frame)
    };
    (0..frames).map(one).collect()
}

/// What several views have no use for.
fn check(arguments: &RenderArguments) -> Result<(), Failure> {
    if arguments.scene.truth.is_some() {
        return Err(Failure::Usage(
            "--truth: there is one photograph, but the scene has several virtual views".into(),
        ));
    }
    if !is_film(&arguments.output) {
        return Ok(());
    }
    if arguments.alpha || arguments.bits == Levels::Sixteen {
        return Err(Failure::Usage(
            "--alpha and --bits 16: a film has 8 bits per value and no alpha channel; write .png files"
                .into(),
        ));
    }
    Ok(())
}

/// A film that grows frame by frame: a file that appears when it is whole, or standard output.
struct Film {
    file: Option<AtomicFile>,
    fps: FrameRate,
    begun: bool,
}

impl Film {
    fn new(arguments: &RenderArguments) -> Result<Self, Failure> {
        let (path, fps) = (&arguments.output, arguments.fps);
        if output::is_standard(path) {
            return Ok(Self { file: None, fps, begun: false });
        }
        #[cfg(unix)]
        hybank::files::remove_unfinished_on_signals();
        let file = AtomicFile::create(path, arguments.scene.force).map_err(Failure::input)?;
        Ok(Self { file: Some(file), fps, begun: false })
    }

    fn append(&mut self, image: &Image) -> Result<(), Failure> {
        let mut bytes = Vec::new();
        if !self.begun {
            bytes = y4m::header(image.size(), image.channels(), self.fps);
            self.begun = true;
        }
        y4m::append_frame(image, &mut bytes);
        match &mut self.file {
            Some(file) => {
                let name = file.name().to_string();
                file.write_all(&bytes).map_err(|e| Failure::Input(format!("{name}: {e}")))
            }
            None => output::print_bytes(&bytes),
        }
    }
}

fn text(summary: &PathSummary, files: &[Outputs], arguments: &RenderArguments) -> String {
    let line = |(number, (figures, files)): (usize, (&Summary, &Outputs))| {
        let coverage = 100.0 * figures.coverage;
        let name = match is_film(&arguments.output) {
            true => format!("frame {}", number + 1),
            false => files.files().next().map_or(String::new(), |path| path.display().to_string()),
        };
        format!("{name}  coverage {coverage:.2} %, {:.3} s\n", figures.seconds)
    };
    let common = summary.frames.first().map_or(String::new(), Summary::common_lines);
    summary.frames.iter().zip(files).enumerate().map(line).collect::<String>() + &common
}
