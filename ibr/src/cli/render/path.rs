//! Rendering the views on a path of the virtual camera: numbered files, which appear together.

use super::{Outputs, Summary, timed, warn};
use crate::cli::arguments::RenderArguments;
use crate::cli::failure::Failure;
use crate::cli::output;
use crate::cli::progress::Progress;
use crate::scene::Scene;
use serde::Serialize;
use std::path::PathBuf;

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
        output::refuse_existing(file, arguments.force)?;
    }
    let progress = Progress::new(frames as u64 + 1);
    let (mut summary, mut written) = (PathSummary { frames: Vec::new() }, Vec::new());
    for (frame, files) in files.iter().enumerate() {
        progress.step("rendering");
        let (done, figures) = timed(scene, frame, preparation, arguments)?;
        if frame == 0 {
            warn(&done, &scene.kind);
        }
        written.extend(output::begin(&files.encoded(&done.rendering, arguments.bits)?, arguments.force)?);
        summary.frames.push(figures);
    }
    progress.step("writing");
    output::commit(written)?;
    drop(progress);
    if arguments.json {
        let json = serde_json::to_string(&summary).map_err(Failure::input)?;
        return output::print(&(json + "\n"));
    }
    output::print(&text(&summary, &files))
}

/// The numbered files of every view.
pub(super) fn outputs(arguments: &RenderArguments, frames: usize) -> Vec<Outputs> {
    (0..frames).map(|frame| Outputs::of(arguments).numbered(frame)).collect()
}

/// What a path has no use for.
fn check(arguments: &RenderArguments) -> Result<(), Failure> {
    if output::is_standard(&arguments.output) {
        return Err(Failure::Usage("-o -: the views of a path are numbered files; give them a name".into()));
    }
    if arguments.truth.is_some() {
        return Err(Failure::Usage(
            "--truth: there is one photograph, but the path has several views".into(),
        ));
    }
    Ok(())
}

fn text(summary: &PathSummary, files: &[Outputs]) -> String {
    let line = |(figures, files): (&Summary, &Outputs)| {
        let coverage = 100.0 * figures.coverage;
        format!("{}  coverage {coverage:.2} %, {:.3} s\n", files.view.display(), figures.seconds)
    };
    summary.frames.iter().zip(files).map(line).collect()
}

impl Outputs {
    /// The same files with the number of a view.
    fn numbered(self, frame: usize) -> Self {
        let with_number = |path: PathBuf| output::numbered(&path, frame);
        let Self { view, mask, depth } = self;
        Self { view: with_number(view), mask: mask.map(with_number), depth: depth.map(with_number) }
    }
}
