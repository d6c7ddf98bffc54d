//! FIR taps that other tools wrote.

use super::layout::PolyphaseTaps;

/// Headings of the table that [`export`](super::export) writes.
const HEADINGS: [&str; 4] = ["channel", "phase", "lag", "value"];

/// Longest header of an array whose shape is looked at; those of taps have a hundred bytes.
const LONGEST_HEADER: usize = 1 << 16;

/// Why a file holds no taps.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum TapsError {
    /// A cell is no finite number.
    #[error("line {line}, column {column}: \"{text}\" is no finite number")]
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
        "the array has the shape {shape:?}; give (channels, taps), or (channels, phases, lags) as export writes it"
    )]
    Shape {
        /// The shape found.
        shape: Vec<u64>,
    },
    /// There are no taps.
    #[error("there are no taps; give one column per channel and one row per tap")]
    Empty,
}

/// `f_i[n]`, one list per channel, from comma-separated values: one column per channel and one row per tap
/// at the fast rate, headings or not; or the table that [`export`](super::export) writes.
///
/// # Errors
/// [`TapsError`] with the line of the first cell that is wrong.
pub fn taps_of_csv(bytes: &[u8]) -> Result<Vec<Vec<f64>>, TapsError> {
    let mut reader = csv::ReaderBuilder::new().has_headers(false).trim(csv::Trim::All).from_reader(bytes);
    let mut rows = Vec::new();
    let mut is_polyphase = false;
    for (index, record) in reader.records().enumerate() {
        let record = record.map_err(|error| TapsError::Broken(error.to_string()))?;
        if index == 0 && record.iter().all(|cell| cell.parse::<f64>().is_err()) {
            is_polyphase = record.iter().zip(HEADINGS).filter(|(cell, known)| cell == known).count() == 4;
            continue;
        }
        let line = record.position().map_or(index as u64 + 1, csv::Position::line);
        let number = |(column, text): (usize, &str)| match text.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(TapsError::NoNumber { line, column: column + 1, text: text.to_owned() }),
        };
        rows.push(record.iter().enumerate().map(number).collect::<Result<Vec<f64>, _>>()?);
    }
    if is_polyphase { of_entries(&rows) } else { columns(&rows) }
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
    let broken =
        |error: &dyn std::fmt::Display| TapsError::Broken(format!("no NumPy array of reals: {error}"));
    if !fits(bytes) {
        return Err(broken(&"its shape has more entries than the file has bytes"));
    }
    let array = npyz::NpyFile::new(bytes).map_err(|error| broken(&error))?;
    let shape = array.shape().to_vec();
    let is_fortran = array.order() == npyz::Order::Fortran;
    let values: Vec<f64> = match array.try_data::<f64>() {
        Ok(data) => data.collect::<Result<_, _>>().map_err(|error| broken(&error))?,
        Err(array) => {
            let data = array.try_data::<f32>().map_err(|_| broken(&"its numbers are neither f8 nor f4"))?;
            data.map(|x| x.map(f64::from)).collect::<Result<_, _>>().map_err(|error| broken(&error))?
        }
    };
    if values.iter().any(|value| !value.is_finite()) {
        return Err(TapsError::Broken("a tap is not finite".to_owned()));
    }
    let sizes: Vec<usize> = shape.iter().map(|&size| size as usize).collect();
    if values.is_empty() {
        return Err(TapsError::Empty);
    }
    match (sizes[..].try_into(), &sizes[..]) {
        (Ok(sizes), _) if !is_fortran => Ok(interleaved(sizes, values)),
        (_, &[channels, taps]) => {
            let at =
                |i: usize, n: usize| if is_fortran { values[n * channels + i] } else { values[i * taps + n] };
            Ok((0..channels).map(|i| (0..taps).map(|n| at(i, n)).collect()).collect())
        }
        _ => Err(TapsError::Shape { shape }),
    }
}

/// Whether the shape in the header of an array has no more entries than `bytes`. The reader multiplies its
/// sizes without a check.
fn fits(bytes: &[u8]) -> bool {
    let header = String::from_utf8_lossy(&bytes[..bytes.len().min(LONGEST_HEADER)]);
    let shape = header.split_once("'shape'").and_then(|(_, rest)| rest.split_once('(')?.1.split_once(')'));
    let sizes =
        shape.map_or("", |(sizes, _)| sizes).split(',').map(str::trim).filter(|size| !size.is_empty());
    let mut entries = sizes.map(|size| size.trim_end_matches('L').parse::<usize>().ok());
    let product = entries.try_fold(1, |product: usize, size| product.checked_mul(size?.max(1)));
    product.is_some_and(|entries| entries <= bytes.len())
}
