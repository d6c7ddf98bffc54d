//! A file that appears only when it is complete.

use super::error::CREATE;
use super::identity::Begun;
use super::{FileError, hidden, rename};
use crate::messages::Quoted;
use std::collections::BTreeMap;
use std::fs::{self, File, Metadata, OpenOptions};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Maximum length of a chain of links, as in Linux.
const MOST_LINKS: usize = 40;

/// Unfinished files of this process.
static UNFINISHED: Mutex<BTreeMap<PathBuf, Begun>> = Mutex::new(BTreeMap::new());

/// The outputs of this process that have their names, as they were asked for. Whoever gives names holds the
/// lock meanwhile, so an end by [`remove_unfinished`] comes before or after all names of a set.
static NAMED: Mutex<Vec<String>> = Mutex::new(Vec::new());

/// Removes all files of this process that have not been committed: for a thread that is about to end the
/// process while others are writing. Other threads can neither begin, commit nor drop a file afterwards;
/// they wait for the end. Returns the names of the files that were committed before.
pub fn remove_unfinished() -> Vec<String> {
    let named = names_given();
    let files = UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner);
    files.iter().for_each(|(path, begun)| drop(begun.remove(path)));
    std::mem::forget(files);
    let committed = named.clone();
    std::mem::forget(named);
    committed
}

/// The names of the files of this process that have been committed, in their order.
pub(super) fn committed() -> Vec<String> {
    names_given().clone()
}

/// For whoever gives names, until it is done.
fn names_given() -> MutexGuard<'static, Vec<String>> {
    NAMED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A file that is written under a hidden name beside its target and gets its name by
/// [`AtomicFile::commit`]; if it is dropped before, it is removed. The hidden name is
/// `.NAME.HOST-PROCESS-NUMBER.part`; an existing file of that name is never changed.
#[derive(Debug)]
pub struct AtomicFile {
    file: Option<File>,
    beside: PathBuf,
    begun: Begun,
    target: PathBuf,
    name: String,
    replace: bool,
    /// What is written cannot be made again: it stays under the hidden name if it gets no other.
    is_unique: bool,
}

/// How a file got its name; this determines how to undo it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Placed {
    /// The name was free.
    New,
    /// The hidden name is now that of the file that was replaced.
    Exchanged,
    /// The file that had the name is deleted.
    Replaced,
}

impl AtomicFile {
    /// Starts a file that will be called `target`, with `replace` in the place of one that exists and with
    /// its owner and permission bits. A link is followed to the file that it leads to.
    ///
    /// # Errors
    /// [`FileError::Exists`] if there is one already and `replace` is not set, [`FileError::NotAFile`] for a
    /// folder or a link to nothing, [`FileError::Special`] for a device, pipe, socket or open descriptor, or
    /// the system's refusal.
    pub fn create(target: &Path, replace: bool) -> Result<Self, FileError> {
        let name = target.display().to_string();
        let (target, known) = allowed(target, replace)?;
        let begin = || {
            let (beside, file, begun) = unfinished(|files| {
                let (beside, file) = create_beside(&target, known.is_some())?;
                let begun = Begun::of(&file);
                files.insert(beside.clone(), begun);
                io::Result::Ok((beside, file, begun))
            })?;
            let (file, name) = (Some(file), name.clone());
            let created = Self { file, beside, begun, target, name, replace, is_unique: false };
            if let (Some(file), Some(known)) = (&created.file, known) {
                rename::keep_access(file, &known)?;
            }
            Ok(created)
        };
        begin().map_err(FileError::system(&name, CREATE))
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
        &self.beside
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
        rename::sync_and_close(file).map_err(FileError::system(&self.name, "write it to the end"))
    }

    /// Gives the file, sealed before, its name: in a way that can be undone if the system allows, unless it
    /// is the last of its set.
    fn place(&mut self, is_last: bool) -> Result<Placed, FileError> {
        if !self.begun.is_at(&self.beside) {
            let (file, hidden) = (self.name.clone(), self.beside.display().to_string());
            return Err(FileError::Replaced { file, hidden });
        }
        let placed = match rename::rename_new(&self.beside, &self.target) {
            Err(error) if self.replace && is_last && error.kind() == io::ErrorKind::AlreadyExists => {
                fs::rename(&self.beside, &self.target).map(|()| Placed::Replaced)
            }
            Err(error) if self.replace && error.kind() == io::ErrorKind::AlreadyExists => self.exchange(),
            other => other.map(|()| Placed::New),
        };
        placed.map_err(|error| self.refused(error))
    }

    /// Gives the file the name of another file, which gets the hidden one if the system allows.
    fn exchange(&mut self) -> io::Result<Placed> {
        match rename::exchange(&self.beside, &self.target) {
            Err(error) if error.kind() == io::ErrorKind::Unsupported => {
                return fs::rename(&self.beside, &self.target).map(|()| Placed::Replaced);
            }
            exchanged => exchanged?,
        }
        // The system exchanges a file with a folder too, and no output replaces a folder.
        if self.beside.symlink_metadata().is_ok_and(|found| found.is_dir()) {
            rename::exchange(&self.beside, &self.target)?;
            return Err(io::ErrorKind::IsADirectory.into());
        }
        self.begun = Begun::at(&self.beside);
        Ok(Placed::Exchanged)
    }

    /// Takes the name back; what was replaced gets its own again. Gives the name if that is impossible.
    fn undo(mut self, placed: Placed) -> Option<String> {
        let undone = match placed {
            Placed::New => fs::rename(&self.target, &self.beside).or_else(|error| match self.is_unique {
                true => Err(error),
                false => fs::remove_file(&self.target),
            }),
            Placed::Exchanged => rename::exchange(&self.beside, &self.target),
            Placed::Replaced => Err(io::ErrorKind::Unsupported.into()),
        };
        match (undone, placed) {
            (Ok(()), Placed::Exchanged) => self.begun = Begun::at(&self.beside),
            (Ok(()), _) => {}
            (Err(_), Placed::Exchanged) => {
                // The file that was replaced has the hidden name, and keeps it.
                self.is_unique = true;
                return Some(format!(
                    "{} (what it replaced is in {})",
                    Quoted(&self.name),
                    Quoted(&self.beside)
                ));
            }
            (Err(_), _) => {
                self.forget();
                return Some(Quoted(&self.name).to_string());
            }
        }
        None
    }

    /// Makes the new name final. What was replaced has the hidden name now, and goes; otherwise gives that
    /// name and the reason.
    fn confirm(mut self, placed: Placed) -> Result<(), (String, io::Error)> {
        let removed = match placed {
            Placed::Exchanged => self.begun.remove(&self.beside),
            Placed::New | Placed::Replaced => Ok(()),
        };
        let hidden = Quoted(&self.beside).to_string();
        self.forget();
        removed.map_err(|source| (hidden, source))
    }

    /// Whether nothing has been written to the open file.
    fn holds_nothing(&self) -> bool {
        self.file.as_ref().is_some_and(|file| file.metadata().is_ok_and(|known| known.len() == 0))
    }

    /// Nothing has the hidden name any more.
    fn forget(&mut self) {
        unfinished(|files| files.remove(&self.beside));
        self.beside = PathBuf::new();
    }

    fn refused(&self, error: io::Error) -> FileError {
        let file = self.name.clone();
        if error.kind() == io::ErrorKind::AlreadyExists && !self.replace {
            return FileError::Exists { file };
        }
        FileError::System { file, action: "give the finished file its name", source: error }
    }

    fn file(&mut self) -> io::Result<&mut File> {
        self.file.as_mut().ok_or_else(|| io::Error::other("the file is already closed"))
    }
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        if !self.beside.as_os_str().is_empty() {
            if !self.is_unique || self.holds_nothing() {
                // The error that led here, or the end of the process, matters more.
                let _ = self.begun.remove(&self.beside);
            }
            self.forget();
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

/// Renames several files to their final names: all of them or, as far as the file system allows, none. The
/// documentation of [this module](super) describes the limits.
///
/// # Errors
/// As [`AtomicFile::commit`], for the first file that fails; the others are taken back.
/// [`FileError::OldFilesStay`] if all are in place and files that they replaced could not be removed.
pub fn commit_all(mut files: Vec<AtomicFile>) -> Result<(), FileError> {
    // Late disk errors occur here, before the first file gets its name.
    files.iter_mut().try_for_each(AtomicFile::seal)?;
    let mut named = names_given();
    let mut placed = Vec::with_capacity(files.len());
    let last = files.len().saturating_sub(1);
    for (k, mut file) in files.into_iter().enumerate() {
        match file.place(k == last) {
            Ok(how) => placed.push((file, how)),
            Err(error) => {
                let stay: Vec<_> =
                    placed.into_iter().rev().filter_map(|(file, how)| file.undo(how)).collect();
                return Err(error.beside(stay));
            }
        }
    }
    named.extend(placed.iter().map(|(file, _)| file.name.clone()));
    let refused = placed.into_iter().filter_map(|(file, how)| file.confirm(how).err());
    let (hidden, reasons): (Vec<_>, Vec<_>) = refused.unzip();
    match reasons.into_iter().next() {
        Some(source) => Err(FileError::OldFilesStay { hidden, source }),
        None => Ok(()),
    }
}

fn unfinished<R>(change: impl FnOnce(&mut BTreeMap<PathBuf, Begun>) -> R) -> R {
    change(&mut UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner))
}

/// The [`destination`] of a file that may be begun.
fn allowed(path: &Path, replace: bool) -> Result<(PathBuf, Option<Metadata>), FileError> {
    let (target, known) = destination(path)?;
    match known {
        Some(_) if !replace => Err(FileError::Exists { file: path.display().to_string() }),
        _ => Ok((target, known)),
    }
}

/// Refuses what [`AtomicFile::create`] would refuse, without a file: for a run that takes long before it
/// writes.
///
/// # Errors
/// As [`AtomicFile::create`].
pub fn check_output(path: &Path, replace: bool) -> Result<(), FileError> {
    let (target, _) = allowed(path, replace)?;
    folder_of(&target).metadata().map(drop).map_err(FileError::system(&path.display().to_string(), CREATE))
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Where a file of this name has to be put, and the plain file that is there.
fn destination(path: &Path) -> Result<(PathBuf, Option<Metadata>), FileError> {
    let refused = |what| Err(FileError::NotAFile { file: path.display().to_string(), what });
    let found = match path.symlink_metadata() {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok((path.to_owned(), None)),
        // A name that is too long, for example, of which the hidden name knows nothing.
        found => found.map_err(FileError::system(&path.display().to_string(), CREATE))?,
    };
    let (target, found) = if found.is_symlink() { follow(path)? } else { (path.to_owned(), found) };
    match found {
        _ if found.is_file() => Ok((target, Some(found))),
        _ if found.is_dir() => refused("a folder; give the name of a file in it"),
        // A rename would put a plain file in the place of /dev/full or of a pipe that somebody listens to.
        _ => Err(special(path, "a device, pipe or socket")),
    }
}

fn special(path: &Path, what: &'static str) -> FileError {
    FileError::Special { file: path.display().to_string(), what }
}

/// The end of a chain of links, or what is wrong with it.
fn follow(link: &Path) -> Result<(PathBuf, Metadata), FileError> {
    let refused = |what| FileError::NotAFile { file: link.display().to_string(), what };
    let nothing = || refused("a link to nothing; remove the link, or give the name that it should lead to");
    let mut path = link.to_owned();
    for _ in 0..MOST_LINKS {
        let folder = folder_of(&path).to_owned();
        // Links there stand for open files (/dev/stdout), not for names.
        if folder.canonicalize().is_ok_and(|folder| folder.starts_with("/proc")) {
            return Err(special(link, "a link to an open file"));
        }
        path = folder.join(fs::read_link(&path).map_err(|_| nothing())?);
        let found = path.symlink_metadata().map_err(|_| nothing())?;
        if !found.is_symlink() {
            return Ok((path, found));
        }
    }
    Err(refused("a link that leads back to itself; remove it"))
}

/// Opens a new file next to `target`, under an unused name; `private` until its permissions are set.
fn create_beside(target: &Path, private: bool) -> io::Result<(PathBuf, File)> {
    let mut options = OpenOptions::new();
    options.write(true).read(true).create_new(true);
    #[cfg(unix)]
    if private {
        std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    }
    #[cfg(not(unix))]
    let _ = private;
    for number in 0..1000u32 {
        let beside = hidden::beside(target, std::process::id(), number);
        let beside = beside.ok_or(io::ErrorKind::InvalidFilename)?;
        match options.open(&beside) {
            Ok(file) => return Ok((beside, file)),
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(error),
        }
    }
    Err(io::ErrorKind::AlreadyExists.into())
}

#[cfg(test)]
mod tests;
