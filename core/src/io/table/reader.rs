//! Captures as text: one line per frame, one column per channel.

use super::Table;
use super::candidate::Candidate;
use super::clock::{Clock, Unsteady};
use super::headings::Role;
use super::options::TableOptions;
use crate::io::block::Block;
use crate::io::capture::Capture;
use crate::io::{InputFault, IoError, PcmFormat, SampleLayout, StreamHeader};
use crate::messages::Quoted;
use std::collections::VecDeque;
use std::io::{self, Read};

/// Frames of a read.
const BLOCK_FRAMES: usize = 1024;
/// Most lines that are read for the header.
const LOOKED_AT: usize = 1 << 16;
/// Bytes that are read at a time: those of [`LOOKED_AT`] lines in a file, or what has come through a pipe.
const BUFFER: usize = LOOKED_AT * 64;
/// A first column that rises in so many lines is no signal.
const LIKELY_TIMES: usize = 256;
/// Share of the lines of a ramp that may be missing.
const MISSING_IN_RAMP: f64 = 0.1;
/// Relative difference from which on a rate in the preamble contradicts the times.
const SAME_RATE: f64 = 1e-3;

/// Reads frames from a table of numbers.
///
/// ```
/// use hybank_core::io::table::{TableOptions, TableReader};
/// let text = "time (ms),left,right\n0,0.5,-1\n0.25,0.25,\n";
/// let mut table = TableReader::new(text.as_bytes(), "table.csv", &TableOptions::default())?;
/// assert_eq!((table.header().channels, table.header().rate), (2, Some(4000.0)));
/// assert_eq!(table.next_frame()?, Some(vec![0.5, -1.0]));
/// assert!(table.next_frame()?.is_some_and(|frame| frame[0] == 0.25 && frame[1].is_nan()));
/// assert_eq!(table.next_frame()?, None);
/// # Ok::<(), hybank_core::io::IoError>(())
/// ```
pub struct TableReader<R> {
    table: Table<R>,
    header: StreamHeader,
    channels: Vec<usize>,
    timed: Option<TimedColumn>,
    /// What was read for the header, in the order of time.
    ahead: VecDeque<Ahead>,
    /// Lines that are missing before the next frame.
    missing: u64,
    all_missing: u64,
    other_rate: Option<InputFault>,
    is_rate_known: bool,
    /// The last frame.
    frame: Vec<f64>,
}

/// The column of time, and what its stamps have said so far.
struct TimedColumn {
    column: usize,
    /// In seconds, if it is known.
    unit: Option<f64>,
    clock: Clock,
}

/// A line that was read for the header.
struct Ahead {
    missing: u64,
    samples: Vec<f64>,
}

impl<R: Read> TableReader<R> {
    /// Reads the first lines; `file` is the name in error messages. Of a table with a column of time these
    /// are the lines that have come with the second one, and the rate is theirs, or that of the preamble.
    ///
    /// # Errors
    /// [`IoError::Malformed`] with the line of the first cell or time that is wrong.
    pub fn new(inner: R, file: &str, options: &TableOptions) -> Result<Self, IoError> {
        let table = Table::new(inner, file, "a table of samples", options, BUFFER)?;
        if table.width() == 0 {
            return Err(table.fault("there are no lines; give one column per channel and one line per frame"));
        }
        let candidate = Candidate::of(&table, options);
        let channels = table.columns();
        refuse_mixed_units(&table, &channels)?;
        let header = StreamHeader::real(SampleLayout::packed(PcmFormat::F64Le), channels.len());
        let mut reader = Self {
            table,
            header,
            channels,
            timed: None,
            ahead: VecDeque::new(),
            missing: 0,
            all_missing: 0,
            other_rate: None,
            is_rate_known: options.is_rate_known,
            frame: Vec::new(),
        };
        reader.look_ahead(candidate)?;
        Ok(reader)
    }

    /// Reads the lines that are at hand, and finds out whether the candidate is the time.
    fn look_ahead(&mut self, mut candidate: Option<Candidate>) -> Result<(), IoError> {
        if let Some(Candidate { column, is_certain: true, .. }) = candidate {
            self.leave_out(column)?;
        }
        let mut lines = Vec::new();
        while lines.len() < LOOKED_AT {
            let wanted = match &candidate {
                Some(time) => self.table.is_more_at_hand() || lines.len() < time.least_lines(),
                None => lines.is_empty() || self.table.may_have_bare_commas(),
            };
            if !wanted || !self.table.next_row()? {
                break;
            }
            candidate = match candidate {
                Some(mut time) => time.take(&mut self.table)?.then_some(time),
                None => None,
            };
            if let Some(Candidate { column, is_certain: true, .. }) = candidate {
                self.leave_out(column)?;
            }
            lines.push(self.table.line());
            let samples = self.samples()?;
            self.ahead.push_back(Ahead { missing: 0, samples });
        }
        match candidate {
            Some(time) if time.is_certain => self.time_by(time, &lines)?,
            Some(time) => self.time_by_ramp(time)?,
            None => {}
        }
        self.take_stated_rate();
        Ok(())
    }

    /// A column that is no channel.
    fn leave_out(&mut self, column: usize) -> Result<(), IoError> {
        let is_index = column == 1 && self.table.role(0) == Role::Index;
        self.channels.retain(|channel| *channel != column && !(is_index && *channel == 0));
        self.header.channels = self.channels.len();
        if self.channels.is_empty() {
            return Err(self.table.fault("the only column is the time; give one more per channel"));
        }
        Ok(())
    }

    /// The samples of the last line.
    fn samples(&mut self) -> Result<Vec<f64>, IoError> {
        self.channels.iter().map(|column| self.table.number(*column)).collect()
    }

    /// Judges the stamps of the lines that were read.
    fn time_by(&mut self, time: Candidate, lines: &[u64]) -> Result<(), IoError> {
        let unit = time.unit();
        self.header.begin = time.stamps.first().zip(unit).map(|(first, unit)| first.value() * unit);
        if time.stamps.len() < 2 || self.is_rate_known {
            return Ok(());
        }
        match Clock::of(&time.stamps) {
            Ok((clock, missing)) => self.follow(time.column, unit, clock, &missing),
            // The rate is known from elsewhere.
            Err((_, Unsteady::Coarse { .. })) if self.table.stated_rate().is_some() => {}
            Err((k, fault)) => return Err(self.table.fault_at(lines[k], &fault.message(unit))),
        }
        Ok(())
    }

    /// A first column that is a steady ramp is no channel.
    fn time_by_ramp(&mut self, time: Candidate) -> Result<(), IoError> {
        let lines = time.stamps.len();
        if lines < time.least_lines() {
            return Ok(());
        }
        let (clock, missing) = match Clock::of(&time.stamps) {
            Ok(found) => found,
            Err(_) if lines >= LIKELY_TIMES && time.stamps.is_sorted_by(|a, b| a.value() < b.value()) => {
                return Err(self.table.fault(
                    "its first column rises in every line so far, but not evenly: say whether it holds the times \
                     (--time-column 1) or is a channel (--time-column none)",
                ));
            }
            Err(_) => return Ok(()),
        };
        if missing.iter().sum::<u64>() as f64 > MISSING_IN_RAMP * lines as f64 {
            return Ok(());
        }
        self.leave_out(time.column)?;
        for line in &mut self.ahead {
            line.samples.remove(0);
        }
        self.header.is_ramp_left_out = true;
        self.follow(time.column, None, clock, &missing);
        Ok(())
    }

    /// From now on a clock judges the stamps of a column.
    fn follow(&mut self, column: usize, unit: Option<f64>, clock: Clock, missing: &[u64]) {
        if let Some(unit) = unit {
            let rate = 1.0 / (clock.step() * unit);
            let error = rate * clock.step_error() / clock.step();
            (self.header.rate, self.header.rate_error) = (Some(rate), error);
        }
        self.ahead.iter_mut().zip(missing).for_each(|(line, missing)| line.missing = *missing);
        self.all_missing = missing.iter().sum();
        self.timed = Some(TimedColumn { column, unit, clock });
    }

    /// The rate of the preamble has more digits than that of the times.
    fn take_stated_rate(&mut self) {
        let Some(stated) = self.table.stated_rate().filter(|_| !self.is_rate_known) else { return };
        if let Some(rate) = self.header.rate {
            let apart = (rate - stated.hertz).abs();
            if apart > self.header.rate_error + stated.error + SAME_RATE * rate {
                self.other_rate = Some(InputFault::OtherRate { stated: stated.hertz, found: rate });
            }
            if apart > self.header.rate_error + stated.error {
                return;
            }
        }
        (self.header.rate, self.header.rate_error) = (Some(stated.hertz), stated.error);
    }

    /// As the header of an input.
    pub fn header(&self) -> StreamHeader {
        self.header
    }

    /// The samples of the next frame, NaN for missing ones; `None` at the end.
    ///
    /// # Errors
    /// [`IoError::Malformed`] with the line of a cell or a time that is wrong.
    pub fn next_frame(&mut self) -> Result<Option<Vec<f64>>, IoError> {
        Ok(self.fill_frame()?.then(|| self.frame.clone()))
    }

    /// Puts the samples of the next frame into `self.frame`; false at the end.
    fn fill_frame(&mut self) -> Result<bool, IoError> {
        self.frame.clear();
        if self.missing == 0 && self.ahead.is_empty() {
            if !self.table.next_row()? {
                return Ok(false);
            }
            let missing = self.judge()?;
            if missing == 0 {
                for &column in &self.channels {
                    self.frame.push(self.table.number(column)?);
                }
                return Ok(true);
            }
            let samples = self.samples()?;
            self.ahead.push_back(Ahead { missing, samples });
        }
        if let Some(line) = self.ahead.front_mut() {
            self.missing += std::mem::take(&mut line.missing);
        }
        if self.missing > 0 {
            self.missing -= 1;
            self.frame.resize(self.channels.len(), f64::NAN);
        } else if let Some(line) = self.ahead.pop_front() {
            self.frame = line.samples;
        }
        Ok(true)
    }

    /// Judges the stamp of the last line: the lines that are missing before it.
    fn judge(&mut self) -> Result<u64, IoError> {
        let Some(timed) = &mut self.timed else { return Ok(0) };
        let stamp = self.table.stamp(timed.column)?;
        let unit = timed.unit;
        let missing = timed.clock.take(stamp).map_err(|fault| self.table.fault(&fault.message(unit)))?;
        self.all_missing += missing;
        Ok(missing)
    }
}

/// Refuses channels of one quantity in units of several sizes, as V beside mV.
fn refuse_mixed_units<R: Read>(table: &Table<R>, channels: &[usize]) -> Result<(), IoError> {
    let units = channels.iter().filter_map(|column| Some((column, table.unit(*column)?)));
    let mut units = units.collect::<Vec<_>>().into_iter();
    let Some((first, one)) = units.next() else { return Ok(()) };
    match units.find(|(_, unit)| unit.quantity == one.quantity && unit.size != one.size) {
        Some((column, unit)) => Err(table.fault(&format!(
            "column {} is in {} and column {} in {}; write them in one unit, or choose columns (--columns)",
            first + 1,
            Quoted(&one.written),
            column + 1,
            Quoted(&unit.written)
        ))),
        None => Ok(()),
    }
}

impl<R: Read> Capture for TableReader<R> {
    fn stream_header(&self) -> StreamHeader {
        self.header
    }

    fn read_block(&mut self, _: usize, block: &mut Block) -> io::Result<bool> {
        let mut frames = 0;
        // A live table is handed on line by line.
        while frames == 0 || (frames < BLOCK_FRAMES && self.is_more_at_hand()) {
            if !self.fill_frame()? {
                return Ok(false);
            }
            block.extend(self.frame.iter().copied());
            frames += 1;
        }
        Ok(true)
    }

    fn faults(&mut self) -> Vec<InputFault> {
        let missing = (self.all_missing > 0).then_some(InputFault::LinesMissing { lines: self.all_missing });
        let ramp = self.header.is_ramp_left_out.then_some(InputFault::RampLeftOut);
        ramp.into_iter().chain(missing).chain(self.other_rate).collect()
    }
}

impl<R: Read> TableReader<R> {
    fn is_more_at_hand(&self) -> bool {
        self.missing > 0 || !self.ahead.is_empty() || self.table.is_more_at_hand()
    }
}

#[cfg(test)]
mod tests;
