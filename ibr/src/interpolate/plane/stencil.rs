//! The symmetric matrix of the plane fit: a stencil of nine pixels and four more two steps away, one half
//! stored.

use rayon::prelude::*;
use std::cmp::Ordering;

/// Entries of one pixel: its diagonal and the couplings to the right, down, down-right and down-left, and to
/// the pixels two to the right and two down.
///
/// f32 suffices: rounding an entry changes the fit by parts in 10^7 of the grey range, and these entries
/// take most of the memory of the plane fit. All arithmetic is in f64.
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
}

impl Stencil {
    pub(super) fn new(width: usize, height: usize) -> Self {
        Self { width, height, entries: vec![Couplings::default(); width * height] }
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

    /// Adds g (u_p - u_{p+1})^2.
    pub(super) fn add_edge_right(&mut self, p: usize, g: f32) {
        self.entries[p].own += g;
        self.entries[p].right -= g;
        self.entries[p + 1].own += g;
    }

    /// Adds g (u_p - u_{p+width})^2.
    pub(super) fn add_edge_down(&mut self, p: usize, g: f32) {
        self.entries[p].own += g;
        self.entries[p].down -= g;
        self.entries[p + self.width].own += g;
    }

    /// Adds h (u_{p-1} - 2 u_p + u_{p+1})^2, p - 1 being `first`.
    pub(super) fn add_bend_right(&mut self, first: usize, h: f32) {
        self.add_bend(first, 1, h, |e| &mut e.right, |e| &mut e.right_two);
    }

    /// Adds h (u_{p-width} - 2 u_p + u_{p+width})^2, p - width being `first`.
    pub(super) fn add_bend_down(&mut self, first: usize, h: f32) {
        self.add_bend(first, self.width, h, |e| &mut e.down, |e| &mut e.down_two);
    }

    fn add_bend(
        &mut self,
        first: usize,
        stride: usize,
        h: f32,
        one: fn(&mut Couplings) -> &mut f32,
        two: fn(&mut Couplings) -> &mut f32,
    ) {
        for (k, share) in [1.0, 4.0, 1.0].into_iter().enumerate() {
            self.entries[first + k * stride].own += share * h;
        }
        *one(&mut self.entries[first]) -= 2.0 * h;
        *one(&mut self.entries[first + stride]) -= 2.0 * h;
        *two(&mut self.entries[first]) += h;
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
    pub(super) fn diagonal(&self, p: usize) -> f64 {
        f64::from(self.entries[p].own)
    }

    /// out = A u, and u . A u. Rows in parallel; the dot product is summed row by row in order.
    pub(super) fn multiply(&self, u: &[f64], out: &mut [f64], partial: &mut [f64]) -> f64 {
        let width = self.width;
        out.par_chunks_exact_mut(width).zip(partial.par_iter_mut()).enumerate().with_min_len(8).for_each(
            |(y, (out, dot))| {
                self.multiply_row(y, u, out);
                let row = &u[y * width..(y + 1) * width];
                *dot = row.iter().zip(out.iter()).map(|(a, b)| a * b).sum();
            },
        );
        partial.iter().sum()
    }

    fn multiply_row(&self, y: usize, u: &[f64], out: &mut [f64]) {
        let width = self.width;
        let start = y * width;
        let here = &u[start..start + width];
        let e = &self.entries[start..start + width];
        for x in 0..width {
            out[x] = f64::from(e[x].own) * here[x];
        }
        for x in 1..width {
            out[x - 1] += f64::from(e[x - 1].right) * here[x];
            out[x] += f64::from(e[x - 1].right) * here[x - 1];
        }
        for x in 2..width {
            out[x - 2] += f64::from(e[x - 2].right_two) * here[x];
            out[x] += f64::from(e[x - 2].right_two) * here[x - 2];
        }
        if y + 2 < self.height {
            let below = &u[start + 2 * width..start + 3 * width];
            for x in 0..width {
                out[x] += f64::from(e[x].down_two) * below[x];
            }
        }
        if y > 1 {
            let above = &u[start - 2 * width..start - width];
            let e = &self.entries[start - 2 * width..start - width];
            for x in 0..width {
                out[x] += f64::from(e[x].down_two) * above[x];
            }
        }
        if y + 1 < self.height {
            let below = &u[start + width..start + 2 * width];
            for x in 0..width {
                out[x] += f64::from(e[x].down) * below[x];
            }
            for x in 1..width {
                out[x - 1] += f64::from(e[x - 1].down_right) * below[x];
                out[x] += f64::from(e[x].down_left) * below[x - 1];
            }
        }
        if y > 0 {
            let above = &u[start - width..start];
            let e = &self.entries[start - width..start];
            for x in 0..width {
                out[x] += f64::from(e[x].down) * above[x];
            }
            for x in 1..width {
                out[x] += f64::from(e[x - 1].down_right) * above[x - 1];
                out[x - 1] += f64::from(e[x].down_left) * above[x];
            }
        }
    }
}
