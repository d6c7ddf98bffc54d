//! Springs between the coefficients of a fit.

use super::Direction;
use super::planes::ROWS_AT_ONCE;
use super::stencil::{Offset, Stencil};
use rayon::prelude::*;

/// Added to the diagonal of a coefficient without samples and springs.
const HELD: f32 = 1e-6;

/// Springs in one direction, one of each kind for each coefficient p: edge (c_p - c_q)^2 to the next one,
/// and bend (c_p - 2 c_q + c_r)^2 with the next two. They are 0 where the next ones are not there.
#[derive(Debug, Clone, PartialEq)]
pub struct Springs {
    /// Weights of the first differences.
    pub edge: Vec<f32>,
    /// Weights of the second differences.
    pub bend: Vec<f32>,
}

/// The planes of the next coefficient and of the one after it.
fn neighbours(matrix: &Stencil, direction: Direction) -> [Option<usize>; 2] {
    let offsets: [Offset; 2] = match direction {
        Direction::Across => [(1, 0), (2, 0)],
        Direction::Down => [(0, 1), (0, 2)],
    };
    offsets.map(|o| matrix.plane_of(o))
}

/// Adds the springs of a direction.
pub(super) fn add(matrix: &mut Stencil, springs: &Springs, direction: Direction) {
    let [Some(next), Some(after)] = neighbours(matrix, direction) else { return };
    let grid = matrix.grid();
    let (width, stride) = (grid.width, grid.stride());
    let rows = matrix.planes_mut().par_rows_mut().enumerate().with_min_len(ROWS_AT_ONCE);
    rows.for_each(|(y, row)| {
        let (diagonal, others) = row.split_at_mut(stride);
        let (one, two) = others.split_at_mut((after - 1) * stride);
        let one = &mut one[(next - 1) * stride..];
        let before = |springs: &[f32], back: usize| shifted(springs, width, y, back, direction);
        let (g, g1) = (before(&springs.edge, 0), before(&springs.edge, 1));
        let (h, h1, h2) = (before(&springs.bend, 0), before(&springs.bend, 1), before(&springs.bend, 2));
        for x in 0..width {
            diagonal[x] += g[x] + g1[x] + h[x] + 4.0 * h1[x] + h2[x];
            one[x] -= g[x] + 2.0 * (h[x] + h1[x]);
            two[x] += h[x];
        }
    });
}

/// Springs of row y that begin `back` coefficients earlier; 0 where none does.
fn shifted(springs: &[f32], width: usize, y: usize, back: usize, direction: Direction) -> Vec<f32> {
    let row = |y: usize| &springs[y * width..(y + 1) * width];
    match direction {
        Direction::Across => std::iter::repeat_n(&0.0, back).chain(row(y)).take(width).copied().collect(),
        Direction::Down if y >= back => row(y - back).to_vec(),
        Direction::Down => vec![0.0; width],
    }
}

/// Makes the rows of coefficients without samples and springs nonsingular.
pub(super) fn hold(matrix: &mut Stencil, alone: impl Fn(usize) -> bool + Sync) {
    let width = matrix.grid().width;
    matrix.planes_mut().par_rows_mut().enumerate().with_min_len(ROWS_AT_ONCE).for_each(|(y, row)| {
        let diagonal = row[..width].iter_mut().enumerate();
        diagonal.filter(|(x, _)| alone(y * width + x)).for_each(|(_, d)| *d += HELD);
    });
}
