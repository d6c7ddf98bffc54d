//! Files that appear only when they are whole.

use std::io::Write;
use std::path::{Path, PathBuf};

/// Writes `bytes` into a file beside `path`, then renames it to `path`.
///
/// # Errors
/// The system's reason, or that `path` is a device, pipe or socket, which a rename would put a plain file in the
/// place of; nothing is left behind then.
pub fn write(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    if path.metadata().is_ok_and(|known| !known.is_file()) {
        return Err(std::io::Error::other("it is a folder, device, pipe or socket, not a file"));
    }
    let beside = neighbour(path);
    let written = std::fs::File::create_new(&beside)
        .and_then(|mut file| file.write_all(bytes).and_then(|()| file.sync_all()))
        .and_then(|()| std::fs::rename(&beside, path));
    if written.is_err() {
        let _ = std::fs::remove_file(&beside);
    }
    written
}

/// A hidden name in the same folder, different for every process.
fn neighbour(path: &Path) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!(".{name}.{}.part", std::process::id()))
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_failed_write_leaves_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let target = dir.path().join("taken");
        std::fs::create_dir(&target).unwrap();
        assert!(super::write(&target, b"x").is_err());
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
    }
}
