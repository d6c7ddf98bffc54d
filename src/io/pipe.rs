//! Standard input and output as files, and pipes wide enough for two processors.

use std::fs::File;
use std::io;

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

/// Standard output without line buffering.
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

/// Files that are no pipes, and systems that refuse, stay as they are.
#[cfg(target_os = "linux")]
pub(super) fn widen_pipe(file: &File) {
    let _ = rustix::pipe::fcntl_setpipe_size(file, PIPE_BYTES);
}

#[cfg(not(target_os = "linux"))]
pub(super) fn widen_pipe(_: &File) {}
