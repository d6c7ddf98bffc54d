//! Complex analog signals, as a quadrature receiver delivers them.

use super::parse::{ParseSourceError, exponentials, parse_term};
use super::source::{Source, Tone};
use std::f64::consts::FRAC_PI_2;
use std::fmt;
use std::str::FromStr;

/// f(t) = sum of A e^{j (w t + phase)} over the exponentials, plus a real signal.
///
/// A bank is real, so it runs on both parts, and so do virtual converters: sample the two
/// [parts](Self::parts).
///
/// ```
/// use hybank::simulate::ComplexSource;
/// use hybank::units::Seconds;
/// let source: ComplexSource = "ctones:-250kHz+step@1ms".parse()?;
/// let (real, imaginary) = source.parts();
/// let value = (real.value(Seconds(1e-6)), imaginary.value(Seconds(1e-6)));
/// assert!((value.0.hypot(value.1) - 1.0).abs() < 1e-12 && value.1 < 0.0);
/// # Ok::<(), hybank::simulate::ParseSourceError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct ComplexSource {
    /// The exponentials; those of a negative frequency turn the other way.
    pub exponentials: Vec<Tone>,
    /// The real signal.
    pub real: Vec<Source>,
}

impl ComplexSource {
    /// True if the signal has no imaginary part.
    pub fn is_real(&self) -> bool {
        self.exponentials.is_empty()
    }

    /// Real and imaginary part: cos(w t + phase) and cos(w t + phase - pi / 2) for each exponential.
    pub fn parts(&self) -> (Source, Source) {
        let later = |tone: &Tone| Tone { phase: tone.phase - FRAC_PI_2, ..*tone };
        let imaginary = Source::Tones(self.exponentials.iter().map(later).collect());
        let mut real = self.real.clone();
        if !self.is_real() {
            real.push(Source::Tones(self.exponentials.clone()));
        }
        (if real.len() == 1 { real.remove(0) } else { Source::Sum(real) }, imaginary)
    }
}

/// As a [`Source`], with `ctones:100kHz,-250kHz` among the terms: exponentials of amplitude 1, angular
/// frequencies in rad/s or frequencies with a unit.
impl FromStr for ComplexSource {
    type Err = ParseSourceError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let mut source = Self { exponentials: Vec::new(), real: Vec::new() };
        for term in text.split('+').map(str::trim) {
            match exponentials(text, term)? {
                Some(tones) => source.exponentials.extend(tones),
                None => source.real.push(parse_term(text, term)?),
            }
        }
        Ok(source)
    }
}

impl fmt::Display for ComplexSource {
    /// As [`Source`]: hertz, seconds, SI prefixes.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut terms: Vec<String> = self.real.iter().map(ToString::to_string).collect();
        if !self.is_real() {
            let tones = Source::Tones(self.exponentials.clone()).to_string();
            let kind = if self.exponentials.len() == 1 { "a complex " } else { "complex " };
            terms.push(format!("{kind}{}", tones.trim_start_matches("a ")));
        }
        write!(f, "{}", terms.join(" plus "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Seconds;

    fn source(text: &str) -> ComplexSource {
        text.parse().unwrap()
    }

    #[test]
    fn both_parts_are_those_of_the_exponentials() {
        let (real, imaginary) = source("tones:2+ctones:3,-0.5Hz").parts();
        for t in [-1.3, 0.0, 0.4, 7.7f64] {
            let slow = -std::f64::consts::PI * t;
            let want = ((2.0 * t).cos() + (3.0 * t).cos() + slow.cos(), (3.0 * t).sin() + slow.sin());
            assert!((real.value(Seconds(t)) - want.0).abs() < 1e-12);
            assert!((imaginary.value(Seconds(t)) - want.1).abs() < 1e-12);
        }
    }

    #[test]
    fn a_signal_without_exponentials_is_the_real_one() {
        let real = source("step@0.5+tones:3");
        assert!(real.is_real());
        assert_eq!(real.parts().0, "step@0.5+tones:3".parse().unwrap());
        assert_eq!(source("tones:3").parts(), ("tones:3".parse().unwrap(), Source::Tones(vec![])));
    }
}
