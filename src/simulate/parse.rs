//! How sources are written on the command line: `step@0.3+tones:440Hz,1kHz+chirp:100Hz..8kHz@2s`.

use super::source::{Source, Tone};
use crate::messages::Quoted;
use crate::quantity::{self, WrittenTime};
use crate::units::{RadiansPerSecond, Seconds};
use std::f64::consts::TAU;
use std::str::FromStr;

/// A text that describes no source.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ParseSourceError {
    /// No such kind of source.
    #[error(
        "`{}` is not a source; write step@0.3, tones:0.3,0.8 (rad/s), tones:440Hz,1kHz, ctones:-2kHz (complex), \
         chirp:100Hz..8kHz@2s, several joined by `+`, or the name of a WAV file",
        Quoted(.text)
    )]
    Unknown {
        /// The text as given.
        text: String,
    },
    /// Not a finite number.
    #[error("`{}` in source `{}` is not a finite number{hint}", Quoted(.number), Quoted(.text))]
    Number {
        /// The text as given.
        text: String,
        /// The number as written.
        number: String,
        /// The units that may follow it.
        hint: &'static str,
    },
}

impl FromStr for Source {
    type Err = ParseSourceError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let mut terms =
            text.split('+').map(|term| parse_term(text, term.trim())).collect::<Result<Vec<_>, _>>()?;
        Ok(if terms.len() == 1 { terms.remove(0) } else { Self::Sum(terms) })
    }
}

/// The complex exponentials of a term of the sum `text`, if it is one of these.
pub(super) fn exponentials(text: &str, term: &str) -> Result<Option<Vec<Tone>>, ParseSourceError> {
    term.strip_prefix("ctones:").map(|list| tones(text, list)).transpose()
}

/// Angular frequencies or frequencies, separated by commas.
fn tones(text: &str, list: &str) -> Result<Vec<Tone>, ParseSourceError> {
    let tone = |s: &str| angular(text, s).map(|omega| Tone { omega, amplitude: 1.0, phase: 0.0 });
    list.split(',').map(tone).collect()
}

/// One real term of the sum `text`.
pub(super) fn parse_term(text: &str, term: &str) -> Result<Source, ParseSourceError> {
    if let Some(at) = term.strip_prefix("step@") {
        return Ok(Source::Step { at: seconds(text, at)?, height: 1.0 });
    }
    if let Some(list) = term.strip_prefix("tones:") {
        return Ok(Source::Tones(tones(text, list)?));
    }
    let chirp = term.strip_prefix("chirp:").and_then(|rest| rest.split_once('@'));
    if let Some((range, length)) = chirp
        && let Some((start, end)) = range.split_once("..")
    {
        let (start, end) = (angular(text, start)?.in_hertz(), angular(text, end)?.in_hertz());
        return Ok(Source::Chirp { start, end, length: seconds(text, length)?, amplitude: 1.0 });
    }
    Err(ParseSourceError::Unknown { text: text.to_owned() })
}

/// Seconds, with an optional unit such as ms or ns.
fn seconds(text: &str, number: &str) -> Result<Seconds, ParseSourceError> {
    match quantity::time(number) {
        Ok(WrittenTime::Seconds(time)) => Ok(time),
        _ => Err(not_a_number(text, number, " (seconds, or with a unit such as ms, us or ns)")),
    }
}

/// rad/s without a unit, or hertz with a unit such as Hz or kHz.
fn angular(text: &str, number: &str) -> Result<RadiansPerSecond, ParseSourceError> {
    let hint = " (rad/s, or with a unit such as Hz, kHz or MHz)";
    let Ok(frequency) = quantity::frequency(number) else { return Err(not_a_number(text, number, hint)) };
    let is_bare = number.trim().parse::<f64>().is_ok();
    Ok(RadiansPerSecond(if is_bare { frequency.0 } else { frequency.0 * TAU }))
}

fn not_a_number(text: &str, number: &str, hint: &'static str) -> ParseSourceError {
    ParseSourceError::Number { text: text.to_owned(), number: number.trim().to_owned(), hint }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Hertz;

    #[test]
    fn all_written_forms_are_read() {
        assert_eq!("step@0.3".parse(), Ok(Source::Step { at: Seconds(0.3), height: 1.0 }));
        let Ok(Source::Tones(tones)) = "tones:0.3,1kHz".parse() else { panic!() };
        assert_eq!((tones[0].omega.0, tones[1].omega.0), (0.3, TAU * 1e3));
        let (start, end, length) = (Hertz(10.0), Hertz(20.0), Seconds(0.5));
        assert_eq!(
            "chirp:10Hz..20Hz@500ms".parse(),
            Ok(Source::Chirp { start, end, length, amplitude: 1.0 })
        );
        assert!(matches!("step@1us+tones:2".parse(), Ok(Source::Sum(terms)) if terms.len() == 2));
    }

    #[test]
    fn a_unit_scales_its_number() {
        for (text, at) in [("step@1ns", 1e-9), ("step@4us", 4e-6), ("step@-2 ms", -2e-3), ("step@1e9s", 1e9)]
        {
            assert_eq!(text.parse(), Ok(Source::Step { at: Seconds(at), height: 1.0 }), "{text}");
        }
    }

    #[test]
    fn an_error_quotes_the_text() {
        for text in [
            "",
            "stp@1",
            "step@",
            "step@nan",
            "tones:",
            "tones:1,,2",
            "chirp:1..2",
            "chirp:1@2",
            "tones:infHz",
        ] {
            let error = text.parse::<Source>().unwrap_err().to_string();
            assert!(error.contains(&format!("`{text}`")), "{text}: {error}");
        }
    }
}
