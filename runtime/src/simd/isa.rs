//! The instruction set that kernels run on, as a value that only detection can make.

use std::fmt;

/// An instruction set of this processor that the kernels are compiled for.
///
/// A value is the proof that the processor has it: only [`Isa::detect`], [`Isa::available`] and
/// [`Isa::portable`] make one.
///
/// ```
/// use hybank_runtime::{Isa, Options};
/// let options = Options { isa: Isa::detect(), ..Options::default() };
/// ```
///
/// No other can be named:
///
/// ```compile_fail,E0599
/// use hybank_runtime::{Isa, Options};
/// let options = Options { isa: Isa::Avx2, ..Options::default() };
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Isa(IsaKind);

/// What kernels are compiled for. Each kind that needs asking the processor exists only inside an [`Isa`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum IsaKind {
    /// What every processor of the architecture has.
    Portable,
    /// x86-64 with AVX2, FMA and POPCNT: 256-bit vectors.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// x86-64 with AVX-512 F, VL, BW and DQ: 512-bit vectors.
    #[cfg(target_arch = "x86_64")]
    Avx512,
    /// aarch64: 128-bit vectors, two to a lane group.
    #[cfg(target_arch = "aarch64")]
    Neon,
}

impl IsaKind {
    /// All kinds, the widest one last.
    const ALL: &'static [Self] = &[
        Self::Portable,
        #[cfg(target_arch = "x86_64")]
        Self::Avx2,
        #[cfg(target_arch = "x86_64")]
        Self::Avx512,
        #[cfg(target_arch = "aarch64")]
        Self::Neon,
    ];

    fn is_available(self) -> bool {
        match self {
            Self::Portable => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => {
                is_x86_feature_detected!("avx2")
                    && is_x86_feature_detected!("fma")
                    && is_x86_feature_detected!("popcnt")
            }
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => {
                Self::Avx2.is_available()
                    && is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512vl")
                    && is_x86_feature_detected!("avx512bw")
                    && is_x86_feature_detected!("avx512dq")
            }
            #[cfg(target_arch = "aarch64")]
            Self::Neon => std::arch::is_aarch64_feature_detected!("neon"),
        }
    }
}

impl Isa {
    /// The widest instruction set of this processor.
    pub fn detect() -> Self {
        Self::available().last().unwrap_or(Self::portable())
    }

    /// All instruction sets of this processor, the portable one first, the widest one last.
    pub fn available() -> impl Iterator<Item = Self> {
        IsaKind::ALL.iter().filter(|kind| kind.is_available()).map(|&kind| Self(kind))
    }

    /// The instructions that every processor of the architecture has.
    pub const fn portable() -> Self {
        Self(IsaKind::Portable)
    }

    /// `portable`, `avx2`, `avx512` or `neon`.
    pub const fn name(self) -> &'static str {
        match self.0 {
            IsaKind::Portable => "portable",
            #[cfg(target_arch = "x86_64")]
            IsaKind::Avx2 => "avx2",
            #[cfg(target_arch = "x86_64")]
            IsaKind::Avx512 => "avx512",
            #[cfg(target_arch = "aarch64")]
            IsaKind::Neon => "neon",
        }
    }

    pub(super) fn kind(self) -> IsaKind {
        self.0
    }
}

impl fmt::Display for Isa {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn detection_takes_the_widest_of_the_available_sets() {
        let available: Vec<_> = Isa::available().collect();
        assert_eq!(available[0], Isa::portable());
        assert_eq!(available.last(), Some(&Isa::detect()));
    }

    #[test]
    #[cfg(target_arch = "x86_64")]
    fn a_set_is_available_only_if_the_processor_says_so() {
        let names: Vec<_> = Isa::available().map(Isa::name).collect();
        assert_eq!(
            names.contains(&"avx2"),
            is_x86_feature_detected!("avx2")
                && is_x86_feature_detected!("fma")
                && is_x86_feature_detected!("popcnt")
        );
        assert!(!names.contains(&"avx512") || is_x86_feature_detected!("avx512f"));
    }
}
