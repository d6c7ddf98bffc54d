//! LQ factorisations, which compress a square root without squaring it.

use super::{CMat, Mat, owned, view};

/// Lower trapezoidal `L` (rows x min(rows, cols)) with `L L' = m m'`, by a QR factorisation of `m'`. It
/// compresses a square root without squaring it.
pub fn lq_factor(m: &Mat) -> Mat {
    if m.is_empty() {
        return Mat::zeros(m.nrows(), m.nrows().min(m.ncols()));
    }
    let qr = view(m).transpose().qr();
    owned(qr.thin_R()).transpose()
}

/// Thin `(L, Q)` with `m = L Q`, `Q Q' = I`.
pub fn lq(m: &Mat) -> (Mat, Mat) {
    if m.is_empty() {
        let k = m.nrows().min(m.ncols());
        return (Mat::zeros(m.nrows(), k), Mat::zeros(k, m.ncols()));
    }
    let qr = view(m).transpose().qr();
    (owned(qr.thin_R()).transpose(), owned(qr.compute_thin_Q().as_ref()).transpose())
}

/// Complex counterpart of [`lq_factor`]: `L L* = m m*`.
pub fn lq_factor_c(m: &CMat) -> CMat {
    if m.is_empty() {
        return CMat::zeros(m.nrows(), m.nrows().min(m.ncols()));
    }
    let qr = view(&m.adjoint()).qr();
    owned(qr.thin_R()).adjoint()
}

/// Complex counterpart of [`lq`]: thin `(L, Q)` with `m = L Q`, `Q Q* = I`.
pub fn lq_c(m: &CMat) -> (CMat, CMat) {
    if m.is_empty() {
        let k = m.nrows().min(m.ncols());
        return (CMat::zeros(m.nrows(), k), CMat::zeros(k, m.ncols()));
    }
    let qr = view(&m.adjoint()).qr();
    (owned(qr.thin_R()).adjoint(), owned(qr.compute_thin_Q().as_ref()).adjoint())
}
