//! Standard input and output as files, and pipes with buffers large enough for two processes.

use super::IoError;
use crate::files::is_same_file;
use crate::messages::Quoted;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

/// Pipes are widened to this where the system allows it; 64 KiB would halve the throughput
/// between two processors.
#[cfg(target_os = "linux")]
const PIPE_BYTES: usize = 1 << 20;

/// Standard input without the buffer that the library's handle shares between threads.
#[cfg(unix)]
pub(super) fn stdin_file() -> io::Result<File> {
    use std::os::fd::AsFd;
    let file = File::from(io::stdin().as_fd().try_clone_to_owned()?);
    widen_pipe(&file);
    Ok(file)
}

#[cfg(not(unix))]
pub(super) fn stdin_file() -> io::Result<io::Stdin> {
    Ok(io::stdin())
}

/// Standard output without line buffering, with a wide pipe where the system allows it.
///
/// # Errors
/// The system's refusal to duplicate the descriptor.
#[cfg(unix)]
pub fn stdout_file() -> io::Result<File> {
    use std::os::fd::AsFd;
    let file = File::from(io::stdout().as_fd().try_clone_to_owned()?);
    widen_pipe(&file);
    Ok(file)
}

/// Standard output.
///
/// # Errors
/// None here.
#[cfg(not(unix))]
pub fn stdout_file() -> io::Result<io::Stdout> {
    Ok(io::stdout())
}

/// A FIFO in place of standard output; waits for its reader.
///
/// # Errors
/// The system's refusal to open it.
pub fn open_fifo(path: &Path) -> io::Result<File> {
    let file = File::options().write(true).open(path)?;
    widen_pipe(&file);
    Ok(file)
}

/// Other files are not changed, nor are pipes whose buffer the system refuses to enlarge.
#[cfg(target_os = "linux")]
pub(super) fn widen_pipe(file: &File) {
    let _ = rustix::pipe::fcntl_setpipe_size(file, PIPE_BYTES);
}

#[cfg(not(target_os = "linux"))]
pub(super) fn widen_pipe(_: &File) {}

/// Two readers of one pipe would each get only some of its bytes.
pub(super) fn refuse_shared_pipes(paths: &[PathBuf]) -> Result<(), IoError> {
    let pipes: Vec<_> = paths.iter().filter(|path| is_pipe(path)).collect();
    for (i, second) in pipes.iter().enumerate() {
        if let Some(first) = pipes[..i].iter().find(|first| is_same_file(first, second)) {
            return Err(IoError::unfit(&second.display().to_string())(format!(
                "the same pipe as {}, each byte of which only one of them would get; give each channel a pipe of its own",
                Quoted(first)
            )));
        }
    }
    Ok(())
}

/// The path, and for `-` that of standard input.
#[cfg(unix)]
fn of_input(path: &Path) -> &Path {
    if path.as_os_str() == "-" { Path::new("/dev/stdin") } else { path }
}

/// True for a file, which has an end, and for `-` if standard input is one.
#[cfg(unix)]
pub(super) fn is_file(path: &Path) -> bool {
    of_input(path).is_file()
}

/// True for a file other than standard input.
#[cfg(not(unix))]
pub(super) fn is_file(path: &Path) -> bool {
    path.as_os_str() != "-" && path.is_file()
}

/// True for a FIFO, pipe or socket, and for `-` if standard input is one.
#[cfg(unix)]
pub fn is_pipe(path: &Path) -> bool {
    use std::os::unix::fs::FileTypeExt;
    of_input(path).metadata().is_ok_and(|known| known.file_type().is_fifo() || known.file_type().is_socket())
}

/// True for standard input.
#[cfg(not(unix))]
pub fn is_pipe(path: &Path) -> bool {
    path.as_os_str() == "-"
}
