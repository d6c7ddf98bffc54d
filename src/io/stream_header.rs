//! The format of an input.

use super::{PcmFormat, SampleLayout};

/// The coding of the inputs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coding {
    /// Raw samples.
    Raw(PcmFormat),
    /// As the WAV header states.
    Wav,
}

/// The format of an input's frames.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StreamHeader {
    /// The layout of a sample in memory.
    pub layout: SampleLayout,
    /// Interleaved channels.
    pub channels: usize,
    /// Frames per second, if the input states it.
    pub rate: Option<f64>,
    /// Number of frames according to the header.
    pub promised: Option<u64>,
}

impl StreamHeader {
    /// Bytes per frame.
    pub fn frame_bytes(&self) -> usize {
        self.layout.container * self.channels
    }
}
