//! Raw standard input, read on the thread that uses it.
//!
//! A separate thread for a single input costs more time than it saves, because each block would wake both
//! the thread and the consumer. A wait must still end when a stop is requested, so the pipe is polled with
//! a timeout.

use super::input_thread::{InputSource, Message, cut_frame};
use super::not_wav::NotWav;
use super::pipe::stdin_file;
use super::stall::Wait;
use super::{FrameReader, IoError, StreamHeader};
use crossbeam_channel::{Receiver, TryRecvError};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::fs::File;
use std::time::Duration;

/// Maximum delay of a stop.
const PATIENCE: Duration = Duration::from_millis(50);

/// The reading end with its block.
pub(super) struct StdinReader {
    name: String,
    source: InputSource,
    pipe: File,
    frames: FrameReader<NotWav<File>>,
    /// As the samples come.
    raw: StreamHeader,
    /// As the consumer sees them.
    pub(super) header: StreamHeader,
    spare: Vec<u8>,
}

impl StdinReader {
    /// Standard input as raw samples.
    ///
    /// # Errors
    /// The system's refusal to duplicate the descriptor.
    pub(super) fn new(source: &InputSource) -> Result<Self, IoError> {
        let name = source.name();
        let refused = || IoError::system(&name, "open it");
        let pipe = stdin_file().map_err(refused())?;
        let raw = source.raw_header();
        let header = if source.only.is_some() { source.chosen(raw)? } else { raw };
        let bytes = NotWav::new(pipe.try_clone().map_err(refused())?, &name);
        let frames = FrameReader::new(bytes, raw.frame_bytes(), None);
        Ok(Self { pipe, frames, raw, header, source: source.clone(), spare: Vec::new(), name })
    }

    /// Waits for whole frames or the end; `None` if a stop was requested first.
    ///
    /// # Errors
    /// The system's refusal to read.
    pub(super) fn receive(
        &mut self,
        stop: &Receiver<()>,
        wait: &mut Wait<'_>,
    ) -> Result<Option<Message>, IoError> {
        let mut bytes = std::mem::take(&mut self.spare);
        let frame = self.frames.frame_bytes();
        bytes.resize((self.source.block / frame).max(1) * frame, 0);
        while !self.frames.ended() {
            if !matches!(stop.try_recv(), Err(TryRecvError::Empty)) {
                return Ok(None);
            }
            if !self.is_readable()? {
                wait.go_on();
                continue;
            }
            let got = self.frames.read_whole(&mut bytes);
            let filled = got.map_err(IoError::reading(&self.name))?;
            if filled > 0 {
                let filled = self.source.arrange(&mut bytes[..filled], &self.raw);
                return Ok(Some(Message::Frames { bytes, filled }));
            }
        }
        Ok(Some(Message::End { faults: cut_frame(self.frames.cut_bytes()), chunks: Vec::new() }))
    }

    /// Takes a used block back.
    pub(super) fn give_back(&mut self, bytes: Vec<u8>) {
        self.spare = bytes;
    }

    /// Whether a read would not wait; false after a while without bytes.
    fn is_readable(&self) -> Result<bool, IoError> {
        let mut ends = [PollFd::new(&self.pipe, PollFlags::IN)];
        let patience = Timespec { tv_sec: 0, tv_nsec: PATIENCE.subsec_nanos().into() };
        match poll(&mut ends, Some(&patience)) {
            Ok(count) => Ok(count > 0),
            Err(rustix::io::Errno::INTR) => Ok(false),
            Err(error) => Err(self.refused()(error.into())),
        }
    }

    fn refused(&self) -> impl FnOnce(std::io::Error) -> IoError {
        IoError::system(&self.name, "read the samples")
    }
}
