//! Quantities as text: a number, an SI prefix and a unit, as in `10ps`, `0.3 samples`, `48 kHz`, `1%`.
//!
//! The prefix moves the decimal point of the number before it is rounded, so `10ps` is the double nearest
//! to 1e-11: the same bits as `1e-11`.
//!
//! ```
//! use hybank_core::quantity::{self, WrittenTime};
//! use hybank_core::units::Seconds;
//! assert_eq!(quantity::time("10ps"), Ok(WrittenTime::Seconds(Seconds(1e-11))));
//! assert_eq!(quantity::time("0.25 samples").map(|time| time.in_seconds(Seconds(4e-9))), Ok(Seconds(1e-9)));
//! assert_eq!(quantity::relative("0.5%"), Ok(0.005));
//! ```

use crate::messages::Quoted;
use crate::units::{FastPeriods, Hertz, Seconds};
use std::fmt;
use std::ops::RangeInclusive;

mod document;
pub(crate) use document::{Rate, Share};

/// A time as it is written: in seconds, or in units of the fast period.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum WrittenTime {
    /// In seconds: `10ps`, `1e-11`.
    Seconds(Seconds),
    /// In fast samples: `0.01 samples`.
    Samples(FastPeriods),
}

impl WrittenTime {
    /// The time in seconds, with the fast period h.
    pub fn in_seconds(self, fast_period: Seconds) -> Seconds {
        match self {
            Self::Seconds(time) => time,
            Self::Samples(time) => time.in_seconds(fast_period),
        }
    }
}

/// A text that is not the quantity it should be.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum QuantityError {
    /// There is no number at the beginning.
    #[error("\"{}\" does not begin with a number; write {example}", Quoted(.text))]
    NoNumber {
        /// The text.
        text: String,
        /// What to write.
        example: &'static str,
    },
    /// The number does not fit a double.
    #[error("\"{}\" does not fit a double; write a number below 1e308", Quoted(.text))]
    TooLarge {
        /// The text.
        text: String,
    },
    /// The number is too small or too large.
    #[error("\"{}\" is out of range; write {example}", Quoted(.text))]
    Range {
        /// The text.
        text: String,
        /// What to write.
        example: &'static str,
    },
    /// The unit is not known here.
    #[error("\"{}\" has the unit \"{}\", which is not known here; write {example}", Quoted(.text), Quoted(.unit))]
    Unit {
        /// The text.
        text: String,
        /// What stands after the number.
        unit: String,
        /// What to write.
        example: &'static str,
    },
}

/// The numbers of a capture that are full scale, -1 to 1 everywhere else.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FullScale {
    /// The number that is full scale, in volts or in whatever the capture has.
    Number(f64),
    /// Codes of a converter of so many bits, from -2^(bits - 1): full scale is 2^(bits - 1).
    Signed(u32),
    /// The same with codes from 0: the middle is 2^(bits - 1).
    Unsigned(u32),
}

impl FullScale {
    /// The number that becomes 1, less the one that becomes 0.
    pub fn amplitude(self) -> f64 {
        match self {
            Self::Number(number) => number,
            Self::Signed(bits) | Self::Unsigned(bits) => 2f64.powi(bits as i32 - 1),
        }
    }

    /// The number that becomes 0.
    pub fn middle(self) -> f64 {
        if let Self::Unsigned(_) = self { self.amplitude() } else { 0.0 }
    }

    /// Lowest and highest sample of codes, of full scale.
    pub fn rails(self) -> Option<(f64, f64)> {
        match self {
            Self::Number(_) => None,
            Self::Signed(_) | Self::Unsigned(_) => Some((-1.0, 1.0 - 1.0 / self.amplitude())),
        }
    }

    /// The codes that reach from `least` to `most`, if a converter has such codes.
    pub fn of_codes(least: f64, most: f64) -> Option<Self> {
        let kinds = [Self::Signed, Self::Unsigned];
        let first = usize::from(least >= 0.0);
        (1..=CODE_BITS).map(kinds[first]).find(|codes| {
            let reach = codes.amplitude();
            least >= codes.middle() - reach && most < codes.middle() + reach
        })
    }
}

/// A number as a number, codes as text.
impl serde::Serialize for FullScale {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Number(number) => serializer.serialize_f64(*number),
            codes => serializer.collect_str(codes),
        }
    }
}

impl fmt::Display for FullScale {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(number) => write!(f, "{number}"),
            Self::Signed(bits) => write!(f, "{bits}bits"),
            Self::Unsigned(bits) => write!(f, "u{bits}bits"),
        }
    }
}

/// SI prefixes with their power of ten. Mu has two code points.
const PREFIXES: [(&str, i32); 13] = [
    ("", 0),
    ("a", -18),
    ("f", -15),
    ("p", -12),
    ("n", -9),
    ("u", -6),
    ("\u{b5}", -6),
    ("\u{3bc}", -6),
    ("m", -3),
    ("k", 3),
    ("M", 6),
    ("G", 9),
    ("T", 12),
];
const RELATIVE_UNITS: [(&str, i32); 3] = [("", 0), ("%", -2), ("ppm", -6)];
const TIMES: &str = "a time such as 10ps, 2.5e-9 (seconds) or 0.01samples";
const FREQUENCIES: &str = "a frequency such as 9kHz, 1.2GHz or 48000 (hertz)";
const RATES: &str = "a rate such as 1GS/s, 48kHz or 48000 (hertz)";
/// Most bits of codes: doubles hold those of more with gaps.
const CODE_BITS: u32 = 53;
/// Range of a number that is full scale: beyond it samples of full scale would lose digits in 32 bits.
const FULL_SCALES: RangeInclusive<f64> = 1e-30..=1e30;
const FULL_SCALE: &str = "the number that is full scale, 1e-30 to 1e30, such as 128 or 2.5, or the codes of a converter: \
                          8bits from -128 to 127, u8bits from 0 to 255 (1 to 53 bits)";
const SHARES: &str = "a share such as 1%, 540ppm or 0.01";

/// A time: seconds with an SI prefix, or fast samples. A number without unit is in seconds.
///
/// # Errors
/// [`QuantityError`]. Any finite time is legal, negative ones too.
pub fn time(text: &str) -> Result<WrittenTime, QuantityError> {
    let written = Written::split(text, TIMES)?;
    if matches!(written.unit, "samples" | "sample") {
        return written.scaled(0).map(|value| WrittenTime::Samples(FastPeriods(value)));
    }
    written.with_prefix(&["s"], TIMES).map(|value| WrittenTime::Seconds(Seconds(value)))
}

/// A frequency: hertz with an SI prefix. A number without unit is in hertz; `48k` is 48 kHz, as audio tools
/// have it.
///
/// # Errors
/// [`QuantityError`]. Any finite frequency is legal, negative ones too.
pub fn frequency(text: &str) -> Result<Hertz, QuantityError> {
    Written::split(text, FREQUENCIES)?.with_prefix(&["Hz"], FREQUENCIES).map(Hertz)
}

/// A rate of samples: `S/s` or hertz with an SI prefix, as in `1 GS/s` and `48k`. A number without unit is
/// in hertz.
///
/// # Errors
/// [`QuantityError`]. Any finite rate is legal, negative ones too.
pub fn rate(text: &str) -> Result<Hertz, QuantityError> {
    Written::split(text, RATES)?.with_prefix(&["S/s", "Hz"], RATES).map(Hertz)
}

/// The full scale of a capture: a number above 0, or the codes of a converter, `8bits` or `u8bits`.
///
/// # Errors
/// [`QuantityError`].
pub fn full_scale(text: &str) -> Result<FullScale, QuantityError> {
    let trimmed = text.trim();
    let codes = trimmed.strip_prefix('u');
    let written = Written::split(codes.unwrap_or(trimmed), FULL_SCALE)?;
    let number = written.scaled(0)?;
    let bits = (1..=CODE_BITS).find(|&bits| f64::from(bits) == number);
    match (written.unit, codes, bits) {
        ("bits" | "bit", None, Some(bits)) => Ok(FullScale::Signed(bits)),
        ("bits" | "bit", Some(_), Some(bits)) => Ok(FullScale::Unsigned(bits)),
        ("", None, _) if FULL_SCALES.contains(&number) => Ok(FullScale::Number(number)),
        ("", None, _) => Err(QuantityError::Range { text: text.to_owned(), example: FULL_SCALE }),
        _ => Err(written.unknown_unit(FULL_SCALE)),
    }
}

/// The SI prefix for values up to `most`: the factor that brings them to it, and the unit with the prefix.
pub fn scale_of(most: f64, unit: &str) -> (f64, String) {
    let power = 3.0 * (most.abs().log10() / 3.0).floor();
    match PREFIXES.iter().find(|(_, known)| f64::from(*known) == power) {
        Some((prefix, power)) => (10f64.powi(-power), format!("{prefix}{unit}")),
        None => (1.0, unit.to_owned()),
    }
}

/// A value with an SI prefix and its unit, in at most six digits, for people: `250 MHz`.
pub fn readable(value: f64, unit: &str) -> String {
    exact(format!("{value:.5e}").parse().unwrap_or(value), unit)
}

/// A value with an SI prefix and its unit, in as many digits as read back to the same bits.
pub fn exact(value: f64, unit: &str) -> String {
    let scientific = format!("{value:e}");
    let (mantissa, exponent) = scientific.split_once('e').unwrap_or((&scientific, "0"));
    let exponent: i32 = exponent.parse().unwrap_or(0);
    let power = 3 * exponent.div_euclid(3);
    let Some((prefix, _)) = PREFIXES.iter().find(|(_, known)| *known == power) else {
        return format!("{scientific} {unit}");
    };
    let (whole, part) = mantissa.split_once('.').unwrap_or((mantissa, ""));
    let shift = (exponent - power) as usize;
    let part = format!("{part:0<shift$}");
    let (shifted, rest) = part.split_at(shift);
    let point = if rest.is_empty() { "" } else { "." };
    format!("{whole}{shifted}{point}{rest} {prefix}{unit}")
}

/// A share of something: per cent, parts per million, or a number without unit.
///
/// # Errors
/// [`QuantityError`]. Any finite share is legal, negative ones too.
pub fn relative(text: &str) -> Result<f64, QuantityError> {
    let written = Written::split(text, SHARES)?;
    match RELATIVE_UNITS.iter().find(|(unit, _)| *unit == written.unit) {
        Some(&(_, exponent)) => written.scaled(exponent),
        None => Err(written.unknown_unit(SHARES)),
    }
}

/// A text cut into the parts of a quantity.
struct Written<'a> {
    text: &'a str,
    /// Sign, digits and point.
    mantissa: &'a str,
    /// Digits after the `e`, empty without one.
    exponent: &'a str,
    unit: &'a str,
}

impl<'a> Written<'a> {
    fn split(text: &'a str, example: &'static str) -> Result<Self, QuantityError> {
        let trimmed = text.trim();
        let is_digit = |c: char| c.is_ascii_digit() || c == '.';
        let unsigned = trimmed.strip_prefix(['+', '-']).unwrap_or(trimmed);
        let sign = trimmed.len() - unsigned.len();
        let digits = unsigned.find(|c| !is_digit(c)).unwrap_or(unsigned.len());
        let (mantissa, rest) = trimmed.split_at(sign + digits);
        if mantissa.parse::<f64>().is_err() {
            return Err(QuantityError::NoNumber { text: text.to_owned(), example });
        }
        let length = exponent_length(rest);
        let exponent = rest[..length].trim_start_matches(['e', 'E']);
        Ok(Self { text, mantissa, exponent, unit: rest[length..].trim() })
    }

    /// The number times a power of ten, rounded once.
    fn scaled(&self, power: i32) -> Result<f64, QuantityError> {
        let too_large = || QuantityError::TooLarge { text: self.text.to_owned() };
        let written = if self.exponent.is_empty() { "0" } else { self.exponent };
        let exponent = written.parse::<i32>().map_err(|_| too_large())?.saturating_add(power);
        let value: f64 = format!("{}e{exponent}", self.mantissa).parse().map_err(|_| too_large())?;
        if value.is_finite() { Ok(value) } else { Err(too_large()) }
    }

    /// The number in the first of `units` that it has, with any prefix; without any unit it stands for the
    /// same.
    fn with_prefix(&self, units: &[&str], example: &'static str) -> Result<f64, QuantityError> {
        let prefix = match self.unit {
            "" => Some(""),
            thousands @ ("k" | "M" | "G") if units.contains(&"Hz") => Some(thousands),
            written => units.iter().find_map(|unit| written.strip_suffix(unit)),
        };
        let known = prefix.and_then(|prefix| PREFIXES.iter().find(|(name, _)| *name == prefix));
        known.map_or_else(|| Err(self.unknown_unit(example)), |&(_, power)| self.scaled(power))
    }

    fn unknown_unit(&self, example: &'static str) -> QuantityError {
        QuantityError::Unit { text: self.text.to_owned(), unit: self.unit.to_owned(), example }
    }
}

/// Length of `e`, sign and digits at the beginning of `rest`; zero if they are not all there.
fn exponent_length(rest: &str) -> usize {
    let Some(after) = rest.strip_prefix(['e', 'E']) else { return 0 };
    let unsigned = after.strip_prefix(['+', '-']).unwrap_or(after);
    let digits = unsigned.find(|c: char| !c.is_ascii_digit()).unwrap_or(unsigned.len());
    if digits == 0 { 0 } else { rest.len() - unsigned.len() + digits }
}

#[cfg(test)]
mod tests;
