//! Files that belong together.

use super::atomic::names_given;
use super::{AtomicFile, FileError};

/// Renames several files to their final names: all of them or, as far as the file system allows, none. The
/// documentation of [this module](super) describes the limits.
///
/// # Errors
/// As [`AtomicFile::commit`], for the first file that fails; the others are taken back.
pub fn commit_all(mut files: Vec<AtomicFile>) -> Result<(), FileError> {
    // Late disk errors occur here, before the first file gets its name.
    files.iter_mut().try_for_each(AtomicFile::seal)?;
    let mut named = names_given();
    let mut placed = Vec::with_capacity(files.len());
    for mut file in files {
        match file.place() {
            Ok(how) => placed.push((file, how)),
            Err(error) => {
                placed.into_iter().rev().for_each(|(file, how)| file.undo(how));
                return Err(error);
            }
        }
    }
    named.extend(placed.iter().map(|(file, _)| file.name().to_owned()));
    placed.into_iter().for_each(|(file, how)| file.keep(how));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::io::Write;
    use std::path::Path;

    fn file(folder: &Path, name: &str, replace: bool) -> AtomicFile {
        let mut file = AtomicFile::create(&folder.join(name), replace).unwrap();
        file.write_all(b"new").unwrap();
        file
    }

    fn content(folder: &Path) -> Vec<(String, String)> {
        let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap());
        let pair = |entry: fs::DirEntry| {
            let text = fs::read_to_string(entry.path()).unwrap_or_else(|_| "folder".into());
            (entry.file_name().to_string_lossy().into_owned(), text)
        };
        let mut content: Vec<_> = entries.map(pair).collect();
        content.sort();
        content
    }

    fn pairs(pairs: &[(&str, &str)]) -> Vec<(String, String)> {
        pairs.iter().map(|&(name, text)| (name.to_owned(), text.to_owned())).collect()
    }

    #[test]
    fn all_appear() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("b"), "old").unwrap();
        commit_all(vec![file(folder.path(), "a", true), file(folder.path(), "b", true)]).unwrap();
        assert_eq!(content(folder.path()), pairs(&[("a", "new"), ("b", "new")]));
    }

    #[test]
    fn none_appears_if_one_is_taken_meanwhile() {
        let folder = tempfile::tempdir().unwrap();
        let files = ["a", "b", "c"].map(|name| file(folder.path(), name, false));
        fs::write(folder.path().join("c"), "another's").unwrap();
        assert!(matches!(commit_all(files.into()), Err(FileError::Exists { .. })));
        assert_eq!(content(folder.path()), pairs(&[("c", "another's")]));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn what_was_replaced_comes_back_if_one_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("a"), "old").unwrap();
        let files = ["a", "b"].map(|name| file(folder.path(), name, true));
        // A folder is not replaced by a file.
        fs::create_dir(folder.path().join("b")).unwrap();
        fs::write(folder.path().join("b/inside"), "").unwrap();
        assert!(commit_all(files.into()).is_err());
        assert_eq!(content(folder.path()), pairs(&[("a", "old"), ("b", "folder")]));
    }
}
