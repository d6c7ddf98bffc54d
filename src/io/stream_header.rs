//! What the bytes of an input mean.

use super::{PcmFormat, SampleLayout};

/// How the bytes of the inputs are to be understood.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coding {
    /// Raw samples.
    Raw(PcmFormat),
    /// A WAV header says.
    Wav,
}

/// What the frames of an input are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StreamHeader {
    /// How a sample lies in memory.
    pub layout: SampleLayout,
    /// Interleaved channels.
    pub channels: usize,
    /// Frames per second, where the input says.
    pub rate: Option<f64>,
    /// Frames that the input is said to have.
    pub promised: Option<u64>,
}

impl StreamHeader {
    /// Bytes per frame.
    pub fn frame_bytes(&self) -> usize {
        self.layout.container * self.channels
    }
}
