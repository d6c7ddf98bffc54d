//! Results: the files that a command writes, which are not overwritten by accident, and standard output.

use super::arguments::SceneArguments;
use super::failure::{Failure, failed, usage};
use super::source::Source;
use crate::image::{self, Image, Levels};
use hybank_core::files::{FileError, check_output};
use hybank_core::messages::{Quoted, printable};
use hybank_program::{is_dash, print, print_bytes, say};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Outputs are different files, and none of them is an input.
pub(super) fn refuse_overlaps(outputs: &[&Path], inputs: &[&Path]) -> Result<(), Failure> {
    hybank_core::files::refuse_overlaps(outputs, inputs).map_err(failed)
}

/// Refuses a file that exists, or cannot be begun, before any work is done.
pub(super) fn refuse_existing(path: &Path, force: bool) -> Result<(), Failure> {
    if is_dash(path) {
        return Ok(());
    }
    check_output(path, force).map_err(|error| match error {
        FileError::Exists { .. } => {
            Failure::Input(format!("{} exists; use --force to overwrite it", Quoted(path)))
        }
        other => failed(other),
    })
}

/// Refuses a file name whose extension is not an image format, before any work is done: wrong usage.
pub(super) fn refuse_format(path: &Path, levels: Levels) -> Result<(), Failure> {
    match encoded(&Image::filled(1, 1, 1, 0.0), path, levels) {
        Err(Failure::Input(message)) => Err(Failure::Usage(message)),
        other => other.map(|_| ()),
    }
}

/// A file to be written, or the PNG for standard output.
pub(super) struct Encoded<'a> {
    pub(super) bytes: Vec<u8>,
    pub(super) path: &'a Path,
}

/// An image in the format of its path, as PNG for standard output.
pub(super) fn encoded<'a>(image: &Image, path: &'a Path, levels: Levels) -> Result<Encoded<'a>, Failure> {
    let format = if is_dash(path) { Path::new("standard output.png") } else { path };
    Ok(Encoded { bytes: image::encode(image, format, levels).map_err(failed)?, path })
}

/// Writes files, each of which appears when it is whole, and prints what goes to standard output.
pub(super) fn write(outputs: &[Encoded<'_>], force: bool) -> Result<(), Failure> {
    outputs.iter().try_for_each(|e| match is_dash(e.path) {
        true => print_bytes(&e.bytes),
        false => image::write_file(&e.bytes, e.path, force).map_err(failed),
    })
}

/// The name of view `frame` of a path, from 0: its number from 1, of four digits, before the extension.
fn numbered(path: &Path, frame: usize) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let name = match path.extension() {
        Some(extension) => format!("{stem}-{:04}.{}", frame + 1, extension.to_string_lossy()),
        None => format!("{stem}-{:04}", frame + 1),
    };
    path.with_file_name(name)
}

/// Prints a report to standard output, as one JSON object or as text. Text goes to standard error where
/// standard output has the image.
pub(super) fn report(
    json: bool,
    value: &impl Serialize,
    text: impl FnOnce() -> String,
    image: Option<&Path>,
) -> Result<(), Failure> {
    if json {
        return print(&(serde_json::to_string(value).map_err(failed)? + "\n"));
    }
    if image.is_some_and(is_dash) {
        say(&text());
        return Ok(());
    }
    print(&printable(&text()))
}

/// What a file shows of a virtual view.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    View,
    Mask,
    Depth,
    /// The predicted error of every pixel.
    Map,
}

/// Endings of films of formats that only encoders write.
const PACKED_FILMS: [&str; 10] = ["mp4", "m4v", "mov", "mkv", "webm", "avi", "mpg", "mpeg", "ogv", "wmv"];

impl Part {
    fn option(self) -> &'static str {
        match self {
            Self::View => "-o",
            Self::Mask => "--mask",
            Self::Depth => "--depth",
            Self::Map => "--map",
        }
    }

    /// Refuses a file whose ending is not one of its formats.
    fn check(self, path: &Path, levels: Levels) -> Result<(), Failure> {
        match self {
            Self::Depth | Self::Map if ends_with(path, "pfm") => return Ok(()),
            Self::Depth | Self::Map => (),
            Self::View if is_film(path) => return Ok(()),
            Self::View if PACKED_FILMS.iter().any(|ending| ends_with(path, ending)) => {
                let (shown, film) = (Quoted(path), path.with_extension("y4m"));
                return usage(format!(
                    "-o {shown}: films are written uncompressed, as .y4m; write `-o {}`, or give an encoder the \
                     frames: `-o - | ffmpeg -i - {shown}`",
                    Quoted(&film)
                ));
            }
            Self::View => return refuse_format(path, levels),
            Self::Mask => return refuse_format(path, Levels::Eight),
        }
        let (option, path) = (self.option(), Quoted(path));
        let name = option.trim_start_matches('-');
        usage(format!("{option} {path}: {name} is written as .pfm"))
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
            let numbered = |(part, path): &(Part, PathBuf)| (*part, numbered(path, frame));
            Self { parts: self.parts.iter().map(numbered).collect() }
        };
        (0..frames).map(name).collect()
    }

    /// The files, without standard output.
    pub(super) fn files(&self) -> impl Iterator<Item = &Path> {
        self.parts.iter().map(|(_, path)| path.as_path()).filter(|path| !is_dash(path))
    }

    /// Checks of names, formats and files that exist, before the scene is read.
    pub(super) fn check(&self, levels: Levels, force: bool) -> Result<(), Failure> {
        for (k, (part, path)) in self.parts.iter().enumerate() {
            let (option, shown) = (part.option(), Quoted(path));
            let name = option.trim_start_matches('-');
            if *part != Part::View && is_dash(path) {
                return usage(format!("{option} -: the {name} cannot go to standard output; give it a file"));
            }
            if k > 0 && *path == self.parts[0].1 {
                let first = self.parts[0].0.option();
                return usage(format!(
                    "{first} and {option} both name {shown}; give the {name} a file of its own"
                ));
            }
        }
        self.parts.iter().try_for_each(|(part, path)| part.check(path, levels))?;
        self.files().try_for_each(|file| refuse_existing(file, force))
    }
}

/// Refuses files that exist, are one, or are an input, before the views of the scene are read.
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
    refuse_overlaps(&files, &inputs)?;
    files.iter().try_for_each(|file| refuse_existing(file, force))
}
