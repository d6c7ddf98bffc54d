//! Rows of zeros: what a recorder writes while it is muted or its data do not arrive.

use crate::calibrate::Record;
use std::ops::Range;

/// Zeros in a row that are no samples: no recorder with noise has so many, and one without loses nothing.
const LEAST_ZEROS: usize = 256;
/// Relative difference of lengths within which rows of two recordings are one silence.
const SAME_LENGTH: f64 = 0.01;

/// The zeros of each recording that are no samples: as such they would contradict those of the others. There
/// are none where all recordings have rows of the same lengths: there the sound itself is zero. `rates`
/// are the samples per second of each, in any unit.
pub(crate) fn lost_zeros(records: &[&Record], rates: &[f64]) -> Vec<Vec<Range<usize>>> {
    let rows: Vec<Vec<Range<usize>>> = records.iter().map(|record| long_rows(record)).collect();
    let lengths = |i: usize| rows[i].iter().map(move |row| row.len() as f64 / rates[i]);
    let is_alike = |(one, other): (f64, f64)| (one - other).abs() <= SAME_LENGTH * one;
    let is_silence =
        (1..rows.len()).all(|i| rows[i].len() == rows[0].len() && lengths(0).zip(lengths(i)).all(is_alike));
    if is_silence { vec![Vec::new(); records.len()] } else { rows }
}

/// The long rows of zeros among the samples that are kept.
fn long_rows(record: &Record) -> Vec<Range<usize>> {
    let is_zero: Vec<bool> =
        record.samples.iter().zip(&record.keep).map(|(x, keep)| *keep && *x == 0.0).collect();
    let mut end = 0;
    let row = |row: &[bool]| {
        end += row.len();
        (row[0] && row.len() >= LEAST_ZEROS).then(|| end - row.len()..end)
    };
    is_zero.chunk_by(|a, b| a == b).filter_map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::{Record, lost_zeros};
    use std::ops::Range;

    /// 6,000 samples with zeros in this range.
    fn record(zeros: Range<usize>) -> Record {
        let mut samples: Vec<f64> = (0..6000).map(|k| f64::from(k % 7) - 3.5).collect();
        samples[zeros].fill(0.0);
        Record::new(samples)
    }

    #[test]
    fn rows_that_others_lack_are_no_samples_and_a_common_silence_is() {
        let (whole, short) = (record(0..0), record(100..300));
        let (first, second) = (record(1000..1500), record(3000..3800));
        let lost = |one: &Record, other: &Record| {
            let rows = lost_zeros(&[one, other], &[1.0, 1.0]).into_iter().flatten();
            rows.map(|row| row.len()).collect::<Vec<_>>()
        };
        assert_eq!(lost(&first, &whole), [500]);
        assert_eq!(lost(&first, &second), [500, 800]);
        assert!(lost(&first, &record(2002..2503)).is_empty());
        assert!(lost(&short, &whole).is_empty());
        // At twice the rate the silence has twice the samples.
        assert!(lost_zeros(&[&first, &record(4000..5000)], &[1.0, 2.0]).concat().is_empty());
        assert!(lost_zeros(&[&first], &[1.0]).concat().is_empty());
    }
}
