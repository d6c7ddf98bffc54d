//! Frames of PCM in memory.

use super::PcmFormat;

/// How the samples of a frame lie in memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SampleLayout {
    /// How the significant bytes are coded.
    pub format: PcmFormat,
    /// Bytes from one sample to the next in a frame, at least `format.bytes()`.
    pub container: usize,
}

impl SampleLayout {
    /// Samples that lie close together.
    pub fn packed(format: PcmFormat) -> Self {
        Self { format, container: format.bytes() }
    }
}

/// Whole frames of one recording.
#[derive(Debug, Clone, Copy)]
pub struct PcmFrames<'a> {
    /// How a frame lies in memory.
    pub layout: SampleLayout,
    /// Samples a frame, at least 1.
    pub channels: usize,
    /// The frames, close together.
    pub bytes: &'a [u8],
}

impl PcmFrames<'_> {
    /// Bytes a frame.
    pub fn frame_bytes(&self) -> usize {
        (self.layout.container * self.channels).max(1)
    }

    /// Whole frames in memory.
    pub fn frames(&self) -> usize {
        self.bytes.len() / self.frame_bytes()
    }
}
