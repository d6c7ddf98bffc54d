//! The frames of an input as its consumer sees them: of full scale 1, time-interleaved converters as
//! channels, or only one channel.

use super::block::Block;
use super::capture::{Capture, InputNotes};
use super::full_scale::Scaling;
use super::open::InputSource;
use super::wav::WavChunk;
use super::{InputFault, IoError, StreamHeader};
use crate::messages::counted;

/// What the thread of an input sends.
pub(super) enum Message {
    /// The header, and what the input says besides its samples; always the first message.
    Header { header: StreamHeader, notes: Box<InputNotes> },
    /// Whole frames.
    Frames(Block),
    /// The end, with the faults that were tolerated; always last.
    End { faults: Vec<InputFault>, chunks: Vec<WavChunk> },
}

/// The frames of an opened input.
pub(super) struct InputFrames {
    source: InputSource,
    name: String,
    capture: Box<dyn Capture>,
    stored: StreamHeader,
    scaling: Scaling,
    /// Samples of time-interleaved converters whose frame is not whole.
    begun: Block,
    ended: bool,
    /// As the consumer sees them.
    pub(super) header: StreamHeader,
}

impl InputFrames {
    /// Opens the input and reads its header.
    ///
    /// # Errors
    /// [`IoError`]: those of the input, or a header that does not fit the settings.
    pub(super) fn open(source: &InputSource) -> Result<Self, IoError> {
        let (capture, name) = (source.open()?, source.name());
        let stored = source.complex(capture.stream_header())?;
        let header = source.chosen(stored)?;
        let scaling = Scaling::new(&stored, source.scale).map_err(IoError::unfit(&name))?;
        let scaling = if source.is_table_or_array() { scaling.of_table() } else { scaling };
        let mut begun = Block::default();
        begun.begin(&stored);
        Ok(Self { source: source.clone(), name, capture, stored, scaling, begun, ended: false, header })
    }

    pub(super) fn capture(&mut self) -> &mut dyn Capture {
        &mut *self.capture
    }

    /// True once the input is over.
    pub(super) fn ended(&self) -> bool {
        self.ended
    }

    /// One read into a block, which may give no frame.
    pub(super) fn read_some(&mut self, block: &mut Block) -> Result<(), IoError> {
        block.begin(&self.stored);
        let begun = self.begun.frames();
        block.append(&self.begun, 0..begun);
        let read = self.capture.read_block(self.source.block, block);
        self.ended = !read.map_err(IoError::reading(&self.name))?;
        self.scaling.take(block, begun).map_err(IoError::unfit(&self.name))?;
        if let Some(interleaving) = &self.source.interleaving {
            let whole = block.frames() - block.frames() % interleaving.converters();
            self.begun.begin(&self.stored);
            self.begun.append(block, whole..block.frames());
            block.truncate(whole);
            block.take_turns(interleaving);
        }
        self.source.only.into_iter().for_each(|only| block.keep(only));
        Ok(())
    }

    /// What was tolerated, at the end.
    pub(super) fn faults(&mut self) -> Vec<InputFault> {
        let begun = self.begun.frames() * self.stored.frame_bytes();
        let mut faults = self.capture.faults();
        // The last turn of converters may lack samples, and the last sample bytes.
        match faults.iter_mut().find(|fault| matches!(fault, InputFault::CutFrame { .. })) {
            Some(InputFault::CutFrame { bytes }) => *bytes += begun,
            _ if begun > 0 => faults.push(InputFault::CutFrame { bytes: begun }),
            _ => {}
        }
        faults.extend(self.scaling.faults());
        faults
    }
}

impl InputSource {
    /// The header of an input whose pairs of channels are complex samples.
    fn complex(&self, header: StreamHeader) -> Result<StreamHeader, IoError> {
        match header.channels {
            _ if !self.is_iq || header.is_complex => Ok(header),
            channels if channels % 2 == 0 => {
                Ok(StreamHeader { channels: channels / 2, is_complex: true, ..header })
            }
            channels => Err(IoError::unfit(&self.name())(format!(
                "{}, but pairs of I and Q are asked for; read its channels as real ones",
                counted(channels, "channel")
            ))),
        }
    }

    /// As the consumer sees an input that states `header`: time-interleaved converters as channels, or the
    /// only channel that is read.
    pub(super) fn chosen(&self, header: StreamHeader) -> Result<StreamHeader, IoError> {
        let unfit = |problem| Err(IoError::unfit(&self.name())(problem));
        let header = StreamHeader { rails: self.scale.rails(&header), ..header };
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
}
