//! What the processor can do at most, for benchmarks to compare with.

use super::dispatch::{Kernel, compiled};
use super::isa::Isa;
use super::vector::Vector;

/// Independent chains: enough to hide the latency of a multiply-add on every processor so far.
const CHAINS: usize = 12;

/// Runs `iterations` times 12 independent f32 multiply-adds on whole vectors of `isa`; returns how many
/// scalar multiply-adds that were, and their sum, so that nothing is optimised away.
#[doc(hidden)]
pub fn multiply_add_chains(isa: Isa, iterations: u64) -> (u64, f32) {
    // SAFETY: the kernel asks nothing of its job.
    unsafe { compiled::<Chains>(isa)(iterations) }
}

struct Chains;

impl Kernel for Chains {
    type Sample = f32;
    type Job<'a> = u64;
    type Output = (u64, f32);

    #[inline(always)]
    unsafe fn run<V: Vector<Sample = f32>>(iterations: u64) -> (u64, f32) {
        let splat = |value: f32| V::splat(std::hint::black_box(value));
        let (factor, term) = (splat(0.999), splat(1e-3));
        let mut sums = [splat(1.0); CHAINS];
        for _ in 0..iterations {
            for sum in &mut sums {
                *sum = sum.mul_add(factor, term);
            }
        }
        let total = sums.into_iter().fold(splat(0.0), |total, sum| sum.mul_add(factor, total));
        (iterations * (CHAINS * V::LANES) as u64, total.to_array().iter().sum())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_what_it_does() {
        let (none, start) = multiply_add_chains(Isa::detect(), 0);
        // Miri takes a thousand times as long.
        let repeats = if cfg!(miri) { 100 } else { 10_000 };
        let (some, later) = multiply_add_chains(Isa::detect(), repeats);
        assert_eq!(none, 0);
        assert!(some % (repeats * CHAINS as u64) == 0 && some > 0);
        // The chains stay at their fixed point, 1.
        assert!(start > 0.0 && (later / start - 1.0).abs() < 1e-3, "{start} {later}");
    }
}
