//! A folder of files that appear together.

use super::Failure;
use crate::files::{AtomicFile, commit_all};
use std::path::Path;

/// Writes the files of each item to `folder` as soon as the item is known; all files appear together. A
/// folder that was made for them is removed if they do not.
pub(super) fn write_together<T>(
    folder: &Path,
    items: impl Iterator<Item = Result<T, Failure>>,
    begin: impl Fn(T) -> Result<Vec<AtomicFile>, Failure>,
) -> Result<(), Failure> {
    let is_new = !folder.exists();
    let begin = |item: Result<T, Failure>| {
        let item = item?;
        std::fs::create_dir_all(folder).map_err(|error| {
            Failure::Input(format!("{}: cannot create the folder: {error}", folder.display()))
        })?;
        begin(item)
    };
    let begun = items.map(begin).collect::<Result<Vec<_>, _>>();
    let written =
        begun.and_then(|files| commit_all(files.into_iter().flatten().collect()).map_err(Failure::input));
    if written.is_err() && is_new {
        // It is empty, or another program has put files there.
        let _ = std::fs::remove_dir(folder);
    }
    written
}
