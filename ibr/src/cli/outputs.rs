//! The files that a command writes of one virtual view.

use super::arguments::SceneArguments;
use super::failure::{Failure, PROGRAM};
use super::output;
use super::source::Source;
use crate::image::Levels;
use hybank::messages::Quoted;
use hybank::program::is_dash;
use std::path::{Path, PathBuf};

/// What a file shows of a virtual view.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    View,
    Mask,
    Depth,
    Count,
    Error,
    /// The predicted error of every pixel.
    Map,
}

impl Part {
    fn option(self) -> &'static str {
        match self {
            Self::View => "-o",
            Self::Mask => "--mask",
            Self::Depth => "--depth",
            Self::Count => "--count",
            Self::Error => "--error",
            Self::Map => "--map",
        }
    }

    /// Refuses a file whose ending is not one of its formats.
    fn check(self, path: &Path, levels: Levels) -> Result<(), Failure> {
        let allowed: &[&str] = match self {
            Self::Depth => &["pfm"],
            Self::Count => &["png", "pfm"],
            Self::View if is_film(path) => return Ok(()),
            Self::View if is_packed_film(path) => return Err(packed_film(path)),
            Self::View => return output::refuse_format(path, levels),
            Self::Mask | Self::Error | Self::Map => return output::refuse_format(path, Levels::Eight),
        };
        if allowed.iter().any(|ending| ends_with(path, ending)) {
            return Ok(());
        }
        let (option, path) = (self.option(), Quoted(path));
        let name = option.trim_start_matches('-');
        let endings: Vec<String> = allowed.iter().map(|ending| format!(".{ending}")).collect();
        Err(Failure::Usage(format!("{option} {path}: {name} is written as {}", endings.join(" or "))))
    }
}

/// Whether a path has this ending, in capitals too.
pub(super) fn ends_with(path: &Path, ending: &str) -> bool {
    path.extension().is_some_and(|own| own.eq_ignore_ascii_case(ending))
}

/// Whether a path is a film of several views.
pub(super) fn is_film(path: &Path) -> bool {
    ends_with(path, "y4m")
}

/// Whether a path is a film of a format that only encoders write.
fn is_packed_film(path: &Path) -> bool {
    let packed = ["mp4", "m4v", "mov", "mkv", "webm", "avi", "mpg", "mpeg", "ogv", "wmv"];
    packed.iter().any(|ending| ends_with(path, ending))
}

fn packed_film(path: &Path) -> Failure {
    let (shown, film) = (Quoted(path), path.with_extension("y4m"));
    Failure::Usage(format!(
        "-o {shown}: films are written uncompressed, as .y4m; write `-o {}`, or give an encoder the frames: \
         `-o - | ffmpeg -i - {shown}`",
        Quoted(&film)
    ))
}

/// The files of one virtual view.
#[derive(Debug, Clone)]
pub(super) struct Outputs {
    pub(super) parts: Vec<(Part, PathBuf)>,
}

impl Outputs {
    /// Those that were asked for.
    pub(super) fn of(asked: &[(Part, Option<&PathBuf>)]) -> Self {
        Self { parts: asked.iter().filter_map(|(part, path)| Some((*part, (*path)?.clone()))).collect() }
    }

    /// The same files of each of several views, with its number; of one view as they are.
    pub(super) fn of_frames(self, frames: usize) -> Vec<Self> {
        if frames == 1 {
            return vec![self];
        }
        let name = |frame: usize| {
            let numbered = |(part, path): &(Part, PathBuf)| (*part, output::numbered(path, frame));
            Self { parts: self.parts.iter().map(numbered).collect() }
        };
        (0..frames).map(name).collect()
    }

    /// The files, without standard output.
    pub(super) fn files(&self) -> impl Iterator<Item = &Path> {
        self.parts.iter().map(|(_, path)| path.as_path()).filter(|path| !is_dash(path))
    }

    /// Checks of names and formats, before the scene is read.
    pub(super) fn check(&self, levels: Levels) -> Result<(), Failure> {
        for (k, (part, path)) in self.parts.iter().enumerate() {
            let (option, shown) = (part.option(), Quoted(path));
            let name = option.trim_start_matches('-');
            if *part != Part::View && is_dash(path) {
                return Err(Failure::Usage(format!(
                    "{option} -: the {name} cannot go to standard output; give it a file"
                )));
            }
            if k > 0 && *path == self.parts[0].1 {
                let first = self.parts[0].0.option();
                return Err(Failure::Usage(format!(
                    "{first} and {option} both name {shown}; give the {name} a file of its own"
                )));
            }
        }
        self.parts.iter().try_for_each(|(part, path)| part.check(path, levels))
    }
}

/// Refuses files that exist, are one, or are an input, before the views of the scene are read; names what
/// killed runs left beside them.
pub(super) fn check_files(
    all: &[Outputs],
    film: Option<&Path>,
    source: &Source,
    scene: &SceneArguments,
    force: bool,
) -> Result<(), Failure> {
    let files: Vec<&Path> = all.iter().flat_map(Outputs::files).chain(film).collect();
    let of_scene = source.files();
    let inputs: Vec<&Path> = of_scene.iter().chain(&scene.truth).map(PathBuf::as_path).collect();
    output::refuse_overlaps(&files, &inputs)?;
    PROGRAM.name_leftovers(&files);
    files.iter().try_for_each(|file| output::refuse_existing(file, force))
}
