//! The vector trait: all that algorithms know of an instruction set.
//!
//! A *lane group* is 32 bytes: 8 lanes of f32, 4 of f64. A vector is one group or two. Its lanes hold
//! samples as they lie in memory, D lanes for each frame or segment, where D divides the group.
//!
//! Sums over the D lanes of a frame are trees of a fixed shape: (l0 + l2) + (l1 + l3) for four lanes, the
//! sum of the lower half plus that of the upper half for eight. They do not depend on the instruction set.
//!
//! Two or four phases lie along diagonals: lane l of the p-th sum belongs to phase (l + p) mod 2 or 4. So
//! the sums come out in the order of the phases and fewer lanes have to be blended. Of three phases the
//! first two do.

use std::fmt::Debug;
use std::ops::{Add, Div, Mul, Neg, Rem, Sub};

/// A sample type: f32 or f64.
pub(crate) trait VectorNumber:
    bytemuck::Pod
    + Default
    + Debug
    + PartialEq
    + Send
    + Sync
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Rem<Output = Self>
    + Neg<Output = Self>
    + From<f32>
    + Into<f64>
    + 'static
{
    /// self * factor + sum; rounded once where that is an instruction of every processor of the target.
    fn mul_add(self, factor: Self, sum: Self) -> Self;
    /// Neither NaN nor infinite.
    fn is_finite(self) -> bool;
}

/// True where a fused multiply-add is an instruction of every processor of the target. In software it would
/// be forty times slower.
pub(super) const FUSED: bool = cfg!(any(target_arch = "aarch64", target_feature = "fma"));

macro_rules! number {
    ($sample:ty) => {
        impl VectorNumber for $sample {
            #[inline(always)]
            fn mul_add(self, factor: Self, sum: Self) -> Self {
                if FUSED { <$sample>::mul_add(self, factor, sum) } else { self * factor + sum }
            }

            #[inline(always)]
            fn is_finite(self) -> bool {
                <$sample>::is_finite(self)
            }
        }
    };
}

number!(f32);
number!(f64);

/// Lanes of a group.
pub(crate) const fn group_lanes<T>() -> usize {
    32 / size_of::<T>()
}

/// Lanes of the widest vector.
pub(super) const MOST_LANES: usize = 16;

/// A vector of samples: one lane group or two.
///
/// A value exists only in code that is compiled for its instruction set and runs on a processor that has it,
/// because all that makes a value of nothing is unsafe. So arithmetic on values is safe.
///
/// An instruction set must implement memory access and arithmetic. All else has a default that goes through
/// memory, and a set overrides it where it has an instruction for it.
///
/// # Safety
/// Functions that are unsafe may run only in code compiled for the instruction set, on a processor that has
/// it. A pointer to read must be valid for as many samples as the function is said to take from there on,
/// one to write for as many as it stores; neither needs an alignment.
pub(crate) trait Vector: Copy {
    /// The type of a lane.
    type Sample: VectorNumber;
    /// Lanes of the vector.
    const LANES: usize;
    /// Lanes of a group.
    const GROUP: usize = group_lanes::<Self::Sample>();
    /// Groups of the vector.
    const GROUPS: usize = Self::LANES / Self::GROUP;
    /// Vectors of sums in registers such that inputs and coefficients fit beside them.
    const SUMS: usize;

    /// The same value in all lanes.
    unsafe fn splat(value: Self::Sample) -> Self;
    /// All lanes: reads LANES samples from `at` on.
    unsafe fn load(at: *const Self::Sample) -> Self;
    /// All lanes: writes LANES samples from `at` on.
    unsafe fn store(self, at: *mut Self::Sample);
    /// self + other.
    fn add(self, other: Self) -> Self;
    /// self * factor + sum, rounded once.
    fn mul_add(self, factor: Self, sum: Self) -> Self;

    /// All lanes zero.
    #[inline(always)]
    unsafe fn zero() -> Self {
        Self::splat(Self::Sample::default())
    }

    /// The lanes as an array, of which the first [`Vector::LANES`] mean something.
    #[inline(always)]
    fn to_array(self) -> [Self::Sample; MOST_LANES] {
        let mut lanes = [Self::Sample::default(); MOST_LANES];
        // SAFETY: the array has room for the widest vector, and the set is there because `self` exists.
        unsafe { self.store(lanes.as_mut_ptr()) };
        lanes
    }

    /// The vector whose lane l is `lane(l)`.
    #[inline(always)]
    unsafe fn from_fn(lane: impl Fn(usize) -> Self::Sample) -> Self {
        let mut lanes = [Self::Sample::default(); MOST_LANES];
        for (l, slot) in lanes.iter_mut().enumerate().take(Self::LANES) {
            *slot = lane(l);
        }
        // The array holds the lanes of the widest vector.
        Self::load(lanes.as_ptr())
    }

    /// Neither NaN nor infinity in any lane.
    #[inline(always)]
    fn finite(self) -> bool {
        self.to_array()[..Self::LANES].iter().all(|value| value.is_finite())
    }

    /// D samples from `at` in the lanes of every frame.
    #[inline(always)]
    unsafe fn broadcast<const D: usize>(at: *const Self::Sample) -> Self {
        Self::from_fn(|l| *at.add(l % D))
    }

    /// Frames of D lanes, the first at `at`: a group of them, then, if there is a second group, those that
    /// follow if D is less than a group, or else the frame at `at + hop`.
    #[inline(always)]
    unsafe fn frames<const D: usize>(at: *const Self::Sample, _hop: usize) -> Self {
        const { assert!(Self::GROUPS == 1) };
        Self::load(at)
    }

    /// For each two lanes: a0 + b1, a1 + b0.
    #[inline(always)]
    fn diagonal_pairs(a: Self, b: Self) -> Self {
        let (a, b) = (a.to_array(), b.to_array());
        // SAFETY: the arguments exist.
        unsafe { Self::from_fn(|l| a[l] + b[l ^ 1]) }
    }

    /// For each four lanes: the sum of those of a, b, c and d that are 0, 1, 2 and 3 lanes before, around
    /// the four.
    #[inline(always)]
    fn diagonal_quads(sums: [Self; 4]) -> Self {
        let [a, b, c, d] = sums.map(Self::to_array);
        let before = |l: usize, back: usize| (l & !3) | ((l + 4 - back) & 3);
        // SAFETY: the arguments exist.
        unsafe { Self::from_fn(|l| (a[l] + c[before(l, 2)]) + (b[before(l, 1)] + d[before(l, 3)])) }
    }

    /// For each four lanes: a0 + a2 + b1 + b3, a1 + a3 + b0 + b2, and the same of c and d.
    #[inline(always)]
    fn diagonal_halves(sums: [Self; 4]) -> Self {
        let [a, b, c, d] = sums.map(Self::to_array);
        let half = |even: &[Self::Sample], odd: &[Self::Sample], at: usize| {
            (even[at] + even[at + 2]) + (odd[at ^ 1] + odd[(at ^ 1) + 2])
        };
        // SAFETY: the arguments exist.
        unsafe { Self::from_fn(|l| if l & 2 == 0 { half(&a, &b, l) } else { half(&c, &d, l & !2) }) }
    }

    /// The sum of each frame of D lanes, for the frames of D vectors one after another.
    #[inline(always)]
    fn sum_frames<const D: usize>(vectors: impl Fn(usize) -> Self) -> Self {
        let vectors: [_; D] = std::array::from_fn(|v| vectors(v).to_array());
        // SAFETY: the arguments exist.
        unsafe {
            Self::from_fn(|frame| {
                let lane = |d: usize| vectors[(frame * D + d) / Self::LANES][(frame * D + d) % Self::LANES];
                let four = |d: usize| (lane(d) + lane(d + 2)) + (lane(d + 1) + lane(d + 3));
                match D {
                    1 => lane(0),
                    2 => lane(0) + lane(1),
                    4 => four(0),
                    _ => four(0) + four(4),
                }
            })
        }
    }

    /// The outputs of one vector to frames: phase p of its t-th frame to `out[t * hop + p]`. The sums are
    /// those of P = 2, 3 or 4 phases with D <= 4 lanes a frame, along diagonals; P = 2 with D = 4 is left to
    /// [`Vector::store_halves`]. Of three phases the place after them may be written as well, before the
    /// next frame is.
    #[inline(always)]
    unsafe fn store_frames<const P: usize, const D: usize>(
        sums: [Self; 4],
        out: *mut Self::Sample,
        hop: usize,
    ) {
        let [a, b, c, d] = sums;
        let phases = match (P, D) {
            (_, 1) => sums.map(Self::to_array),
            (2, _) => [Self::diagonal_pairs(a, b).to_array(); 4],
            (_, 2) => {
                let last = Self::diagonal_pairs(c, if P == 3 { c } else { d });
                [Self::diagonal_pairs(a, b).to_array(), last.to_array(), last.to_array(), last.to_array()]
            }
            (3, _) => [Self::diagonal_halves([a, b, c, c]).to_array(); 4],
            _ => [Self::diagonal_quads(sums).to_array(); 4],
        };
        for (t, p) in (0..Self::LANES / D).flat_map(|t| (0..P).map(move |p| (t, p))) {
            let value = match D {
                1 => phases[p][t],
                2 => phases[p / 2][2 * t + p % 2],
                _ => phases[0][4 * t + p],
            };
            *out.add(t * hop + p) = value;
        }
    }

    /// The same for P = 2 and D = 4: the two sums of one vector, then those of another, each to an output of
    /// its own.
    #[inline(always)]
    unsafe fn store_halves(sums: [Self; 4], out: [*mut Self::Sample; 2], hop: usize) {
        let pairs = Self::diagonal_halves(sums).to_array();
        for (l, &value) in pairs.iter().enumerate().take(Self::LANES) {
            *out[l / 2 % 2].add(l / 4 * hop + l % 2) = value;
        }
    }

    /// Both halves of each group added, for the groups of `vectors` vectors from `sums` on: four outputs
    /// each, to `out`, `out + hop` and so on. The place after the last frame's outputs up to four is written
    /// too, in order.
    #[inline(always)]
    unsafe fn add_halves(sums: *const Self::Sample, vectors: usize, out: *mut Self::Sample, hop: usize) {
        for index in 0..vectors * Self::GROUPS {
            let from = sums.add(index * Self::GROUP);
            let outputs: [_; 4] = std::array::from_fn(|i| *from.add(i) + *from.add(4 + i));
            out.add(index * hop).copy_from_nonoverlapping(outputs.as_ptr(), 4);
        }
    }
}
