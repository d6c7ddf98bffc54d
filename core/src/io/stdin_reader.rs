//! Raw standard input, read on the thread that uses it.
//!
//! A separate thread for a single input costs more time than it saves, because each block would wake both
//! the thread and the consumer. A wait must still end when a stop is requested, so the pipe is polled with
//! a timeout.

use super::IoError;
use super::frames::{InputFrames, Message};
use super::stall::Wait;
use crossbeam_channel::{Receiver, TryRecvError};
use rustix::event::{PollFd, PollFlags, Timespec, poll};

/// Most nanoseconds by which a stop is late: a twentieth of a second, which nobody notices.
const PATIENCE: i64 = 50_000_000;

/// Waits for whole frames, which come in the block `spare`, or for the end; `None` if a stop was requested
/// first.
///
/// # Errors
/// The system's refusal to read.
pub(super) fn read_stdin(
    frames: &mut InputFrames,
    spare: &mut Vec<u8>,
    stop: &Receiver<()>,
    wait: &mut Wait<'_>,
) -> Result<Option<Message>, IoError> {
    let mut bytes = std::mem::take(spare);
    while !frames.ended() {
        if !matches!(stop.try_recv(), Err(TryRecvError::Empty)) {
            return Ok(None);
        }
        if !is_readable().map_err(IoError::system("standard input", "read the samples"))? {
            wait.go_on();
            continue;
        }
        let filled = frames.read_some(&mut bytes)?;
        if filled > 0 {
            return Ok(Some(Message::Frames { bytes, filled }));
        }
    }
    Ok(Some(Message::End { faults: frames.faults(), chunks: Vec::new() }))
}

/// Whether a read would not wait; false after a while without bytes.
fn is_readable() -> std::io::Result<bool> {
    let stdin = std::io::stdin();
    let mut ends = [PollFd::new(&stdin, PollFlags::IN)];
    match poll(&mut ends, Some(&Timespec { tv_sec: 0, tv_nsec: PATIENCE })) {
        Ok(count) => Ok(count > 0),
        Err(rustix::io::Errno::INTR) => Ok(false),
        Err(error) => Err(error.into()),
    }
}
