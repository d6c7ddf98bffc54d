//! Delays that were measured elsewhere, as JSON lines.

use super::{ReadingProblem, TrackError};
use crate::messages::of_document;
use crate::spec::HALF_WIDTH;
use crate::units::Seconds;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// The delays at one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Reading {
    /// The frame, from 0.
    pub frame: u64,
    /// D_i and its standard deviation; `None` for a channel of which the line says nothing.
    pub delays: Vec<Option<(Seconds, Seconds)>>,
}

/// A line: absolute delays in seconds with half-widths of 95 % intervals, one for all channels or one each.
/// The other keys of a log are not read.
#[derive(Serialize, Deserialize)]
struct Line {
    frame: u64,
    delay: Vec<Option<f64>>,
    half_width: HalfWidths,
}

#[derive(Serialize, Deserialize)]
#[serde(untagged, expecting = "half_width is one number for all channels, or a list")]
enum HalfWidths {
    Same(f64),
    Each(Vec<Option<f64>>),
}

impl HalfWidths {
    fn of(&self, i: usize) -> Option<f64> {
        match self {
            Self::Same(value) => Some(*value),
            Self::Each(list) => list.get(i).copied().flatten(),
        }
    }
}

impl Reading {
    /// Reads JSON lines for `channels` channels, in the order of their frames; `file` is used in messages. A
    /// log of a [`super::Follower`] is such a file.
    ///
    /// # Errors
    /// [`TrackError::Reading`] for the first line that is wrong.
    pub fn parse(text: &str, file: &str, channels: usize) -> Result<Vec<Self>, TrackError> {
        let mut readings: Vec<Self> = Vec::new();
        for (number, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
            let fault = |problem| TrackError::Reading { file: file.to_owned(), line: number + 1, problem };
            let reading = Self::of_line(line, channels).map_err(fault)?;
            if readings.last().is_some_and(|last| last.frame > reading.frame) {
                return Err(fault(ReadingProblem::Order { frame: reading.frame }));
            }
            readings.push(reading);
        }
        Ok(readings)
    }

    fn of_line(line: &str, channels: usize) -> Result<Self, ReadingProblem> {
        let syntax =
            |error: serde_json::Error| ReadingProblem::Syntax { reason: of_document(&error.to_string()) };
        let line: Line = serde_json::from_str(line).map_err(syntax)?;
        if line.delay.len() != channels {
            return Err(ReadingProblem::DelayCount { given: line.delay.len(), channels });
        }
        let of = |i: usize| {
            let (Some(delay), channel) = (line.delay[i], i + 1) else { return Ok(None) };
            let half_width = line.half_width.of(i).ok_or(ReadingProblem::NoHalfWidth { channel })?;
            if half_width < 0.0 || !half_width.is_finite() || !delay.is_finite() {
                return Err(ReadingProblem::Numbers { channel, delay, half_width });
            }
            // The half-width of the reference is zero: it is a definition.
            Ok((half_width > 0.0).then_some((Seconds(delay), Seconds(half_width / HALF_WIDTH))))
        };
        let delays = (0..channels).map(of).collect::<Result<_, _>>()?;
        Ok(Self { frame: line.frame, delays })
    }

    /// The line that [`Reading::parse`] reads.
    pub fn line(&self) -> String {
        let delay = self.delays.iter().map(|known| known.map(|(delay, _)| delay.0)).collect();
        let half_width = self.delays.iter().map(|known| known.map(|(_, sigma)| sigma.0 * HALF_WIDTH));
        let line = Line { frame: self.frame, delay, half_width: HalfWidths::Each(half_width.collect()) };
        serde_json::to_string(&line).unwrap_or_default()
    }

    /// Those of some frames.
    pub(super) fn within(readings: &[Self], frames: Range<u64>) -> &[Self] {
        let first = readings.partition_point(|reading| reading.frame < frames.start);
        let end = readings.partition_point(|reading| reading.frame < frames.end);
        &readings[first..end]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_read_and_found_by_frame() {
        let text = "{\"frame\": 3, \"delay\": [null, 2e-6], \"half_width\": 1.96e-9}\n\n\
                    {\"frame\": 9, \"delay\": [0.0, 3e-6], \"half_width\": [0.0, 1.96e-8], \"lock\": [\"held\"]}\n";
        let readings = Reading::parse(text, "d.jsonl", 2).unwrap();
        assert_eq!(readings[0].delays[0], None);
        let (delay, sigma) = readings[1].delays[1].unwrap();
        assert!(
            delay == Seconds(3e-6) && (sigma.0 * HALF_WIDTH / 1.96e-8 - 1.0).abs() < 1e-12,
            "{readings:?}"
        );
        assert_eq!(readings[1].delays[0], None);
        assert_eq!(Reading::within(&readings, 4..10), &readings[1..]);
        assert!(Reading::within(&readings, 4..9).is_empty());
    }

    #[test]
    fn what_is_wrong_is_named_with_its_line() {
        for (text, words) in [
            ("{\"frame\": 3}", "the key delay is missing"),
            ("{\"frame\": 3, \"delay\": [1], \"half_width\": 1}", "1 delays for 2 channels"),
            ("{\"frame\": 3, \"delay\": [1, 2], \"half_width\": -1}", "zero or more"),
            ("{\"frame\": 3, \"delay\": [1, 2], \"half_width\": [1]}", "no half_width"),
            ("{\"frame\": -3, \"delay\": [1, 2], \"half_width\": 1}", "-3"),
            ("frame", "a value is missing"),
        ] {
            let error = Reading::parse(&format!("\n{text}"), "d.jsonl", 2).unwrap_err().to_string();
            assert!(error.starts_with("d.jsonl: line 2: ") && error.contains(words), "{error}");
        }
        let line = |frame: u32| format!("{{\"frame\": {frame}, \"delay\": [1, 2], \"half_width\": 1}}\n");
        let error = Reading::parse(&(line(5) + &line(4)), "d.jsonl", 2).unwrap_err().to_string();
        assert!(error.contains("line 2") && error.contains("sort"), "{error}");
    }
}
