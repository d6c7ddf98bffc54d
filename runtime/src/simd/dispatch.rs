//! From an [`Isa`] to compiled code: the one place where the instruction set is chosen.
//!
//! A kernel is one body that is generic over the [`Vector`] type. [`compiled`] returns the function that was
//! compiled for an instruction set. Plans keep these functions, so that a call does not ask again.

#[cfg(target_arch = "x86_64")]
use super::avx2::{Avx2F32, Avx2F64};
#[cfg(target_arch = "x86_64")]
use super::avx512::{Avx512F32, Avx512F64};
use super::isa::{Isa, IsaKind};
use super::lanes::Lanes;
#[cfg(target_arch = "aarch64")]
use super::neon::{NeonF32, NeonF64};
use super::portable::Portable;
use super::vector::{Vector, VectorNumber};

/// A sample type with its vector in each instruction set.
pub(crate) trait SimdElement: VectorNumber {
    /// One group as an array.
    type Portable: Vector<Sample = Self> + Lanes<Self>;
    /// One group.
    #[cfg(target_arch = "x86_64")]
    type Avx2: Vector<Sample = Self>;
    /// Two groups.
    #[cfg(target_arch = "x86_64")]
    type Avx512: Vector<Sample = Self>;
    /// One group in two registers.
    #[cfg(target_arch = "aarch64")]
    type Neon: Vector<Sample = Self>;
}

macro_rules! element {
    ($sample:ty, $lanes:literal, $avx2:ty, $avx512:ty, $neon:ty) => {
        impl SimdElement for $sample {
            type Portable = Portable<$sample, $lanes>;
            #[cfg(target_arch = "x86_64")]
            type Avx2 = $avx2;
            #[cfg(target_arch = "x86_64")]
            type Avx512 = $avx512;
            #[cfg(target_arch = "aarch64")]
            type Neon = $neon;
        }
    };
}

element!(f32, 8, Avx2F32, Avx512F32, NeonF32);
element!(f64, 4, Avx2F64, Avx512F64, NeonF64);

/// A computation that is written once for all instruction sets.
pub(crate) trait Kernel {
    /// The sample type, which decides on the vector of each instruction set.
    type Sample: SimdElement;
    /// The arguments.
    type Job<'a>;
    /// The result.
    type Output;

    /// The body. It and all that it calls must be `#[inline(always)]`: what is not inlined is not compiled
    /// for the instruction set.
    ///
    /// # Safety
    /// The caller is compiled for the instruction set of `V`, the processor has it, and the job's memory is
    /// there, as said for each kernel.
    unsafe fn run<V: Vector<Sample = Self::Sample>>(job: Self::Job<'_>) -> Self::Output;
}

/// A kernel compiled for one instruction set, which the processor has.
///
/// # Safety
/// To call it, what the kernel asks of its job must hold.
pub(crate) type Compiled<K> = for<'a> unsafe fn(<K as Kernel>::Job<'a>) -> <K as Kernel>::Output;

/// Declares [`compiled`], [`compiled_narrow`] and, for each instruction set, a function with the given
/// target features. Before them stand the kind, the function, and that for vectors of one lane group.
macro_rules! instruction_sets {
    ($($arch:literal $kind:ident $function:ident $narrow:ident $features:literal;)*) => {
        /// The function of kernel `K` for an instruction set.
        pub(crate) fn compiled<K: Kernel>(isa: Isa) -> Compiled<K> {
            match isa.kind() {
                IsaKind::Portable => portable::<K>,
                $(
                    #[cfg(target_arch = $arch)]
                    IsaKind::$kind => $function::<K>,
                )*
            }
        }

        /// As [`compiled`], for a kernel that gains nothing from vectors wider than one lane group: it is
        /// compiled for such vectors only.
        pub(crate) fn compiled_narrow<K: Kernel>(isa: Isa) -> Compiled<K> {
            match isa.kind() {
                IsaKind::Portable => portable::<K>,
                $(
                    #[cfg(target_arch = $arch)]
                    IsaKind::$kind => $narrow::<K>,
                )*
            }
        }

        /// Lanes of a vector of an instruction set.
        pub(crate) fn vector_lanes<T: SimdElement>(isa: Isa) -> usize {
            match isa.kind() {
                IsaKind::Portable => T::Portable::LANES,
                $(
                    #[cfg(target_arch = $arch)]
                    IsaKind::$kind => T::$kind::LANES,
                )*
            }
        }

        $(
            #[cfg(target_arch = $arch)]
            #[target_feature(enable = $features)]
            unsafe fn $function<K: Kernel>(job: K::Job<'_>) -> K::Output {
                // This function is compiled for the set, and is returned only for an `Isa` that includes it.
                K::run::<<K::Sample as SimdElement>::$kind>(job)
            }
        )*
    };
}

instruction_sets! {
    "x86_64" Avx2 avx2 avx2 "avx2,fma,popcnt";
    "x86_64" Avx512 avx512 avx2 "avx512f,avx512vl,avx512bw,avx512dq,avx2,fma,popcnt";
    "aarch64" Neon neon neon "neon";
}

unsafe fn portable<K: Kernel>(job: K::Job<'_>) -> K::Output {
    // Every processor has these instructions.
    K::run::<<K::Sample as SimdElement>::Portable>(job)
}
