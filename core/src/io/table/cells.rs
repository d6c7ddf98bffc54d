//! The cells of a line, and the numbers in them.

use super::options::{Decimal, Delimiter};
use csv_core::{ReadRecordResult, Reader, ReaderBuilder};

/// What instruments write where they have no sample: none was taken, or it was beyond their range.
const MISSING: [&str; 14] =
    ["-", "--", "---", "n/a", "na", "null", "none", "overload", "over", "ovld", "ol", "∞", "-∞", "+∞"];
/// Numbers at and above this are infinity and "not a number" of SCPI (9.9e37 and 9.91e37).
const SCPI_INFINITY: f64 = 9.9e37;
/// Numbers above this are no SCPI code.
const SCPI_MOST: f64 = 9.92e37;

/// Splits lines into cells.
pub(super) struct Cells {
    reader: Reader,
    delimiter: Delimiter,
    /// The cells without quotes, one after the other, and where each ends.
    text: Vec<u8>,
    ends: Vec<usize>,
    /// Cells of the last line.
    pub(super) count: usize,
    /// The last line with its end.
    line: Vec<u8>,
}

impl Cells {
    pub(super) fn new(delimiter: Delimiter) -> Self {
        let reader = ReaderBuilder::new().delimiter(delimiter.byte()).build();
        Self { reader, delimiter, text: Vec::new(), ends: vec![0; 16], count: 0, line: Vec::new() }
    }

    /// Splits a line; false if a quote is not closed.
    pub(super) fn split(&mut self, line: &[u8]) -> bool {
        self.line.clear();
        if self.delimiter == Delimiter::Space {
            let words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
            words.for_each(|word| {
                self.line.extend_from_slice(word);
                self.line.push(b' ');
            });
            self.line.pop();
        } else {
            self.line.extend_from_slice(line);
        }
        self.line.push(b'\n');
        self.text.resize(self.line.len().max(self.text.len()), 0);
        let (mut from, mut written) = (0, 0);
        self.count = 0;
        loop {
            let (input, output) = (&self.line[from..], &mut self.text[written..]);
            let (result, read, wrote, ended) =
                self.reader.read_record(input, output, &mut self.ends[self.count..]);
            from += read;
            written += wrote;
            self.count += ended;
            match result {
                ReadRecordResult::Record => return true,
                ReadRecordResult::OutputEndsFull => self.ends.resize(2 * self.ends.len(), 0),
                ReadRecordResult::OutputFull => self.text.resize(2 * self.text.len(), 0),
                ReadRecordResult::InputEmpty | ReadRecordResult::End => {
                    self.reader.reset();
                    return false;
                }
            }
        }
    }

    /// A cell without the spaces around it; an empty one beyond the last.
    pub(super) fn get(&self, column: usize) -> &str {
        if column >= self.count {
            return "";
        }
        let start = if column == 0 { 0 } else { self.ends[column - 1] };
        str::from_utf8(&self.text[start..self.ends[column]]).unwrap_or("\u{fffd}").trim()
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &str> {
        (0..self.count).map(|column| self.get(column))
    }
}

/// Reads numbers with the decimal mark of the table: what was asked for, or the first one that is found.
#[derive(Debug, Clone, Copy)]
pub(super) struct Numbers {
    pub(super) decimal: Option<Decimal>,
}

impl Numbers {
    /// The number in a cell; NaN for a missing sample, `None` for what is no number.
    pub(super) fn read(&mut self, cell: &str) -> Option<f64> {
        match self.decimal {
            Some(Decimal::Point) => parse(cell),
            Some(Decimal::Comma) => with_comma(cell),
            None => {
                let mark = if cell.contains(',') { Some(Decimal::Comma) } else { None };
                let mark = mark.or_else(|| cell.contains('.').then_some(Decimal::Point));
                // 1,046 may be a thousand and 46.
                if mark == Some(Decimal::Comma) && may_be_thousands(cell) {
                    return None;
                }
                let number = if mark == Some(Decimal::Comma) { with_comma(cell) } else { parse(cell) };
                self.decimal = mark.filter(|_| number.is_some_and(f64::is_finite));
                number
            }
        }
    }
}

fn with_comma(cell: &str) -> Option<f64> {
    if cell.contains(',') && !cell.contains('.') { parse(&cell.replace(',', ".")) } else { whole(cell) }
}

/// True for one to three digits that do not begin with 0, a comma and three digits.
pub(super) fn may_be_thousands(cell: &str) -> bool {
    let digits = cell.trim_start_matches(['-', '+']).split_once(',');
    digits.is_some_and(|(before, after)| {
        let are_digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
        (1..=3).contains(&before.len())
            && after.len() == 3
            && are_digits(before)
            && are_digits(after)
            && !before.starts_with('0')
    })
}

/// How a time is written.
pub(super) const AS_TIME: &str = "write a number, or date and time in one cell as 2026-11-28T10:00:00.125Z";

/// What to do about a cell that is no number, if it is clear what it was to be.
pub(super) fn remedy(cell: &str) -> Option<&'static str> {
    let is_of_digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_hexdigit());
    let letters = cell.trim_start_matches(|c: char| !c.is_alphabetic() && c != '°');
    let number = cell[..cell.len() - letters.len()].trim_end();
    if cell.strip_prefix("0x").or(cell.strip_prefix("0X")).is_some_and(is_of_digits) {
        Some("write codes as decimal numbers")
    } else if cell.starts_with(|c: char| c.is_ascii_digit())
        && (cell.contains(':') || ['/', '.', '-'].iter().any(|mark| cell.matches(*mark).count() > 1))
    {
        Some(AS_TIME)
    } else {
        (!letters.is_empty() && parse(number).is_some_and(f64::is_finite))
            .then_some("write units into the heading, not beside each number")
    }
}

/// A number without decimals.
fn whole(cell: &str) -> Option<f64> {
    parse(cell).filter(|_| !cell.contains('.'))
}

fn parse(cell: &str) -> Option<f64> {
    match cell.parse::<f64>() {
        Ok(number) if number.is_finite() && !(SCPI_INFINITY..SCPI_MOST).contains(&number.abs()) => {
            Some(number)
        }
        Ok(_) => Some(f64::NAN),
        Err(_) => is_missing(cell).then_some(f64::NAN),
    }
}

fn is_missing(cell: &str) -> bool {
    cell.is_empty() || MISSING.iter().any(|known| cell.eq_ignore_ascii_case(known))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(cells: &[&str]) -> Vec<Option<f64>> {
        let mut numbers = Numbers { decimal: None };
        cells.iter().map(|cell| numbers.read(cell)).collect()
    }

    #[test]
    fn quotes_hold_delimiters_and_quotes() {
        let mut cells = Cells::new(Delimiter::Comma);
        assert!(cells.split(b" 1 ,\"a,b\",\"say \"\"x\"\"\",,5"));
        assert_eq!(cells.iter().collect::<Vec<_>>(), ["1", "a,b", "say \"x\"", "", "5"]);
        assert!(!cells.split(b"1,\"2"));
        // The open quote does not reach into the next line.
        assert!(cells.split(b"3,4"));
        assert_eq!(cells.iter().collect::<Vec<_>>(), ["3", "4"]);
        let wide = vec![b','; 1000];
        assert!(cells.split(&wide));
        assert_eq!(cells.count, 1001);
        let mut spaces = Cells::new(Delimiter::Space);
        assert!(spaces.split(b"  1 \t -2e3  "));
        assert_eq!(spaces.iter().collect::<Vec<_>>(), ["1", "-2e3"]);
    }

    #[test]
    fn the_first_decimal_mark_is_that_of_all_cells() {
        assert_eq!(read(&["1", "0,5", "-2,25e3", "7"]), [Some(1.0), Some(0.5), Some(-2250.0), Some(7.0)]);
        assert_eq!(read(&["0,5", "0.5", "1,046"]), [Some(0.5), None, Some(1.046)]);
        assert_eq!(read(&["703", "1,046", "-12,345"]), [Some(703.0), None, None]);
        assert_eq!(read(&["0.5", "0,5", "+1E3"]), [Some(0.5), None, Some(1000.0)]);
        assert_eq!(read(&["1.234,5", "1,234.5", "1,2,3"]), [None, None, None]);
    }

    #[test]
    fn missing_samples_have_many_names() {
        for cell in
            ["", "NaN", "-nan", "inf", "-Infinity", "-", "N/A", "Overload", "9.91E+37", "-9.9e37", "∞"]
        {
            assert!(read(&[cell])[0].is_some_and(f64::is_nan), "{cell}");
        }
        for cell in ["x", "1 V", "missing", "0x1f", "1e37 ", "--1"] {
            assert!(read(&[cell])[0].is_none(), "{cell}");
        }
        assert_eq!(read(&["1e37", "9.92e37"]), [Some(1e37), Some(9.92e37)]);
    }
}
