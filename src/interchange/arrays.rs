//! Arrays for MATLAB and SciPy.

use super::ExportError;
use super::layout::PolyphaseTaps;
use crate::bank::{Bank, SynthesisFilters};

/// A named array of doubles, row-major.
struct Array {
    name: &'static str,
    shape: Vec<u64>,
    values: Vec<f64>,
}

fn arrays(bank: &Bank) -> Vec<Array> {
    let scalar = |name, value| Array { name, shape: vec![1, 1], values: vec![value] };
    let mut all = match &bank.filters {
        SynthesisFilters::Fir(taps) => {
            let taps = PolyphaseTaps::new(taps, bank.ratio);
            let shape = [taps.channels, taps.ratio, taps.lags].map(|size| size as u64).to_vec();
            vec![Array { name: "taps", shape, values: taps.values }]
        }
        SynthesisFilters::StateSpace(block) => {
            let columns = [block.a.len(), bank.frame_samples(), block.a.len(), bank.frame_samples()];
            let matrices = [("a", &block.a), ("b", &block.b), ("c", &block.c), ("d", &block.d)];
            let matrix = |((name, rows), columns): ((&'static str, &Vec<Vec<f64>>), usize)| Array {
                name,
                shape: vec![rows.len() as u64, columns as u64],
                values: rows.concat(),
            };
            matrices.into_iter().zip(columns).map(matrix).collect()
        }
    };
    all.push(Array {
        name: "offsets",
        shape: vec![1, bank.frame_samples() as u64],
        values: bank.layout().each(&bank.offsets),
    });
    all.push(scalar("ratio", bank.ratio as f64));
    all.push(scalar("latency", bank.latency as f64));
    all.push(scalar("fast_period", bank.fast_period.0));
    all
}

/// A MATLAB file, level 4: for each variable a header of five integers, its name, and its columns.
///
/// Source: MathWorks, *MAT-File Format*, "Level 4 MAT-files".
pub(super) fn mat(bank: &Bank) -> Result<Vec<u8>, ExportError> {
    let mut bytes = Vec::new();
    for Array { name, shape, values } in arrays(bank) {
        let rows = shape[0];
        let columns = shape[1..].iter().product::<u64>();
        // Type 0: doubles, little endian, a full matrix.
        for number in [0, rows, columns, 0, name.len() as u64 + 1] {
            let number = u32::try_from(number).map_err(|_| ExportError::TooLarge { name, rows, columns })?;
            bytes.extend(number.to_le_bytes());
        }
        bytes.extend(name.bytes().chain([0]));
        for column in 0..columns as usize {
            let column = (0..rows as usize).map(|row| values[row * columns as usize + column]);
            column.for_each(|value| bytes.extend(value.to_le_bytes()));
        }
    }
    Ok(bytes)
}
