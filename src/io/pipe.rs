//! Standard input and output as files, and pipes with buffers large enough for two processes.

use super::IoError;
use crate::files::{StandardStream, is_same_file};
use crate::messages::Quoted;
use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Pipes are widened to this where the system allows it; 64 KiB would halve the throughput
/// between two processors.
#[cfg(target_os = "linux")]
const PIPE_BYTES: usize = 1 << 20;

/// Standard input without the buffer that the library's handle shares between threads.
#[cfg(unix)]
pub(super) fn stdin_file() -> io::Result<File> {
    use std::os::fd::AsFd;
    StandardStream::Input.check()?;
    let file = File::from(io::stdin().as_fd().try_clone_to_owned()?);
    widen_pipe(&file);
    Ok(file)
}

#[cfg(not(unix))]
pub(super) fn stdin_file() -> io::Result<io::Stdin> {
    StandardStream::Input.check()?;
    Ok(io::stdin())
}

/// Standard output without line buffering.
#[cfg(unix)]
fn stdout_file() -> io::Result<File> {
    use std::os::fd::AsFd;
    StandardStream::Output.check()?;
    let file = File::from(io::stdout().as_fd().try_clone_to_owned()?);
    widen_pipe(&file);
    Ok(file)
}

#[cfg(not(unix))]
fn stdout_file() -> io::Result<io::Stdout> {
    StandardStream::Output.check()?;
    Ok(io::stdout())
}

/// When the write to a stream that is under way began, in milliseconds since [`CLOCK`]; 0 for none.
static STDOUT_WRITE_BEGAN: AtomicU64 = AtomicU64::new(0);
static REPORT_WRITE_BEGAN: AtomicU64 = AtomicU64::new(0);
static STDERR_WRITE_BEGAN: AtomicU64 = AtomicU64::new(0);
static CLOCK: LazyLock<Instant> = LazyLock::new(Instant::now);

/// Bytes of one write. During a longer one it would be unknown whether it makes progress.
const WRITE_BYTES: usize = 64 << 10;

/// A standard stream; [`is_output_stalled`] knows how long its writes wait.
///
/// ```
/// use hybank::io::{Stdout, is_output_stalled};
/// use std::{io::Write, time::Duration};
/// let mut output = Stdout::for_samples()?;
/// output.write_all(b"0.5,-0.5\n")?;
/// assert!(!is_output_stalled(Duration::from_secs(1)));
/// # Ok::<(), std::io::Error>(())
/// ```
pub struct Watched<W> {
    stream: W,
    began: &'static AtomicU64,
}

/// Standard output for samples, without a buffer.
#[cfg(unix)]
pub type Stdout = Watched<File>;
/// Standard output for samples.
#[cfg(not(unix))]
pub type Stdout = Watched<io::Stdout>;

impl Stdout {
    /// Standard output, with a wide pipe where the system allows it.
    ///
    /// # Errors
    /// The system's refusal to duplicate the descriptor.
    pub fn for_samples() -> io::Result<Self> {
        Ok(Watched::new(stdout_file()?, &STDOUT_WRITE_BEGAN))
    }

    /// The same stream for reports, which another thread writes than the samples: a report that gets through
    /// says nothing about samples that wait.
    pub fn for_reports(self) -> Self {
        Self { began: &REPORT_WRITE_BEGAN, ..self }
    }
}

#[cfg(unix)]
impl Stdout {
    /// A FIFO in place of standard output; waits for its reader.
    ///
    /// # Errors
    /// The system's refusal to open it.
    pub fn fifo(path: &Path) -> io::Result<Self> {
        // An interrupt must end the wait too.
        let mut waiting = Watched::new((), &STDOUT_WRITE_BEGAN);
        let file = waiting.timed(|()| std::fs::OpenOptions::new().write(true).open(path))?;
        widen_pipe(&file);
        Ok(Watched::new(file, &STDOUT_WRITE_BEGAN))
    }
}

#[cfg(not(unix))]
impl Stdout {
    /// Systems without FIFOs.
    ///
    /// # Errors
    /// Always.
    pub fn fifo(_: &Path) -> io::Result<Self> {
        Err(io::ErrorKind::Unsupported.into())
    }
}

/// Standard output for text.
pub fn stdout() -> Watched<impl Write> {
    Watched::new(io::stdout().lock(), &STDOUT_WRITE_BEGAN)
}

/// Standard error.
pub fn stderr() -> Watched<impl Write> {
    Watched::new(io::stderr().lock(), &STDERR_WRITE_BEGAN)
}

impl<W> Watched<W> {
    fn new(stream: W, began: &'static AtomicU64) -> Self {
        LazyLock::force(&CLOCK);
        Self { stream, began }
    }

    fn timed<R>(&mut self, act: impl FnOnce(&mut W) -> R) -> R {
        let now = CLOCK.elapsed().as_millis() as u64;
        self.began.store(now.max(1), Ordering::Relaxed);
        let result = act(&mut self.stream);
        self.began.store(0, Ordering::Relaxed);
        result
    }
}

impl<W: Write> Write for Watched<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.timed(|stream| stream.write(&bytes[..bytes.len().min(WRITE_BYTES)]))
    }

    fn flush(&mut self) -> io::Result<()> {
        self.timed(Write::flush)
    }
}

/// True if a write of this process to standard output, standard error or a report has waited for so long:
/// its reader takes no more data.
pub fn is_output_stalled(patience: Duration) -> bool {
    [&STDOUT_WRITE_BEGAN, &REPORT_WRITE_BEGAN, &STDERR_WRITE_BEGAN].into_iter().any(|began| {
        let began = began.load(Ordering::Relaxed);
        began > 0 && CLOCK.elapsed() >= Duration::from_millis(began) + patience
    })
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
