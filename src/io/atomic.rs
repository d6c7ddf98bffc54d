//! A file that appears only when it is whole.

use super::IoError;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Written beside its final name and renamed by [`AtomicFile::commit`]; dropped without that, it
/// leaves nothing behind.
#[derive(Debug)]
pub struct AtomicFile {
    file: Option<File>,
    beside: PathBuf,
    target: PathBuf,
}

impl AtomicFile {
    /// Starts a file that will be called `target`.
    ///
    /// # Errors
    /// [`IoError::Exists`] if there is one already and `force` is not set, [`IoError::System`] for what is no plain
    /// file (a folder, device, pipe or socket), or the system's refusal.
    pub fn create(target: &Path, force: bool) -> Result<Self, IoError> {
        let name = target.display().to_string();
        if !force && target.symlink_metadata().is_ok() {
            return Err(IoError::Exists { file: name });
        }
        if target.is_dir() {
            let source = io::Error::from(io::ErrorKind::IsADirectory);
            return Err(IoError::System { file: name, action: "create it", source });
        }
        // A rename would put a plain file in the place of /dev/full or of a pipe that somebody listens to.
        if target.metadata().is_ok_and(|known| !known.is_file()) {
            let source =
                io::Error::other("it is a device, pipe or socket, not a file; write to `-` and redirect");
            return Err(IoError::System { file: name, action: "replace it", source });
        }
        let (beside, file) = create_beside(target).map_err(IoError::system(&name, "create it"))?;
        Ok(Self { file: Some(file), beside, target: target.to_owned() })
    }

    /// The final name.
    pub fn target(&self) -> &Path {
        &self.target
    }

    /// Gives the file its final name.
    ///
    /// # Errors
    /// The system's refusal; the unfinished file is removed.
    pub fn commit(mut self) -> Result<(), IoError> {
        // Closing before the rename reports a full disk on systems that write late.
        drop(self.file.take());
        fs::rename(&self.beside, &self.target).map_err(IoError::system(
            &self.target.display().to_string(),
            "give the finished file its name",
        ))?;
        // Nothing is left to remove.
        self.beside = PathBuf::new();
        Ok(())
    }

    fn file(&mut self) -> io::Result<&mut File> {
        self.file.as_mut().ok_or_else(|| io::Error::other("the file is already closed"))
    }
}

/// Opens a new file next to `target`, under a name that nobody has.
fn create_beside(target: &Path) -> io::Result<(PathBuf, File)> {
    let name = target.file_name().ok_or(io::ErrorKind::InvalidFilename)?.to_string_lossy().into_owned();
    for attempt in 0..1000u32 {
        let beside = target.with_file_name(format!(".{name}.{}-{attempt}.part", std::process::id()));
        match OpenOptions::new().write(true).read(true).create_new(true).open(&beside) {
            Ok(file) => return Ok((beside, file)),
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(error),
        }
    }
    Err(io::ErrorKind::AlreadyExists.into())
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        if !self.beside.as_os_str().is_empty() {
            // There is nobody to tell: the failure that led here is already on its way.
            let _ = fs::remove_file(&self.beside);
        }
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file()?.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file()?.flush()
    }
}

impl Seek for AtomicFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file()?.seek(to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap();
        entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned()).collect()
    }

    #[test]
    fn appears_only_when_committed() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("out.wav");
        let mut file = AtomicFile::create(&target, false).unwrap();
        file.write_all(b"whole").unwrap();
        assert!(!target.exists());
        file.commit().unwrap();
        assert_eq!(fs::read(&target).unwrap(), b"whole");
        assert_eq!(names(folder.path()), ["out.wav"]);
    }

    #[test]
    fn leaves_nothing_when_dropped() {
        let folder = tempfile::tempdir().unwrap();
        let mut file = AtomicFile::create(&folder.path().join("out.wav"), false).unwrap();
        file.write_all(b"half").unwrap();
        drop(file);
        assert!(names(folder.path()).is_empty());
    }

    #[test]
    fn replaces_only_by_force() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("out.wav");
        fs::write(&target, "old").unwrap();
        let error = AtomicFile::create(&target, false).unwrap_err();
        assert!(matches!(error, IoError::Exists { .. }) && error.to_string().contains("--force"));
        assert_eq!(fs::read(&target).unwrap(), b"old");
        AtomicFile::create(&target, true).unwrap().commit().unwrap();
        assert_eq!(fs::read(&target).unwrap(), b"");
    }

    #[cfg(unix)]
    #[test]
    fn devices_pipes_and_sockets_are_never_replaced() {
        use std::os::unix::fs::FileTypeExt;
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("socket");
        let _listener = std::os::unix::net::UnixListener::bind(&target).unwrap();
        let error = AtomicFile::create(&target, true).unwrap_err().to_string();
        assert!(error.contains("socket") && error.contains("redirect"), "{error}");
        assert!(target.symlink_metadata().unwrap().file_type().is_socket());
        assert_eq!(names(folder.path()), ["socket"]);
    }

    #[test]
    fn refuses_folders_and_missing_folders() {
        let folder = tempfile::tempdir().unwrap();
        assert!(AtomicFile::create(folder.path(), true).is_err());
        let error = AtomicFile::create(&folder.path().join("no/such/out.wav"), false).unwrap_err();
        assert!(error.to_string().contains("no/such/out.wav"));
    }
}
