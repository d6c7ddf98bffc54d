//! Tables of numbers as instruments, loggers and people write them.
//!
//! Lines before the first one of numbers are a preamble; the last of them hold the headings, and some state
//! the rate. Cells are separated by commas, semicolons, tabs or spaces, and may be quoted. Lines that begin
//! with `#` are comments.

mod bare_commas;
mod candidate;
mod cells;
mod clock;
mod headings;
mod options;
mod preamble;
mod reader;
mod stamp;
mod stamped;
mod text;

pub use options::{Column, Decimal, Delimiter, TableOptions, TimeColumn};
pub use reader::TableReader;
pub use stamped::{StampedTable, read_stamped};

use super::IoError;
use crate::messages::{Quoted, counted};
use bare_commas::BareCommas;
use cells::{AS_TIME, Cells, Numbers};
use headings::{Role, StatedRate, Unit};
use preamble::Preamble;
use stamp::{Days, Stamp};
use std::fs::File;
use std::io::Read;
use std::path::Path;
use text::Lines;

/// Bytes that tell whether a file is a table.
const LOOKED_AT: u64 = 1 << 14;

/// Whether the file at `path` reads as a table: a line of numbers is among the first, and no document begins
/// there.
pub(super) fn is_table(path: &Path) -> bool {
    let Some(mut file) = path.is_file().then(|| File::open(path).ok()).flatten() else { return false };
    let mut head = Vec::new();
    if file.by_ref().take(LOOKED_AT).read_to_end(&mut head).is_err() || head.starts_with(b"{") {
        return false;
    }
    let table = Table::new(&head[..], "", "", &TableOptions::default(), LOOKED_AT as usize);
    table.is_ok_and(|table| !table.preamble.ahead.is_empty())
}

/// The lines of a table that hold numbers, from the first one on.
pub struct Table<R> {
    lines: Lines<R>,
    preamble: Preamble,
    cells: Cells,
    numbers: Numbers,
    bare: Option<BareCommas>,
    days: Days,
    /// Number of the last line, from 1.
    line: u64,
}

impl<R: Read> Table<R> {
    /// Of a file that is called `file` in messages, and should be of this kind. `buffer` bytes are read at a
    /// time, and now those up to the first line of numbers.
    ///
    /// # Errors
    /// [`IoError::Malformed`] if none is found or the options name what is not there, or the system's
    /// refusal.
    pub fn new(
        inner: R,
        file: &str,
        kind: &'static str,
        options: &TableOptions,
        buffer: usize,
    ) -> Result<Self, IoError> {
        let mut lines = Lines::new(inner, file, kind, buffer);
        lines.skip(options.skip_lines)?;
        let preamble = Preamble::read(&mut lines, options)?;
        let delimiter = preamble.layout.delimiter;
        let is_open = delimiter == Delimiter::Comma && options.decimal.is_none();
        let bare = is_open.then(BareCommas::default);
        let (cells, numbers) = (Cells::new(delimiter), Numbers { decimal: options.decimal });
        Ok(Self { line: lines.number, lines, preamble, cells, numbers, bare, days: Days::default() })
    }

    /// True if a line has come that was not used.
    pub fn is_more_at_hand(&self) -> bool {
        !self.preamble.ahead.is_empty() || self.lines.is_more_at_hand()
    }

    /// Columns, with the time and those that hold nothing; none if there are no lines.
    pub fn width(&self) -> usize {
        self.preamble.names.len()
    }

    /// The heading of a column; empty if it has none.
    pub fn name(&self, column: usize) -> &str {
        &self.preamble.names[column]
    }

    /// What the headings say of a column.
    fn role(&self, column: usize) -> Role {
        headings::role(&self.preamble.names[column], &self.preamble.units[column])
    }

    /// The unit of a column, if its heading or the line of units below says one that is known.
    fn unit(&self, column: usize) -> Option<Unit> {
        Unit::of(&self.preamble.names[column], &self.preamble.units[column])
    }

    /// The first column that holds something.
    fn first_column(&self) -> Option<usize> {
        self.preamble.blank.iter().position(|blank| !blank)
    }

    /// True if a line has come that may show decimal commas between commas.
    fn may_have_bare_commas(&self) -> bool {
        self.is_more_at_hand() && self.bare.as_ref().is_some_and(|bare| !bare.is_over)
    }

    /// The column of time that the options name.
    fn time(&self) -> Option<usize> {
        self.preamble.layout.time
    }

    /// The rate that the preamble states.
    fn stated_rate(&self) -> Option<StatedRate> {
        self.preamble.stated
    }

    /// Goes to the next line of numbers; false at the end.
    ///
    /// # Errors
    /// [`IoError::Malformed`] with the line, or the system's refusal.
    pub fn next_row(&mut self) -> Result<bool, IoError> {
        let is_closed = loop {
            if let Some((number, line)) = self.preamble.ahead.pop_front() {
                self.line = number;
                if !line.starts_with(b"#") {
                    break self.cells.split(&line);
                }
            } else {
                let Some(line) = self.lines.next()? else { return Ok(false) };
                if !line.starts_with(b"#") {
                    let is_closed = self.cells.split(line);
                    self.line = self.lines.number;
                    break is_closed;
                }
            }
        };
        if !is_closed {
            return Err(self.fault("a quote is not closed; cells cannot hold line ends"));
        }
        self.check_width()?;
        let bare = self.bare.as_mut().and_then(|bare| bare.find(&self.cells));
        bare.map_or(Ok(true), |problem| Err(self.fault(&problem)))
    }

    /// As many cells as before, and nothing in the columns that held nothing.
    fn check_width(&self) -> Result<(), IoError> {
        let (count, width) = (self.cells.count, self.width());
        let is_blank = |column: usize| self.preamble.blank.get(column).is_none_or(|blank| *blank);
        let least = (0..width).rev().find(|&column| !is_blank(column)).map_or(width, |last| last + 1);
        if count < least || (width..count).any(|column| !self.cells.get(column).is_empty()) {
            return Err(self.fault(&format!(
                "{}, but the lines before have {width}; give one column per channel, and cut off what follows the table",
                counted(count, "cell")
            )));
        }
        let is_beside = |column: &usize| is_blank(*column) && !self.cells.get(*column).is_empty();
        match (0..width).find(is_beside).filter(|_| !self.preamble.is_beside) {
            Some(column) => Err(self.fault(&format!(
                "column {}: \"{}\", but the column is empty in the first line and has no heading; give it one",
                column + 1,
                Quoted(self.cells.get(column))
            ))),
            None => Ok(()),
        }
    }

    /// The columns that hold something, or those that the options choose.
    pub fn columns(&self) -> Vec<usize> {
        let held = (0..self.width())
            .filter(|&column| !self.preamble.blank[column] && self.preamble.layout.time != Some(column));
        if self.preamble.layout.chosen.is_empty() {
            held.collect()
        } else {
            self.preamble.layout.chosen.clone()
        }
    }

    /// A cell of the last line.
    pub fn cell(&self, column: usize) -> &str {
        self.cells.get(column)
    }

    /// Number of the last line, from 1.
    pub fn line(&self) -> u64 {
        self.line
    }

    /// The number in a cell of the last line; NaN for a missing sample.
    ///
    /// # Errors
    /// [`IoError::Malformed`] with the line and the column.
    pub fn number(&mut self, column: usize) -> Result<f64, IoError> {
        self.numbers.read(self.cells.get(column)).ok_or_else(|| {
            let cell = self.cells.get(column);
            if self.numbers.decimal.is_none() && cells::may_be_thousands(cell) {
                return self.fault(&format!(
                    "column {}: \"{}\" may be a decimal or hold a thousands separator; state that decimals have a comma, \
                     or leave the separators out",
                    column + 1,
                    Quoted(cell)
                ));
            }
            let mark = match self.numbers.decimal {
                Some(Decimal::Comma) => "decimals have a comma in this table",
                _ => "decimals have a point",
            };
            let separated =
                format!("{mark}, cells are separated by , ; tab or space, and nothing follows the table");
            let remedy = cells::remedy(cell).unwrap_or(&separated);
            self.fault(&format!("column {}: \"{}\" is no number; {remedy}", column + 1, Quoted(cell)))
        })
    }

    /// The time in a cell of the last line; times of day go on after midnight.
    fn stamp(&mut self, column: usize) -> Result<Stamp, IoError> {
        Stamp::parse(self.cells.get(column)).map(|stamp| self.days.count(stamp)).ok_or_else(|| {
            let cell = self.cells.get(column);
            self.fault(&format!("column {}: \"{}\" is no time; {AS_TIME}", column + 1, Quoted(cell)))
        })
    }

    /// What is wrong with the last line.
    pub fn fault(&self, problem: &str) -> IoError {
        self.fault_at(self.line, problem)
    }

    /// What is wrong with a line.
    fn fault_at(&self, line: u64, problem: &str) -> IoError {
        self.lines.fault_at(line, problem)
    }
}
