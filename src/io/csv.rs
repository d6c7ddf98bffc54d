//! Captures as text: one line per frame, one column per channel.
//!
//! Cells are separated by commas, semicolons, tabs or spaces. Lines that begin with `#` and empty lines are
//! skipped. A first line with a cell that is no number is a heading; if its first cell names the time, that
//! column is no channel and gives the rate. An empty cell is a missing sample.

use super::{IoError, PcmFormat, SampleLayout, StreamHeader};
use std::io::{self, BufRead, BufReader, Read};

/// Longest line.
const LONGEST_LINE: u64 = 1 << 20;
/// Frames of a read.
const BLOCK_FRAMES: usize = 1024;
/// Lines from whose times the rate is computed.
const TIMED_LINES: usize = 1 << 16;

/// Reads frames from a table of numbers.
#[derive(Debug)]
pub struct CsvReader<R> {
    lines: Lines<R>,
    separator: Separator,
    /// The first column is the time.
    is_timed: bool,
    channels: usize,
    rate: Option<f64>,
    /// Frames that were read for the header.
    ahead: Vec<f64>,
    given: usize,
    /// Frames as bytes that the last read did not take.
    bytes: Vec<u8>,
}

/// Lines with their numbers.
#[derive(Debug)]
struct Lines<R> {
    reader: BufReader<R>,
    file: String,
    number: u64,
}

/// What stands between two cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Separator {
    Char(char),
    Spaces,
}

impl Separator {
    /// Of a line: the first of `;`, tab and `,` that it has.
    fn of(line: &str) -> Self {
        [';', '\t', ','].into_iter().find(|&c| line.contains(c)).map_or(Self::Spaces, Self::Char)
    }

    fn cells(self, line: &str) -> Vec<&str> {
        match self {
            Self::Char(c) => line.split(c).map(|cell| cell.trim().trim_matches('"')).collect(),
            Self::Spaces => line.split_whitespace().collect(),
        }
    }
}

impl<R: Read> CsvReader<R> {
    /// Reads the first lines; `file` is the name in error messages.
    ///
    /// # Errors
    /// [`IoError::Malformed`] with the line of the first cell that is wrong.
    pub fn new(inner: R, file: &str) -> Result<Self, IoError> {
        let mut lines = Lines { reader: BufReader::new(inner), file: file.to_owned(), number: 0 };
        let Some(mut line) = lines.next()? else {
            return Err(lines.fault("there are no lines; give one column per channel and one line per frame"));
        };
        let separator = Separator::of(&line);
        let cells = separator.cells(&line);
        let mut unit = None;
        if cells.iter().any(|cell| number(cell).is_none()) {
            unit = cells.first().and_then(|heading| time_unit(heading));
            let width = cells.len();
            match lines.next()? {
                Some(next) => line = next,
                None => return Ok(Self::empty(lines, separator, width - usize::from(unit.is_some()))),
            }
        }
        let width = separator.cells(&line).len();
        let channels = width - usize::from(unit.is_some());
        if channels == 0 {
            return Err(lines.fault("the only column is the time; give one more per channel"));
        }
        let is_timed = unit.is_some();
        let mut reader = Self {
            lines,
            separator,
            is_timed,
            channels,
            rate: None,
            ahead: Vec::new(),
            given: 0,
            bytes: Vec::new(),
        };
        let first = reader.frame_of(&line)?;
        reader.ahead.extend(&first[usize::from(is_timed)..]);
        if let Some(unit) = unit {
            reader.read_times(first[0], unit)?;
        }
        Ok(reader)
    }

    fn empty(lines: Lines<R>, separator: Separator, channels: usize) -> Self {
        Self {
            lines,
            separator,
            is_timed: false,
            channels,
            rate: None,
            ahead: Vec::new(),
            given: 0,
            bytes: Vec::new(),
        }
    }

    /// Columns that are channels.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Frames per second, if a column holds the time.
    pub fn rate(&self) -> Option<f64> {
        self.rate
    }

    /// As the header of an input.
    pub(super) fn stream_header(&self) -> StreamHeader {
        let real = StreamHeader::real(SampleLayout::packed(PcmFormat::F64Le), self.channels);
        StreamHeader { rate: self.rate, ..real }
    }

    /// Puts the next frames into `frames`, at most `most` and none only at the end.
    ///
    /// # Errors
    /// [`IoError::Malformed`] with line and column, or the system's refusal.
    pub fn fill(&mut self, frames: &mut Vec<f64>, most: usize) -> Result<(), IoError> {
        frames.clear();
        let room = most.max(1) * self.channels;
        let known = self.ahead.len().min(self.given + room);
        frames.extend(&self.ahead[self.given..known]);
        self.given = known;
        // A live table is handed on line by line.
        while frames.is_empty() || (frames.len() < room && !self.lines.reader.buffer().is_empty()) {
            let Some(line) = self.lines.next()? else { break };
            let frame = self.frame_of(&line)?;
            frames.extend(&frame[usize::from(self.is_timed)..]);
        }
        Ok(())
    }

    /// The numbers of a line, the time among them.
    fn frame_of(&self, line: &str) -> Result<Vec<f64>, IoError> {
        let cells = self.separator.cells(line);
        let width = self.channels + usize::from(self.is_timed);
        if cells.len() != width {
            return Err(self.lines.fault(&format!(
                "{} cells, but the lines before have {width}; one column per channel",
                cells.len()
            )));
        }
        let cell = |(column, &cell): (usize, &&str)| {
            number(cell).ok_or_else(|| {
                let shown: String = cell.chars().take(20).collect();
                self.lines.fault(&format!(
                    "column {}: \"{shown}\" is no number; decimals have a point, cells are separated by , ; tab or space",
                    column + 1
                ))
            })
        };
        cells.iter().enumerate().map(cell).collect()
    }

    /// Reads ahead, and computes the rate from equal steps of time.
    fn read_times(&mut self, begin: f64, unit: f64) -> Result<(), IoError> {
        let mut times = vec![begin];
        while times.len() < TIMED_LINES {
            let Some(line) = self.lines.next()? else { break };
            let frame = self.frame_of(&line)?;
            times.push(frame[0]);
            self.ahead.extend(&frame[1..]);
        }
        let steps = (times.len() - 1) as f64;
        if steps < 1.0 {
            return Ok(());
        }
        let step = (times[times.len() - 1] - begin) / steps;
        // Times are rounded, but a line that is left out makes a step of two.
        let is_even = |pair: &[f64]| (pair[1] - pair[0] - step).abs() <= 0.75 * step;
        if !(step > 0.0 && times.windows(2).all(is_even)) {
            return Err(self
                .lines
                .fault("the times before are not evenly spaced; leave out the column, or repair it"));
        }
        self.rate = Some(1.0 / (step * unit));
        Ok(())
    }
}

/// Numbers as `f64le`. An error of this reader holds an [`IoError`].
impl<R: Read> Read for CsvReader<R> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        if self.bytes.is_empty() {
            let mut frames = Vec::new();
            self.fill(&mut frames, BLOCK_FRAMES).map_err(io::Error::other)?;
            self.bytes.extend(frames.iter().flat_map(|x| x.to_le_bytes()));
        }
        let count = bytes.len().min(self.bytes.len());
        bytes[..count].copy_from_slice(&self.bytes[..count]);
        self.bytes.drain(..count);
        Ok(count)
    }
}

impl<R: Read> Lines<R> {
    /// The next line that holds cells.
    fn next(&mut self) -> Result<Option<String>, IoError> {
        loop {
            let mut bytes = Vec::new();
            let read = (&mut self.reader).take(LONGEST_LINE + 1).read_until(b'\n', &mut bytes);
            self.number += 1;
            match read.map_err(IoError::system(&self.file, "read the samples"))? {
                0 => return Ok(None),
                length if length as u64 > LONGEST_LINE => {
                    return Err(
                        self.fault(&format!("longer than {LONGEST_LINE} bytes; write one line per frame"))
                    );
                }
                _ => {}
            }
            let text = String::from_utf8(bytes)
                .map_err(|_| self.fault("it is not UTF-8; this is no table of numbers"))?;
            let text = text.trim_start_matches('\u{feff}').trim();
            if !text.is_empty() && !text.starts_with('#') {
                return Ok(Some(text.to_owned()));
            }
        }
    }

    fn fault(&self, problem: &str) -> IoError {
        IoError::Malformed {
            file: self.file.clone(),
            kind: "a table of samples",
            problem: format!("line {}: {problem}", self.number),
        }
    }
}

/// The number in a cell; an empty one is a missing sample.
fn number(cell: &str) -> Option<f64> {
    if cell.is_empty() { Some(f64::NAN) } else { cell.parse().ok() }
}

/// The unit in seconds of a heading that names the time.
fn time_unit(heading: &str) -> Option<f64> {
    let heading = heading.to_lowercase();
    let mut words = heading.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty());
    let first = words.next()?;
    let unit = match words.next() {
        None | Some("s" | "sec" | "seconds") => 1.0,
        Some("ms") => 1e-3,
        Some("us" | "µs" | "μs") => 1e-6,
        Some("ns") => 1e-9,
        Some(_) => return None,
    };
    matches!(first, "t" | "time" | "seconds").then_some(unit)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<(usize, Option<f64>, Vec<f64>), String> {
        let mut reader = CsvReader::new(text.as_bytes(), "x.csv").map_err(|error| error.to_string())?;
        let (mut all, mut some) = (Vec::new(), Vec::new());
        loop {
            reader.fill(&mut some, 3).map_err(|error| error.to_string())?;
            assert!(some.len() <= 3 * reader.channels());
            if some.is_empty() {
                return Ok((reader.channels(), reader.rate(), all));
            }
            all.extend(&some);
        }
    }

    #[test]
    fn every_separator_and_heading_gives_the_same_frames() {
        let want = vec![1.0, -0.5, 2e-3, 4.0, 0.25, 6.0, 7.0, 8.0];
        for text in [
            "1,-0.5\n2e-3,4\n.25,6\n7,8\n",
            "\u{feff}a;b\r\n1;-0.5\r\n\r\n2e-3;4\r\n0.25;6\r\n7;8",
            "# scope\nCh 1\tCh 2\n1\t-0.5\n# more\n2e-3\t4\n0.25\t6\n7\t8\n",
            "  1  -0.5 \n 2e-3 4\n0.25 6\n7 8\n",
            "\"x\",\"y\"\n1,\"-0.5\"\n2e-3,4\n0.25,6\n7,8\n",
        ] {
            assert_eq!(read(text).unwrap(), (2, None, want.clone()), "{text}");
        }
    }

    #[test]
    fn a_column_of_time_is_the_rate() {
        let table = |heading: &str, step: f64| {
            let line = |k: u32| format!("{},{k}\n", 5.0 + step * f64::from(k));
            format!("{heading},x\n") + &(0..9).map(line).collect::<String>()
        };
        let samples: Vec<f64> = (0..9).map(f64::from).collect();
        for (heading, step) in [("Time (s)", 1.0 / 64.0), ("t", 1.0 / 64.0), ("time_ms", 1000.0 / 64.0)] {
            assert_eq!(read(&table(heading, step)).unwrap(), (1, Some(64.0), samples.clone()), "{heading}");
        }
        let uneven = "t,x\n0,1\n1,1\n2,1\n3,1\n4,1\n6,1\n7,1\n8,1\n9,1\n";
        assert!(read(uneven).unwrap_err().contains("not evenly spaced"));
    }

    #[test]
    fn empty_cells_are_missing_samples() {
        let (channels, _, samples) = read("1,2\n,3\n4,nan\n").unwrap();
        assert_eq!(
            (channels, samples.iter().map(|x| x.is_nan()).collect::<Vec<_>>()),
            (2, vec![false, false, true, false, false, true])
        );
    }

    #[test]
    fn faults_have_line_and_column() {
        for (text, part) in [
            ("", "there are no lines"),
            ("1,2\n3\n", "line 2: 1 cells"),
            ("1,2\n3,x\n", "line 2: column 2: \"x\" is no number"),
            ("0,5;0,7\n0,5;0,7\n", "line 2: column 1: \"0,5\""),
            ("time\n1\n", "only column is the time"),
        ] {
            let message = read(text).unwrap_err();
            assert!(message.starts_with("x.csv: not a table") && message.contains(part), "{message}");
        }
        assert_eq!(read("a,b\n").unwrap(), (2, None, vec![]));
    }
}
