//! Orthonormal bases of the range of the taps, for least squares and for dual matrices that are exactly
//! orthogonal to every tap.

use super::prepare::Reduced;
use crate::lmi::settings::SETTINGS;
use hybank_linalg::blocks::Batch;
use hybank_linalg::{LinalgError, Mat, Svd};

/// The map from one row's taps to that row of `F(omega_l) h_l`, as a QR factorisation that serves all
/// numbers of lags (columns are ordered by lag), with an SVD of each triangle in use.
#[derive(Debug, Clone)]
pub(super) struct Basis {
    q: Mat,
    triangles: Vec<(usize, Svd)>,
    weights: Vec<f64>,
    /// Rows below the responses, whose reference is zero.
    zero_rows: usize,
}

impl Basis {
    /// `weights[l]` multiplies the row entries at point l.
    /// The taps of original channel i, times `noise[i]`, are further rows whose reference is zero.
    pub(super) fn new(reduced: &Reduced, weights: Vec<f64>, noise: &[f64]) -> Result<Self, LinalgError> {
        let map = row_map(reduced, &weights, noise);
        let zero_rows = map.nrows() - 2 * reduced.h.cols() * reduced.count();
        let (l, q) = hybank_linalg::lq(&map.transpose());
        let (q, r) = (q.transpose(), l.transpose());
        let mut triangles: Vec<(usize, Svd)> = Vec::new();
        for &lags in reduced.layout.lags.iter().filter(|lags| **lags > 0) {
            if triangles.iter().all(|(have, _)| *have != lags) {
                let cols = reduced.layout.channels * lags;
                let rows = cols.min(r.nrows());
                triangles.push((lags, hybank_linalg::svd(&r.view((0, 0), (rows, cols)).into_owned())?));
            }
        }
        Ok(Self { q, triangles, weights, zero_rows })
    }

    /// The triangle for a number of lags; none for a row without taps.
    fn triangle(&self, lags: usize) -> Option<&Svd> {
        self.triangles.iter().find(|(have, _)| *have == lags).map(|(_, svd)| svd)
    }

    /// `1 / sigma_min` of the map from one row's taps to responses (the longest row counts: the others
    /// are restrictions of it); infinite unless the map is injective beyond rounding errors.
    pub(super) fn inverse_norm(&self) -> f64 {
        let longest = self.triangles.iter().max_by_key(|(lags, _)| *lags).map(|(_, svd)| svd);
        let Some(svd) = longest else { return 0.0 };
        match (svd.s.first(), svd.s.last()) {
            (Some(most), Some(least))
                if svd.s.len() == svd.v.nrows() && *least > SETTINGS.injective * most =>
            {
                1.0 / least
            }
            _ => f64::INFINITY,
        }
    }

    /// Taps of all rows that minimise `sum_l weights_l^2 ||w_l - F h_l||_F^2`, least norm among
    /// directions weaker than `cut` times the strongest.
    pub(super) fn least_squares(&self, reduced: &Reduced, w: &Batch, cut: f64) -> Vec<f64> {
        let mut x = vec![0.0; reduced.layout.unknowns()];
        for p in 0..reduced.layout.rows {
            let Some(svd) = self.triangle(reduced.layout.lags[p]) else { continue };
            let (u, kept) = (&svd.u, svd.rank(cut));
            let component =
                self.q.columns(0, u.nrows()).tr_mul(&row_vector(w, p, &self.weights, self.zero_rows));
            let mut c = u.columns(0, kept).tr_mul(&component);
            for (value, s) in c.iter_mut().zip(&svd.s) {
                *value /= s;
            }
            let solution = svd.v.columns(0, kept) * c;
            x[reduced.layout.range(p)].copy_from_slice(solution.as_slice());
        }
        x
    }

    /// Makes each row of `y` orthogonal to the range of its taps, in two passes for the last digits. Needs a
    /// basis with unit weights.
    pub(super) fn project_out(&self, reduced: &Reduced, y: &mut Batch, cut: f64) {
        for p in 0..reduced.layout.rows {
            let Some(svd) = self.triangle(reduced.layout.lags[p]) else { continue };
            let u = svd.u.columns(0, svd.rank(cut));
            let q = self.q.columns(0, svd.u.nrows());
            let mut row = row_vector(y, p, &self.weights, self.zero_rows);
            for _ in 0..2 {
                let image = u * u.tr_mul(&q.tr_mul(&row));
                row -= q * image;
            }
            set_row(y, p, &row);
        }
    }
}

/// Rows: real parts of all (point, input), then imaginary parts, then the noise of all (lag, channel with
/// noise). Columns: lag by lag, channels inside.
fn row_map(reduced: &Reduced, weights: &[f64], noise: &[f64]) -> Mat {
    let (n, k, lags) = (reduced.layout.channels, reduced.h.cols(), reduced.phases.lags());
    let half = k * reduced.count();
    let noisy: Vec<usize> = (0..noise.len()).filter(|&i| noise[i] > 0.0).collect();
    let mut map = Mat::zeros(2 * half + noisy.len() * lags, n * lags);
    for a in 0..n * lags {
        for r in 0..half {
            let (l, c) = (r / k, r % k);
            let z = reduced.phases.phase(l, a / n) * reduced.h.block(l).at(a % n, c) * weights[l];
            map[(r, a)] = z.re;
            map[(half + r, a)] = z.im;
        }
        for (s, &i) in noisy.iter().enumerate() {
            map[(2 * half + noisy.len() * (a / n) + s, a)] = noise[i] * reduced.mix[(a % n, i)];
        }
    }
    map
}

fn row_vector(y: &Batch, p: usize, weights: &[f64], zero_rows: usize) -> Mat {
    let (k, half) = (y.cols(), y.cols() * y.count());
    Mat::from_fn(2 * half + zero_rows, 1, |r, _| {
        if r >= 2 * half {
            return 0.0;
        }
        let (l, c) = ((r % half) / k, r % k);
        let z = y.block(l).at(p, c) * weights[l];
        if r < half { z.re } else { z.im }
    })
}

fn set_row(y: &mut Batch, p: usize, row: &Mat) {
    let (m, k, half) = (y.rows(), y.cols(), y.cols() * y.count());
    for l in 0..y.count() {
        let block = y.block_mut(l);
        for c in 0..k {
            block.data[p + m * c].re = row[l * k + c];
            block.data[p + m * c].im = row[half + l * k + c];
        }
    }
}
