//! The Newton matrix of the taps: Toeplitz plus Hankel in the lags for each pair of taps.
//!
//! With `X_l = S_l^{-1}`, the dual `Z_l`, and `u` for a row of the taps and `v` for a channel (the
//! LMI's second block mapped through `h_l`), the entry for the taps (p,i,j), (p',i',j') is
//!
//! ```text
//! Re sum_l e^{-i w (j-j')} ( Xvv[i,i'] Zuu[p',p] + Xuu[p',p] Zvv[i,i'] )
//!  + e^{-i w (j+j')} ( Xvu[i,p'] Zvu[i',p] + Xvu[i',p] Zvu[i,p'] ).
//! ```

use super::fourier::{LagPhasors, Layout};
use super::prepare::Reduced;
use hybank_linalg::blocks::{Batch, BatchView, inner};
use hybank_linalg::{Complex, Mat};

/// A family of Hermitian matrices, projected on the rows (u) and channels (v).
#[derive(Debug, Clone)]
pub(super) struct ChannelProjection {
    pub(super) uu: Batch,
    pub(super) vu: Batch,
    pub(super) vv: Batch,
}

impl ChannelProjection {
    /// Projects the blocks `x` of order m + k through the channels `h` (n x k).
    pub(super) fn new(x: &Batch, h: &Batch) -> Self {
        let (count, n, k, m) = (x.count(), h.rows(), h.cols(), x.rows() - h.cols());
        let (mut uu, mut vu) = (Batch::zeros(count, m, m), Batch::zeros(count, n, m));
        let (mut vv, mut half) = (Batch::zeros(count, n, n), Batch::zeros(1, n, k));
        for l in 0..count {
            let (full, h) = (x.block(l), h.block(l));
            copy(full.part(0, 0, m, m), uu.block_mut(l).data);
            vu.block_mut(l).set_product(1.0, h.plain(), full.part(m, 0, k, m).plain());
            half.block_mut(0).set_product(1.0, h.plain(), full.part(m, m, k, k).plain());
            vv.block_mut(l).set_product(1.0, half.block(0).plain(), h.adjoint());
        }
        Self { uu, vu, vv }
    }
}

fn copy(from: BatchView<'_>, to: &mut [Complex<f64>]) {
    for j in 0..from.cols {
        for i in 0..from.rows {
            to[i + j * from.rows] = from.at(i, j);
        }
    }
}

/// Adds the tap-tap part to the lower triangle of `matrix`.
pub(super) fn add_taps(
    matrix: &mut Mat,
    layout: &Layout,
    phases: &LagPhasors,
    x: &ChannelProjection,
    z: &ChannelProjection,
) {
    let (n, count) = (layout.channels, x.uu.count());
    let mut toeplitz = Mat::zeros(n * n, 2 * count);
    let mut hankel = Mat::zeros(n * n, 2 * count);
    // Rows without lags have no taps.
    let with_taps = |p: &usize| layout.lags[*p] > 0;
    for p in (0..layout.rows).filter(with_taps) {
        for p2 in (0..=p).filter(with_taps) {
            for l in 0..count {
                let (xl, zl) = (ProjectionAt::new(x, l), ProjectionAt::new(z, l));
                for i2 in 0..n {
                    for i in 0..n {
                        let t = xl.vv.at(i, i2) * zl.uu.at(p2, p) + xl.uu.at(p2, p) * zl.vv.at(i, i2);
                        let h = xl.vu.at(i, p2) * zl.vu.at(i2, p) + xl.vu.at(i2, p) * zl.vu.at(i, p2);
                        put(&mut toeplitz, i + n * i2, l, count, t);
                        put(&mut hankel, i + n * i2, l, count, h);
                    }
                }
            }
            add_toeplitz(matrix, layout, phases, (p, p2), &toeplitz);
            add_hankel(matrix, layout, phases, (p, p2), &hankel);
        }
    }
}

struct ProjectionAt<'a> {
    uu: BatchView<'a>,
    vu: BatchView<'a>,
    vv: BatchView<'a>,
}

impl<'a> ProjectionAt<'a> {
    fn new(s: &'a ChannelProjection, l: usize) -> Self {
        Self { uu: s.uu.block(l), vu: s.vu.block(l), vv: s.vv.block(l) }
    }
}

fn put(data: &mut Mat, r: usize, l: usize, count: usize, z: Complex<f64>) {
    data[(r, l)] = z.re;
    data[(r, count + l)] = z.im;
}

/// Row and corner of the unknown t: `-Re sum_l e^{-i w j} (Xvu Zuu + Zvu Xuu)_{i,p}` and
/// `Re sum_l tr(Xuu Zuu)`.
pub(super) fn border(reduced: &Reduced, x: &ChannelProjection, z: &ChannelProjection) -> (Vec<f64>, f64) {
    let (n, m) = (reduced.layout.channels, reduced.layout.rows);
    let mut mixed = Batch::zeros(1, n, m);
    let mut e = Batch::zeros(reduced.count(), m, n);
    let mut corner = 0.0;
    for l in 0..reduced.count() {
        let (xl, zl) = (ProjectionAt::new(x, l), ProjectionAt::new(z, l));
        mixed.block_mut(0).set_product(-1.0, xl.vu.plain(), zl.uu.plain());
        mixed.block_mut(0).add_product(-1.0, zl.vu.plain(), xl.uu.plain());
        let to = e.block_mut(l).data;
        (0..m * n).for_each(|a| to[a] = mixed.block(0).at(a / m, a % m).conj());
        corner += inner(xl.uu.data, zl.uu.data);
    }
    (reduced.layout.gather(&reduced.phases.adjoint_sum(&e)), corner)
}

/// Adds `2 sum_l weights_l Re e^{-i w (j-j')} (h h*)_{i,i'}` within each row: the second derivative of
/// the weighted mean square.
pub(super) fn add_mean_square(
    matrix: &mut Mat,
    layout: &Layout,
    phases: &LagPhasors,
    h: &Batch,
    weights: &[f64],
) {
    let (n, count) = (layout.channels, h.count());
    let mut gram = Batch::zeros(1, n, n);
    let mut data = Mat::zeros(n * n, 2 * count);
    for (l, weight) in weights.iter().enumerate() {
        gram.block_mut(0).set_product(2.0 * weight, h.block(l).plain(), h.block(l).adjoint());
        for (r, z) in gram.as_slice().iter().enumerate() {
            put(&mut data, r, l, count, *z);
        }
    }
    for p in 0..layout.rows {
        add_toeplitz(matrix, layout, phases, (p, p), &data);
    }
}

fn add_toeplitz(matrix: &mut Mat, layout: &Layout, phases: &LagPhasors, (p, p2): (usize, usize), data: &Mat) {
    let n = layout.channels;
    let (jp, jp2) = (layout.lags[p], layout.lags[p2]);
    let (even, odd) = phases.split_sum(data, jp.max(jp2));
    each_pair(layout, (p, p2), |row, col, j, j2, r| {
        let sum =
            if j >= j2 { even[(r, j - j2)] + odd[(r, j - j2)] } else { even[(r, j2 - j)] - odd[(r, j2 - j)] };
        matrix[(row, col)] += sum;
    });
    assert_eq!(data.nrows(), n * n);
}

fn add_hankel(matrix: &mut Mat, layout: &Layout, phases: &LagPhasors, (p, p2): (usize, usize), data: &Mat) {
    let lags = (layout.lags[p] + layout.lags[p2]).max(1) - 1;
    let sums = phases.sum(data, lags);
    each_pair(layout, (p, p2), |row, col, j, j2, r| matrix[(row, col)] += sums[(r, j + j2)]);
}

/// All unknowns of row `p` against all of row `p2`; `r` is the entry i + n i' of the pair of channels.
fn each_pair(
    layout: &Layout,
    (p, p2): (usize, usize),
    mut visit: impl FnMut(usize, usize, usize, usize, usize),
) {
    let n = layout.channels;
    for j2 in 0..layout.lags[p2] {
        for i2 in 0..n {
            let col = layout.index(p2, j2, i2);
            for j in 0..layout.lags[p] {
                for i in 0..n {
                    visit(layout.index(p, j, i), col, j, j2, i + n * i2);
                }
            }
        }
    }
}
