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
        self.add_couplings(column, &rows, sample.weight, &couplings(&down), &couplings(&across));
        for (row, down) in rows.iter().zip(down) {
            for (c, value) in sample.values.iter().enumerate() {
                let (sums, factor) = (self.rhs.at::<ORDER>(c, column, *row), sample.weight * down * value);
                (0..ORDER).for_each(|j| sums[j] += factor * across[j]);
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

    /// Adds the products of the couplings of both directions.
    #[inline(always)]
    fn add_couplings(
        &mut self,
        column: usize,
        rows: &[usize; ORDER],
        weight: f32,
        down: &Couplings<ORDER>,
        across: &Couplings<ORDER>,
    ) {
        let (reach, across) = (reach(ORDER), to_both_sides(across));
        for (i, row) in rows.iter().enumerate() {
            let mut plane = 0;
            for (rows_down, down) in down[..=reach.min(ORDER - 1 - i)].iter().enumerate() {
                // Along the row to the right only, in rows below to both sides.
                let left = if rows_down == 0 { 0 } else { reach };
                let factor = weight * down[i];
                for across in &across[MOST_REACH - left..=MOST_REACH + reach] {
                    let sums = self.matrix.at::<ORDER>(plane, column, *row);
                    (0..ORDER).for_each(|j| sums[j] += factor * across[j]);
                    plane += 1;
                }
            }
        }
    }
}

/// Splines beside each one with which it is coupled.
pub(super) const fn reach(order: usize) -> usize {
    order / 2
}

/// That of bicubic splines.
const MOST_REACH: usize = reach(4);

/// Couplings of the splines around a position in one direction: `[k][j]` is that of splines j and j + k.
type Couplings<const ORDER: usize> = [[f32; ORDER]; MOST_REACH + 1];

/// The third difference of four numbers.
const THIRD: [f32; 4] = [-1.0, 3.0, -3.0, 1.0];

/// b b' for the values b of the splines. Of four splines the first and the last would be coupled by
/// b_0 b_3 <= 1 / 2304. The square of the third difference d in this proportion takes that coupling away:
/// b b' + b_0 b_3 d d' is definite too and has half as many entries in two directions. Coefficients of
/// polynomials of degree 2 have no third difference.
#[inline(always)]
fn couplings<const ORDER: usize>(b: &[f32; ORDER]) -> Couplings<ORDER> {
    let share = if ORDER == 4 { b[0] * b[3] } else { 0.0 };
    let coupling = |j: usize, k: usize| b[j] * b[k] + share * THIRD[j] * THIRD[k];
    let of = |k, j| if j + k < ORDER { coupling(j, j + k) } else { 0.0 };
    std::array::from_fn(|k| std::array::from_fn(|j| of(k, j)))
}

/// Couplings with the splines [`MOST_REACH`] to the left first, and to the right last.
#[inline(always)]
fn to_both_sides<const ORDER: usize>(right: &Couplings<ORDER>) -> [[f32; ORDER]; 2 * MOST_REACH + 1] {
    std::array::from_fn(|place| match place.checked_sub(MOST_REACH) {
        Some(k) => right[k],
        None => {
            let k = MOST_REACH - place;
            std::array::from_fn(|j| if j >= k { right[k][j - k] } else { 0.0 })
        }
    })
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
