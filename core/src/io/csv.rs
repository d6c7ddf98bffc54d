//! Captures as text: one line per frame, one column per channel.
//!
//! A first line with a cell that is no number is a heading; if its first cell names the time, that column is
//! no channel and gives the rate. An empty cell is a missing sample.

use super::capture::{Blocks, ByteSource};
use super::table::{Table, number};
use super::{IoError, PcmFormat, SampleLayout, StreamHeader};
use std::io::{self, Read};

/// Frames of a read.
const BLOCK_FRAMES: usize = 1024;
/// Most lines from whose times the rate is computed.
const TIMED_LINES: usize = 1 << 16;
/// Lines at the end of these among which one is written with all digits.
const LAST_TIMES: usize = 16;
/// Bytes that are read at a time: those of [`TIMED_LINES`] in a file, or what has come through a pipe.
const BUFFER: usize = TIMED_LINES * 64;

/// Reads frames from a table of numbers.
///
/// ```
/// use hybank_core::io::CsvReader;
/// use std::io::Read;
/// let text = "time (ms),left,right\n0,0.5,-1\n0.25,0.25,\n";
/// let mut table = CsvReader::new(text.as_bytes(), "table.csv")?;
/// assert_eq!((table.header().channels, table.header().rate), (2, Some(4000.0)));
/// let mut bytes = Vec::new();
/// table.read_to_end(&mut bytes)?;
/// let samples: Vec<_> = bytes.as_chunks().0.iter().map(|sample| f64::from_le_bytes(*sample)).collect();
/// assert_eq!(samples[..3], [0.5, -1.0, 0.25]);
/// assert!(samples[3].is_nan());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct CsvReader<R> {
    table: Table<R>,
    /// The first column is the time.
    is_timed: bool,
    header: StreamHeader,
    /// The next frames; at first those that were read for the header.
    blocks: Blocks,
}

impl<R: Read> CsvReader<R> {
    /// Reads the first lines; `file` is the name in error messages. Of a table with a column of time these
    /// are the lines that have come with the second one, and the rate is theirs.
    ///
    /// # Errors
    /// [`IoError::Malformed`] with the line of the first cell that is wrong.
    pub fn new(inner: R, file: &str) -> Result<Self, IoError> {
        let mut table = Table::new(inner, file, "a table of samples", BUFFER);
        let headings = table.cells()?;
        if headings.is_empty() {
            return Err(table.fault("there are no lines; give one column per channel and one line per frame"));
        }
        let is_heading = headings.iter().any(|cell| number(cell).is_none());
        let unit = if is_heading { time_unit(&headings[0]) } else { None };
        let first = if is_heading { table.cells()? } else { headings.clone() };
        // A table of headings alone is empty.
        let width = if first.is_empty() { headings.len() } else { first.len() };
        let is_timed = unit.is_some();
        let channels = width - usize::from(is_timed);
        if channels == 0 {
            return Err(table.fault("the only column is the time; give one more per channel"));
        }
        let header = StreamHeader::real(SampleLayout::packed(PcmFormat::F64Le), channels);
        let mut reader = Self { table, is_timed, header, blocks: Blocks::default() };
        if !first.is_empty() {
            let numbers = reader.table.numbers(&first)?;
            let mut ahead = Vec::new();
            reader.encode(&numbers, &mut ahead);
            if let Some(unit) = unit {
                reader.read_times(numbers[0], &first[0], unit, &mut ahead)?;
            }
            reader.blocks.put(ahead);
        }
        Ok(reader)
    }

    /// As the header of an input.
    pub fn header(&self) -> StreamHeader {
        self.header
    }

    /// The next line: its first cell, and its numbers with the time among them.
    fn frame(&mut self) -> Result<Option<(String, Vec<f64>)>, IoError> {
        let mut cells = self.table.cells()?;
        if cells.is_empty() {
            return Ok(None);
        }
        let width = self.header.channels + usize::from(self.is_timed);
        if cells.len() != width {
            let count = cells.len();
            return Err(self.table.fault(&format!(
                "{count} cells, but the lines before have {width}; one column per channel"
            )));
        }
        let numbers = self.table.numbers(&cells)?;
        Ok(Some((cells.swap_remove(0), numbers)))
    }

    /// Appends the samples of a line.
    fn encode(&self, numbers: &[f64], bytes: &mut Vec<u8>) {
        let samples = &numbers[usize::from(self.is_timed)..];
        bytes.extend(samples.iter().flat_map(|x| x.to_le_bytes()));
    }

    /// Reads ahead, and computes the rate from equal steps of time, with its error from their last digits.
    fn read_times(&mut self, begin: f64, text: &str, unit: f64, ahead: &mut Vec<u8>) -> Result<(), IoError> {
        let (mut times, mut digits, mut lines) = (vec![begin], vec![last_digit(text)], vec![self.table.line]);
        while times.len() < TIMED_LINES && (times.len() < 2 || self.table.is_more_at_hand()) {
            let Some((text, frame)) = self.frame()? else { break };
            times.push(frame[0]);
            digits.push(last_digit(&text));
            lines.push(self.table.line);
            self.encode(&frame, ahead);
        }
        self.header.begin = Some(begin * unit);
        let steps = (times.len() - 1) as f64;
        if steps < 1.0 {
            return Ok(());
        }
        let length = times[times.len() - 1] - begin;
        let step = length / steps;
        // Times are rounded, but a line that is left out makes a step of two.
        let is_even = |pair: &[f64]| (pair[1] - pair[0] - step).abs() <= 0.75 * step;
        if !(step > 0.0 && times.windows(2).all(is_even)) {
            let (line, problem) = uneven(&times, &lines);
            self.table.line = line;
            return Err(self.table.fault(&problem));
        }
        let rate = 1.0 / (step * unit);
        // Both ends are rounded by half of the last digit. Some writers leave out zeros at the end, and some
        // write fewer digits as the time grows.
        let digit = digits.iter().rev().take(LAST_TIMES).copied().fold(f64::INFINITY, f64::min);
        (self.header.rate, self.header.rate_error) = (Some(rate), rate * digit / length);
        Ok(())
    }
}

impl<R: Read> ByteSource for CsvReader<R> {
    fn stream_header(&self) -> StreamHeader {
        self.header
    }
}

/// Numbers as `f64le`. An error of this reader holds an [`IoError`].
impl<R: Read> Read for CsvReader<R> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let mut blocks = std::mem::take(&mut self.blocks);
        let count = blocks.read(bytes, |block| {
            let most = BLOCK_FRAMES * self.header.frame_bytes();
            // A live table is handed on line by line.
            while block.is_empty() || (block.len() < most && self.table.is_more_at_hand()) {
                let Some((_, frame)) = self.frame()? else { break };
                self.encode(&frame, block);
            }
            Ok::<_, IoError>(())
        });
        self.blocks = blocks;
        count
    }
}

/// The line at the step that differs most from the usual one, and what is wrong with it.
fn uneven(times: &[f64], lines: &[u64]) -> (u64, String) {
    let steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let mut sorted = steps.clone();
    sorted.sort_by(f64::total_cmp);
    let usual = sorted[sorted.len() / 2];
    let off = |at: &usize| (steps[*at] - usual).abs();
    let at = (0..steps.len()).max_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or(0);
    let missing = (steps[at] / usual).round() - 1.0;
    let remedy = if usual > 0.0 && missing >= 1.0 {
        format!(
            "{missing} lines are missing: put in a line of empty cells for each, or leave out the column and name the lost \
             samples with --lost"
        )
    } else {
        "they are not evenly spaced: repair them, or leave out the column if the samples are".to_owned()
    };
    (lines[at + 1], format!("the times step by {:.6} here and by {usual:.6} elsewhere; {remedy}", steps[at]))
}

/// The value of a unit of the last digit of a decimal number: 0.001 for `2.125`, 1e-6 for `4.2e-5`.
pub(super) fn last_digit(number: &str) -> f64 {
    let (mantissa, exponent) = number.split_once(['e', 'E']).unwrap_or((number, "0"));
    let decimals = mantissa.split_once('.').map_or(0, |(_, decimals)| decimals.len());
    10f64.powi(exponent.parse::<i32>().unwrap_or(0).saturating_sub(decimals as i32))
}

/// The unit in seconds of a heading that names the time.
pub(super) fn time_unit(heading: &str) -> Option<f64> {
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

    fn numbers(bytes: &[u8]) -> Vec<f64> {
        bytes.chunks_exact(8).map(|number| f64::from_le_bytes(number.try_into().unwrap())).collect()
    }

    fn read(text: &str) -> Result<(usize, Option<f64>, Vec<f64>), String> {
        let mut reader = CsvReader::new(text.as_bytes(), "x.csv").map_err(|error| error.to_string())?;
        let mut bytes = Vec::new();
        reader.read_to_end(&mut bytes).map_err(|error| error.to_string())?;
        Ok((reader.header().channels, reader.header().rate, numbers(&bytes)))
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
        let gap = "t,x\n0,1\n1,1\n2,1\n3,1\n4,1\n7,1\n8,1\n9,1\n10,1\n";
        let message = read(gap).unwrap_err();
        assert!(
            message.contains("line 7: the times step by 3.0") && message.contains("2 lines are missing"),
            "{message}"
        );
        for uneven in ["t,x\n0,1\n1,1\n1,1\n2,1\n3,1\n", "t,x\n3,1\n2,1\n1,1\n", "t,x\n0,1\n0,1\n"] {
            assert!(read(uneven).unwrap_err().contains("not evenly spaced"));
        }
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
    /// Gives one line at a time, as a pipe whose writer is live does, and counts them.
    struct Live(std::rc::Rc<std::cell::Cell<usize>>);

    impl Read for Live {
        fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
            let k = self.0.get();
            self.0.set(k + 1);
            let line = if k == 0 { "t,x\n".to_owned() } else { format!("{:.6},{k}\n", k as f64 / 24e3) };
            bytes[..line.len()].copy_from_slice(line.as_bytes());
            Ok(line.len())
        }
    }

    #[test]
    fn live_lines_with_their_times_are_handed_on_one_by_one() {
        let lines = std::rc::Rc::new(std::cell::Cell::new(0));
        let mut reader = CsvReader::new(Live(lines.clone()), "x.csv").unwrap();
        // The headings and two lines: the least that tells a rate.
        assert_eq!(lines.get(), 3);
        let header = reader.header();
        let rate = header.rate.unwrap();
        assert!((rate - 24e3).abs() <= header.rate_error && header.rate_error < 0.05 * rate, "{header:?}");
        let mut bytes = [0; 1000];
        for (read, want) in [(3, vec![1.0, 2.0]), (4, vec![3.0]), (5, vec![4.0])] {
            let count = reader.read(&mut bytes).unwrap();
            assert_eq!((lines.get(), numbers(&bytes[..count])), (read, want));
        }
    }

    #[test]
    fn the_last_digits_of_the_times_bound_the_error_of_the_rate() {
        for (number, digit) in [("2.125", 1e-3), ("4.2e-5", 1e-6), ("17", 1.0), ("-1E3", 1e3), ("nan", 1.0)] {
            assert!((last_digit(number) / digit - 1.0).abs() < 1e-12, "{number}");
        }
        let table: String = (0..240).map(|k| format!("{:.6},0\n", f64::from(k) / 24e3)).collect();
        let header = CsvReader::new(format!("t,x\n{table}").as_bytes(), "x.csv").unwrap().header();
        let error = (header.rate.unwrap() - 24e3).abs();
        assert!(error > 0.0 && error <= header.rate_error && header.rate_error < 3.0, "{header:?}");
    }
}
