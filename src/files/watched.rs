//! Standard output and standard error whose writes are timed: a reader that takes no more data is noticed.

use std::io::{self, Write};
use std::sync::LazyLock;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// When the write to a stream that is under way began, in milliseconds since [`CLOCK`]; 0 for none.
pub(crate) static STDOUT_WRITE_BEGAN: AtomicU64 = AtomicU64::new(0);
pub(crate) static REPORT_WRITE_BEGAN: AtomicU64 = AtomicU64::new(0);
static STDERR_WRITE_BEGAN: AtomicU64 = AtomicU64::new(0);
static CLOCK: LazyLock<Instant> = LazyLock::new(Instant::now);

/// Bytes of one write. During a longer one it would be unknown whether it makes progress.
const WRITE_BYTES: usize = 64 << 10;

/// A standard stream; [`is_output_stalled`] knows how long its writes wait.
///
/// ```
/// use hybank::files::{is_output_stalled, stdout};
/// use std::{io::Write, time::Duration};
/// stdout().write_all(b"0.5,-0.5\n")?;
/// assert!(!is_output_stalled(Duration::from_secs(1)));
/// # Ok::<(), std::io::Error>(())
/// ```
pub struct Watched<W> {
    pub(crate) stream: W,
    pub(crate) began: &'static AtomicU64,
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
    pub(crate) fn new(stream: W, began: &'static AtomicU64) -> Self {
        LazyLock::force(&CLOCK);
        Self { stream, began }
    }

    pub(crate) fn timed<R>(&mut self, act: impl FnOnce(&mut W) -> R) -> R {
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
