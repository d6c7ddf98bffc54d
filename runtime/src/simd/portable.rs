//! One lane group as an array, which the compiler turns into whatever vectors the architecture has.

use super::vector::{Vector, VectorNumber};

/// L lanes of T, 32 bytes.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(32))]
pub(crate) struct Portable<T, const L: usize>(pub(super) [T; L]);

impl<T, const L: usize> Vector for Portable<T, L>
where
    T: VectorNumber,
{
    type Sample = T;
    const LANES: usize = L;
    // 16 registers of 16 bytes hold 8 groups.
    const SUMS: usize = 4;

    #[inline(always)]
    unsafe fn splat(value: T) -> Self {
        Self([value; L])
    }

    #[inline(always)]
    unsafe fn load(at: *const T) -> Self {
        Self(at.cast::<[T; L]>().read_unaligned())
    }

    #[inline(always)]
    unsafe fn store(self, at: *mut T) {
        at.cast::<[T; L]>().write_unaligned(self.0)
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(std::array::from_fn(|l| self.0[l] + other.0[l]))
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, sum: Self) -> Self {
        Self(std::array::from_fn(|l| self.0[l].mul_add(factor.0[l], sum.0[l])))
    }
}
