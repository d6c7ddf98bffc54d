//! Whether samples are numbers.

use super::dispatch::{Element, Kernel, compiled_narrow};
use super::isa::Isa;
use super::vector::Vector;
use std::marker::PhantomData;

/// Lanes of a partial sum; there are four of them, so that none waits long for the one before.
const LANES: usize = 8;

/// True only if all samples are finite; false also for sums past the largest number.
pub(crate) fn all_finite<T: Element>(isa: Isa, samples: &[T]) -> bool {
    // SAFETY: the kernel asks nothing of its job.
    unsafe { compiled_narrow::<AllFinite<T>>(isa)(samples) }
}

struct AllFinite<T>(PhantomData<T>);

impl<T: Element> Kernel for AllFinite<T> {
    type Sample = T;
    type Job<'a> = &'a [T];
    type Output = bool;

    /// What is not finite stays so in a sum, and one addition a sample is cheap.
    #[inline(always)]
    unsafe fn run<V: Vector<Sample = T>>(samples: &[T]) -> bool {
        let [mut a, mut b, mut c, mut d] = [[T::default(); LANES]; 4];
        let (blocks, rest) = samples.as_chunks::<{ 4 * LANES }>();
        for x in blocks {
            for l in 0..LANES {
                a[l] = a[l] + x[l];
                b[l] = b[l] + x[LANES + l];
                c[l] = c[l] + x[2 * LANES + l];
                d[l] = d[l] + x[3 * LANES + l];
            }
        }
        let sum = rest.iter().fold(T::default(), |sum, &x| sum + x);
        (0..LANES).fold(sum, |sum, l| sum + ((a[l] + b[l]) + (c[l] + d[l]))).is_finite()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_finite_is_noticed_wherever_it_is() {
        for isa in Isa::available() {
            // Miri takes a thousand times as long.
            let lengths: &[usize] = if cfg!(miri) { &[1, 35] } else { &[1, 7, 63, 64, 65, 200] };
            for &len in lengths {
                let clean: Vec<f32> = (0..len).map(|i| i as f32 - 50.0).collect();
                assert!(all_finite(isa, &clean));
                for place in 0..len {
                    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
                        let mut samples = clean.clone();
                        samples[place] = bad;
                        assert!(!all_finite(isa, &samples), "{bad} at {place} of {len}");
                        // Two infinities do not cancel.
                        samples[(place + 64) % len] = -bad;
                        assert!(!all_finite(isa, &samples));
                        let wide: Vec<f64> = samples.iter().map(|&x| f64::from(x)).collect();
                        assert!(!all_finite(isa, &wide));
                    }
                }
            }
        }
    }
}
