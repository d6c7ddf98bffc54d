//! Sums over the points with the phases of the lags, as real matrix products.

use hybank_linalg::blocks::Batch;
use hybank_linalg::{Complex, Mat};

/// Cosines (rows 0..L) and sines (rows L..2L) of `omega_l k`, k = 0 .. 2J-2.
#[derive(Debug, Clone)]
pub(super) struct LagPhasors {
    table: Mat,
    count: usize,
    lags: usize,
}

impl LagPhasors {
    /// For the frequencies `omega` and lags 0 .. `lags - 1`.
    pub(super) fn new(omega: &[f64], lags: usize) -> Self {
        let count = omega.len();
        let table = Mat::from_fn(2 * count, (2 * lags).max(2) - 1, |row, k| {
            let angle = omega[row % count] * k as f64;
            if row < count { angle.cos() } else { angle.sin() }
        });
        Self { table, count, lags }
    }

    /// Largest number of lags.
    pub(super) fn lags(&self) -> usize {
        self.lags
    }

    /// `e^{-i omega_l k}`.
    pub(super) fn phase(&self, l: usize, k: usize) -> Complex<f64> {
        Complex::new(self.table[(l, k)], -self.table[(self.count + l, k)])
    }

    /// `sum_l cos(omega_l k) data[:, l] + sin(omega_l k) data[:, L + l]` for k = 0 .. `lags - 1`,
    /// which is `Re sum_l e^{-i omega_l k} g_l` when the columns hold `Re g_l` and `Im g_l`.
    pub(super) fn sum(&self, data: &Mat, lags: usize) -> Mat {
        data * self.table.columns(0, lags)
    }

    /// The cosine and the sine part of [`LagPhasors::sum`] apart: their sum belongs to the lag k, their
    /// difference to -k.
    pub(super) fn split_sum(&self, data: &Mat, lags: usize) -> (Mat, Mat) {
        let part = |first| data.columns(first, self.count) * self.table.view((first, 0), (self.count, lags));
        (part(0), part(self.count))
    }

    /// `Re sum_l e^{+i omega_l k} e_l` for every entry of the blocks, as an (entries x lags) matrix.
    pub(super) fn adjoint_sum(&self, e: &Batch) -> Mat {
        let size = e.rows() * e.cols();
        let entry = |r: usize, l: usize| e.as_slice()[l * size + r];
        let data = Mat::from_fn(size, 2 * self.count, |r, c| {
            if c < self.count { entry(r, c).re } else { -entry(r, c - self.count).im }
        });
        self.sum(&data, self.lags)
    }

    /// `out_l = sum_k e^{-i omega_l k} coefficients[:, k]`, entry by entry.
    pub(super) fn response(&self, coefficients: &Mat, out: &mut Batch) {
        let size = out.rows() * out.cols();
        let values = coefficients * self.table.columns(0, self.lags).transpose();
        for l in 0..self.count {
            for (r, z) in out.as_mut_slice()[l * size..(l + 1) * size].iter_mut().enumerate() {
                z.re = values[(r, l)];
                z.im = -values[(r, self.count + l)];
            }
        }
    }
}

/// Which unknown is which tap: row p owns `channels * lags[p]` consecutive unknowns, lag by lag.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Layout {
    pub(super) rows: usize,
    pub(super) channels: usize,
    pub(super) lags: Vec<usize>,
    offsets: Vec<usize>,
}

impl Layout {
    pub(super) fn new(channels: usize, lags: &[usize]) -> Self {
        let mut offsets = vec![0];
        for (p, j) in lags.iter().enumerate() {
            offsets.push(offsets[p] + channels * j);
        }
        Self { rows: lags.len(), channels, lags: lags.to_vec(), offsets }
    }

    /// Number of unknown taps.
    pub(super) fn unknowns(&self) -> usize {
        self.offsets[self.rows]
    }

    /// Index of the unknown tap of row `p`, lag `j`, channel `i`.
    pub(super) fn index(&self, p: usize, j: usize, i: usize) -> usize {
        self.offsets[p] + j * self.channels + i
    }

    /// The unknowns of row `p`.
    pub(super) fn range(&self, p: usize) -> std::ops::Range<usize> {
        self.offsets[p]..self.offsets[p + 1]
    }

    /// From an (entries x lags) matrix, entry = p + rows * i, to the vector of unknowns.
    pub(super) fn gather(&self, coefficients: &Mat) -> Vec<f64> {
        let mut x = vec![0.0; self.unknowns()];
        self.each(|p, j, i, a| x[a] = coefficients[(p + self.rows * i, j)]);
        x
    }

    /// The inverse of [`Layout::gather`], zero where there is no unknown.
    pub(super) fn scatter(&self, x: &[f64]) -> Mat {
        let lags = self.lags.iter().copied().max().unwrap_or(0);
        let mut c = Mat::zeros(self.rows * self.channels, lags);
        self.each(|p, j, i, a| c[(p + self.rows * i, j)] = x[a]);
        c
    }

    fn each(&self, mut visit: impl FnMut(usize, usize, usize, usize)) {
        for p in 0..self.rows {
            for j in 0..self.lags[p] {
                for i in 0..self.channels {
                    visit(p, j, i, self.index(p, j, i));
                }
            }
        }
    }
}
