//! Lost samples, from a file that lists them.

use super::IoError;
use super::timestamps::{MAX_LOST_AT_ONCE, Timestamp, Timestamps};
use crate::files::{Bound, read_text};
use crate::messages::of_document;
use serde::Deserialize;
use std::ops::Range;
use std::path::Path;

/// Maximum size of a file of lost samples: a million lines.
const LOST_FILE: Bound = Bound {
    bytes: 64 << 20,
    kind: "a file of lost samples",
    remedy: "give the file that was meant, or fuse the recording in parts",
};

/// Most lines of a file times the channels of all inputs.
const MOST_LINES: usize = 1 << 24;

/// Invalid samples of one channel, or of all.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Dropout {
    /// The channel, from 0; `None` for all channels of the input.
    pub(super) channel: Option<usize>,
    /// Frames.
    pub(super) frames: Range<u64>,
}

/// A file in addition to the samples that lists which of them were lost.
///
/// JSON Lines: one object per line, empty lines are skipped. There are two kinds of line, which may be
/// mixed:
///
/// ```text
/// {"channel": 1, "sample_start": 0, "global_index": 100}
/// {"channel": 1, "sample_start": 5, "global_index": 108}
/// {"channel": 2, "first": 40, "length": 3}
/// ```
///
/// The first kind is that of SigMF's captures: sample 5 (from 0) in the input of channel 1 was number 108
/// at the converter. Samples between two such lines are consecutive. If the numbers increase by more than
/// the samples between two lines, samples were *left out* of the input. So the first line of a channel is
/// about its sample 0. Time begins at the earliest number of any input; an input without such lines begins
/// there too.
///
/// The second kind is that of the gap report: from frame 40 on, 3 samples of channel 2 are present in the
/// input but *invalid*.
///
/// Channels count from 1; a line without `channel` holds for all of them. Channels that are interleaved
/// in one input lose samples together, or have invalid ones.
#[derive(Debug, Clone)]
pub struct LostSamples {
    file: String,
    lines: Vec<LostLine>,
}

/// A line, as written.
#[derive(Debug, Deserialize)]
#[serde(
    deny_unknown_fields,
    expecting = "a JSON object such as {\"channel\": 1, \"first\": 40, \"length\": 3}"
)]
struct Line {
    channel: Option<usize>,
    sample_start: Option<u64>,
    global_index: Option<u64>,
    first: Option<u64>,
    length: Option<u64>,
    /// Of the gap report; not read.
    #[serde(rename = "snr_db")]
    _snr_db: Option<serde::de::IgnoredAny>,
}

/// What a line says.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Entry {
    /// Samples before this one were left out, if its number has increased by more than the samples.
    Timestamp(Timestamp),
    /// These frames are in the input but invalid.
    Invalid(Range<u64>),
}

impl Entry {
    fn timestamp(&self) -> Option<Timestamp> {
        if let Self::Timestamp(timestamp) = self { Some(*timestamp) } else { None }
    }
}

/// A line, checked.
#[derive(Debug, Clone, PartialEq, Eq)]
struct LostLine {
    /// From 1.
    number: usize,
    /// The channel, from 0; `None` for all.
    channel: Option<usize>,
    entry: Entry,
}

impl LostLine {
    /// Line `number` of a file, or what is wrong with it.
    fn parse(line: &str, number: usize) -> Result<Self, String> {
        let line: Line = serde_json::from_str(line).map_err(|error| {
            format!("not an object that says what was lost: {}", of_document(&error.to_string()))
        })?;
        if line.channel == Some(0) {
            return Err("channel is 0; channels count from 1".into());
        }
        let channel = line.channel.map(|channel| channel - 1);
        let entry = match line {
            Line {
                sample_start: Some(frame), global_index: Some(index), first: None, length: None, ..
            } => Entry::Timestamp(Timestamp { frame, index }),
            Line {
                first: Some(first), length: Some(length), sample_start: None, global_index: None, ..
            } => {
                let end = first.checked_add(length).filter(|_| length <= MAX_LOST_AT_ONCE);
                let end =
                    end.ok_or_else(|| format!("length is {length}; it may be at most {MAX_LOST_AT_ONCE}"))?;
                Entry::Invalid(first..end)
            }
            _ => return Err("give either sample_start and global_index, or first and length".into()),
        };
        Ok(Self { number, channel, entry })
    }
}

/// The lost samples of one input.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct LostInInput {
    pub(super) timestamps: Timestamps,
    /// In the order of their first frames; channels count from the input's first.
    pub(super) dropouts: Vec<Dropout>,
}

impl LostSamples {
    /// Reads a file.
    ///
    /// # Errors
    /// [`IoError::File`] if it cannot be read or is too long, [`IoError::Unfit`] for a line that is neither
    /// of the two kinds.
    pub fn read(path: &Path) -> Result<Self, IoError> {
        Self::parse(&read_text(path, LOST_FILE)?, &path.display().to_string())
    }

    /// As [`LostSamples::read`], from text; `file` is the name in error messages.
    ///
    /// # Errors
    /// [`IoError::Unfit`] for a line that is neither of the two kinds.
    pub fn parse(text: &str, file: &str) -> Result<Self, IoError> {
        let lines = text.lines().zip(1..).filter(|(line, _)| !line.trim().is_empty());
        let parsed = lines.map(|(line, number)| {
            let fault = |problem| IoError::unfit(file)(format!("line {number}: {problem}"));
            LostLine::parse(line, number).map_err(fault)
        });
        Ok(Self { file: file.to_owned(), lines: parsed.collect::<Result<_, _>>()? })
    }

    /// The lines of each input, given the channels of all inputs in their order.
    pub(super) fn of_inputs(&self, channels: &[usize]) -> Result<Vec<LostInInput>, IoError> {
        let all = channels.iter().sum::<usize>();
        let mut named = self.lines.iter().filter_map(|line| line.channel);
        if let Some(channel) = named.find(|&channel| channel >= all) {
            return Err(self.fault(format!("channel {} is named, but there are {all}", channel + 1)));
        }
        let lines = self.lines.len();
        if lines.saturating_mul(all) > MOST_LINES {
            return Err(self.fault(format!(
                "{lines} lines for {all} channels are more than {MOST_LINES} in all; fuse the recording in parts"
            )));
        }
        let mut first = 0;
        let of_input = |&count: &usize| {
            first += count;
            self.of_input(first - count..first)
        };
        channels.iter().map(of_input).collect()
    }

    fn of_input(&self, channels: Range<usize>) -> Result<LostInInput, IoError> {
        let timestamps = |wanted: usize| -> Vec<Timestamp> {
            let lines = self.lines.iter().filter(|line| line.channel.is_none_or(|channel| channel == wanted));
            lines.filter_map(|line| line.entry.timestamp()).collect()
        };
        let all = channels.clone().map(|channel| (channel, timestamps(channel)));
        let mut given = all.filter(|(_, timestamps)| !timestamps.is_empty());
        let (channel, timestamps) = given.next().unwrap_or_default();
        if let Some((other, _)) = given.find(|(_, others)| *others != timestamps) {
            return Err(self.fault(format!(
                "channels {} and {} are interleaved in one input but lose different samples; give invalid samples with first and length",
                channel + 1,
                other + 1
            )));
        }
        let timestamps = Timestamps::new(timestamps).map_err(|problem| self.fault(problem))?;
        self.check_first(channel, &timestamps)?;
        Ok(LostInInput { timestamps, dropouts: self.dropouts_of(&channels) })
    }

    /// Only a number of sample 0 says what was lost before the next line.
    fn check_first(&self, channel: usize, timestamps: &Timestamps) -> Result<(), IoError> {
        let Some(first) = timestamps.first().filter(|first| first.frame > 0) else { return Ok(()) };
        let is_it = |line: &&LostLine| {
            line.entry.timestamp() == Some(first) && line.channel.is_none_or(|named| named == channel)
        };
        let number = self.lines.iter().find(is_it).map_or(0, |line| line.number);
        Err(self.fault(format!(
            "line {number}: the first line of channel {} with sample_start is about sample {}, so what was lost before it is unknown; \
             put a line with sample_start 0 and the number of that sample before it",
            channel + 1,
            first.frame
        )))
    }

    fn dropouts_of(&self, channels: &Range<usize>) -> Vec<Dropout> {
        let here = |line: &LostLine| {
            let Entry::Invalid(frames) = &line.entry else { return None };
            let inside = line.channel.is_none_or(|channel| channels.contains(&channel)) && !frames.is_empty();
            inside.then(|| Dropout {
                channel: line.channel.map(|channel| channel - channels.start),
                frames: frames.clone(),
            })
        };
        let mut dropouts: Vec<_> = self.lines.iter().filter_map(here).collect();
        dropouts.sort_by_key(|dropout| (dropout.frames.start, dropout.channel));
        dropouts
    }

    /// An error about this file.
    fn fault(&self, problem: String) -> IoError {
        IoError::unfit(&self.file)(problem)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = r#"
        {"sample_start": 0, "global_index": 10}
        {"channel": 1, "sample_start": 2, "global_index": 13}
        {"sample_start": 5, "global_index": 18}

        {"channel": 3, "first": 40, "length": 3}
        {"channel": 1, "first": 30, "length": 2}
        {"first": 20, "length": 1}
        {"channel": 2, "first": 7, "length": 0}
    "#;

    fn dropout(channel: Option<usize>, frames: Range<u64>) -> Dropout {
        Dropout { channel, frames }
    }

    #[test]
    fn lines_go_to_their_inputs() {
        let lost = LostSamples::parse(TEXT, "lost").unwrap();
        let inputs = lost.of_inputs(&[1, 2]).unwrap();
        let timestamp = |frame, index| Timestamp { frame, index };
        assert_eq!(
            inputs[0].timestamps,
            Timestamps::new(vec![timestamp(0, 10), timestamp(2, 13), timestamp(5, 18)]).unwrap()
        );
        assert_eq!(inputs[1].timestamps, Timestamps::new(vec![timestamp(0, 10), timestamp(5, 18)]).unwrap());
        assert_eq!(inputs[0].dropouts, [dropout(None, 20..21), dropout(Some(0), 30..32)]);
        assert_eq!(inputs[1].dropouts, [dropout(None, 20..21), dropout(Some(1), 40..43)]);
    }

    #[test]
    fn interleaved_channels_lose_samples_together() {
        let lost = LostSamples::parse(TEXT, "lost").unwrap();
        let error = lost.of_inputs(&[3]).unwrap_err().to_string();
        assert!(error.contains("channels 1 and 2 are interleaved"), "{error}");
        let both = r#"{"channel":1,"sample_start":0,"global_index":7}
            {"channel":2,"sample_start":0,"global_index":7}"#;
        assert!(LostSamples::parse(both, "lost").unwrap().of_inputs(&[2]).is_ok());
        let error = lost.of_inputs(&[2]).unwrap_err().to_string();
        assert!(error.contains("channel 3 is named, but there are 2"), "{error}");
    }

    #[test]
    fn the_first_line_of_a_channel_is_about_its_first_sample() {
        let parse = |text: &str| LostSamples::parse(text, "lost").unwrap();
        let begun = "{\"channel\": 1, \"sample_start\": 0, \"global_index\": 0}\n\n";
        let later = begun.to_owned() + r#"{"channel": 2, "sample_start": 48, "global_index": 60}"#;
        let error = parse(&later).of_inputs(&[1, 1]).unwrap_err().to_string();
        assert!(error.contains("line 3: the first line of channel 2"), "{error}");
        assert!(error.contains("sample 48") && error.contains("sample_start 0"), "{error}");
        let begun = r#"{"sample_start": 0, "global_index": 0}"#.to_owned() + "\n" + &later;
        assert!(parse(&begun).of_inputs(&[1, 1]).is_ok());
    }

    #[test]
    fn other_lines_are_refused_with_their_number() {
        for (line, part) in [
            (r#"{"channel": 1}"#, "either sample_start"),
            (r#"{"channel": 1, "first": 1, "global_index": 3}"#, "either sample_start"),
            (r#"{"first": 1, "length": 3, "sample_start": 0, "global_index": 0}"#, "either sample_start"),
            (r#"{"channel": 0, "first": 1, "length": 3}"#, "count from 1"),
            (r#"{"first": 1, "length": 99999999999999}"#, "at most"),
            (r#"{"first": 18446744073709551615, "length": 1}"#, "at most"),
            (
                r#"{"first": -1, "length": 1}"#,
                "expected a whole number, zero or more, without point and exponent, found -1",
            ),
            (r#"{"first": 1, "lenght": 1}"#, "unknown key \"lenght\""),
            ("1,2,3", "expected a JSON object"),
            (r#"{"first": 1, "length": 3} {}"#, "more text after the end"),
        ] {
            let error = LostSamples::parse(&format!("\n{line}\n"), "lost.jsonl").unwrap_err().to_string();
            assert!(error.starts_with("lost.jsonl: line 2: ") && error.contains(part), "{error}");
            assert!(!error.contains("column"), "{error}");
        }
    }
}
