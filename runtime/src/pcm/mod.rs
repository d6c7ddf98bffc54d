//! Sample formats: names as in ffmpeg, and the conversions between bytes and numbers.
//!
//! Integers of b bits map to x = i / 2^(b-1), so that full scale is 1.0; `u8`, `u16le`.. are offset by
//! half their range.
//! Numbers map back by rounding to the nearest integer (ties to even) and saturating.

mod frames;
mod peak;

pub use frames::{PcmFrames, SampleLayout};
pub(crate) use peak::peak;

use std::fmt;
use std::str::FromStr;

/// How one sample is stored.
///
/// ```
/// use hybank_runtime::{ParsePcmFormatError, PcmFormat};
/// assert_eq!("s24le".parse(), Ok(PcmFormat::S24Le));
/// assert_eq!("s24".parse::<PcmFormat>(), Err(ParsePcmFormatError("s24".into())));
/// let mut bytes = [0; 3];
/// assert!(!PcmFormat::S24Le.encode(-0.5, &mut bytes));
/// assert_eq!((bytes, PcmFormat::S24Le.decode(&bytes)), ([0, 0, 0xC0], -0.5));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum PcmFormat {
    /// Signed 8 bit.
    S8,
    /// Unsigned 8 bit, 128 is zero.
    U8,
    /// Signed 16 bit, little endian.
    S16Le,
    /// Signed 16 bit, big endian.
    S16Be,
    /// Signed 24 bit in three bytes, little endian.
    S24Le,
    /// Signed 24 bit in three bytes, big endian.
    S24Be,
    /// Signed 32 bit, little endian.
    S32Le,
    /// Signed 32 bit, big endian.
    S32Be,
    /// Unsigned 16 bit, 2^15 is zero, little endian.
    U16Le,
    /// Unsigned 16 bit, 2^15 is zero, big endian.
    U16Be,
    /// Unsigned 32 bit, 2^31 is zero, little endian.
    U32Le,
    /// Unsigned 32 bit, 2^31 is zero, big endian.
    U32Be,
    /// Signed 64 bit, little endian.
    S64Le,
    /// Signed 64 bit, big endian.
    S64Be,
    /// 16-bit float, little endian.
    F16Le,
    /// 16-bit float, big endian.
    F16Be,
    /// 32-bit float, little endian.
    F32Le,
    /// 32-bit float, big endian.
    F32Be,
    /// 64-bit float, little endian.
    F64Le,
    /// 64-bit float, big endian.
    F64Be,
}

/// The names of [`PcmFormat::ALL`].
const NAMES: [&str; 20] = [
    "s8", "u8", "s16le", "s16be", "s24le", "s24be", "s32le", "s32be", "u16le", "u16be", "u32le", "u32be",
    "s64le", "s64be", "f16le", "f16be", "f32le", "f32be", "f64le", "f64be",
];

/// A name of no format.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("unknown sample format `{0}`; use one of {names}", names = NAMES.join(" "))]
pub struct ParsePcmFormatError(pub String);

impl PcmFormat {
    /// All formats, in the order of the contract.
    pub const ALL: [Self; 20] = [
        Self::S8,
        Self::U8,
        Self::S16Le,
        Self::S16Be,
        Self::S24Le,
        Self::S24Be,
        Self::S32Le,
        Self::S32Be,
        Self::U16Le,
        Self::U16Be,
        Self::U32Le,
        Self::U32Be,
        Self::S64Le,
        Self::S64Be,
        Self::F16Le,
        Self::F16Be,
        Self::F32Le,
        Self::F32Be,
        Self::F64Le,
        Self::F64Be,
    ];

    /// The name, as in ffmpeg.
    pub fn name(self) -> &'static str {
        NAMES[self as usize]
    }

    /// Bytes per sample.
    pub const fn bytes(self) -> usize {
        match self {
            Self::S8 | Self::U8 => 1,
            Self::S16Le | Self::S16Be | Self::U16Le | Self::U16Be | Self::F16Le | Self::F16Be => 2,
            Self::S24Le | Self::S24Be => 3,
            Self::S32Le | Self::S32Be | Self::U32Le | Self::U32Be | Self::F32Le | Self::F32Be => 4,
            Self::S64Le | Self::S64Be | Self::F64Le | Self::F64Be => 8,
        }
    }

    /// True for floats: they do not saturate, and they can hold NaN.
    pub const fn is_float(self) -> bool {
        matches!(self, Self::F16Le | Self::F16Be | Self::F32Le | Self::F32Be | Self::F64Le | Self::F64Be)
    }

    /// True for integers that count from 0, whose middle is zero (offset binary).
    pub const fn is_unsigned(self) -> bool {
        matches!(self, Self::U8 | Self::U16Le | Self::U16Be | Self::U32Le | Self::U32Be)
    }

    /// The number in the first [`Self::bytes`] bytes.
    ///
    /// # Panics
    /// If `bytes` is shorter than one sample.
    #[inline(always)]
    pub fn decode(self, bytes: &[u8]) -> f64 {
        match self {
            Self::F32Le => f64::from(f32::from_le_bytes(first(bytes))),
            Self::F32Be => f64::from(f32::from_be_bytes(first(bytes))),
            Self::F64Le => f64::from_le_bytes(first(bytes)),
            Self::F64Be => f64::from_be_bytes(first(bytes)),
            Self::F16Le => half::f16::from_le_bytes(first(bytes)).to_f64(),
            Self::F16Be => half::f16::from_be_bytes(first(bytes)).to_f64(),
            Self::S64Le => i64::from_le_bytes(first(bytes)) as f64 / 2f64.powi(63),
            Self::S64Be => i64::from_be_bytes(first(bytes)) as f64 / 2f64.powi(63),
            // Integers fill the upper bytes of 32 bits.
            _ => {
                let (mut word, size) = ([0; 4], self.bytes());
                if self.is_big_endian() {
                    word[..size].copy_from_slice(&bytes[..size]);
                    word.reverse();
                } else {
                    word[4 - size..].copy_from_slice(&bytes[..size]);
                }
                if self.is_unsigned() {
                    word[3] ^= SIGN;
                }
                f64::from(i32::from_le_bytes(word)) / 2147483648.0
            }
        }
    }

    /// Writes one number into the first [`Self::bytes`] bytes; true if it had to be clipped.
    ///
    /// # Panics
    /// If `bytes` is shorter than one sample.
    #[inline(always)]
    pub fn encode(self, value: f64, bytes: &mut [u8]) -> bool {
        match self {
            Self::F32Le => store(bytes, (value as f32).to_le_bytes()),
            Self::F32Be => store(bytes, (value as f32).to_be_bytes()),
            Self::F64Le => store(bytes, value.to_le_bytes()),
            Self::F64Be => store(bytes, value.to_be_bytes()),
            Self::F16Le => store(bytes, half::f16::from_f64(value).to_le_bytes()),
            Self::F16Be => store(bytes, half::f16::from_f64(value).to_be_bytes()),
            _ => {
                let size = self.bytes();
                let (i, clipped) = quantise(value, 8 * size as u32 - 1);
                bytes[..size].copy_from_slice(&i.to_le_bytes()[..size]);
                if self.is_unsigned() {
                    bytes[size - 1] ^= SIGN;
                }
                if self.is_big_endian() {
                    bytes[..size].reverse();
                }
                clipped
            }
        }
    }

    /// The same numbers in the byte order of this machine.
    pub const fn native(self) -> Self {
        match self {
            Self::S8 | Self::U8 => self,
            // In pairs, the little-endian one first.
            _ => Self::ALL[self as usize / 2 * 2 + cfg!(target_endian = "big") as usize],
        }
    }

    const fn is_big_endian(self) -> bool {
        // In pairs after those of one byte, the little-endian one first.
        self as usize >= 2 && self as usize % 2 == 1
    }
}

/// Calls `$body` with the format as a constant, so that each becomes a loop of its own.
macro_rules! for_pcm_format {
    ($format:expr, $constant:ident => $body:expr) => {
        $crate::pcm::for_pcm_format!(@ $format, $constant => $body;
            S8 U8 S16Le S16Be S24Le S24Be S32Le S32Be U16Le U16Be U32Le U32Be S64Le S64Be F16Le F16Be
            F32Le F32Be F64Le F64Be)
    };
    (@ $format:expr, $constant:ident => $body:expr; $($name:ident)*) => {
        match $format {
            $($crate::PcmFormat::$name => { const $constant: $crate::PcmFormat = $crate::PcmFormat::$name; $body })*
        }
    };
}

pub(crate) use for_pcm_format;

impl fmt::Display for PcmFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for PcmFormat {
    type Err = ParsePcmFormatError;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        Self::ALL
            .into_iter()
            .find(|format| format.name() == name)
            .ok_or_else(|| ParsePcmFormatError(name.to_owned()))
    }
}

/// Nearest integer of `value * 2^bits` and whether it had to be clipped to the range.
#[inline(always)]
fn quantise(value: f64, bits: u32) -> (i64, bool) {
    let full = (1u64 << bits) as f64;
    let scaled = (value * full).round_ties_even();
    // NaN comes out of a filter only where its sums overflow; the cast makes it 0, and saturates at 2^63.
    let held = scaled.clamp(-full, full - 1.0);
    // Vectors of all processors have integers of 32 bits.
    let integer = if bits < 32 { i64::from(held as i32) } else { held as i64 };
    (integer, scaled < -full || scaled >= full)
}

/// The bit of the sign in the most significant byte: where it is turned, integers count from 0.
const SIGN: u8 = 0x80;

/// The first bytes.
#[inline(always)]
fn first<const B: usize>(bytes: &[u8]) -> [u8; B] {
    std::array::from_fn(|i| bytes[i])
}

/// Never clips.
#[inline(always)]
fn store<const B: usize>(bytes: &mut [u8], packed: [u8; B]) -> bool {
    bytes[..B].copy_from_slice(&packed);
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bytes_of(format: PcmFormat, value: f64) -> (Vec<u8>, bool) {
        let mut bytes = vec![0; format.bytes()];
        let clipped = format.encode(value, &mut bytes);
        (bytes, clipped)
    }

    #[test]
    fn names_go_both_ways_and_a_wrong_one_is_named() {
        for format in PcmFormat::ALL {
            assert_eq!(format.name().parse(), Ok(format));
        }
        let error = "s16".parse::<PcmFormat>().unwrap_err();
        assert!(error.to_string().contains("`s16`") && error.to_string().contains("s16le"));
    }

    #[test]
    fn every_integer_of_every_short_format_survives() {
        use PcmFormat::{S8, S16Be, S16Le, U8, U16Be, U16Le};
        for format in [S8, U8, S16Le, S16Be, U16Le, U16Be] {
            for code in 0..1u32 << (8 * format.bytes()) {
                let bytes = &code.to_le_bytes()[..format.bytes()];
                assert_eq!(bytes_of(format, format.decode(bytes)), (bytes.to_vec(), false), "{format}");
            }
        }
    }

    #[test]
    fn long_formats_survive_at_the_edges() {
        use PcmFormat::{S24Be, S24Le, S32Be, S32Le, U32Be, U32Le};
        for format in [S24Le, S24Be, S32Le, S32Be, U32Le, U32Be] {
            for pattern in [[0x80, 0, 0, 0], [0x7f, 0xff, 0xff, 0xff], [0, 0, 0, 1], [0xff; 4], [1, 2, 3, 4]]
            {
                let bytes = &pattern[..format.bytes()];
                assert_eq!(bytes_of(format, format.decode(bytes)), (bytes.to_vec(), false), "{format}");
            }
        }
    }

    #[test]
    fn integers_of_64_bits_keep_53() {
        for code in [0, 1, -1, 1 << 52, -(1 << 53), 5 << 60, i64::MIN] {
            assert_eq!(PcmFormat::S64Be.decode(&code.to_be_bytes()) * 2f64.powi(63), code as f64);
            assert_eq!(
                bytes_of(PcmFormat::S64Le, code as f64 / 2f64.powi(63)),
                (code.to_le_bytes().to_vec(), false)
            );
        }
        assert_eq!(bytes_of(PcmFormat::S64Le, 1.0), (i64::MAX.to_le_bytes().to_vec(), true));
    }

    #[test]
    fn half_floats_survive() {
        for format in [PcmFormat::F16Le, PcmFormat::F16Be] {
            for code in 0..=u16::MAX {
                let bytes = code.to_le_bytes();
                let value = format.decode(&bytes);
                assert!(value.is_nan() || bytes_of(format, value).0 == bytes, "{format} {code}");
            }
        }
        assert_eq!(PcmFormat::F16Le.decode(&[0x00, 0x3C]), 1.0);
    }

    #[test]
    fn offset_binary_begins_at_the_lowest_code() {
        let ends = [PcmFormat::U16Le, PcmFormat::U32Be].map(|format| {
            let word = [[0; 4], [0x80; 4], [0xFF; 4]];
            word.map(|bytes| format.decode(&bytes))
        });
        assert_eq!(ends[0], [-1.0, 128.0 / 32768.0, 32767.0 / 32768.0]);
        assert_eq!((ends[1][0], ends[1][2]), (-1.0, 1.0 - 2f64.powi(-31)));
    }

    #[test]
    fn full_scale_is_one_and_beyond_it_saturates() {
        assert_eq!(bytes_of(PcmFormat::S16Le, 1.0), (vec![0xff, 0x7f], true));
        assert_eq!(bytes_of(PcmFormat::S16Le, -1.0), (vec![0, 0x80], false));
        assert_eq!(bytes_of(PcmFormat::S24Be, -7.0), (vec![0x80, 0, 0], true));
        assert_eq!(bytes_of(PcmFormat::U8, 0.0), (vec![128], false));
        assert_eq!(bytes_of(PcmFormat::S32Le, 0.5), (vec![0, 0, 0, 0x40], false));
        // 0.99999 rounds to 32768, which is beyond the range; 32767.4 is not.
        assert_eq!(bytes_of(PcmFormat::S16Be, 32767.4 / 32768.0), (vec![0x7f, 0xff], false));
        assert_eq!(bytes_of(PcmFormat::S16Be, 32767.6 / 32768.0), (vec![0x7f, 0xff], true));
        assert_eq!(bytes_of(PcmFormat::F32Le, 3.0), (3f32.to_le_bytes().to_vec(), false));
    }

    #[test]
    fn ties_go_to_even() {
        assert_eq!(bytes_of(PcmFormat::S8, 0.5 / 128.0).0, vec![0]);
        assert_eq!(bytes_of(PcmFormat::S8, 1.5 / 128.0).0, vec![2]);
        assert_eq!(bytes_of(PcmFormat::S8, -2.5 / 128.0).0, vec![(-2i8) as u8]);
    }
}
