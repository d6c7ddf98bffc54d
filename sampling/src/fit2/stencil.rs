//! A symmetric matrix that couples each coefficient of a grid to its neighbours, one half stored.

use super::planes::{BlocksMut, Grid, LANES, LaneBlocks, Planes, ROWS_AT_ONCE, blocks, blocks_mut};
use rayon::prelude::*;

/// Columns to the right (negative: left) and rows down to a neighbour that comes later in memory.
pub(super) type Offset = (isize, usize);

/// The neighbours within `reach` columns and rows that come later in memory, the coefficient itself first.
pub(super) fn half_square(reach: usize) -> impl Iterator<Item = Offset> {
    let reach_left = reach as isize;
    let columns = move |row: usize| if row == 0 { 0 } else { -reach_left }..=reach_left;
    (0..=reach).flat_map(move |row| columns(row).map(move |column| (column, row)))
}

/// The same as far as a grid has them: one of few rows has no neighbours farther down.
fn couplings_within(reach: usize, grid: Grid) -> impl Iterator<Item = Offset> {
    half_square(reach).filter(move |offset| offset.1 < grid.height)
}

/// A = sum_k (a_k shifted by o_k, and its transpose): plane k holds the couplings of each coefficient with
/// the one at offset k, plane 0 the diagonal. f32 suffices: rounding an entry changes the fit by parts in
/// 10^7 of the range of the values, and these entries take most of the memory.
#[derive(Debug, Clone)]
pub(super) struct Stencil {
    offsets: Vec<Offset>,
    planes: Planes,
    /// A row of zeros, in place of rows above and below the grid.
    zeros: Vec<f32>,
}

impl Stencil {
    /// The matrix 0 with these couplings, of which the first is that of a coefficient with itself.
    pub(super) fn new(grid: Grid, offsets: Vec<Offset>) -> Self {
        let planes = Planes::zeros(grid, offsets.len());
        Self { offsets, planes, zeros: vec![0.0; grid.stride()] }
    }

    pub(super) fn grid(&self) -> Grid {
        self.planes.grid()
    }

    pub(super) fn planes_mut(&mut self) -> &mut Planes {
        &mut self.planes
    }

    /// The plane of an offset.
    pub(super) fn plane_of(&self, offset: Offset) -> Option<usize> {
        self.offsets.iter().position(|o| *o == offset)
    }

    /// Diagonal of a row, with its zeros to the right.
    pub(super) fn diagonal_row(&self, y: usize) -> &[f32] {
        let start = self.planes.start(y, 0);
        &self.planes.data()[start..start + self.grid().stride()]
    }

    /// out = A u in all channels, and u . A u of each. Rows in parallel; the products are summed row by row
    /// in order.
    pub(super) fn multiply<const C: usize>(&self, u: &Planes, out: &mut Planes) -> [f64; C] {
        let mut products = vec![[0.0; C]; self.grid().height];
        let rows = out.par_rows_mut().zip(&mut products).enumerate().with_min_len(ROWS_AT_ONCE);
        rows.for_each(|(y, (out, product))| *product = self.multiply_row(y, u, out));
        total(&products)
    }

    /// One row of the product: the diagonal, then the couplings that a coefficient stores and those that
    /// earlier ones store, two offsets at a time.
    fn multiply_row<const C: usize>(&self, y: usize, u: &Planes, out: &mut [f32]) -> [f64; C] {
        let stride = self.grid().stride();
        std::array::from_fn(|c| {
            let out = blocks_mut(&mut out[c * stride..(c + 1) * stride]);
            let here = self.row_from(u, Some(u.start(y, c)));
            set_product(out, blocks(self.diagonal_row(y)), here);
            for k in (1..self.offsets.len()).step_by(2) {
                let [one, two] = [k, k + 1].map(|k| self.pair(y, k, u, c));
                add_products(out, [one[0], one[1], two[0], two[1]]);
            }
            dot(out, here)
        })
    }

    /// A row's couplings at offset k, and the coefficients of channel c that they belong to: those that the
    /// row stores, and those that an earlier row does. Zeros if there is no offset k or no such row.
    #[inline]
    fn pair<'a>(
        &'a self,
        y: usize,
        k: usize,
        u: &'a Planes,
        c: usize,
    ) -> [(LaneBlocks<'a>, LaneBlocks<'a>); 2] {
        let a = |start| self.row_from(&self.planes, start);
        let Some(offset) = self.offsets.get(k) else { return [(a(None), a(None)); 2] };
        let (entry, ahead) = (self.planes.start(y, k), u.after(y, c, *offset));
        let (earlier, behind) = (self.planes.before(y, k, *offset), u.before(y, c, *offset));
        [(a(Some(entry)), self.row_from(u, ahead)), (a(earlier), self.row_from(u, behind))]
    }

    /// The row of some images that begins there, zeros if there is none.
    #[inline]
    fn row_from<'a>(&'a self, planes: &'a Planes, start: Option<usize>) -> LaneBlocks<'a> {
        blocks(start.map_or(&self.zeros[..], |start| &planes.data()[start..start + self.zeros.len()]))
    }

    /// A 1, the sums of the rows of A, for one row of the grid and its zeros.
    pub(super) fn row_sums(&self, y: usize, sums: &mut [f32]) {
        sums.fill(0.0);
        let mut add = |start: usize| {
            let row = self.row_from(&self.planes, Some(start));
            for (sum, a) in blocks_mut(sums).iter_mut().zip(row) {
                (0..LANES).for_each(|l| sum[l] += a[l]);
            }
        };
        for (k, offset) in self.offsets.iter().enumerate() {
            add(self.planes.start(y, k));
            if k > 0 {
                self.planes.before(y, k, *offset).into_iter().for_each(&mut add);
            }
        }
    }

    /// The matrix of blocks of 2 x 2 coefficients that move together: the sums of the entries between the
    /// blocks.
    pub(super) fn coarsened(&self) -> Self {
        let height = self.grid().height;
        let reach = self.offsets.iter().map(|o| o.0.unsigned_abs().max(o.1)).max().unwrap_or(0).div_ceil(2);
        let grid = self.grid().halved();
        let mut coarse = Self::new(grid, couplings_within(reach, grid).collect());
        for y in 0..height {
            for (k, (columns, rows)) in self.offsets.iter().enumerate() {
                let row = self.planes.row(y, k);
                for (x, coupling) in row.iter().enumerate().filter(|(_, a)| **a != 0.0) {
                    let other = x.wrapping_add_signed(*columns);
                    coarse.couple([x / 2, y / 2], [other / 2, (y + rows) / 2], *coupling, k == 0);
                }
            }
        }
        coarse
    }

    /// Adds a coupling between two coefficients, twice to the diagonal if they are one.
    fn couple(&mut self, a: [usize; 2], b: [usize; 2], coupling: f32, diagonal: bool) {
        let (first, second) = if (a[1], a[0]) <= (b[1], b[0]) { (a, b) } else { (b, a) };
        let offset = (second[0] as isize - first[0] as isize, second[1] - first[1]);
        let times = if offset == (0, 0) && !diagonal { 2.0 } else { 1.0 };
        if let Some(k) = self.plane_of(offset) {
            self.planes.row_mut(first[1], k)[first[0]] += times * coupling;
        }
    }
}

/// out = a u.
#[inline]
fn set_product(out: BlocksMut<'_>, a: LaneBlocks<'_>, u: LaneBlocks<'_>) {
    for ((out, a), u) in out.iter_mut().zip(a).zip(u) {
        (0..LANES).for_each(|l| out[l] = a[l] * u[l]);
    }
}

/// out += a u for four rows of a and u: sums pass through the registers once for four products.
#[inline]
fn add_products(out: BlocksMut<'_>, terms: [(LaneBlocks<'_>, LaneBlocks<'_>); 4]) {
    let n = out.len();
    let [(a0, u0), (a1, u1), (a2, u2), (a3, u3)] = terms.map(|(a, u)| (&a[..n], &u[..n]));
    for b in 0..n {
        for l in 0..LANES {
            let sum = a0[b][l] * u0[b][l] + a1[b][l] * u1[b][l];
            out[b][l] += sum + (a2[b][l] * u2[b][l] + a3[b][l] * u3[b][l]);
        }
    }
}

/// u . v along a row.
#[inline]
pub(super) fn dot(u: LaneBlocks<'_>, v: LaneBlocks<'_>) -> f64 {
    let mut sums = [0.0; LANES];
    for (u, v) in u.iter().zip(v) {
        (0..LANES).for_each(|l| sums[l] += u[l] * v[l]);
    }
    sum(sums)
}

/// The sum of some numbers in double precision.
#[inline]
pub(super) fn sum(numbers: [f32; LANES]) -> f64 {
    numbers.iter().map(|v| f64::from(*v)).sum()
}

/// The sum of partial sums in all channels.
pub(super) fn total<const C: usize>(partial: &[[f64; C]]) -> [f64; C] {
    partial.iter().fold([0.0; C], |sum, part| std::array::from_fn(|c| sum[c] + part[c]))
}
