//! A file that appears only when it is complete.

use super::FileError;
use super::error::CREATE;
use std::collections::BTreeSet;
use std::fs::{self, File, Metadata};
use std::io::{self, ErrorKind, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use tempfile::{Builder, PathPersistError, TempPath};

/// Characters of the target's name in the hidden one, so that this is not too long for the file system.
const NAME_PART: usize = 48;

/// Hidden names of the unfinished files of this process. Whoever gives names holds the lock meanwhile, so an
/// end by [`remove_unfinished`] comes before or after all names of a set.
static UNFINISHED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn unfinished() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes all files of this process that have not been committed: for a thread that is about to end the
/// process while others are writing. Other threads can neither begin, commit nor drop a file afterwards;
/// they wait for the end.
pub fn remove_unfinished() {
    let files = unfinished();
    files.iter().for_each(|hidden| drop(fs::remove_file(hidden)));
    std::mem::forget(files);
}

/// A file that is written under a hidden name, `.NAME.XXXXXX.part`, beside its target and gets its name by
/// [`AtomicFile::commit`]; if it is dropped before, it is removed.
#[derive(Debug)]
pub struct AtomicFile {
    /// Until all bytes are on the disk.
    file: Option<File>,
    /// Until it has its name.
    hidden: Option<TempPath>,
    hidden_name: PathBuf,
    target: PathBuf,
    name: String,
    replace: bool,
    /// What is written cannot be made again: it stays under the hidden name if it gets no other.
    is_unique: bool,
}

impl AtomicFile {
    /// Starts a file that will be called `target`, with `replace` in the place of one that exists and with
    /// its permission bits. A link is followed to the file that it leads to.
    ///
    /// # Errors
    /// [`FileError::Exists`] if there is one already and `replace` is not set, [`FileError::NotAFile`] for a
    /// folder or a link to nothing, [`FileError::Special`] for a device, pipe or socket, or the system's
    /// refusal.
    pub fn create(target: &Path, replace: bool) -> Result<Self, FileError> {
        let name = target.display().to_string();
        let (target, known) = destination(target, replace)?;
        let mut files = unfinished();
        let begun = begin_beside(&target, known.as_ref());
        let (file, hidden) = begun.map_err(FileError::system(&name, CREATE))?;
        let hidden_name = target.with_file_name(hidden.file_name().unwrap_or_default());
        files.insert(hidden_name.clone());
        let (file, hidden) = (Some(file), Some(hidden));
        Ok(Self { file, hidden, hidden_name, target, name, replace, is_unique: false })
    }

    /// The name that was asked for.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// From now on what is written stays under the hidden name if it gets no other: what is recorded live
    /// cannot be made again.
    pub fn keep(&mut self) {
        self.is_unique = true;
    }

    /// The hidden name.
    pub fn hidden_name(&self) -> &Path {
        &self.hidden_name
    }

    /// Gives the file its final name.
    ///
    /// # Errors
    /// [`FileError::Exists`] if a file appeared under the name and must not be replaced, or the system's
    /// refusal to store the bytes or to give the name; then no file remains.
    pub fn commit(self) -> Result<(), FileError> {
        commit_all(vec![self])
    }

    /// Brings the bytes to the disk and closes the file, which has no name yet; later writes fail. Sets of
    /// many files need no more than one open file this way.
    ///
    /// # Errors
    /// The system's refusal.
    pub fn seal(&mut self) -> Result<(), FileError> {
        let Some(file) = self.file.take() else { return Ok(()) };
        match file.sync_all() {
            // Some file systems have no such call.
            Err(error) if matches!(error.kind(), ErrorKind::Unsupported | ErrorKind::InvalidInput) => Ok(()),
            other => other.map_err(FileError::system(&self.name, "write it to the end")),
        }
    }

    /// Gives the file, sealed before, its name.
    fn place(&mut self) -> Result<(), FileError> {
        let Some(hidden) = self.hidden.take() else { return Ok(()) };
        let placed = match self.replace {
            true => hidden.persist(&self.target),
            false => persist_new(hidden, &self.target),
        };
        placed.map_err(|refused| {
            self.hidden = Some(refused.path);
            match refused.error.kind() {
                ErrorKind::AlreadyExists if !self.replace => FileError::Exists { file: self.name.clone() },
                _ => FileError::system(&self.name, "give the finished file its name")(refused.error),
            }
        })
    }

    fn file(&mut self) -> io::Result<&mut File> {
        self.file.as_mut().ok_or_else(|| io::Error::other("the file is already closed"))
    }
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        let mut files = unfinished();
        if let Some(hidden) = &mut self.hidden {
            let holds_something = hidden.metadata().is_ok_and(|known| known.len() > 0);
            hidden.disable_cleanup(self.is_unique && holds_something);
        }
        drop(self.hidden.take());
        files.remove(&self.hidden_name);
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

/// Gives several files their final names, once all of them are whole and on the disk.
///
/// # Errors
/// As [`AtomicFile::commit`], for the first file that fails; [`FileError::InPart`] names the files that have
/// their names already.
pub fn commit_all(mut files: Vec<AtomicFile>) -> Result<(), FileError> {
    // Late disk errors occur here, before the first file gets its name.
    files.iter_mut().try_for_each(AtomicFile::seal)?;
    let is_taken = |file: &&AtomicFile| !file.replace && file.target.symlink_metadata().is_ok();
    if let Some(file) = files.iter().find(is_taken) {
        return Err(FileError::Exists { file: file.name.clone() });
    }
    let _names = unfinished();
    for k in 0..files.len() {
        let placed = files[k].place();
        placed.map_err(|error| error.after(files[..k].iter().map(AtomicFile::name)))?;
    }
    Ok(())
}

/// Refuses what [`AtomicFile::create`] would refuse, without a file: for a run that takes long before it
/// writes.
///
/// # Errors
/// As [`AtomicFile::create`].
pub fn check_output(path: &Path, replace: bool) -> Result<(), FileError> {
    let (target, _) = destination(path, replace)?;
    folder_of(&target).metadata().map(drop).map_err(FileError::system(&path.display().to_string(), CREATE))
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Where a file of this name has to be put, and the plain file that is there and may be replaced.
fn destination(path: &Path, replace: bool) -> Result<(PathBuf, Option<Metadata>), FileError> {
    let file = path.display().to_string();
    let refused = |what| Err(FileError::NotAFile { file: file.clone(), what });
    match path.metadata() {
        Err(error) if error.kind() == ErrorKind::NotFound && path.is_symlink() => {
            refused("a link to nothing; remove the link, or give the name that it should lead to")
        }
        Err(error) if error.kind() == ErrorKind::NotFound => Ok((path.to_owned(), None)),
        // A name that is too long, for example, of which the hidden name knows nothing.
        Err(error) => Err(FileError::system(&file, CREATE)(error)),
        Ok(known) if known.is_dir() => refused("a folder; give the name of a file in it"),
        // A rename would put a plain file in the place of /dev/full or of a pipe that somebody listens to.
        Ok(known) if !known.is_file() => Err(FileError::Special { file }),
        Ok(_) if !replace => Err(FileError::Exists { file }),
        Ok(known) => {
            let target = path.canonicalize().map_err(FileError::system(&file, CREATE))?;
            Ok((target, Some(known)))
        }
    }
}

/// Opens a new file next to `target`, with the permissions of an ordinary one or of the one that it
/// replaces.
fn begin_beside(target: &Path, replaced: Option<&Metadata>) -> io::Result<(File, TempPath)> {
    let name = target.file_name().ok_or(ErrorKind::InvalidFilename)?.to_string_lossy();
    let prefix = format!(".{}.", name.chars().take(NAME_PART).collect::<String>());
    let mut builder = Builder::new();
    builder.prefix(&prefix).suffix(".part");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let mode = replaced.map_or(0o666, |known| known.permissions().mode() & 0o777);
        builder.permissions(fs::Permissions::from_mode(mode));
    }
    let (file, hidden) = builder.tempfile_in(folder_of(target))?.into_parts();
    if let Some(known) = replaced {
        // What the system refuses here was more than it gives to a new file.
        let _ = file.set_permissions(known.permissions());
    }
    Ok((file, hidden))
}

/// Gives a file a name that nothing must have.
fn persist_new(hidden: TempPath, target: &Path) -> Result<(), PathPersistError> {
    match hidden.persist_noclobber(target) {
        // The file system can neither rename without replacing nor link, so another process may create the
        // file between this check and the rename.
        Err(refused)
            if refused.error.kind() != ErrorKind::AlreadyExists && target.symlink_metadata().is_err() =>
        {
            refused.path.persist(target)
        }
        other => other,
    }
}

#[cfg(test)]
mod tests;
