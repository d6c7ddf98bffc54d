//! System calls that rename files, and give them the access of the files that they replace.

use std::fs::{self, File, Metadata};
use std::io;
use std::path::Path;

/// Gives `from` the name `to`, which nothing must have.
///
/// # Errors
/// `AlreadyExists` if something has it, or the system's refusal.
pub(super) fn rename_new(from: &Path, to: &Path) -> io::Result<()> {
    match rename_without_replacing(from, to) {
        Err(error) if error.kind() == io::ErrorKind::Unsupported => {}
        other => return other,
    }
    match fs::hard_link(from, to) {
        Ok(()) => fs::remove_file(from),
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => Err(error),
        // The file system supports neither call, so another process may create the file between this check
        // and the rename.
        Err(_) if to.symlink_metadata().is_ok() => Err(io::ErrorKind::AlreadyExists.into()),
        Err(_) => fs::rename(from, to),
    }
}

#[cfg(target_os = "linux")]
fn rename_without_replacing(from: &Path, to: &Path) -> io::Result<()> {
    rename_with(from, to, rustix::fs::RenameFlags::NOREPLACE)
}

#[cfg(not(target_os = "linux"))]
fn rename_without_replacing(_: &Path, _: &Path) -> io::Result<()> {
    Err(io::ErrorKind::Unsupported.into())
}

/// Exchanges the names of two files in one step.
///
/// # Errors
/// `Unsupported` where the system cannot, or its refusal.
#[cfg(target_os = "linux")]
pub(super) fn exchange(a: &Path, b: &Path) -> io::Result<()> {
    rename_with(a, b, rustix::fs::RenameFlags::EXCHANGE)
}

#[cfg(not(target_os = "linux"))]
pub(super) fn exchange(_: &Path, _: &Path) -> io::Result<()> {
    Err(io::ErrorKind::Unsupported.into())
}

#[cfg(target_os = "linux")]
fn rename_with(from: &Path, to: &Path, flags: rustix::fs::RenameFlags) -> io::Result<()> {
    use rustix::fs::{CWD, renameat_with};
    use rustix::io::Errno;
    match renameat_with(CWD, from, CWD, to, flags) {
        // A file system that does not know the flag answers "invalid".
        Err(Errno::INVAL | Errno::NOSYS | Errno::OPNOTSUPP) => Err(io::ErrorKind::Unsupported.into()),
        other => Ok(other?),
    }
}

/// Gives `file` the owner and the permission bits of the file that it is to replace. Only root gives files
/// away: others keep the group at most, and then no bits by which a program runs as its owner.
///
/// # Errors
/// The system's refusal of the permissions.
#[cfg(unix)]
pub(super) fn keep_access(file: &File, replaced: &Metadata) -> io::Result<()> {
    use std::os::unix::fs::{MetadataExt, PermissionsExt, fchown};
    let known = file.metadata()?;
    let (owner, group) = (replaced.uid(), replaced.gid());
    let is_kept =
        (known.uid(), known.gid()) == (owner, group) || fchown(file, Some(owner), Some(group)).is_ok();
    if !is_kept {
        let _ = fchown(file, None, Some(group));
    }
    let mut permissions = replaced.permissions();
    permissions.set_mode(permissions.mode() & if is_kept { 0o7777 } else { 0o1777 });
    file.set_permissions(permissions)
}

#[cfg(not(unix))]
pub(super) fn keep_access(file: &File, replaced: &Metadata) -> io::Result<()> {
    file.set_permissions(replaced.permissions())
}

/// Brings all bytes to the disk and closes the file; some file systems report a failed write only now.
///
/// # Errors
/// The system's.
pub(super) fn sync_and_close(file: File) -> io::Result<()> {
    match file.sync_all() {
        // Some file systems have no such call.
        Err(error) if matches!(error.kind(), io::ErrorKind::Unsupported | io::ErrorKind::InvalidInput) => {}
        other => other?,
    }
    close(file)
}

#[cfg(unix)]
fn close(file: File) -> io::Result<()> {
    nix::unistd::close(file).map_err(io::Error::from)
}

#[cfg(not(unix))]
fn close(file: File) -> io::Result<()> {
    drop(file);
    Ok(())
}
