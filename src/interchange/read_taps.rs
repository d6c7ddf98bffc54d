//! FIR taps that other tools wrote.

use super::layout::PolyphaseTaps;
use crate::io::table::{Table, TableOptions};
use crate::io::{ArrayHeader, IoError, npy_header};
use crate::messages::Quoted;

/// Headings of the table that [`export`](super::export) writes.
const HEADINGS: [&str; 4] = ["channel", "phase", "lag", "value"];

/// Bytes of a table that are parsed at a time.
const BUFFER: usize = 1 << 16;

/// Why a file holds no taps.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TapsError {
    /// A cell is no finite number.
    #[error("line {line}, column {column}: \"{}\" is no finite number", Quoted(.text))]
    NoNumber {
        /// Line, from 1.
        line: u64,
        /// Column, from 1.
        column: usize,
        /// The cell.
        text: String,
    },
    /// The file is no table or array.
    #[error("{0}")]
    Broken(String),
    /// An array of another shape.
    #[error(
        "the array has the shape {}; give (channels, taps), or (channels, phases, lags)",
        Quoted(format!("{:?}", .shape))
    )]
    Shape {
        /// The shape found.
        shape: Vec<u64>,
    },
    /// There are no taps.
    #[error("there are no taps; give one column per channel and one row per tap")]
    Empty,
}

/// `f_i[n]`, one list per channel, from a table: one column per channel and one row per tap at the fast
/// rate, headings or not; or the table that [`export`](super::export) writes.
///
/// # Errors
/// [`TapsError`] with the line of the first cell that is wrong.
pub fn taps_of_csv(bytes: &[u8]) -> Result<Vec<Vec<f64>>, TapsError> {
    let options = TableOptions::default();
    let mut table = Table::new(bytes, "", "a table of taps", &options, BUFFER).map_err(broken)?;
    let places = table.columns();
    let named = places.iter().zip(HEADINGS).filter(|(place, known)| table.name(**place) == *known);
    let is_polyphase = named.count() == HEADINGS.len();
    let mut rows: Vec<Vec<f64>> = Vec::new();
    while table.next_row().map_err(broken)? {
        let number = |column: &usize| match table.number(*column) {
            Ok(value) if value.is_finite() => Ok(value),
            _ => {
                let text = table.cell(*column).to_owned();
                Err(TapsError::NoNumber { line: table.line(), column: column + 1, text })
            }
        };
        rows.push(places.iter().map(number).collect::<Result<_, _>>()?);
    }
    if is_polyphase { of_entries(&rows) } else { columns(&rows) }
}

/// What the reader of a table or of an array says, without a name of the file.
fn broken(error: IoError) -> TapsError {
    match error {
        IoError::Malformed { problem, .. } => TapsError::Broken(problem),
        other => TapsError::Broken(other.to_string()),
    }
}

fn columns(rows: &[Vec<f64>]) -> Result<Vec<Vec<f64>>, TapsError> {
    let width = rows.first().map_or(0, Vec::len);
    if width == 0 {
        return Err(TapsError::Empty);
    }
    Ok((0..width).map(|i| rows.iter().map(|row| row[i]).collect()).collect())
}

/// From (channel, phase, lag, value), all entries in the order of the export.
fn of_entries(rows: &[Vec<f64>]) -> Result<Vec<Vec<f64>>, TapsError> {
    let last = rows.last().ok_or(TapsError::Empty)?;
    let size = |column: usize| (last[column] as usize).min(rows.len());
    let shape = [size(0), size(1) + 1, size(2) + 1];
    let expected = shape.iter().try_fold(1_usize, |product, &size| product.checked_mul(size));
    let in_order = rows.iter().enumerate().all(|(k, row)| {
        let [_, m, lags] = shape;
        let entry = [k / (m * lags) + 1, k / lags % m, k % lags];
        entry.iter().zip(row).all(|(&want, &got)| want as f64 == got)
    });
    if expected != Some(rows.len()) || !in_order {
        let message = "the entries are not those of all channels, phases and lags in this order";
        return Err(TapsError::Broken(message.to_owned()));
    }
    Ok(interleaved(shape, rows.iter().map(|row| row[3]).collect()))
}

/// Taps at the fast rate from those of the phases.
fn interleaved([channels, ratio, lags]: [usize; 3], values: Vec<f64>) -> Vec<Vec<f64>> {
    let taps = PolyphaseTaps { channels, ratio, lags, values };
    let tap = |i: usize, n: usize| taps.get(i, n % ratio, n / ratio);
    (0..channels).map(|i| (0..ratio * lags).map(|n| tap(i, n)).collect()).collect()
}

/// `f_i[n]`, one list per channel, from a NumPy array (channels, taps) or (channels, phases, lags).
///
/// # Errors
/// [`TapsError`] for other arrays and other files.
pub fn taps_of_npy(bytes: &[u8]) -> Result<Vec<Vec<f64>>, TapsError> {
    let no_array = |problem: &str| TapsError::Broken(format!("no NumPy array of reals: {problem}"));
    let mut rest = bytes;
    let ArrayHeader { format, is_complex, shape, is_column_major, .. } =
        npy_header(&mut rest, "").map_err(broken)?;
    if is_complex || !format.is_float() {
        return Err(no_array("its numbers are neither f8 nor f4"));
    }
    let count = shape.iter().try_fold(1, |product: usize, &size| product.checked_mul(size.try_into().ok()?));
    let values = count.and_then(|count| rest.get(..count.checked_mul(format.bytes())?));
    let values = values.ok_or_else(|| no_array("its shape has more entries than the file"))?;
    let values: Vec<f64> = values.chunks_exact(format.bytes()).map(|number| format.decode(number)).collect();
    if values.iter().any(|value| !value.is_finite()) {
        return Err(TapsError::Broken("a tap is not finite".to_owned()));
    }
    if values.is_empty() {
        return Err(TapsError::Empty);
    }
    let sizes: Vec<usize> = shape.iter().map(|&size| size as usize).collect();
    match (sizes[..].try_into(), &sizes[..]) {
        (Ok(sizes), _) if !is_column_major => Ok(interleaved(sizes, values)),
        (_, &[channels, taps]) => {
            let (along, across) = if is_column_major { (channels, 1) } else { (1, taps) };
            let tap = |i: usize, n: usize| values[i * across + n * along];
            Ok((0..channels).map(|i| (0..taps).map(|n| tap(i, n)).collect()).collect())
        }
        _ => Err(TapsError::Shape { shape }),
    }
}
