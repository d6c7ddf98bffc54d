//! Matrices from blocks: side by side, on top of one another, and along the diagonal.

use nalgebra::{ComplexField, DMatrix};

/// `[p_1 p_2 ..]`: the `parts` side by side. No parts give a 0 x 0 matrix.
///
/// # Panics
/// If the numbers of rows differ.
pub fn hstack<T: ComplexField>(parts: &[&DMatrix<T>]) -> DMatrix<T> {
    let rows = parts.first().map_or(0, |first| first.nrows());
    let mut whole = DMatrix::zeros(rows, parts.iter().map(|m| m.ncols()).sum());
    let mut start = 0;
    for part in parts {
        whole.columns_mut(start, part.ncols()).copy_from(part);
        start += part.ncols();
    }
    whole
}

/// `[p_1; p_2; ..]`: the `parts` on top of one another, the first one uppermost. No parts give a 0 x 0
/// matrix.
///
/// # Panics
/// If the numbers of columns differ.
pub fn vstack<T: ComplexField>(parts: &[&DMatrix<T>]) -> DMatrix<T> {
    let columns = parts.first().map_or(0, |first| first.ncols());
    let mut whole = DMatrix::zeros(parts.iter().map(|m| m.nrows()).sum(), columns);
    let mut start = 0;
    for part in parts {
        whole.rows_mut(start, part.nrows()).copy_from(part);
        start += part.nrows();
    }
    whole
}

/// The matrix of the given rows of blocks, `from_blocks(&[&[&a, &b], &[&c, &d]]) = [a b; c d]`.
///
/// # Panics
/// If the blocks of a row differ in their numbers of rows, or the rows in their widths.
pub fn from_blocks<T: ComplexField>(rows: &[&[&DMatrix<T>]]) -> DMatrix<T> {
    let rows: Vec<DMatrix<T>> = rows.iter().map(|row| hstack(row)).collect();
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
