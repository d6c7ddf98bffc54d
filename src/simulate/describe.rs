//! What a source is, in words and hertz.

use super::source::{Source, Tone};
use crate::quantity::readable;
use std::fmt;

/// Tones that a line holds.
const MOST_TONES: usize = 8;

impl fmt::Display for Source {
    /// Frequencies in hertz and times in seconds, with SI prefixes and at most six digits.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Step { at, .. } => write!(f, "a step at {}", readable(at.0, "s")),
            Self::Tones(tones) => write!(f, "{}", tones_text(tones)),
            Self::Chirp { start, end, length, .. } => {
                let [start, end] = [start, end].map(|frequency| readable(frequency.0, "Hz"));
                write!(f, "a chirp from {start} to {end} in {}", readable(length.0, "s"))
            }
            Self::Sum(terms) => {
                let terms: Vec<String> = terms.iter().map(ToString::to_string).collect();
                write!(f, "{}", terms.join(" plus "))
            }
        }
    }
}

fn tones_text(tones: &[Tone]) -> String {
    let shown = tones.iter().take(MOST_TONES).map(|tone| readable(tone.omega.in_hertz().0, "Hz"));
    let shown: Vec<String> = shown.collect();
    let rest = if tones.len() > MOST_TONES { ", .." } else { "" };
    let plural = if tones.len() == 1 { "a tone" } else { "tones" };
    format!("{plural} at {}{rest}", shown.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sources_are_described_in_hertz() {
        for (text, words) in [
            ("tones:440", "a tone at 70.0282 Hz"),
            ("tones:440Hz,1.5kHz", "tones at 440 Hz, 1.5 kHz"),
            ("step@0.3", "a step at 300 ms"),
            ("chirp:50Hz..8kHz@2s", "a chirp from 50 Hz to 8 kHz in 2 s"),
            ("step@1us+tones:1GHz", "a step at 1 us plus a tone at 1 GHz"),
        ] {
            assert_eq!(text.parse::<Source>().unwrap().to_string(), words);
        }
    }
}
