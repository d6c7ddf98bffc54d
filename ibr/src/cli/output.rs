//! Writing results: files that are not overwritten by accident, and standard output.

use super::failure::Failure;
use crate::image::{Image, encode, save};
use std::io::Write;
use std::path::Path;

/// Whether a path stands for standard output.
pub(super) fn is_standard(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// Refuses a file that exists, before any work is done.
pub(super) fn refuse_existing(path: &Path, force: bool) -> Result<(), Failure> {
    if !force && !is_standard(path) && path.exists() {
        return Err(Failure::Input(format!("{} exists; use --force to overwrite it", path.display())));
    }
    Ok(())
}

/// Refuses a file name whose extension is not an image format, before any work is done.
pub(super) fn refuse_format(path: &Path) -> Result<(), Failure> {
    if is_standard(path) {
        return Ok(());
    }
    encode(&Image::filled(1, 1, 1, 0.0), path).map(|_| ()).map_err(Failure::input)
}

/// Writes an image to a file, or as PNG to standard output.
pub(super) fn write_image(image: &Image, path: &Path) -> Result<(), Failure> {
    if !is_standard(path) {
        return save(image, path).map_err(Failure::input);
    }
    let bytes = encode(image, Path::new("standard output.png")).map_err(Failure::input)?;
    let mut out = std::io::stdout().lock();
    out.write_all(&bytes).and_then(|()| out.flush()).map_err(|e| Failure::printing(&e))
}

/// Prints text to standard output.
pub(super) fn print(text: &str) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(|e| Failure::printing(&e))
}
