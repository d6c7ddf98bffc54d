//! What the processor can do at most, for benchmarks to compare with.

use super::Isa;
use super::isa::Kind;
#[cfg(target_arch = "x86_64")]
use super::vector::{Avx2F32, Avx512F32};
use super::vector::{Portable, Vector};

/// Independent chains: enough to hide the latency of a multiply-add on every processor so far.
const CHAINS: usize = 12;

/// Runs `turns` turns of 12 independent f32 multiply-adds on whole vectors of `isa`; returns how many scalar multiply-adds that were, and their sum, so that nothing is optimised away.
pub fn multiply_add_chains(isa: Isa, turns: u64) -> (u64, f32) {
    match isa.kind() {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: an `Isa` is made only where the processor has it.
        Kind::Avx2 => unsafe { avx2(turns) },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: an `Isa` is made only where the processor has it.
        Kind::Avx512 => unsafe { avx512(turns) },
        // SAFETY: needs nothing.
        Kind::Portable => unsafe { chains::<Portable<f32>>(turns) },
    }
}

#[inline(always)]
unsafe fn chains<V: Vector<Sample = f32>>(turns: u64) -> (u64, f32) {
    let mut out = [0.0; 64];
    // SAFETY: the caller's for the instruction set; one vector fits `out`.
    unsafe {
        let (factor, term) = (V::splat(std::hint::black_box(0.999)), V::splat(std::hint::black_box(1e-3)));
        let mut sums = [V::splat(1.0); CHAINS];
        for _ in 0..turns {
            for sum in &mut sums {
                *sum = sum.mul_add(factor, term);
            }
        }
        for sum in sums {
            sum.mul_add(factor, V::load(out.as_ptr())).store(out.as_mut_ptr());
        }
    }
    (turns * (CHAINS * V::LANES) as u64, out.iter().sum())
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
unsafe fn avx2(turns: u64) -> (u64, f32) {
    // SAFETY: the caller's.
    unsafe { chains::<Avx2F32>(turns) }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx2,fma")]
unsafe fn avx512(turns: u64) -> (u64, f32) {
    // SAFETY: the caller's.
    unsafe { chains::<Avx512F32>(turns) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_what_it_does() {
        let (none, start) = multiply_add_chains(Isa::detect(), 0);
        let (some, later) = multiply_add_chains(Isa::detect(), 10_000);
        assert_eq!(none, 0);
        assert!(some % (10_000 * CHAINS as u64) == 0 && some > 0);
        // The chains stay at their fixed point, 1.
        assert!(start > 0.0 && (later / start - 1.0).abs() < 1e-3, "{start} {later}");
    }
}
