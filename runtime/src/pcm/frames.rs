//! Frames of PCM in memory.

use super::PcmFormat;
use std::ops::Range;

/// How the samples of a frame lie in memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SampleLayout {
    /// How the significant bytes are coded.
    pub format: PcmFormat,
    /// Bytes from one sample to the next, at least `format.bytes()`: more for samples in wider words, and
    /// for one part of complex samples.
    pub container: usize,
}

impl SampleLayout {
    /// Samples that lie close together.
    pub fn packed(format: PcmFormat) -> Self {
        Self { format, container: format.bytes() }
    }

    /// True if no bytes lie between samples.
    pub(crate) fn is_packed(self) -> bool {
        self.container == self.format.bytes()
    }

    /// How the real or the imaginary parts lie in pairs of samples of this layout.
    pub(crate) fn part(self) -> Self {
        Self { container: 2 * self.container, ..self }
    }

    /// Samples in so many bytes; the last one may end before its container does.
    pub(crate) fn containers(self, bytes: usize) -> usize {
        (bytes + self.container).saturating_sub(self.format.bytes()) / self.container.max(1)
    }
}

/// Whole frames of one recording.
#[derive(Debug, Clone, Copy)]
pub struct PcmFrames<'a> {
    /// How a frame lies in memory.
    pub layout: SampleLayout,
    /// Samples per frame, at least 1.
    pub channels: usize,
    /// The frames, close together.
    pub bytes: &'a [u8],
}

impl<'a> PcmFrames<'a> {
    /// Bytes per frame.
    pub fn frame_bytes(&self) -> usize {
        (self.layout.container * self.channels).max(1)
    }

    /// Whole frames in memory.
    pub fn frames(&self) -> usize {
        self.layout.containers(self.bytes.len()) / self.channels.max(1)
    }

    /// One part of complex samples, which are pairs of these samples, so that channels 2 i and 2 i + 1 are
    /// the parts of one channel: the real parts if `part` is 0, the imaginary ones if it is 1.
    pub fn part(&self, part: usize) -> PcmFrames<'a> {
        let start = (part * self.layout.container).min(self.bytes.len());
        PcmFrames { layout: self.layout.part(), channels: self.channels / 2, bytes: &self.bytes[start..] }
    }

    /// Some of the frames, fewer where the range ends beyond them.
    ///
    /// # Panics
    /// If the range begins beyond them.
    pub fn range(&self, frames: Range<usize>) -> PcmFrames<'a> {
        let size = self.frame_bytes();
        let end = (frames.end * size).min(self.bytes.len());
        PcmFrames { bytes: &self.bytes[frames.start * size..end], ..*self }
    }

    /// True if no sample is NaN or infinite, nor any that lies between them; integers never are.
    pub fn is_finite(&self) -> bool {
        match self.layout.format {
            PcmFormat::F32Le => all_finite(self.bytes, |b| u32::from_le_bytes(b) << 1 < 0xFF00_0000),
            PcmFormat::F32Be => all_finite(self.bytes, |b| u32::from_be_bytes(b) << 1 < 0xFF00_0000),
            PcmFormat::F64Le => all_finite(self.bytes, |b| u64::from_le_bytes(b) << 1 < 0xFFE0 << 48),
            PcmFormat::F64Be => all_finite(self.bytes, |b| u64::from_be_bytes(b) << 1 < 0xFFE0 << 48),
            PcmFormat::F16Le => all_finite(self.bytes, |b| u16::from_le_bytes(b) << 1 < 0xF800),
            PcmFormat::F16Be => all_finite(self.bytes, |b| u16::from_be_bytes(b) << 1 < 0xF800),
            _ => true,
        }
    }
}

/// Samples that lie close together, in blocks without an early end, so that each becomes one vector loop.
fn all_finite<const B: usize>(bytes: &[u8], finite: impl Fn([u8; B]) -> bool) -> bool {
    let (samples, _) = bytes.as_chunks::<B>();
    samples.chunks(1024).all(|block| block.iter().fold(true, |all, &sample| all & finite(sample)))
}
