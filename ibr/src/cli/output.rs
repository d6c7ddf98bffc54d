//! Writing results: files that are not overwritten by accident, and standard output.

use super::failure::{self, Failure};
use crate::image::{Image, begin, encode};
use hybank::files::commit_all;
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

/// Names the unfinished files that killed runs left beside `outputs`.
pub(super) fn name_leftovers(outputs: &[&Path]) {
    for left in hybank::files::leftovers(outputs) {
        failure::say(&format!(
            "hybank-ibr: warning: {}: an unfinished output of process {}, which no longer runs; remove it\n",
            left.path.display(),
            left.process
        ));
    }
}

/// Refuses a file name whose extension is not an image format, before any work is done.
pub(super) fn refuse_format(path: &Path) -> Result<(), Failure> {
    if is_standard(path) {
        return Ok(());
    }
    encode(&Image::filled(1, 1, 1, 0.0), path).map(|_| ()).map_err(Failure::input)
}

/// Writes images to files, which appear together, or as PNG to standard output.
pub(super) fn write_images(images: &[(&Image, &Path)], force: bool) -> Result<(), Failure> {
    let (to_output, to_files): (Vec<_>, Vec<_>) = images.iter().partition(|(_, path)| is_standard(path));
    #[cfg(unix)]
    hybank::files::remove_unfinished_on_signals();
    let files = to_files.iter().map(|(image, path)| begin(image, path, force));
    let files = files.collect::<Result<Vec<_>, _>>().map_err(Failure::input)?;
    to_output.iter().try_for_each(|(image, _)| print_image(image))?;
    commit_all(files).map_err(Failure::input)
}

fn print_image(image: &Image) -> Result<(), Failure> {
    let bytes = encode(image, Path::new("standard output.png")).map_err(Failure::input)?;
    let mut out = std::io::stdout().lock();
    out.write_all(&bytes).and_then(|()| out.flush()).map_err(|e| Failure::printing(&e))
}

/// Prints text to standard output.
pub(super) fn print(text: &str) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(|e| Failure::printing(&e))
}
