//! Inputs whose samples are bytes, as frames.

use super::block::Block;
use super::capture::{ByteSource, Capture, InputNotes};
use super::wav::WavChunk;
use super::{InputFault, StreamHeader};
use crate::runtime::PcmFrames;
use std::io::{self, Read};

/// Cuts a byte stream, which may come in pieces of any size, into whole frames of `frame` bytes.
#[derive(Debug)]
struct FrameReader<R> {
    inner: R,
    frame: usize,
    /// The beginning of a frame whose rest has not come.
    carry: Vec<u8>,
    ended: bool,
}

impl<R: Read> FrameReader<R> {
    fn new(inner: R, frame: usize) -> Self {
        Self { inner, frame, carry: Vec::with_capacity(frame), ended: false }
    }

    /// One read, which may give no whole frame. Puts whole frames into `bytes`, which holds one at least,
    /// and gives how many bytes they have.
    fn read_some(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let capacity = bytes.len() / self.frame * self.frame;
        let carried = self.carry.len();
        bytes[..carried].copy_from_slice(&self.carry);
        let got = loop {
            match self.inner.read(&mut bytes[carried..capacity]) {
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                other => break other?,
            }
        };
        self.ended = got == 0;
        let whole = (carried + got) / self.frame * self.frame;
        self.carry.clear();
        self.carry.extend_from_slice(&bytes[whole..carried + got]);
        Ok(whole)
    }
}

/// The frames of an input of bytes.
pub(super) struct ByteFrames<R> {
    frames: FrameReader<R>,
    header: StreamHeader,
    bytes: Vec<u8>,
}

impl<R: ByteSource> ByteFrames<R> {
    pub(super) fn new(source: R) -> Self {
        let header = source.stream_header();
        Self { frames: FrameReader::new(source, header.frame_bytes().max(1)), header, bytes: Vec::new() }
    }
}

impl<R: ByteSource> Capture for ByteFrames<R> {
    fn stream_header(&self) -> StreamHeader {
        self.header
    }

    fn read_block(&mut self, bytes: usize, block: &mut Block) -> io::Result<bool> {
        let Self { frames, header, bytes: buffer } = self;
        let room = bytes.max(frames.frame);
        let memory = |_| io::ErrorKind::OutOfMemory;
        buffer.try_reserve(room.saturating_sub(buffer.len())).map_err(memory)?;
        buffer.resize(room, 0);
        let filled = frames.read_some(buffer)?;
        let (layout, bytes) = (header.layout, &buffer[..filled]);
        block.decode(&PcmFrames { layout, channels: header.columns(), bytes }).map_err(memory)?;
        Ok(!frames.ended)
    }

    fn notes(&self) -> InputNotes {
        self.frames.inner.notes()
    }

    fn faults(&mut self) -> Vec<InputFault> {
        let (missing_bytes, bytes) = (self.frames.inner.missing_bytes(), self.frames.carry.len());
        let truncated = (missing_bytes > 0).then_some(InputFault::Truncated { missing_bytes });
        let cut = (bytes > 0).then_some(InputFault::CutFrame { bytes });
        let bytes = self.frames.inner.further_bytes();
        let further = (bytes > 0).then_some(InputFault::FurtherSamples { bytes });
        let altered = self.frames.inner.is_altered().then_some(InputFault::Altered);
        truncated.into_iter().chain(cut).chain(further).chain(altered).collect()
    }

    fn chunks_after(&mut self) -> Vec<WavChunk> {
        self.frames.inner.chunks_after()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gives `step` bytes at a time.
    struct Dripping<'a>(&'a [u8], usize);

    impl Read for Dripping<'_> {
        fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
            let n = self.1.min(self.0.len()).min(bytes.len());
            bytes[..n].copy_from_slice(&self.0[..n]);
            self.0 = &self.0[n..];
            Ok(n)
        }
    }

    #[test]
    fn any_drip_and_any_buffer_give_the_same_frames() {
        let data: Vec<u8> = (0..100).collect();
        for frame in [1, 3, 8] {
            for step in 1..20 {
                for buffer in [frame, 2 * frame + 1, 64] {
                    let mut reader = FrameReader::new(Dripping(&data, step), frame);
                    let mut all = Vec::new();
                    let mut bytes = vec![0; buffer];
                    while !reader.ended {
                        let n = reader.read_some(&mut bytes).unwrap();
                        assert_eq!(n % frame, 0);
                        all.extend_from_slice(&bytes[..n]);
                    }
                    assert_eq!(all, data[..100 / frame * frame]);
                    assert_eq!(reader.carry.len(), 100 % frame);
                }
            }
        }
    }
}
