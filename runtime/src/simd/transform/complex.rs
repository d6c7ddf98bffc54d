//! Complex numbers in lanes: real parts in one vector, imaginary ones in another.

use super::super::vector::{Vector, group_lanes};

/// Samples of a row: real and imaginary parts.
pub(crate) const fn row_samples<T>() -> usize {
    2 * group_lanes::<T>()
}

#[derive(Clone, Copy)]
pub(super) struct Complex<V> {
    pub(super) re: V,
    pub(super) im: V,
}

impl<V: Vector> Complex<V> {
    /// A row.
    ///
    /// # Safety
    /// As for [`Vector`]; the row is there.
    #[inline(always)]
    pub(super) unsafe fn load(row: *const V::Sample) -> Self {
        // SAFETY: the caller's.
        unsafe { Self { re: V::load(row), im: V::load(row.add(V::GROUP)) } }
    }

    /// # Safety
    /// As for [`Complex::load`].
    #[inline(always)]
    pub(super) unsafe fn store(self, row: *mut V::Sample) {
        // SAFETY: the caller's.
        unsafe {
            self.re.store(row);
            self.im.store(row.add(V::GROUP));
        }
    }

    /// The number at `at` in all lanes.
    ///
    /// # Safety
    /// As for [`Vector`]; the number is there.
    #[inline(always)]
    pub(super) unsafe fn splat(at: *const V::Sample) -> Self {
        // SAFETY: the caller's.
        unsafe { Self { re: V::splat(*at), im: V::splat(*at.add(1)) } }
    }

    #[inline(always)]
    pub(super) fn add(self, other: Self) -> Self {
        Self { re: self.re.add(other.re), im: self.im.add(other.im) }
    }

    #[inline(always)]
    pub(super) fn sub(self, other: Self) -> Self {
        Self { re: self.re.sub(other.re), im: self.im.sub(other.im) }
    }

    /// self + i other.
    #[inline(always)]
    pub(super) fn add_times_i(self, other: Self) -> Self {
        Self { re: self.re.sub(other.im), im: self.im.add(other.re) }
    }

    /// self - i other.
    #[inline(always)]
    pub(super) fn sub_times_i(self, other: Self) -> Self {
        Self { re: self.re.add(other.im), im: self.im.sub(other.re) }
    }

    #[inline(always)]
    pub(super) fn mul(self, w: Self) -> Self {
        Self {
            re: self.im.neg_mul_add(w.im, self.re.mul(w.re)),
            im: self.re.mul_add(w.im, self.im.mul(w.re)),
        }
    }

    /// self times the conjugate of w.
    #[inline(always)]
    pub(super) fn mul_conjugate(self, w: Self) -> Self {
        Self {
            re: self.im.mul_add(w.im, self.re.mul(w.re)),
            im: self.re.neg_mul_add(w.im, self.im.mul(w.re)),
        }
    }
}
