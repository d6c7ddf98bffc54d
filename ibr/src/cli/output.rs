//! Writing results: files that are not overwritten by accident, and standard output.

use super::failure::{Failure, failed};
use crate::image::{self, Image, Levels};
use hybank::files::{AtomicFile, FileError, check_output, commit_all};
use hybank::messages::{Quoted, printable};
use hybank::program::{is_dash, print, print_bytes, say};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Outputs are different files, and none of them is an input.
pub(super) fn refuse_overlaps(outputs: &[&Path], inputs: &[&Path]) -> Result<(), Failure> {
    hybank::files::refuse_overlaps(outputs, inputs).map_err(failed)
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

/// Writes files, which appear together, and prints what goes to standard output.
pub(super) fn write(outputs: &[Encoded<'_>], force: bool) -> Result<(), Failure> {
    commit(begin(outputs, force)?)
}

/// Writes files without giving them their names yet, and prints what goes to standard output. The files are
/// closed: a long path has more than a process may have open.
pub(super) fn begin(outputs: &[Encoded<'_>], force: bool) -> Result<Vec<AtomicFile>, Failure> {
    let (to_output, to_files): (Vec<_>, Vec<_>) = outputs.iter().partition(|e| is_dash(e.path));
    #[cfg(unix)]
    hybank::files::remove_unfinished_on_signals();
    let files = to_files.iter().map(|e| image::begin(&e.bytes, e.path, force));
    let mut files = files.collect::<Result<Vec<_>, _>>().map_err(failed)?;
    files.iter_mut().try_for_each(AtomicFile::seal).map_err(failed)?;
    to_output.iter().try_for_each(|e| print_bytes(&e.bytes))?;
    Ok(files)
}

/// Gives the files their names, all or none.
pub(super) fn commit(files: Vec<AtomicFile>) -> Result<(), Failure> {
    commit_all(files).map_err(failed)
}

/// The name of view `frame` of a path, from 0: its number from 1, of four digits, before the extension.
pub(super) fn numbered(path: &Path, frame: usize) -> PathBuf {
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
