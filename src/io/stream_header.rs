//! The format of an input.

use super::{ParsePcmFormatError, PcmFormat, SampleLayout};
use std::str::FromStr;

/// The coding of the inputs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coding {
    /// Raw real samples.
    Raw(PcmFormat),
    /// Raw complex samples: the real part first, both in this format.
    Complex(PcmFormat),
    /// As the WAV header states.
    Wav,
}

impl Coding {
    /// The format of the numbers of raw samples.
    pub fn format(self) -> Option<PcmFormat> {
        match self {
            Self::Raw(format) | Self::Complex(format) => Some(format),
            Self::Wav => None,
        }
    }

    /// True for complex samples.
    pub fn is_complex(self) -> bool {
        matches!(self, Self::Complex(_))
    }
}

/// `wav`, the name of a sample format, or that name with a `c` before it for complex samples. `cs16`,
/// `cs32`, `cf32` and `cf64` are little-endian.
impl FromStr for Coding {
    type Err = ParsePcmFormatError;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        match name.strip_prefix('c') {
            _ if name == "wav" => Ok(Self::Wav),
            Some(part @ ("s16" | "s32" | "f32" | "f64")) => format!("{part}le").parse().map(Self::Complex),
            Some(part) => part.parse().map(Self::Complex),
            None => name.parse().map(Self::Raw),
        }
    }
}

/// The format of an input's frames.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StreamHeader {
    /// The layout of a number in memory.
    pub layout: SampleLayout,
    /// Interleaved channels.
    pub channels: usize,
    /// A sample is two numbers, the real and the imaginary part.
    pub is_complex: bool,
    /// Frames per second, if the input states it.
    pub rate: Option<f64>,
    /// Number of frames according to the header.
    pub promised: Option<u64>,
}

impl StreamHeader {
    /// Real samples of which nothing else is known.
    pub fn real(layout: SampleLayout, channels: usize) -> Self {
        Self { layout, channels, is_complex: false, rate: None, promised: None }
    }

    /// Numbers per sample.
    pub fn parts(&self) -> usize {
        if self.is_complex { 2 } else { 1 }
    }

    /// Numbers per frame.
    pub fn columns(&self) -> usize {
        self.channels * self.parts()
    }

    /// Bytes per frame.
    pub fn frame_bytes(&self) -> usize {
        self.layout.container * self.columns()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn complex_formats_have_the_names_of_their_parts() {
        for (name, coding) in [
            ("f32be", Coding::Raw(PcmFormat::F32Be)),
            ("cf32", Coding::Complex(PcmFormat::F32Le)),
            ("cs16", Coding::Complex(PcmFormat::S16Le)),
            ("cs16be", Coding::Complex(PcmFormat::S16Be)),
            ("cu8", Coding::Complex(PcmFormat::U8)),
            ("wav", Coding::Wav),
        ] {
            assert_eq!(name.parse::<Coding>().unwrap(), coding);
        }
        for name in ["c", "cwav", "ccf32", "f32", "cf16"] {
            assert!(name.parse::<Coding>().is_err(), "{name}");
        }
    }
}
