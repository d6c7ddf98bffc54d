//! Analytic sources: signals known in closed form, and how they are written on the command line.

use std::f64::consts::TAU;
use std::str::FromStr;

/// An analog signal f(t), t in seconds.
#[derive(Debug, Clone, PartialEq)]
pub enum Source {
    /// 0 before `at`, `height` from then on (thesis 5.42).
    Step {
        /// Instant of the step, seconds.
        at: f64,
        /// Height of the step.
        height: f64,
    },
    /// Sum of amplitude cos(omega t + phase) from t = minus infinity (thesis 5.43).
    Tones(Vec<Tone>),
    /// amplitude sin(2 pi (start t + (end - start) t^2 / (2 length))) for 0 <= t < length, else 0.
    Chirp {
        /// Frequency at t = 0, hertz.
        start: f64,
        /// Frequency at t = length, hertz.
        end: f64,
        /// Duration in seconds.
        length: f64,
        /// Peak value.
        amplitude: f64,
    },
    /// The sum of several sources.
    Sum(Vec<Source>),
}

/// amplitude cos(omega t + phase).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tone {
    /// Angular frequency, rad/s.
    pub omega: f64,
    /// Peak value.
    pub amplitude: f64,
    /// Phase at t = 0, rad.
    pub phase: f64,
}

impl Source {
    /// The same signal with time counted in units of `unit` seconds.
    pub fn in_unit(&self, unit: f64) -> Self {
        match self {
            Self::Step { at, height } => Self::Step { at: at / unit, height: *height },
            Self::Tones(tones) => {
                Self::Tones(tones.iter().map(|tone| Tone { omega: tone.omega * unit, ..*tone }).collect())
            }
            Self::Chirp { start, end, length, amplitude } => Self::Chirp {
                start: start * unit,
                end: end * unit,
                length: length / unit,
                amplitude: *amplitude,
            },
            Self::Sum(parts) => Self::Sum(parts.iter().map(|part| part.in_unit(unit)).collect()),
        }
    }

    /// When all has happened that happens once: the end of a chirp, the instant of a step.
    pub fn duration(&self) -> Option<f64> {
        match self {
            Self::Chirp { length, .. } => Some(*length),
            Self::Step { at, .. } => Some(*at),
            Self::Sum(parts) => parts.iter().filter_map(Self::duration).reduce(f64::max),
            Self::Tones(_) => None,
        }
    }

    /// f(t).
    pub fn value(&self, t: f64) -> f64 {
        match self {
            Self::Step { at, height } => {
                if t >= *at {
                    *height
                } else {
                    0.0
                }
            }
            Self::Tones(tones) => {
                tones.iter().map(|tone| tone.amplitude * (tone.omega * t + tone.phase).cos()).sum()
            }
            Self::Chirp { start, end, length, amplitude } => {
                if !(0.0..*length).contains(&t) {
                    return 0.0;
                }
                amplitude * (TAU * (start + (end - start) * t / (2.0 * length)) * t).sin()
            }
            Self::Sum(parts) => parts.iter().map(|part| part.value(t)).sum(),
        }
    }
}

/// A source that could not be read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ParseSourceError {
    /// No such kind of source.
    #[error(
        "`{text}` is no source: write step@0.3, tones:0.3,0.8 (rad/s), tones:440Hz,1kHz, \
         chirp:100Hz..8kHz@2s, several joined by `+`, or the name of a WAV file"
    )]
    Unknown {
        /// What was typed.
        text: String,
    },
    /// A number that is none.
    #[error("`{number}` in source `{text}` is not a finite number{hint}")]
    Number {
        /// What was typed.
        text: String,
        /// The part that is wrong.
        number: String,
        /// Which units are understood there.
        hint: &'static str,
    },
}

impl FromStr for Source {
    type Err = ParseSourceError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let mut parts =
            text.split('+').map(|part| parse_one(text, part.trim())).collect::<Result<Vec<_>, _>>()?;
        Ok(if parts.len() == 1 { parts.remove(0) } else { Self::Sum(parts) })
    }
}

fn parse_one(text: &str, part: &str) -> Result<Source, ParseSourceError> {
    if let Some(at) = part.strip_prefix("step@") {
        return Ok(Source::Step { at: seconds(text, at)?, height: 1.0 });
    }
    if let Some(list) = part.strip_prefix("tones:") {
        let tone = |s: &str| angular(text, s).map(|omega| Tone { omega, amplitude: 1.0, phase: 0.0 });
        return Ok(Source::Tones(list.split(',').map(tone).collect::<Result<_, _>>()?));
    }
    let chirp = part.strip_prefix("chirp:").and_then(|rest| rest.split_once('@'));
    if let Some((range, length)) = chirp
        && let Some((start, end)) = range.split_once("..")
    {
        let (start, end) = (angular(text, start)? / TAU, angular(text, end)? / TAU);
        return Ok(Source::Chirp { start, end, length: seconds(text, length)?, amplitude: 1.0 });
    }
    Err(ParseSourceError::Unknown { text: text.to_owned() })
}

/// Seconds, with an optional unit s, ms, us or ns.
fn seconds(text: &str, number: &str) -> Result<f64, ParseSourceError> {
    let units = [("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9), ("s", 1.0)];
    scaled(text, number, &units, " (seconds; the units ms, us and ns are understood)")
}

/// rad/s when bare, or hertz with the unit Hz, kHz or MHz.
fn angular(text: &str, number: &str) -> Result<f64, ParseSourceError> {
    let units = [("kHz", TAU * 1e3), ("MHz", TAU * 1e6), ("Hz", TAU)];
    scaled(text, number, &units, " (rad/s; the units Hz, kHz and MHz are understood)")
}

fn scaled(
    text: &str,
    number: &str,
    units: &[(&str, f64)],
    hint: &'static str,
) -> Result<f64, ParseSourceError> {
    let number = number.trim();
    let unit = units.iter().find_map(|&(name, factor)| number.strip_suffix(name).map(|bare| (bare, factor)));
    let (bare, factor) = unit.unwrap_or((number, 1.0));
    match bare.trim().parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value * factor),
        _ => Err(ParseSourceError::Number { text: text.to_owned(), number: number.to_owned(), hint }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_written_forms_are_understood() {
        assert_eq!("step@0.3".parse(), Ok(Source::Step { at: 0.3, height: 1.0 }));
        let Ok(Source::Tones(tones)) = "tones:0.3,1kHz".parse() else { panic!() };
        assert_eq!((tones[0].omega, tones[1].omega), (0.3, TAU * 1e3));
        let chirp = "chirp:10Hz..20Hz@500ms".parse();
        assert_eq!(chirp, Ok(Source::Chirp { start: 10.0, end: 20.0, length: 0.5, amplitude: 1.0 }));
        assert!(matches!("step@1us+tones:2".parse(), Ok(Source::Sum(parts)) if parts.len() == 2));
    }

    #[test]
    fn nonsense_is_named() {
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
            assert!(error.contains('`'), "{text}: {error}");
        }
    }

    #[test]
    fn changing_the_unit_of_time_changes_nothing_else() {
        let source: Source = "step@0.5+tones:3,4+chirp:1Hz..2Hz@2s".parse().unwrap();
        let scaled = source.in_unit(1e-3);
        for t in [0.0, 0.25, 0.75, 1.5, 2.5] {
            assert!((source.value(t) - scaled.value(t * 1e3)).abs() < 1e-9);
        }
    }
}
