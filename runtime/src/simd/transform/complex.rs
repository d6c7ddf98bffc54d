//! Complex numbers in lanes: real parts in one vector, imaginary ones in another.

use super::super::channels::ChannelVector;
use super::group_lanes;

#[derive(Clone, Copy)]
pub(super) struct Complex<V> {
    pub(super) re: V,
    pub(super) im: V,
}

/// # Safety
/// As for [`Vector`](super::super::vector::Vector).
impl<V: ChannelVector> Complex<V> {
    /// A row's lanes.
    #[inline(always)]
    pub(super) unsafe fn load(row: *const V::Sample) -> Self {
        unsafe { Self { re: V::load(row), im: V::load(row.add(group_lanes::<V::Sample>())) } }
    }

    #[inline(always)]
    pub(super) unsafe fn store(self, row: *mut V::Sample) {
        unsafe {
            self.re.store(row);
            self.im.store(row.add(group_lanes::<V::Sample>()));
        }
    }

    /// The same number in all lanes.
    #[inline(always)]
    pub(super) unsafe fn splat(at: *const V::Sample) -> Self {
        unsafe { Self { re: V::splat(*at), im: V::splat(*at.add(1)) } }
    }

    #[inline(always)]
    pub(super) unsafe fn add(self, other: Self) -> Self {
        unsafe { Self { re: self.re.add(other.re), im: self.im.add(other.im) } }
    }

    #[inline(always)]
    pub(super) unsafe fn sub(self, other: Self) -> Self {
        unsafe { Self { re: self.re.sub(other.re), im: self.im.sub(other.im) } }
    }

    /// self + i other.
    #[inline(always)]
    pub(super) unsafe fn add_turned(self, other: Self) -> Self {
        unsafe { Self { re: self.re.sub(other.im), im: self.im.add(other.re) } }
    }

    /// self - i other.
    #[inline(always)]
    pub(super) unsafe fn sub_turned(self, other: Self) -> Self {
        unsafe { Self { re: self.re.add(other.im), im: self.im.sub(other.re) } }
    }

    #[inline(always)]
    pub(super) unsafe fn mul(self, w: Self) -> Self {
        unsafe {
            Self {
                re: self.im.mul_sub(w.im, self.re.mul(w.re)),
                im: self.re.mul_add(w.im, self.im.mul(w.re)),
            }
        }
    }

    /// self times the conjugate of w.
    #[inline(always)]
    pub(super) unsafe fn mul_conjugate(self, w: Self) -> Self {
        unsafe {
            Self {
                re: self.im.mul_add(w.im, self.re.mul(w.re)),
                im: self.re.mul_sub(w.im, self.im.mul(w.re)),
            }
        }
    }
}
