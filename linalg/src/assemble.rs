//! Matrices from blocks: side by side, on top of one another, and along the diagonal.

use super::LinalgError;
use nalgebra::{ComplexField, DMatrix};

/// `[p_1 p_2 ..]`: the `parts` side by side. No parts give a 0 x 0 matrix.
///
/// # Errors
/// [`LinalgError::Sizes`] if the numbers of rows differ.
pub fn hstack<T: ComplexField>(parts: &[&DMatrix<T>]) -> Result<DMatrix<T>, LinalgError> {
    let Some(first) = parts.first() else { return Ok(DMatrix::zeros(0, 0)) };
    check("hstack", "rows", parts, |m| m.nrows())?;
    let mut whole = DMatrix::zeros(first.nrows(), parts.iter().map(|m| m.ncols()).sum());
    let mut start = 0;
    for part in parts {
        whole.columns_mut(start, part.ncols()).copy_from(part);
        start += part.ncols();
    }
    Ok(whole)
}

/// `[p_1; p_2; ..]`: the `parts` on top of one another, the first one uppermost. No parts give a 0 x 0
/// matrix.
///
/// # Errors
/// [`LinalgError::Sizes`] if the numbers of columns differ.
pub fn vstack<T: ComplexField>(parts: &[&DMatrix<T>]) -> Result<DMatrix<T>, LinalgError> {
    let Some(first) = parts.first() else { return Ok(DMatrix::zeros(0, 0)) };
    check("vstack", "columns", parts, |m| m.ncols())?;
    let mut whole = DMatrix::zeros(parts.iter().map(|m| m.nrows()).sum(), first.ncols());
    let mut start = 0;
    for part in parts {
        whole.rows_mut(start, part.nrows()).copy_from(part);
        start += part.nrows();
    }
    Ok(whole)
}

/// The matrix of the given rows of blocks, `from_blocks(&[&[&a, &b], &[&c, &d]]) = [a b; c d]`.
///
/// # Errors
/// [`LinalgError::Sizes`] if the blocks of a row differ in their numbers of rows, or the rows in their
/// widths.
pub fn from_blocks<T: ComplexField>(rows: &[&[&DMatrix<T>]]) -> Result<DMatrix<T>, LinalgError> {
    let rows = rows.iter().map(|row| hstack(row)).collect::<Result<Vec<_>, _>>()?;
    vstack(&rows.iter().collect::<Vec<_>>())
}

/// `diag(p_1, p_2, ..)`: the `parts` along the diagonal, zeros elsewhere. Parts without rows or without
/// columns take up columns or rows only.
pub fn block_diagonal<T: ComplexField>(parts: &[&DMatrix<T>]) -> DMatrix<T> {
    let (rows, cols) = parts.iter().fold((0, 0), |(r, c), m| (r + m.nrows(), c + m.ncols()));
    let mut whole = DMatrix::zeros(rows, cols);
    let mut start = (0, 0);
    for part in parts {
        whole.view_mut(start, part.shape()).copy_from(part);
        start = (start.0 + part.nrows(), start.1 + part.ncols());
    }
    whole
}

/// Every part has the size of the first one, as `size` counts it.
fn check<T>(
    operation: &'static str,
    shared: &'static str,
    parts: &[&DMatrix<T>],
    size: impl Fn(&DMatrix<T>) -> usize,
) -> Result<(), LinalgError> {
    let shape = |m: &DMatrix<T>| (m.nrows(), m.ncols());
    match parts.iter().find(|part| size(part) != size(parts[0])) {
        None => Ok(()),
        Some(other) => {
            Err(LinalgError::Sizes { operation, shared, first: shape(parts[0]), other: shape(other) })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Mat;

    fn numbered(rows: usize, cols: usize, start: f64) -> Mat {
        Mat::from_fn(rows, cols, |i, j| start + (10 * i + j) as f64)
    }

    #[test]
    fn every_entry_of_a_block_matrix_is_where_its_block_is() {
        for (r1, r2, c1, c2) in [(1, 1, 1, 1), (2, 3, 1, 4), (0, 2, 3, 0), (2, 0, 0, 2), (0, 0, 1, 2)] {
            let [a, b, c, d] = [(r1, c1), (r1, c2), (r2, c1), (r2, c2)]
                .map(|(rows, cols)| numbered(rows, cols, 1000.0 * rows as f64 + 100.0 * cols as f64));
            let whole = from_blocks(&[&[&a, &b], &[&c, &d]]).unwrap();
            assert_eq!(whole.shape(), (r1 + r2, c1 + c2));
            let entry = |i: usize, j: usize| match (i < r1, j < c1) {
                (true, true) => a[(i, j)],
                (true, false) => b[(i, j - c1)],
                (false, true) => c[(i - r1, j)],
                (false, false) => d[(i - r1, j - c1)],
            };
            assert_eq!(whole, Mat::from_fn(r1 + r2, c1 + c2, entry));
        }
    }

    #[test]
    fn a_block_diagonal_matrix_acts_on_each_part_alone() {
        let (a, b, c) = (numbered(2, 1, 1.0), numbered(0, 3, 0.0), numbered(1, 2, 5.0));
        let x = numbered(6, 1, 0.5);
        let parts = [&a * x.rows(0, 1), &b * x.rows(1, 3), &c * x.rows(4, 2)];
        let apart = vstack(&parts.each_ref()).unwrap();
        assert_eq!(block_diagonal(&[&a, &b, &c]) * x, apart);
    }

    #[test]
    fn sizes_that_do_not_fit_are_both_named() {
        let error = hstack(&[&numbered(2, 3, 0.0), &numbered(2, 1, 0.0), &numbered(4, 5, 0.0)]).unwrap_err();
        assert!(error.to_string().contains("2x3 and 4x5"), "{error}");
        assert!(vstack(&[&numbered(2, 3, 0.0), &numbered(3, 2, 0.0)]).is_err());
    }
}
