//! Tables whose first column says when each line was taken.

use super::IoError;
use super::csv::{last_digit, time_unit};
use super::table::{Table, number};
use crate::units::Seconds;
use std::fs::File;
use std::path::Path;

/// Bytes that are read at a time.
const BUFFER: usize = 1 << 16;
/// Digits by which the stamps of an even clock may be off: rounding is half of one.
const ROUNDING: f64 = 0.75;

/// Samples with their time stamps.
#[derive(Debug, Clone, PartialEq)]
pub struct StampedTable {
    /// When each line was taken. Stamps that are even up to the rounding of their last digit are so exactly.
    pub stamps: Vec<Seconds>,
    /// The numbers of each column, as many as there are stamps; missing ones are NaN.
    pub columns: Vec<Vec<f64>>,
}

/// Reads a table whose headings begin with a time; `None` if the file is none.
///
/// # Errors
/// [`IoError`] with the line and the column.
pub fn read_stamped(path: &Path) -> Result<Option<StampedTable>, IoError> {
    let name = path.display().to_string();
    let file = File::open(path).map_err(IoError::system(&name, "read it"))?;
    let mut table = Table::new(file, &name, "a table of samples", BUFFER);
    // What is no text is no table.
    let Ok(headings) = table.cells() else { return Ok(None) };
    let unit = headings.first().filter(|cell| number(cell).is_none()).and_then(|cell| time_unit(cell));
    let Some(unit) = unit.filter(|_| headings.len() > 1) else { return Ok(None) };
    let mut read = StampedTable { stamps: Vec::new(), columns: vec![Vec::new(); headings.len() - 1] };
    let mut digit = f64::INFINITY;
    loop {
        let cells = table.cells()?;
        if cells.is_empty() {
            break;
        }
        if cells.len() != headings.len() {
            return Err(table.fault(&format!(
                "{} cells, but the headings are {}",
                cells.len(),
                headings.len()
            )));
        }
        let numbers = table.numbers(&cells)?;
        let stamp = Seconds(numbers[0] * unit);
        if read.stamps.last().is_some_and(|last| *last >= stamp) || !stamp.0.is_finite() {
            return Err(
                table.fault("its time is not after that of the line before; sort the lines by their times")
            );
        }
        digit = digit.min(last_digit(&cells[0]) * unit);
        read.stamps.push(stamp);
        read.columns.iter_mut().zip(&numbers[1..]).for_each(|(column, number)| column.push(*number));
    }
    make_even(&mut read.stamps, digit);
    Ok(Some(read))
}

/// Takes the rounding of their last digit from stamps that are even up to it.
fn make_even(stamps: &mut [Seconds], digit: f64) {
    let [first, .., last] = stamps else { return };
    let (first, last, steps) = (first.0, last.0, (stamps.len() - 1) as f64);
    let on_line = |k: usize| first + (last - first) * (k as f64 / steps);
    if stamps.iter().enumerate().all(|(k, stamp)| (stamp.0 - on_line(k)).abs() <= 2.0 * ROUNDING * digit) {
        stamps.iter_mut().enumerate().for_each(|(k, stamp)| stamp.0 = on_line(k));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Option<StampedTable>, String> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        read_stamped(file.path()).map_err(|error| error.to_string())
    }

    #[test]
    fn stamps_come_with_their_columns() {
        let table = read("time (ms),x,y\n0,1,2\n1.5,,4\n7,5,6\n").unwrap().unwrap();
        assert_eq!(table.stamps, [0.0, 1.5e-3, 7e-3].map(Seconds));
        assert!(table.columns[0][1].is_nan());
        assert_eq!(table.columns[1], [2.0, 4.0, 6.0]);
        assert!(read("a,b\n1,2\n").unwrap().is_none() && read("1,2\n3,4\n").unwrap().is_none());
    }

    #[test]
    fn rounded_stamps_of_an_even_clock_are_even() {
        let line = |k: u32| format!("{:.6},{k}\n", f64::from(k) / 24_000.0);
        let table = read(&("t,x\n".to_owned() + &(0..=240).map(line).collect::<String>())).unwrap().unwrap();
        let off = |(k, stamp): (usize, &Seconds)| (stamp.0 - k as f64 / 24_000.0).abs();
        assert!(table.stamps.iter().enumerate().map(off).fold(0.0, f64::max) < 1e-15);
    }

    #[test]
    fn faults_have_their_line() {
        assert!(read("t,x\n0,1\n0,2\n").unwrap_err().contains("line 3: its time is not after"));
        assert!(read("t,x\n0,1\n1\n").unwrap_err().contains("line 3: 1 cells"));
    }
}
