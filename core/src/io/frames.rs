//! Whole frames of an input as its consumer sees them: time-interleaved converters as channels, or only one
//! channel. Counts what was tolerated.

use super::capture::{Capture, InputNotes};
use super::full_scale::Scaling;
use super::open::InputSource;
use super::wav::WavChunk;
use super::{InputFault, IoError, StreamHeader};
use crate::messages::counted;
use crate::quantity::FullScale;
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

/// What the thread of an input sends.
pub(super) enum Message {
    /// The header, and what the input says besides its samples; always the first message.
    Header { header: StreamHeader, notes: Box<InputNotes> },
    /// Whole frames.
    Frames { bytes: Vec<u8>, filled: usize },
    /// The end, with the faults that were tolerated; always last.
    End { faults: Vec<InputFault>, chunks: Vec<WavChunk> },
}

/// The frames of an opened input.
pub(super) struct InputFrames {
    source: InputSource,
    name: String,
    frames: FrameReader<Box<dyn Capture>>,
    stored: StreamHeader,
    scaling: Option<Scaling>,
    /// As the consumer sees them.
    pub(super) header: StreamHeader,
}

impl InputFrames {
    /// Opens the input and reads its header.
    ///
    /// # Errors
    /// [`IoError`]: those of the input, or a header that does not fit the settings.
    pub(super) fn open(source: &InputSource) -> Result<Self, IoError> {
        let capture = source.open()?;
        let stored = capture.stream_header();
        let header = source.chosen(stored)?;
        let frames = FrameReader::new(capture, stored.frame_bytes().max(1) * source.samples_per_frame());
        let wanted = source.full_scale.is_some() || source.may_hold_codes();
        let scaling = Scaling::new(&stored, source.full_scale).filter(|_| wanted);
        Ok(Self { source: source.clone(), name: source.name(), frames, stored, scaling, header })
    }

    pub(super) fn capture(&mut self) -> &mut dyn Capture {
        &mut *self.frames.inner
    }

    /// True once the input is over.
    pub(super) fn ended(&self) -> bool {
        self.frames.ended
    }

    /// One read into `bytes`, which become a block. Gives the bytes of the whole frames that came; there may
    /// be none.
    pub(super) fn read_some(&mut self, bytes: &mut Vec<u8>) -> Result<usize, IoError> {
        let wanted = self.source.block.max(self.frames.frame);
        let memory = bytes.try_reserve(wanted.saturating_sub(bytes.len()));
        memory.map_err(|_| IoError::reading(&self.name)(io::ErrorKind::OutOfMemory.into()))?;
        bytes.resize(wanted, 0);
        let filled = self.frames.read_some(bytes).map_err(IoError::reading(&self.name))?;
        let frames = &mut bytes[..filled];
        self.scaling.iter_mut().for_each(|scaling| scaling.take(frames));
        Ok(self.source.arrange(frames, &self.stored))
    }

    /// What was tolerated, at the end.
    pub(super) fn faults(&mut self) -> Vec<InputFault> {
        let (missing_bytes, bytes) = (self.frames.inner.missing_bytes(), self.frames.carry.len());
        let truncated = (missing_bytes > 0).then_some(InputFault::Truncated { missing_bytes });
        let cut = (bytes > 0).then_some(InputFault::CutFrame { bytes });
        let bytes = self.frames.inner.further_bytes();
        let further = (bytes > 0).then_some(InputFault::FurtherSamples { bytes });
        let scale = self.scaling.as_ref().and_then(Scaling::fault);
        let altered = self.frames.inner.is_altered().then_some(InputFault::Altered);
        let own = self.frames.inner.faults();
        own.into_iter().chain(truncated).chain(cut).chain(further).chain(scale).chain(altered).collect()
    }
}

impl InputSource {
    /// As the consumer sees an input that states `header`: time-interleaved converters as channels, or the
    /// only channel that is read.
    pub(super) fn chosen(&self, header: StreamHeader) -> Result<StreamHeader, IoError> {
        let unfit = |problem| Err(IoError::unfit(&self.name())(problem));
        let codes = self.full_scale.filter(|_| !header.is_scaled).and_then(FullScale::rails);
        let header = StreamHeader { rails: codes.or(header.rails), ..header };
        let channels = header.channels;
        if let Some(only) = self.only {
            if only >= channels {
                let channel = only + 1;
                let there = counted(channels, "channel");
                return unfit(format!("channel {channel} was asked for: it has {there}, counted from 1"));
            }
            return Ok(StreamHeader { channels: 1, ..header });
        }
        if self.per_frame > 1 && channels != 1 {
            return unfit(format!(
                "{channels} channels, but a converter with a sample rate of its own needs a recording of its own; extract \
                 its channel first"
            ));
        }
        let converters = self.samples_per_frame();
        if self.interleaving.is_some() && channels != 1 {
            return unfit(format!(
                "{channels} channels, but time-interleaved converters share one; read it as channels that are not interleaved, or \
                 extract that channel first"
            ));
        }
        Ok(StreamHeader {
            channels: channels * converters,
            rate: header.rate.map(|rate| rate / converters as f64),
            rate_error: header.rate_error / converters as f64,
            promised: header.promised.map(|samples| samples / converters as u64),
            ..header
        })
    }

    /// Puts the samples of whole frames, which are stored as `header` says, into the order of the channels,
    /// or keeps those of the only one. Gives the bytes that remain.
    fn arrange(&self, frames: &mut [u8], header: &StreamHeader) -> usize {
        let sample = header.layout.container * header.parts();
        self.interleaving.iter().for_each(|interleaving| interleaving.reorder(frames, sample));
        let Some(only) = self.only.filter(|_| header.channels > 1) else { return frames.len() };
        let count = frames.len() / header.frame_bytes();
        for k in 0..count {
            let from = k * header.frame_bytes() + only * sample;
            frames.copy_within(from..from + sample, k * sample);
        }
        count * sample
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
