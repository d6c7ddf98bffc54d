//! Arrays for MATLAB and SciPy.

use super::ExportError;
use super::layout::PolyphaseTaps;
use crate::bank::{Bank, SynthesisFilters};

/// A MATLAB file, level 4.
///
/// Source: MathWorks, *MAT-File Format*, "Level 4 MAT-files".
pub(super) fn mat(bank: &Bank) -> Result<Vec<u8>, ExportError> {
    let (mut bytes, samples, ratio) = (Vec::new(), bank.frame_samples(), bank.ratio);
    let mut add = |name, shape, values: &[f64]| add(&mut bytes, name, shape, values);
    match &bank.filters {
        SynthesisFilters::Fir(taps) => {
            let PolyphaseTaps { channels, lags, values, .. } = PolyphaseTaps::new(taps, ratio);
            add("taps", [channels, ratio * lags], &values)?;
        }
        SynthesisFilters::StateSpace(block) => {
            let states = block.a.len();
            add("a", [states, states], &block.a.concat())?;
            add("b", [states, samples], &block.b.concat())?;
            add("c", [ratio, states], &block.c.concat())?;
            add("d", [ratio, samples], &block.d.concat())?;
        }
    }
    add("offsets", [1, samples], &bank.layout().each(&bank.offsets))?;
    add("ratio", [1, 1], &[ratio as f64])?;
    add("latency", [1, 1], &[bank.latency as f64])?;
    add("fast_period", [1, 1], &[bank.fast_period.0])?;
    Ok(bytes)
}

/// Adds a variable, whose values are row-major: a header of five integers, its name, and its columns.
fn add(
    bytes: &mut Vec<u8>,
    name: &'static str,
    [rows, columns]: [usize; 2],
    values: &[f64],
) -> Result<(), ExportError> {
    // Type 0: doubles, little endian, a full matrix.
    for number in [0, rows, columns, 0, name.len() + 1] {
        let number = u32::try_from(number).map_err(|_| ExportError::TooLarge { name, rows, columns })?;
        bytes.extend(number.to_le_bytes());
    }
    bytes.extend(name.bytes().chain([0]));
    for column in 0..columns {
        let column = (0..rows).map(|row| values[row * columns + column]);
        column.for_each(|value| bytes.extend(value.to_le_bytes()));
    }
    Ok(())
}
