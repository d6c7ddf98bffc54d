//! Raw standard input, read on the thread that uses it.
//!
//! A thread of its own for an input that is alone costs more than it gives: each block would wake it once and the
//! consumer once. Waiting here must still end when the stop channel speaks, so the pipe is looked at with a timeout.

use super::lane::Shape;
use super::pipe::stdin_file;
use super::reader::{Opening, Said, cut_note};
use super::{FrameReader, IoError};
use crossbeam_channel::{Receiver, TryRecvError};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::fs::File;

/// How long the stop channel may wait for an answer.
const PATIENCE: Timespec = Timespec { tv_sec: 0, tv_nsec: 50_000_000 };

/// The reading end, with the one block that goes to and fro.
pub(super) struct Direct {
    name: String,
    pipe: File,
    frames: FrameReader<File>,
    pub(super) shape: Shape,
    block: usize,
    spare: Vec<u8>,
}

impl Direct {
    /// Standard input as raw samples.
    ///
    /// # Errors
    /// The system's refusal to duplicate the descriptor.
    pub(super) fn new(opening: &Opening) -> Result<Self, IoError> {
        let name = opening.name();
        let refused = || IoError::system(&name, "open it");
        let pipe = stdin_file().map_err(refused())?;
        let shape = opening.raw_shape();
        let frames = FrameReader::new(pipe.try_clone().map_err(refused())?, shape.frame_bytes(), None);
        Ok(Self { pipe, frames, shape, block: opening.block, spare: Vec::new(), name })
    }

    /// Waits for whole frames or the end; `None` if `stop` spoke first.
    ///
    /// # Errors
    /// The system's refusal to read.
    pub(super) fn hear(&mut self, stop: &Receiver<()>) -> Result<Option<Said>, IoError> {
        let mut bytes = std::mem::take(&mut self.spare);
        let frame = self.frames.frame_bytes();
        bytes.resize((self.block / frame).max(1) * frame, 0);
        while !self.frames.ended() {
            if !matches!(stop.try_recv(), Err(TryRecvError::Empty)) {
                return Ok(None);
            }
            if !self.has_news()? {
                continue;
            }
            let got = self.frames.read_whole(&mut bytes);
            let filled = got.map_err(self.refused())?;
            if filled > 0 {
                return Ok(Some(Said::Frames { bytes, filled }));
            }
        }
        Ok(Some(Said::End { notes: cut_note(self.frames.cut_bytes()) }))
    }

    /// Takes a block back that was used.
    pub(super) fn give_back(&mut self, bytes: Vec<u8>) {
        self.spare = bytes;
    }

    /// Whether a read would not wait; false after a while without news.
    fn has_news(&self) -> Result<bool, IoError> {
        let mut ends = [PollFd::new(&self.pipe, PollFlags::IN)];
        match poll(&mut ends, Some(&PATIENCE)) {
            Ok(count) => Ok(count > 0),
            Err(rustix::io::Errno::INTR) => Ok(false),
            Err(error) => Err(self.refused()(error.into())),
        }
    }

    fn refused(&self) -> impl FnOnce(std::io::Error) -> IoError {
        IoError::system(&self.name, "read the samples")
    }
}
