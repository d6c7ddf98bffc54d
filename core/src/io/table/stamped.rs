//! Tables whose lines say when each was taken, at any times.

use super::Table;
use super::clock::Clock;
use super::headings::{Role, unit_by_size};
use super::options::{TableOptions, TimeColumn};
use super::stamp::Stamp;
use crate::io::IoError;
use crate::units::Seconds;
use std::fs::File;
use std::path::Path;

/// Bytes that are read at a time.
const BUFFER: usize = 1 << 16;

/// Samples with their time stamps.
#[derive(Debug, Clone, PartialEq)]
pub struct StampedTable {
    /// When each line was taken. Stamps that are even up to the rounding of their last digit are so exactly.
    pub stamps: Vec<Seconds>,
    /// The numbers of each column, as many as there are stamps; missing ones are NaN.
    pub columns: Vec<Vec<f64>>,
}

/// Reads a table whose first heading, or the options, name the column of time; `None` if the file is none.
///
/// # Errors
/// [`IoError`] with the line and the column.
pub fn read_stamped(path: &Path, options: &TableOptions) -> Result<Option<StampedTable>, IoError> {
    let name = path.display().to_string();
    let file = File::open(path).map_err(IoError::system(&name, "read it"))?;
    // What is no text is no table.
    let Ok(mut table) = Table::new(file, &name, "a table of samples", options, BUFFER) else {
        return Ok(None);
    };
    if options.time == TimeColumn::None || table.width() < 2 {
        return Ok(None);
    }
    let role = table.role(table.time().unwrap_or(0));
    if table.time().is_none() && !matches!(role, Role::Time(_)) {
        return Ok(None);
    }
    let column = table.time().unwrap_or(0);
    let columns: Vec<usize> = table.columns().into_iter().filter(|other| *other != column).collect();
    let mut read = StampedTable { stamps: Vec::new(), columns: vec![Vec::new(); columns.len()] };
    let mut stamps: Vec<Stamp> = Vec::new();
    while table.next_row()? {
        let stamp = table.stamp(column)?;
        if stamps.last().is_some_and(|last| stamp.since(*last) <= 0.0) {
            return Err(
                table.fault("its time is not after that of the line before; sort the lines by their times")
            );
        }
        stamps.push(stamp);
        for (numbers, column) in read.columns.iter_mut().zip(&columns) {
            numbers.push(table.number(*column)?);
        }
    }
    read.stamps = times(&stamps, role);
    Ok(Some(read))
}

/// The stamps in seconds. Those of an even clock are without the rounding of their last digit.
fn times(stamps: &[Stamp], role: Role) -> Vec<Seconds> {
    let Some(&first) = stamps.first() else { return Vec::new() };
    let unit = match role {
        _ if first.is_date => 1.0,
        Role::Time(Some(unit)) => unit,
        Role::Time(None) => unit_by_size(first.value()),
        Role::Index | Role::Other => 1.0,
    };
    let even = if stamps.len() < 3 { None } else { Clock::of(stamps).ok() };
    let even = even.filter(|(_, missing)| missing.iter().all(|lines| *lines == 0));
    let at = |(k, stamp): (usize, &Stamp)| match &even {
        Some((clock, _)) => k as f64 * clock.step(),
        None => stamp.since(first),
    };
    stamps.iter().enumerate().map(|line| Seconds((first.value() + at(line)) * unit)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Option<StampedTable>, String> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        read_stamped(file.path(), &TableOptions::default()).map_err(|error| error.to_string())
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
        assert!(read("t,x\n0,1\n1\n").unwrap_err().contains("line 3: 1 cell,"));
    }
}
