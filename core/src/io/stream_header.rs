//! The format of an input.

use super::{ParsePcmFormatError, PcmFormat, SampleLayout, Word};
use std::fmt;
use std::str::FromStr;

/// The coding of the inputs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Coding {
    /// Raw real samples.
    Raw(PcmFormat),
    /// Raw complex samples: the real part first, both in this format.
    Complex(PcmFormat),
    /// As the WAV header states.
    Wav,
    /// A table of numbers as text.
    Csv,
}

impl Coding {
    /// The format of the numbers of raw samples.
    pub fn format(self) -> Option<PcmFormat> {
        match self {
            Self::Raw(format) | Self::Complex(format) => Some(format),
            Self::Wav | Self::Csv => None,
        }
    }

    /// True for complex samples.
    pub fn is_complex(self) -> bool {
        matches!(self, Self::Complex(_))
    }
}

/// The name that reads as it.
impl fmt::Display for Coding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Wav => f.write_str("wav"),
            Self::Csv => f.write_str("csv"),
            Self::Raw(format) => f.write_str(format.name()),
            Self::Complex(format) => write!(f, "c{}", format.name()),
        }
    }
}

/// `wav`, `csv`, the name of a sample format, or that name with a `c` before it for complex samples. `cs16`,
/// `cs32`, `cf32` and `cf64` are little-endian.
impl FromStr for Coding {
    type Err = ParsePcmFormatError;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        match name.strip_prefix('c') {
            _ if name == "wav" => Ok(Self::Wav),
            _ if name == "csv" => Ok(Self::Csv),
            Some(part @ ("s16" | "s32" | "f32" | "f64")) => format!("{part}le").parse().map(Self::Complex),
            Some(part) => part.parse().map(Self::Complex),
            None => name.parse().map(Self::Raw),
        }
    }
}

/// Maximum number of channels of an input, the same as in a WAV header.
pub(super) const MOST_CHANNELS: u64 = 65_535;

/// Relative difference up to which two rates are the same. Specs state periods with six or seven digits, and
/// within the length of a filter a difference this small moves no sample.
const SAME_RATE: f64 = 1e-6;

/// True if two rates in hertz, stated with errors of at most `error`, are the same.
pub fn is_same_rate(a: f64, b: f64, error: f64) -> bool {
    (a - b).abs() <= error + SAME_RATE * b.abs()
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
    /// Hertz by which the stated rate may differ from the true one, as WAV headers hold whole hertz.
    pub rate_error: f64,
    /// Seconds at which the first frame was taken by the input's own clock, if it states times.
    pub begin: Option<f64>,
    /// Number of frames according to the header.
    pub promised: Option<u64>,
    /// The format states its full scale: WAV and FLAC.
    pub is_scaled: bool,
    /// The words of integers; `None` for floats.
    pub word: Option<Word>,
    /// Bits of the words that count, if the header states them.
    pub valid_bits: Option<u32>,
    /// The first column of a table was left out as times or an index, because it is a steady ramp.
    pub is_ramp_left_out: bool,
    /// Lowest and highest sample of integers and of codes; `None` for floats.
    pub rails: Option<(f64, f64)>,
}

impl StreamHeader {
    /// Real samples of which nothing else is known.
    pub fn real(layout: SampleLayout, channels: usize) -> Self {
        let word = Word::of(layout.format);
        Self {
            layout,
            channels,
            is_complex: false,
            rate: None,
            rate_error: 0.0,
            begin: None,
            promised: None,
            is_scaled: false,
            word,
            valid_bits: None,
            is_ramp_left_out: false,
            rails: word.map(Word::rails),
        }
    }

    /// The same stream at a rate that its header had to round to whole hertz.
    pub(super) fn at_whole_hertz(self, rate: u32) -> Self {
        Self { rate: Some(f64::from(rate)), rate_error: 0.5, ..self }
    }

    /// The stated rate, if it is not `wanted`.
    pub fn other_rate(&self, wanted: f64) -> Option<f64> {
        self.rate.filter(|&rate| !is_same_rate(rate, wanted, self.rate_error))
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
    fn only_headers_in_whole_hertz_may_be_half_a_hertz_off() {
        let header = StreamHeader::real(SampleLayout::packed(PcmFormat::U8), 1);
        let exact = |rate| StreamHeader { rate: Some(rate), ..header };
        assert_eq!(header.other_rate(10.0), None);
        assert_eq!(exact(10.4).other_rate(10.0), Some(10.4));
        assert_eq!(exact(10.000_009).other_rate(10.0), None);
        assert_eq!(exact(250e6 + 300.0).other_rate(250e6), Some(250_000_300.0));
        assert_eq!(header.at_whole_hertz(10).other_rate(10.4), None);
        assert_eq!(header.at_whole_hertz(10).other_rate(10.6), Some(10.0));
    }

    #[test]
    fn complex_formats_have_the_names_of_their_parts() {
        for (name, coding) in [
            ("f32be", Coding::Raw(PcmFormat::F32Be)),
            ("cf32", Coding::Complex(PcmFormat::F32Le)),
            ("cs16", Coding::Complex(PcmFormat::S16Le)),
            ("cs16be", Coding::Complex(PcmFormat::S16Be)),
            ("cu8", Coding::Complex(PcmFormat::U8)),
            ("wav", Coding::Wav),
            ("csv", Coding::Csv),
        ] {
            assert_eq!(name.parse::<Coding>().unwrap(), coding);
        }
        for name in ["c", "cwav", "ccf32", "f32", "cf16"] {
            assert!(name.parse::<Coding>().is_err(), "{name}");
        }
    }
}
