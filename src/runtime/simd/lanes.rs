//! Vectors whose lanes hold frames as they lie in memory, and the fixed order in which lanes are added.
//!
//! A *group* is 32 bytes: 8 lanes of f32, 4 of f64. A window of D samples (D divides the group)
//! fills D neighbouring lanes, so that a group holds group / D ticks. Sums over the D lanes of a tick are
//! trees of a fixed shape, (l0 + l2) + (l1 + l3) for four lanes, and the lower half plus the upper
//! half for eight; they do not depend on the instruction set.

/// A group of lanes; [`Lanes`] vectors consist of one or two.
///
/// # Safety
/// As for [`Lanes`].
pub(super) trait Group: Copy {
    type Sample: Copy;
    /// For each pair of lanes: a0 + a1, b0 + b1, a2 + a3, b2 + b3 ...
    unsafe fn neighbours(a: Self, b: Self) -> Self;
    /// For each four lanes: the sum of those of a, of b, of c, of d.
    unsafe fn quads(sums: [Self; 4]) -> Self;
    unsafe fn store(self, at: *mut Self::Sample);
}

/// A register of one or two groups.
///
/// # Safety
/// The methods of a type may only run on a processor that has its instruction set, and inside a
/// function compiled for it (or else they are calls instead of instructions). Memory is touched as
/// said for each method.
pub(super) trait Lanes: Copy {
    type Sample: Copy + Default + PartialEq + std::ops::Add<Output = Self::Sample>;
    type Group: Group<Sample = Self::Sample>;
    /// Lanes of a group.
    const GROUP: usize;
    /// Groups of the register.
    const GROUPS: usize;
    /// Registers that sums may take such that inputs and coefficients fit beside them.
    const SUMS: usize;
    unsafe fn zero() -> Self;
    /// D samples from `at`, again and again.
    unsafe fn spread<const D: usize>(at: *const Self::Sample) -> Self;
    /// A group from `at`; the second one follows at once if D is less than a group, and from
    /// `at + hop` otherwise.
    unsafe fn windows<const D: usize>(at: *const Self::Sample, hop: usize) -> Self;
    /// self * factor + sum, rounded once.
    unsafe fn mul_add(self, factor: Self, sum: Self) -> Self;
    unsafe fn group(self, index: usize) -> Self::Group;
    /// The loop of a tile of 4 phases times 3 vectors, for sets whose registers it fills to the last one:
    /// `steps` >= 1 steps from the newest window on, vectors `stride` samples apart. `None` leaves it to
    /// the compiler.
    #[inline(always)]
    unsafe fn full_tile<const D: usize>(
        _x: *const Self::Sample,
        _stride: usize,
        _coefficients: *const Self::Sample,
        _steps: usize,
    ) -> Option<[[Self; 3]; 4]> {
        None
    }
}

/// L lanes as an array, which the compiler turns into whatever vectors the architecture has.
#[derive(Clone, Copy)]
pub(super) struct Plain<T, const L: usize>([T; L]);

/// True where a fused multiply-add is an instruction of every processor of the target.
const FUSED: bool = cfg!(any(target_arch = "aarch64", target_feature = "fma"));

macro_rules! plain {
    ($sample:ty, $lanes:literal) => {
        impl Group for Plain<$sample, $lanes> {
            type Sample = $sample;

            #[inline(always)]
            unsafe fn neighbours(a: Self, b: Self) -> Self {
                Self(std::array::from_fn(|l| {
                    let Self(v) = if l % 2 == 0 { a } else { b };
                    v[l & !1] + v[l | 1]
                }))
            }

            #[inline(always)]
            unsafe fn quads(sums: [Self; 4]) -> Self {
                Self(std::array::from_fn(|l| {
                    let (Self(v), from) = (sums[l % 4], l & !3);
                    (v[from] + v[from + 2]) + (v[from + 1] + v[from + 3])
                }))
            }

            #[inline(always)]
            unsafe fn store(self, at: *mut $sample) {
                unsafe { at.cast::<[$sample; $lanes]>().write_unaligned(self.0) }
            }
        }

        impl Lanes for Plain<$sample, $lanes> {
            type Sample = $sample;
            type Group = Self;
            const GROUP: usize = $lanes;
            const GROUPS: usize = 1;
            const SUMS: usize = 4;

            #[inline(always)]
            unsafe fn zero() -> Self {
                Self([0.0; $lanes])
            }

            #[inline(always)]
            unsafe fn spread<const D: usize>(at: *const $sample) -> Self {
                Self(std::array::from_fn(|l| unsafe { *at.add(l % D) }))
            }

            #[inline(always)]
            unsafe fn windows<const D: usize>(at: *const $sample, _: usize) -> Self {
                Self(unsafe { at.cast::<[$sample; $lanes]>().read_unaligned() })
            }

            #[inline(always)]
            unsafe fn mul_add(self, factor: Self, sum: Self) -> Self {
                Self(std::array::from_fn(|l| {
                    let (a, b, c) = (self.0[l], factor.0[l], sum.0[l]);
                    if FUSED { a.mul_add(b, c) } else { a * b + c }
                }))
            }

            #[inline(always)]
            unsafe fn group(self, _: usize) -> Self {
                self
            }
        }
    };
}

plain!(f32, 8);
plain!(f64, 4);
