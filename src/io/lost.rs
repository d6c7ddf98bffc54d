//! What a file beside the samples says of those that were lost.

use super::IoError;
use super::sequence::{Anchor, MOST_LOST, Sequence};
use serde::Deserialize;
use std::ops::Range;
use std::path::Path;

/// Void samples of one channel.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Mark {
    /// The channel, from 0.
    pub(super) channel: usize,
    /// Ticks.
    pub(super) ticks: Range<u64>,
}

/// A file beside the samples that says which of them were lost.
///
/// JSON Lines: one object a line, empty lines are passed over. There are two kinds, which may be mixed:
///
/// ```text
/// {"channel": 1, "sample_start": 5, "global_index": 108}
/// {"channel": 2, "first": 40, "length": 3}
/// ```
///
/// The first kind is that of SigMF's captures: sample 5 (from 0) in the input of channel 1 was number 108 at the
/// converter. Samples between two such lines follow each other; where the count runs ahead of them,
/// samples were *left out* of the input. Time begins at the earliest number of any input; one without such
/// lines begins there too.
///
/// The second kind is that of the report of gaps: from tick 40 on, 3 samples of channel 2 are *in* the
/// input but void.
///
/// Channels count from 1; a line without `channel` holds for all of them. Channels that are interleaved
/// in one input lose samples together, or have void ones.
#[derive(Debug, Clone)]
pub struct LostSamples {
    file: String,
    anchors: Vec<(Option<usize>, Anchor)>,
    marks: Vec<(Option<usize>, Range<u64>)>,
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
}

/// What is lost in one input.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct LostOfInput {
    pub(super) sequence: Sequence,
    /// In the order of their first ticks; channels count from the input's first.
    pub(super) marks: Vec<Mark>,
}

impl LostSamples {
    /// Reads a file.
    ///
    /// # Errors
    /// [`IoError::System`] if it cannot be read, [`IoError::Lost`] for a line that is neither of the two kinds.
    pub fn read(path: &Path) -> Result<Self, IoError> {
        let name = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(IoError::system(&name, "read it"))?;
        Self::parse(&text, &name)
    }

    /// As [`LostSamples::read`], from text; `file` is the name for complaints.
    ///
    /// # Errors
    /// [`IoError::Lost`] for a line that is neither of the two kinds.
    pub fn parse(text: &str, file: &str) -> Result<Self, IoError> {
        let mut lost = Self { file: file.to_owned(), anchors: Vec::new(), marks: Vec::new() };
        for (number, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
            lost.add(line).map_err(|problem| lost.fault(format!("line {}: {problem}", number + 1)))?;
        }
        Ok(lost)
    }

    fn add(&mut self, line: &str) -> Result<(), String> {
        let line: Line = serde_json::from_str(line).map_err(|error| without_place(&error))?;
        if line.channel == Some(0) {
            return Err("channel is 0; channels count from 1".into());
        }
        let channel = line.channel.map(|channel| channel - 1);
        match line {
            Line {
                sample_start: Some(frame), global_index: Some(index), first: None, length: None, ..
            } => self.anchors.push((channel, Anchor { frame, index })),
            Line {
                first: Some(first), length: Some(length), sample_start: None, global_index: None, ..
            } => {
                let end = first.checked_add(length).filter(|_| length <= MOST_LOST);
                let end = end.ok_or_else(|| format!("length is {length}; it may be at most {MOST_LOST}"))?;
                self.marks.push((channel, first..end));
            }
            _ => return Err("give either sample_start and global_index, or first and length".into()),
        }
        Ok(())
    }

    /// The lines of each input, given the channels of all inputs in their order.
    pub(super) fn of_inputs(&self, channels: &[usize]) -> Result<Vec<LostOfInput>, IoError> {
        let all = channels.iter().sum::<usize>();
        let named = self.anchors.iter().map(|(channel, _)| channel).chain(self.marks.iter().map(|(c, _)| c));
        if let Some(channel) = named.flatten().find(|&&channel| channel >= all) {
            return Err(self.fault(format!("channel {} is named, but there are {all}", channel + 1)));
        }
        let mut first = 0;
        let of_input = |&count: &usize| {
            first += count;
            self.of_input(first - count..first)
        };
        channels.iter().map(of_input).collect()
    }

    fn of_input(&self, channels: Range<usize>) -> Result<LostOfInput, IoError> {
        let anchors = |wanted: usize| -> Vec<Anchor> {
            let lines = self.anchors.iter().filter(|(channel, _)| channel.is_none_or(|c| c == wanted));
            lines.map(|&(_, anchor)| anchor).collect()
        };
        let mut told =
            channels.clone().map(|channel| (channel, anchors(channel))).filter(|(_, a)| !a.is_empty());
        let (channel, anchors) = told.next().unwrap_or_default();
        if let Some((other, _)) = told.find(|(_, others)| *others != anchors) {
            return Err(self.fault(format!(
                "channels {} and {} are interleaved in one input but lose different samples; mark void samples with first and length",
                channel + 1,
                other + 1
            )));
        }
        let sequence = Sequence::new(anchors).map_err(|problem| self.fault(problem))?;
        Ok(LostOfInput { sequence, marks: self.marks_of(channels) })
    }

    fn marks_of(&self, channels: Range<usize>) -> Vec<Mark> {
        let named = |&(channel, ref ticks): &(Option<usize>, Range<u64>)| {
            let here = channels.clone().filter(move |&c| channel.is_none_or(|channel| channel == c));
            let first = channels.start;
            let ticks = ticks.clone();
            here.map(move |c| Mark { channel: c - first, ticks: ticks.clone() })
        };
        let mut marks: Vec<_> =
            self.marks.iter().flat_map(named).filter(|mark| !mark.ticks.is_empty()).collect();
        marks.sort_by_key(|mark| (mark.ticks.start, mark.channel));
        marks
    }

    /// A complaint about this file.
    pub(super) fn fault(&self, problem: String) -> IoError {
        IoError::Lost { file: self.file.clone(), problem }
    }
}

/// Each line is a text of its own to the parser, so that its place says nothing.
fn without_place(error: &serde_json::Error) -> String {
    let text = error.to_string();
    let place = format!(" at line {} column {}", error.line(), error.column());
    text.strip_suffix(&place).unwrap_or(&text).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = r#"
        {"channel": 1, "sample_start": 0, "global_index": 10}
        {"sample_start": 5, "global_index": 18}

        {"channel": 3, "first": 40, "length": 3}
        {"first": 20, "length": 1}
        {"channel": 2, "first": 7, "length": 0}
    "#;

    fn mark(channel: usize, ticks: Range<u64>) -> Mark {
        Mark { channel, ticks }
    }

    #[test]
    fn lines_go_to_their_inputs() {
        let lost = LostSamples::parse(TEXT, "lost").unwrap();
        let inputs = lost.of_inputs(&[1, 2]).unwrap();
        let anchor = |frame, index| Anchor { frame, index };
        assert_eq!(inputs[0].sequence, Sequence::new(vec![anchor(0, 10), anchor(5, 18)]).unwrap());
        assert_eq!(inputs[1].sequence, Sequence::new(vec![anchor(5, 18)]).unwrap());
        assert_eq!(inputs[0].marks, [mark(0, 20..21)]);
        assert_eq!(inputs[1].marks, [mark(0, 20..21), mark(1, 20..21), mark(1, 40..43)]);
    }

    #[test]
    fn interleaved_channels_lose_samples_together() {
        let lost = LostSamples::parse(TEXT, "lost").unwrap();
        let error = lost.of_inputs(&[3]).unwrap_err().to_string();
        assert!(error.contains("channels 1 and 2 are interleaved"), "{error}");
        let both = r#"{"channel":1,"sample_start":5,"global_index":7}
            {"channel":2,"sample_start":5,"global_index":7}"#;
        assert!(LostSamples::parse(both, "lost").unwrap().of_inputs(&[2]).is_ok());
        let error = lost.of_inputs(&[2]).unwrap_err().to_string();
        assert!(error.contains("channel 3 is named, but there are 2"), "{error}");
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
            (r#"{"first": -1, "length": 1}"#, "invalid value"),
            (r#"{"first": 1, "lenght": 1}"#, "unknown field `lenght`"),
            ("1,2,3", "expected a JSON object"),
            (r#"{"first": 1, "length": 3} {}"#, "trailing characters"),
        ] {
            let error = LostSamples::parse(&format!("\n{line}\n"), "lost.jsonl").unwrap_err().to_string();
            assert!(error.starts_with("lost.jsonl: line 2: ") && error.contains(part), "{error}");
            assert!(!error.contains("column"), "{error}");
        }
    }
}
