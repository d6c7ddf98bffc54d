//! Samples enter the normal equations, into some rows of an image.

use super::super::kernel::BSpline;
use super::planes::RowsMut;

/// A sample of an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fit2Sample<const C: usize> {
    /// Column, in pixels.
    pub x: f64,
    /// Row, in pixels.
    pub y: f64,
    /// Values.
    pub values: [f32; C],
    /// Weight w >= 0.
    pub weight: f32,
}

/// Some rows of the equations of a [`Fit2`](super::Fit2). Rows that do not overlap take samples at the same
/// time.
#[derive(Debug)]
pub struct Fit2Rows<'a, const ORDER: usize, const C: usize> {
    size: (usize, usize),
    /// The first row.
    first: usize,
    matrix: RowsMut<'a>,
    rhs: RowsMut<'a>,
}

impl<'a, const ORDER: usize, const C: usize> Fit2Rows<'a, ORDER, C> {
    pub(super) fn new(size: (usize, usize), matrix: RowsMut<'a>, rhs: RowsMut<'a>) -> Self {
        Self { size, first: 0, matrix, rhs }
    }

    /// The rows before row `row` of the image, and the rest.
    ///
    /// # Panics
    /// If the row lies above the first of these.
    pub fn split_at(self, row: usize) -> (Self, Self) {
        let (size, first) = (self.size, self.first);
        // Below the image there are more coefficients.
        let rows = if row < size.1 { row - first } else { usize::MAX };
        let (matrix, rhs) = (self.matrix.split_at(rows), self.rhs.split_at(rows));
        (
            Self { size, first, matrix: matrix.0, rhs: rhs.0 },
            Self { size, first: row, matrix: matrix.1, rhs: rhs.1 },
        )
    }

    /// Adds a sample, whose position is moved into the image. It changes its own row and the ORDER - 1 rows
    /// below it; they must be among these rows.
    ///
    /// # Panics
    /// If they are not.
    // A call would pass the sample through memory.
    #[inline(always)]
    pub fn add(&mut self, sample: &Fit2Sample<C>) {
        let (column, across) = span::<ORDER>(sample.x, self.size.0);
        let (row, down) = span::<ORDER>(sample.y, self.size.1);
        let rows = self.rows_from(row);
        let weighted = self.add_couplings(column, &rows, &product(&down, &across), sample.weight);
        for (row, own) in rows.iter().zip(&weighted) {
            for (c, value) in sample.values.iter().enumerate() {
                let sums = self.rhs.at::<ORDER>(c, column, *row);
                (0..ORDER).for_each(|j| sums[j] += own[j] * value);
            }
        }
    }

    /// The ORDER rows of coefficients from `row` on, counted from the first of these. An image of one row
    /// has one less, and 0 is added to its last one instead.
    #[inline(always)]
    fn rows_from(&self, row: usize) -> [usize; ORDER] {
        let last = self.size.1.max(1) + ORDER - 3;
        std::array::from_fn(|i| (row + i).min(last) - self.first)
    }

    /// Adds weight b b', b the values of the splines from a coefficient on; returns weight b.
    #[inline(always)]
    fn add_couplings(
        &mut self,
        column: usize,
        rows: &[usize; ORDER],
        b: &Tensor<ORDER>,
        weight: f32,
    ) -> Tensor<ORDER> {
        let weighted = b.map(|row| row.map(|b| weight * b));
        for (i, own) in weighted.iter().enumerate() {
            let mut plane = 0;
            for other in &b[i..] {
                // Along the row to the right only, in rows below to both sides.
                let left = if plane == 0 { 0 } else { ORDER - 1 };
                for shift in 0..ORDER + left {
                    let couplings = self.matrix.at::<ORDER>(plane, column, rows[i]);
                    for j in 0..ORDER {
                        if (left..left + ORDER).contains(&(j + shift)) {
                            couplings[j] += own[j] * other[j + shift - left];
                        }
                    }
                    plane += 1;
                }
            }
        }
        weighted
    }
}

/// A number for each of the splines around a position, row by row.
type Tensor<const ORDER: usize> = [[f32; ORDER]; ORDER];

#[inline(always)]
fn product<const ORDER: usize>(down: &[f32; ORDER], across: &[f32; ORDER]) -> Tensor<ORDER> {
    down.map(|d| across.map(|a| d * a))
}

/// First coefficient around a position, which is moved into a row of `length` pixels, and the weights of the
/// splines there.
#[inline(always)]
fn span<const ORDER: usize>(position: f64, length: usize) -> (usize, [f32; ORDER]) {
    let position = position.clamp(0.0, length.saturating_sub(1) as f64);
    // The cast cuts toward zero: rounding functions are library calls on baseline x86-64, and casts of 64
    // bits take several instructions.
    let first = (position as u32).min(length.saturating_sub(2) as u32);
    let weights = BSpline::<ORDER>::in_span(position - f64::from(first));
    (first as usize, weights.map(|w| w as f32))
}
