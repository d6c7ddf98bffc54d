//! Vectors whose lanes hold frames as they lie in memory, and the fixed order in which lanes are added.
//!
//! A *group* is 32 bytes: 8 lanes of f32, 4 of f64. A window of D samples (D divides the group)
//! fills D neighbouring lanes, so that a group holds group / D ticks. Sums over the D lanes of a tick are
//! trees of a fixed shape, (l0 + l2) + (l1 + l3) for four lanes, and the lower half plus the upper
//! half for eight; they do not depend on the instruction set.
//!
//! Two or four phases lie along diagonals: lane l of the p-th sum belongs to phase (l + p) mod 2 or 4, so that the sums
//! come out in the order of the phases and fewer lanes have to be blended. Of three phases the first two do.

/// A group of lanes; [`Lanes`] vectors consist of one or two.
///
/// # Safety
/// As for [`Lanes`].
pub(super) trait Group: Copy {
    type Sample: Copy;
    /// For each pair of lanes: a0 + b1, a1 + b0, a2 + b3, a3 + b2 ...
    unsafe fn diagonal_pairs(a: Self, b: Self) -> Self;
    /// For each four lanes: the sum of those of a, b, c and d that are 0, 1, 2 and 3 lanes before, around the four.
    unsafe fn diagonal_quads(sums: [Self; 4]) -> Self;
    /// For each four lanes: a0 + a2 + b1 + b3, a1 + a3 + b0 + b2, and the same of c and d.
    unsafe fn diagonal_halves(sums: [Self; 4]) -> Self;
    /// The outputs of one vector to frames: phase p of its t-th tick to `out[t * hop + p]`. The sums are those of P = 2, 3 or
    /// 4 phases with D <= 4 lanes a tick, in the order of diagonals; (2, 4) is left to [`Group::store_halves`]. Of
    /// 3 phases the place behind them may be written as well, before the next tick.
    unsafe fn store_ticks<const P: usize, const D: usize>(
        sums: [Self; 4],
        out: *mut Self::Sample,
        hop: usize,
    );
    /// The same for P = 2, D = 4 and the two sums of one vector, then those of another.
    unsafe fn store_halves(sums: [Self; 4], out: [*mut Self::Sample; 2], hop: usize);
    /// Ticks of D lanes each, one after the other in D groups: the sum of each tick.
    unsafe fn ticks<const D: usize>(groups: impl Fn(usize) -> Self) -> Self;
    unsafe fn load(at: *const Self::Sample) -> Self;
    unsafe fn add(self, other: Self) -> Self;
    /// Neither NaN nor infinity in any lane.
    unsafe fn finite(self) -> bool;
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
    /// A group is a register by itself as well.
    type Group: Group<Sample = Self::Sample> + Lanes<Sample = Self::Sample, Group = Self::Group>;
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
            unsafe fn diagonal_pairs(a: Self, b: Self) -> Self {
                Self(std::array::from_fn(|l| a.0[l] + b.0[l ^ 1]))
            }

            #[inline(always)]
            unsafe fn diagonal_quads([a, b, c, d]: [Self; 4]) -> Self {
                Self(std::array::from_fn(|l| {
                    let at = |back: usize| (l & !3) | ((l + 4 - back) & 3);
                    (a.0[l] + c.0[at(2)]) + (b.0[at(1)] + d.0[at(3)])
                }))
            }

            #[inline(always)]
            unsafe fn diagonal_halves([a, b, c, d]: [Self; 4]) -> Self {
                Self(std::array::from_fn(|l| {
                    let (Self(even), Self(odd)) = if l & 2 == 0 { (a, b) } else { (c, d) };
                    let at = l & !2;
                    (even[at] + even[at + 2]) + (odd[at ^ 1] + odd[(at ^ 1) + 2])
                }))
            }

            #[inline(always)]
            unsafe fn store_ticks<const P: usize, const D: usize>(
                [a, b, c, d]: [Self; 4],
                out: *mut $sample,
                hop: usize,
            ) {
                let put = |groups: &[Self], places: usize| unsafe {
                    let ticks = $lanes / places;
                    for t in 0..ticks * groups.len() {
                        let Self(lanes) = groups[t / ticks];
                        for p in 0..P {
                            *out.add(t * hop + p) = lanes[t % ticks * places + p];
                        }
                    }
                };
                unsafe {
                    match (P, D) {
                        (_, 1) => put(
                            &std::array::from_fn::<_, 4, _>(|quarter| {
                                let rows = [a, b, c, d];
                                Self(std::array::from_fn(|l| rows[l % 4].0[quarter * $lanes / 4 + l / 4]))
                            }),
                            4,
                        ),
                        (2, _) => put(&[Self::diagonal_pairs(a, b)], 2),
                        (_, 2) => {
                            let last = Self::diagonal_pairs(c, if P == 3 { c } else { d }).0;
                            let Self(first) = Self::diagonal_pairs(a, b);
                            for t in 0..$lanes / 2 {
                                for p in 0..P {
                                    *out.add(t * hop + p) =
                                        if p < 2 { first[2 * t + p] } else { last[2 * t + p - 2] };
                                }
                            }
                        }
                        (3, _) => put(&[Self::diagonal_halves([a, b, c, c])], 4),
                        _ => put(&[Self::diagonal_quads([a, b, c, d])], 4),
                    }
                }
            }

            #[inline(always)]
            unsafe fn store_halves(sums: [Self; 4], out: [*mut $sample; 2], hop: usize) {
                let Self(pairs) = unsafe { Self::diagonal_halves(sums) };
                for (l, value) in pairs.into_iter().enumerate() {
                    unsafe { *out[l / 2 % 2].add(l / 4 * hop + l % 2) = value };
                }
            }

            #[inline(always)]
            unsafe fn ticks<const D: usize>(groups: impl Fn(usize) -> Self) -> Self {
                let groups: [Self; D] = std::array::from_fn(groups);
                Self(std::array::from_fn(|t| {
                    let lane = |d: usize| groups[(t * D + d) / $lanes].0[(t * D + d) % $lanes];
                    let four = |d: usize| (lane(d) + lane(d + 2)) + (lane(d + 1) + lane(d + 3));
                    match D {
                        1 => lane(0),
                        2 => lane(0) + lane(1),
                        4 => four(0),
                        _ => four(0) + four(4),
                    }
                }))
            }

            #[inline(always)]
            unsafe fn load(at: *const $sample) -> Self {
                Self(unsafe { at.cast::<[$sample; $lanes]>().read_unaligned() })
            }

            #[inline(always)]
            unsafe fn add(self, other: Self) -> Self {
                Self(std::array::from_fn(|l| self.0[l] + other.0[l]))
            }

            #[inline(always)]
            unsafe fn finite(self) -> bool {
                self.0.into_iter().all(<$sample>::is_finite)
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
