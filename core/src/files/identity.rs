//! Tests whether two names refer to the same file.

use super::FileError;
use std::collections::HashMap;
use std::io;
use std::path::{Path, PathBuf};

/// The identity of a file, independent of its name.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
enum Identity {
    /// An existing file.
    #[cfg(unix)]
    Inode { device: u64, number: u64 },
    /// The name of a file that does not exist.
    Name(PathBuf),
}

impl Identity {
    #[cfg(unix)]
    fn of(path: &Path) -> io::Result<Self> {
        use std::os::unix::fs::MetadataExt;
        match path.metadata() {
            Ok(known) => Ok(Self::Inode { device: known.dev(), number: known.ino() }),
            Err(_) => Self::of_name(path),
        }
    }

    #[cfg(not(unix))]
    fn of(path: &Path) -> io::Result<Self> {
        path.canonicalize().map(Self::Name).or_else(|_| Self::of_name(path))
    }

    fn of_name(path: &Path) -> io::Result<Self> {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let name = path.file_name().ok_or(io::ErrorKind::InvalidFilename)?;
        Ok(Self::Name(folder.canonicalize()?.join(name)))
    }
}

/// True if both names lead to one file (the same device and inode), or to the same place where a file may
/// come to be. `-` stands for what standard input is connected to.
pub fn is_same_file(a: &Path, b: &Path) -> bool {
    matches!((identity(a), identity(b)), (Some(a), Some(b)) if a == b)
}

fn identity(path: &Path) -> Option<Identity> {
    let input = path.as_os_str() == "-";
    Identity::of(if input { Path::new("/dev/stdin") } else { path }).ok()
}

/// Refuses outputs that are also inputs, or that are the same file twice. Inputs may be `-`, outputs are
/// files. Takes one look at each file: a film may have ten thousand outputs.
///
/// # Errors
/// [`FileError::InputIsOutput`] and [`FileError::SameOutput`], with the names.
pub fn refuse_overlaps(outputs: &[&Path], inputs: &[&Path]) -> Result<(), FileError> {
    let mut known: HashMap<Identity, &Path> = HashMap::new();
    // The first of several names of one input is reported.
    for input in inputs.iter().rev() {
        known.extend(identity(input).map(|identity| (identity, *input)));
    }
    let mut own: HashMap<Identity, &Path> = HashMap::new();
    for output in outputs {
        let Some(identity) = identity(output) else { continue };
        if let Some(input) = known.get(&identity) {
            let (output, input) = (output.display().to_string(), input.display().to_string());
            return Err(FileError::InputIsOutput { output, input });
        }
        if let Some(other) = own.insert(identity, output) {
            let (first, second) = (other.display().to_string(), output.display().to_string());
            return Err(FileError::SameOutput { first, second });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_one_file_are_known_before_and_after_it_exists() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        std::fs::create_dir(path("sub")).unwrap();
        assert!(is_same_file(&path("a"), &path("sub/../a")));
        assert!(!is_same_file(&path("a"), &path("b")));
        std::fs::write(path("a"), "").unwrap();
        std::fs::hard_link(path("a"), path("b")).unwrap();
        assert!(is_same_file(&path("sub/../a"), &path("b")));
        assert!(!is_same_file(&path("a"), &path("none/a")));
    }

    #[test]
    fn overlaps_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let (a, b) = (folder.path().join("a"), folder.path().join("b"));
        std::fs::write(&a, "").unwrap();
        assert!(refuse_overlaps(&[&b], &[&a]).is_ok());
        let error = refuse_overlaps(&[&b, &a], &[&a]).unwrap_err().to_string();
        assert!(error.contains("also the input"), "{error}");
        let error = refuse_overlaps(&[&b, &b], &[&a]).unwrap_err().to_string();
        assert!(error.contains("same file"), "{error}");
    }
}
