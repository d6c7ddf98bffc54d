//! Whether samples are numbers.

use super::Isa;
use super::isa::Kind;

/// Lanes of a partial sum; there are four of them, so that none waits long for the one before.
const LANES: usize = 8;

macro_rules! all_finite {
    ($name:ident, $avx2:ident, $generic:ident, $sample:ty) => {
        /// True only if all samples are finite; false at once also for sums past the largest number.
        pub(crate) fn $name(isa: Isa, samples: &[$sample]) -> bool {
            match isa.kind() {
                #[cfg(target_arch = "x86_64")]
                // SAFETY: an `Isa` is made only where the processor has it.
                Kind::Avx2 | Kind::Avx512 => unsafe { $avx2(samples) },
                Kind::Portable => $generic(samples),
            }
        }

        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx2,fma")]
        fn $avx2(samples: &[$sample]) -> bool {
            $generic(samples)
        }

        /// What is not finite stays so in a sum, and one addition a sample is cheap.
        #[inline(always)]
        fn $generic(samples: &[$sample]) -> bool {
            let [mut a, mut b, mut c, mut d] = [[0.0; LANES]; 4];
            let (blocks, rest) = samples.as_chunks::<{ 4 * LANES }>();
            for x in blocks {
                for l in 0..LANES {
                    a[l] += x[l];
                    b[l] += x[LANES + l];
                    c[l] += x[2 * LANES + l];
                    d[l] += x[3 * LANES + l];
                }
            }
            let sum = rest.iter().sum::<$sample>();
            (0..LANES).fold(sum, |sum, l| sum + ((a[l] + b[l]) + (c[l] + d[l]))).is_finite()
        }
    };
}

all_finite!(all_finite_f32, avx2_f32, generic_f32, f32);
all_finite!(all_finite_f64, avx2_f64, generic_f64, f64);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_finite_is_noticed_wherever_it_is() {
        for isa in Isa::available() {
            for len in [1, 7, 63, 64, 65, 200] {
                let clean: Vec<f32> = (0..len).map(|i| i as f32 - 50.0).collect();
                assert!(all_finite_f32(isa, &clean));
                for place in 0..len {
                    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
                        let mut samples = clean.clone();
                        samples[place] = bad;
                        assert!(!all_finite_f32(isa, &samples), "{bad} at {place} of {len}");
                        // Two infinities do not cancel.
                        samples[(place + 64) % len] = -bad;
                        assert!(!all_finite_f32(isa, &samples));
                        let wide: Vec<f64> = samples.iter().map(|&x| f64::from(x)).collect();
                        assert!(!all_finite_f64(isa, &wide));
                    }
                }
            }
        }
    }
}
