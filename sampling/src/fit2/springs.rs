//! Springs between the coefficients of a fit.

use super::Direction;
use super::planes::ROWS_AT_ONCE;
use super::stencil::{Offset, Stencil};
use rayon::prelude::*;

/// Added to the diagonal of a coefficient without samples and springs.
const HELD_STIFFNESS: f32 = 1e-6;

/// Rows whose springs a thread makes in turn; those down from the two rows before are made again.
const BAND: usize = 32;

/// Springs that begin in one row, one of each kind for each coefficient p: edge (c_p - c_q)^2 to the next
/// one, and bend (c_p - 2 c_q + c_r)^2 with the next two. They are 0 where the next ones are not there.
#[derive(Debug, Clone, PartialEq)]
pub struct Springs {
    /// Weights of the first differences.
    pub edge: Vec<f32>,
    /// Weights of the second differences.
    pub bend: Vec<f32>,
}

impl Springs {
    /// None, in a row of this width.
    pub fn none(width: usize) -> Self {
        Self { edge: vec![0.0; width], bend: vec![0.0; width] }
    }
}

/// The planes of the next coefficient and of the one after it.
fn neighbours(matrix: &Stencil, direction: Direction) -> [Option<usize>; 2] {
    let offsets: [Offset; 2] = match direction {
        Direction::Across => [(1, 0), (2, 0)],
        Direction::Down => [(0, 1), (0, 2)],
    };
    offsets.map(|o| matrix.plane_of(o))
}

/// Adds the springs of a direction, which `springs` gives row by row.
pub(super) fn add(
    matrix: &mut Stencil,
    springs: &(impl Fn(Direction, usize) -> Springs + Sync),
    direction: Direction,
) {
    let [Some(next), Some(after)] = neighbours(matrix, direction) else { return };
    let grid = matrix.grid();
    let bands = matrix.planes_mut().par_bands_mut(BAND).enumerate();
    bands.for_each(|(band, rows)| {
        let first = band * BAND;
        let above = |back: usize| match first.checked_sub(back) {
            Some(y) if direction == Direction::Down => springs(direction, y),
            _ => Springs::none(grid.width),
        };
        let (mut two_above, mut one_above) = (above(2), above(1));
        for (y, row) in (first..).zip(rows) {
            let here = springs(direction, y);
            let mut row = PlaneRow { numbers: row, stride: grid.stride(), next, after };
            match direction {
                Direction::Across => row.add([0, 1, 2].map(|back| shifted(&here, back))),
                Direction::Down => {
                    let three = [here, one_above, two_above];
                    row.add(three.each_ref().map(|s| (&s.edge[..], &s.bend[..])));
                    [one_above, two_above, _] = three;
                }
            }
        }
    });
}

/// Springs that begin `back` coefficients earlier in the same row, in a row with zeros before it.
fn shifted(springs: &Springs, back: usize) -> (Vec<f32>, Vec<f32>) {
    let shift = |numbers: &[f32]| -> Vec<f32> {
        std::iter::repeat_n(&0.0, back).chain(numbers).take(numbers.len()).copied().collect()
    };
    (shift(&springs.edge), shift(&springs.bend))
}

/// A row of all planes of a matrix, and the planes of a direction.
struct PlaneRow<'a> {
    numbers: &'a mut [f32],
    stride: usize,
    next: usize,
    after: usize,
}

impl PlaneRow<'_> {
    /// Adds the edges and bends that begin at each coefficient, one before it and two before it.
    fn add<T: AsRef<[f32]>>(&mut self, [here, one, two]: [(T, T); 3]) {
        let (diagonal, others) = self.numbers.split_at_mut(self.stride);
        let (nearer, farther) = others.split_at_mut((self.after - 1) * self.stride);
        let nearer = &mut nearer[(self.next - 1) * self.stride..];
        let (g, g1) = (here.0.as_ref(), one.0.as_ref());
        let (h, h1, h2) = (here.1.as_ref(), one.1.as_ref(), two.1.as_ref());
        for x in 0..g.len() {
            diagonal[x] += g[x] + g1[x] + h[x] + 4.0 * h1[x] + h2[x];
            nearer[x] -= g[x] + 2.0 * (h[x] + h1[x]);
            farther[x] += h[x];
        }
    }
}

/// Makes the rows of coefficients without samples and springs nonsingular.
pub(super) fn hold(matrix: &mut Stencil, alone: impl Fn(usize) -> bool + Sync) {
    let width = matrix.grid().width;
    matrix.planes_mut().par_rows_mut().enumerate().with_min_len(ROWS_AT_ONCE).for_each(|(y, row)| {
        let diagonal = row[..width].iter_mut().enumerate();
        diagonal.filter(|(x, _)| alone(y * width + x)).for_each(|(_, d)| *d += HELD_STIFFNESS);
    });
}
