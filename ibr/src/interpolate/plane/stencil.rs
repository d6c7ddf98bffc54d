//! The symmetric matrix of the plane fit: a stencil of nine pixels and four more two steps away, one half
//! stored.

use rayon::prelude::*;
use std::cmp::Ordering;

/// Entries of one pixel: its diagonal and the couplings to the right, down, down-right and down-left, and to
/// the pixels two to the right and two down.
///
/// f32 suffices: rounding an entry changes the fit by parts in 10^7 of the grey range, and these entries
/// take most of the memory of the plane fit.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Couplings {
    own: f32,
    right: f32,
    down: f32,
    down_right: f32,
    down_left: f32,
    right_two: f32,
    down_two: f32,
}

impl Couplings {
    /// The couplings to the next pixel and the one after it, to the right or down.
    fn towards(&mut self, down: bool) -> (&mut f32, &mut f32) {
        if down { (&mut self.down, &mut self.down_two) } else { (&mut self.right, &mut self.right_two) }
    }
}

/// Upper left pixel of the cell around a position in an image, and the weights of its four corners (upper
/// left, upper right, lower left, lower right).
pub(super) fn bilinear((width, height): (usize, usize), x: f64, y: f64) -> (usize, [f32; 4]) {
    let column = (x as usize).min(width.saturating_sub(2));
    let row = (y as usize).min(height.saturating_sub(2));
    let (s, t) = (x - column as f64, y - row as f64);
    let weights = [(1.0 - s) * (1.0 - t), s * (1.0 - t), (1.0 - s) * t, s * t];
    (row * width + column, weights.map(|w| w as f32))
}

/// The corners of a cell that exist, with their weights; an image one pixel wide has no right corners.
pub(super) fn corners(
    (width, height): (usize, usize),
    pixel: usize,
    weights: &[f32; 4],
) -> impl Iterator<Item = (usize, f32)> + use<> {
    let right = if width > 1 { 1 } else { 0 };
    let down = if height > 1 { width } else { 0 };
    let corners = [pixel, pixel + right, pixel + down, pixel + down + right];
    // A missing corner coincides with an existing one; its weight is 0.
    corners.into_iter().zip(*weights).filter(|(_, w)| *w != 0.0)
}

/// Adds the products of the four bilinear weights of a sample, times its own weight.
pub(super) fn add_sample(entries: &mut [Couplings], width: usize, pixel: usize, w: &[f32; 4], weight: f32) {
    let v = w.map(|w| weight * w);
    entries[pixel].own += v[0] * w[0];
    entries[pixel].right += v[0] * w[1];
    entries[pixel].down += v[0] * w[2];
    entries[pixel].down_right += v[0] * w[3];
    if w[1] != 0.0 || w[3] != 0.0 {
        let e = &mut entries[pixel + 1];
        e.own += v[1] * w[1];
        e.down_left += v[1] * w[2];
        e.down += v[1] * w[3];
    }
    if w[2] != 0.0 || w[3] != 0.0 {
        let e = &mut entries[pixel + width];
        e.own += v[2] * w[2];
        e.right += v[2] * w[3];
    }
    if w[3] != 0.0 {
        entries[pixel + width + 1].own += v[3] * w[3];
    }
}

/// The matrix A = B^T B + edges over the pixels of one image.
#[derive(Debug, Clone)]
pub(super) struct Stencil {
    width: usize,
    height: usize,
    entries: Vec<Couplings>,
    /// A row without couplings.
    none: Vec<Couplings>,
}

impl Stencil {
    pub(super) fn new(width: usize, height: usize) -> Self {
        let entries = vec![Couplings::default(); width * height];
        Self { width, height, entries, none: vec![Couplings::default(); width] }
    }

    /// The entries, which [`add_sample`] fills.
    pub(super) fn entries(&mut self) -> &mut [Couplings] {
        &mut self.entries
    }

    /// Row sum of the sample part, the total weight of the samples at a pixel. Valid before any edge is
    /// added.
    pub(super) fn sample_weight(&self, p: usize) -> f32 {
        let at = |q: Option<usize>| q.and_then(|q| self.entries.get(q)).copied().unwrap_or_default();
        let e = self.entries[p];
        let up = p.checked_sub(self.width);
        e.own
            + e.right
            + e.down
            + e.down_right
            + e.down_left
            + at(p.checked_sub(1)).right
            + at(up).down
            + at(up.and_then(|q| q.checked_sub(1))).down_right
            + at(up.map(|q| q + 1)).down_left
    }

    /// Adds edge_p (u_p - u_{p+s})^2 + bend_p (u_p - 2 u_{p+s} + u_{p+2s})^2 for all pixels p, s being one
    /// pixel to the right or a row down. Both are 0 where p + s or p + 2 s is not there.
    pub(super) fn add_springs(&mut self, edge: &[f32], bend: &[f32], down: bool) {
        let (stride, width) = (if down { self.width } else { 1 }, self.width);
        let at = |values: &[f32], p: Option<usize>| p.map_or(0.0, |p| values[p]);
        self.entries.par_chunks_mut(width).enumerate().with_min_len(8).for_each(|(y, row)| {
            for (x, e) in row.iter_mut().enumerate() {
                let p = y * width + x;
                let (one, two) = (p.checked_sub(stride), p.checked_sub(2 * stride));
                let (g, h, before) = (edge[p], bend[p], at(bend, one));
                e.own += g + at(edge, one) + h + 4.0 * before + at(bend, two);
                let (next, after) = e.towards(down);
                *next -= g + 2.0 * (h + before);
                *after += h;
            }
        });
    }

    /// Makes the row of a pixel without samples and edges nonsingular.
    pub(super) fn isolate(&mut self, p: usize) {
        self.entries[p].own += 1e-6;
    }

    /// The matrix of blocks of 2 x 2 pixels that move together: the sums of the entries between the blocks.
    pub(super) fn coarsened(&self) -> Self {
        let mut coarse = Self::new(self.width.div_ceil(2), self.height.div_ceil(2));
        for (p, e) in self.entries.iter().enumerate() {
            coarse.entries[self.block(p)].own += e.own;
            let neighbours = [
                (1, e.right),
                (self.width, e.down),
                (self.width + 1, e.down_right),
                (self.width.wrapping_sub(1), e.down_left),
                (2, e.right_two),
                (2 * self.width, e.down_two),
            ];
            for (offset, coupling) in neighbours.into_iter().filter(|n| n.1 != 0.0) {
                coarse.couple(self.block(p), self.block(p + offset), coupling);
            }
        }
        coarse
    }

    /// Adds a coupling between two of the nine neighbours, or to the diagonal if they coincide.
    fn couple(&mut self, a: usize, b: usize, coupling: f32) {
        let (first, second) = (a.min(b), a.max(b));
        let e = &mut self.entries[first];
        let columns = (first % self.width, second % self.width);
        match (second / self.width - first / self.width, columns.0.cmp(&columns.1)) {
            (0, Ordering::Equal) => e.own += 2.0 * coupling,
            (0, _) => e.right += coupling,
            (_, Ordering::Equal) => e.down += coupling,
            (_, Ordering::Less) => e.down_right += coupling,
            (_, Ordering::Greater) => e.down_left += coupling,
        }
    }

    /// The block of a pixel in the coarsened matrix.
    pub(super) fn block(&self, p: usize) -> usize {
        (p / self.width / 2) * self.width.div_ceil(2) + p % self.width / 2
    }

    /// Pixels of the image.
    pub(super) fn pixels(&self) -> usize {
        self.entries.len()
    }

    /// Columns of the image.
    pub(super) fn width(&self) -> usize {
        self.width
    }

    /// Rows of the image.
    pub(super) fn rows(&self) -> usize {
        self.height
    }

    /// Diagonal entry of a pixel.
    pub(super) fn diagonal(&self, p: usize) -> f32 {
        self.entries[p].own
    }

    /// out = A u in all channels, and u . A u of each. Rows in parallel; the products are summed row by row
    /// in order.
    pub(super) fn multiply<const L: usize>(
        &self,
        u: &[[f32; L]],
        out: &mut [[f32; L]],
        partial: &mut [[f64; L]],
    ) -> [f64; L] {
        let width = self.width;
        out.par_chunks_exact_mut(width).zip(partial.par_iter_mut()).enumerate().with_min_len(8).for_each(
            |(y, (out, dot))| {
                self.multiply_row(y, u, out);
                let (u, mut x) = (&u[y * width..(y + 1) * width], 0);
                *dot = [0.0; L];
                while x < width {
                    add_product(dot, &u[x], &out[x], 1.0);
                    x += 1;
                }
            },
        );
        total(partial)
    }

    /// One row of the product. A pixel gathers the couplings that it stores and those that the pixels above
    /// and to the left store; couplings across the border of the image are 0.
    fn multiply_row<const L: usize>(&self, y: usize, u: &[[f32; L]], out: &mut [[f32; L]]) {
        let (width, start) = (self.width, y * self.width);
        let (e, here) = (&self.entries[start..start + width], &u[start..start + width]);
        let (up, above) = self.earlier(y, 1, u);
        let (up_two, above_two) = self.earlier(y, 2, u);
        // Below the last row all couplings are 0, so any row will do.
        let below = if y + 1 < self.height { &u[start + width..start + 2 * width] } else { here };
        let below_two = if y + 2 < self.height { &u[start + 2 * width..start + 3 * width] } else { here };
        let out = &mut out[..width];
        let mut x = 0;
        while x < width {
            let c = &e[x];
            let mut sum = [0.0; L];
            add(&mut sum, c.own, &here[x]);
            add(&mut sum, c.down, &below[x]);
            add(&mut sum, c.down_two, &below_two[x]);
            add(&mut sum, up[x].down, &above[x]);
            add(&mut sum, up_two[x].down_two, &above_two[x]);
            if x > 0 {
                add(&mut sum, e[x - 1].right, &here[x - 1]);
                add(&mut sum, c.down_left, &below[x - 1]);
                add(&mut sum, up[x - 1].down_right, &above[x - 1]);
            }
            if x > 1 {
                add(&mut sum, e[x - 2].right_two, &here[x - 2]);
            }
            if x + 1 < width {
                add(&mut sum, c.right, &here[x + 1]);
                add(&mut sum, c.down_right, &below[x + 1]);
                add(&mut sum, up[x + 1].down_left, &above[x + 1]);
            }
            if x + 2 < width {
                add(&mut sum, c.right_two, &here[x + 2]);
            }
            out[x] = sum;
            x += 1;
        }
    }

    /// Entries and values of a row above; entries of 0 and some row where there is none.
    fn earlier<'a, const L: usize>(
        &'a self,
        y: usize,
        rows: usize,
        u: &'a [[f32; L]],
    ) -> (&'a [Couplings], &'a [[f32; L]]) {
        let width = self.width;
        match y.checked_sub(rows) {
            Some(y) => (&self.entries[y * width..(y + 1) * width], &u[y * width..(y + 1) * width]),
            None => (&self.none, &u[..width]),
        }
    }
}

/// sum += coupling * u in all channels. A loop without an iterator, here and below: these are the innermost
/// loops, and in builds with little optimisation iterators are calls.
#[inline(always)]
fn add<const L: usize>(sum: &mut [f32; L], coupling: f32, u: &[f32; L]) {
    let mut c = 0;
    while c < L {
        sum[c] += coupling * u[c];
        c += 1;
    }
}

/// sum += factor u v in all channels.
#[inline(always)]
pub(super) fn add_product<const L: usize>(sum: &mut [f64; L], u: &[f32; L], v: &[f32; L], factor: f32) {
    let mut c = 0;
    while c < L {
        sum[c] += (u[c] * v[c] * factor) as f64;
        c += 1;
    }
}

/// The sum of partial sums in all channels.
pub(super) fn total<const L: usize>(partial: &[[f64; L]]) -> [f64; L] {
    partial.iter().fold([0.0; L], |sum, part| std::array::from_fn(|c| sum[c] + part[c]))
}
