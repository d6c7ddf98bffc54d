//! A file that appears only when it is complete.

use super::{FileError, hidden, rename};
use std::collections::BTreeSet;
use std::fs::{self, File, Metadata, OpenOptions};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Maximum length of a chain of links, as in Linux.
const MOST_LINKS: usize = 40;

const OTHER_KIND: &str = "a device, pipe or socket, not a file; write to `-` and redirect";

/// Unfinished files of this process.
static UNFINISHED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// The outputs of this process that have their names, as they were asked for. Whoever gives names holds the
/// lock meanwhile, so an end by [`remove_unfinished`] comes before or after all names of a set.
static NAMED: Mutex<Vec<String>> = Mutex::new(Vec::new());

/// Removes all files of this process that have not been committed: for a thread that is about to end the
/// process while others are writing. Other threads can neither begin, commit nor drop a file afterwards;
/// they wait for the end. Returns the names of the files that were committed before.
pub fn remove_unfinished() -> Vec<String> {
    let named = names_given();
    let files = UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner);
    for path in files.iter() {
        // An error cannot be reported from here.
        let _ = fs::remove_file(path);
    }
    std::mem::forget(files);
    let committed = named.clone();
    std::mem::forget(named);
    committed
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
    target: PathBuf,
    name: String,
    replace: bool,
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
    /// its permission bits. A link is followed to the file that it leads to.
    ///
    /// # Errors
    /// [`FileError::Exists`] if there is one already and `replace` is not set, [`FileError::NotAFile`] for
    /// what is no plain file (a folder, device, pipe, socket, link to nothing or open descriptor), or the
    /// system's refusal.
    pub fn create(target: &Path, replace: bool) -> Result<Self, FileError> {
        let name = target.display().to_string();
        let (target, known) = destination(target)?;
        if known.is_some() && !replace {
            return Err(FileError::Exists { file: name });
        }
        let begin = || {
            let (beside, file) = unfinished(|files| {
                let created = create_beside(&target, known.is_some())?;
                files.insert(created.0.clone());
                io::Result::Ok(created)
            })?;
            let begun = Self { file: Some(file), beside, target, name: name.clone(), replace };
            if let (Some(file), Some(known)) = (&begun.file, known) {
                file.set_permissions(known.permissions())?;
            }
            Ok(begun)
        };
        begin().map_err(FileError::system(&name, "create it"))
    }

    /// The name that was asked for.
    pub fn name(&self) -> &str {
        &self.name
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
    fn exchange(&self) -> io::Result<Placed> {
        if rename::exchange(&self.beside, &self.target).is_err() {
            return fs::rename(&self.beside, &self.target).map(|()| Placed::Replaced);
        }
        // The system exchanges a file with a folder too, and no output replaces a folder.
        if self.beside.symlink_metadata().is_ok_and(|found| found.is_dir()) {
            rename::exchange(&self.beside, &self.target)?;
            return Err(io::ErrorKind::IsADirectory.into());
        }
        Ok(Placed::Exchanged)
    }

    /// Takes the name back; what was replaced gets its own again, unless it is gone.
    fn undo(mut self, placed: Placed) {
        // The failure that led here is reported; a second one adds nothing.
        match placed {
            Placed::New => drop(fs::remove_file(&self.target)),
            Placed::Exchanged => drop(rename::exchange(&self.beside, &self.target)),
            Placed::Replaced => {}
        }
        if placed != Placed::Exchanged {
            self.forget();
        }
    }

    /// Makes the new name final.
    fn keep(mut self, placed: Placed) {
        if placed != Placed::Exchanged {
            self.forget();
        }
        // Otherwise the hidden name is that of the old file, which goes with this value.
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
            // A second error is not reported: the first one is already being returned.
            let _ = fs::remove_file(&self.beside);
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
                placed.into_iter().rev().for_each(|(file, how)| file.undo(how));
                return Err(error);
            }
        }
    }
    named.extend(placed.iter().map(|(file, _)| file.name.clone()));
    placed.into_iter().for_each(|(file, how)| file.keep(how));
    Ok(())
}

fn unfinished<R>(change: impl FnOnce(&mut BTreeSet<PathBuf>) -> R) -> R {
    change(&mut UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner))
}

/// Where a file of this name has to be put, and the plain file that is there.
fn destination(path: &Path) -> Result<(PathBuf, Option<Metadata>), FileError> {
    let refused = |what| Err(FileError::NotAFile { file: path.display().to_string(), what });
    let Ok(found) = path.symlink_metadata() else { return Ok((path.to_owned(), None)) };
    let (target, found) = if found.is_symlink() {
        match follow(path) {
            Ok(end) => end,
            Err(what) => return refused(what),
        }
    } else {
        (path.to_owned(), found)
    };
    match found {
        _ if found.is_file() => Ok((target, Some(found))),
        _ if found.is_dir() => refused("a folder; give the name of a file in it"),
        // A rename would put a plain file in the place of /dev/full or of a pipe that somebody listens to.
        _ => refused(OTHER_KIND),
    }
}

/// The end of a chain of links, or what is wrong with it.
fn follow(link: &Path) -> Result<(PathBuf, Metadata), &'static str> {
    const NOTHING: &str = "a link to nothing; remove the link, or give the name that it should lead to";
    let mut path = link.to_owned();
    for _ in 0..MOST_LINKS {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let folder = folder.unwrap_or(Path::new(".")).to_owned();
        // Links there stand for open files (/dev/stdout), not for names.
        if folder.canonicalize().is_ok_and(|folder| folder.starts_with("/proc")) {
            return Err("a link to an open file; write to `-` and redirect");
        }
        path = folder.join(fs::read_link(&path).map_err(|_| NOTHING)?);
        let found = path.symlink_metadata().map_err(|_| NOTHING)?;
        if !found.is_symlink() {
            return Ok((path, found));
        }
    }
    Err("a link that leads back to itself; remove it")
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
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap();
        let mut names: Vec<_> =
            entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
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
    fn replaces_only_when_asked() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("out.wav");
        fs::write(&target, "old").unwrap();
        let error = AtomicFile::create(&target, false).unwrap_err();
        assert!(matches!(error, FileError::Exists { .. }) && error.to_string().contains("--force"));
        assert_eq!(fs::read(&target).unwrap(), b"old");
        AtomicFile::create(&target, true).unwrap().commit().unwrap();
        assert_eq!(fs::read(&target).unwrap(), b"");
    }

    #[test]
    fn what_came_in_between_is_kept() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("out.wav");
        // Two runs that began before either of them ended.
        let mut first = AtomicFile::create(&target, false).unwrap();
        let mut second = AtomicFile::create(&target, false).unwrap();
        first.write_all(b"first").unwrap();
        second.write_all(b"second").unwrap();
        first.commit().unwrap();
        assert!(matches!(second.commit().unwrap_err(), FileError::Exists { .. }));
        assert_eq!(fs::read(&target).unwrap(), b"first");
        assert_eq!(names(folder.path()), ["out.wav"]);
    }

    #[test]
    fn hidden_names_of_others_are_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        let stale = hidden::beside(&folder.path().join("out.wav"), std::process::id(), 0).unwrap();
        fs::write(&stale, "not ours").unwrap();
        let target = folder.path().join("out.wav");
        AtomicFile::create(&target, false).unwrap().commit().unwrap();
        drop(AtomicFile::create(&target, true).unwrap());
        assert_eq!(fs::read(&stale).unwrap(), b"not ours");
    }

    #[test]
    fn a_name_as_long_as_the_system_allows_is_no_fault() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("x".repeat(250));
        AtomicFile::create(&target, false).unwrap().commit().unwrap();
        assert!(target.exists());
    }

    #[cfg(unix)]
    #[test]
    fn a_replaced_file_keeps_its_permissions_and_is_never_more_open() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("out.wav");
        for mode in [0o600, 0o640, 0o444] {
            let _ = fs::remove_file(&target);
            fs::write(&target, "old").unwrap();
            fs::set_permissions(&target, fs::Permissions::from_mode(mode)).unwrap();
            let file = AtomicFile::create(&target, true).unwrap();
            assert_eq!(file.beside.metadata().unwrap().permissions().mode() & 0o777, mode);
            file.commit().unwrap();
            assert_eq!(target.metadata().unwrap().permissions().mode() & 0o777, mode);
        }
    }

    #[cfg(unix)]
    #[test]
    fn links_are_followed_or_refused_but_never_replaced() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        fs::create_dir(path("sub")).unwrap();
        fs::write(path("sub/real"), "old").unwrap();
        symlink("sub/real", path("link")).unwrap();
        symlink("link", path("second")).unwrap();
        symlink("none", path("dangling")).unwrap();
        symlink("circle", path("circle")).unwrap();
        assert!(matches!(AtomicFile::create(&path("second"), false), Err(FileError::Exists { .. })));
        let mut file = AtomicFile::create(&path("second"), true).unwrap();
        file.write_all(b"new").unwrap();
        file.commit().unwrap();
        assert_eq!(fs::read(path("sub/real")).unwrap(), b"new");
        for (name, part) in [("dangling", "link to nothing"), ("circle", "back to itself")] {
            let error = AtomicFile::create(&path(name), true).unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        }
        for name in ["link", "second", "dangling", "circle"] {
            assert!(path(name).symlink_metadata().unwrap().is_symlink(), "{name}");
        }
        assert_eq!(names(&path("sub")), ["real"]);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn links_to_open_files_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let open = File::create(folder.path().join("open")).unwrap();
        let descriptor = format!("/proc/self/fd/{}", std::os::fd::AsRawFd::as_raw_fd(&open));
        std::os::unix::fs::symlink(&descriptor, folder.path().join("link")).unwrap();
        for path in [PathBuf::from(descriptor), folder.path().join("link")] {
            let error = AtomicFile::create(&path, true).unwrap_err().to_string();
            assert!(error.contains("open file") && error.contains("redirect"), "{error}");
        }
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

    #[test]
    fn unfinished_files_can_be_removed_from_elsewhere() {
        // Not remove_unfinished itself: other tests of this process are writing.
        let folder = tempfile::tempdir().unwrap();
        let file = AtomicFile::create(&folder.path().join("out.wav"), false).unwrap();
        assert!(unfinished(|files| files.contains(&file.beside)));
        let beside = file.beside.clone();
        file.commit().unwrap();
        assert!(unfinished(|files| !files.contains(&beside)));
    }

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
