//! Frames in memory, read as those of a file are.

use super::block::{Block, RecordedFrames};
use super::full_scale::{Scaling, StatedScale};
use super::{InputFault, OfflineError, StreamHeader};
use crate::runtime::PcmFrames;

/// Frames that are judged at a time.
const STEP: usize = 1 << 16;

/// Frames in memory that cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DecodeError {
    /// Codes beyond their full scale, or a full scale that the words of the samples cannot hold.
    #[error("{0}")]
    Scale(String),
    /// The system does not have the memory: [`OfflineError::Memory`].
    #[error(transparent)]
    Memory(OfflineError),
}

/// Reads the frames of one recording, piece by piece, as numbers of full scale 1.
#[derive(Debug, Clone)]
pub struct Decoder {
    header: StreamHeader,
    scaling: Scaling,
}

impl Decoder {
    /// For frames that are stored as these; of complex samples each part is a channel of `stored`.
    ///
    /// # Errors
    /// A full scale that the words of the samples cannot hold.
    pub fn new(stored: &PcmFrames<'_>, is_complex: bool, scale: StatedScale) -> Result<Self, DecodeError> {
        let parts = if is_complex { 2 } else { 1 };
        let header =
            StreamHeader { is_complex, ..StreamHeader::real(stored.layout, stored.channels / parts) };
        Ok(Self { header, scaling: Scaling::new(&header, scale).map_err(DecodeError::Scale)? })
    }

    /// The next frames.
    ///
    /// # Errors
    /// Codes beyond the full scale, or too little memory.
    pub fn decode(&mut self, stored: &PcmFrames<'_>) -> Result<DecodedFrames, DecodeError> {
        let mut block = Block::default();
        self.decode_into(stored, &mut block)?;
        Ok(DecodedFrames { block, rails: self.scaling.rails() })
    }

    fn decode_into(&mut self, stored: &PcmFrames<'_>, block: &mut Block) -> Result<(), DecodeError> {
        block.begin(&self.header);
        let (frames, channels) = (stored.frames(), stored.channels);
        block.decode(stored).map_err(|_| DecodeError::Memory(OfflineError::Memory { frames, channels }))?;
        self.scaling.take(block, 0).map_err(DecodeError::Scale)
    }

    /// Judges frames that are read where they lie.
    ///
    /// # Errors
    /// As [`Decoder::decode`].
    pub fn judge(&mut self, stored: &PcmFrames<'_>) -> Result<(), DecodeError> {
        let mut block = Block::default();
        let mut steps = (0..stored.frames()).step_by(STEP).map(|first| stored.range(first..first + STEP));
        steps.try_for_each(|step| self.decode_into(&step, &mut block))
    }

    /// What is odd about the frames so far.
    pub fn faults(&self) -> impl Iterator<Item = InputFault> {
        self.scaling.faults()
    }
}

/// Samples as numbers.
#[derive(Debug)]
pub struct DecodedFrames {
    block: Block,
    rails: Option<(f64, f64)>,
}

impl DecodedFrames {
    /// The frames.
    pub fn frames(&self) -> RecordedFrames<'_> {
        self.block.view(0..self.block.frames(), 1)
    }

    /// Lowest and highest sample of codes; `None` for floats.
    pub fn rails(&self) -> Option<(f64, f64)> {
        self.rails
    }
}
