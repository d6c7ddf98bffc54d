//! Whether samples are numbers, and zeros in place of those that are not.

use super::dispatch::{Kernel, SimdElement, compiled};
use super::isa::Isa;
use super::vector::{MOST_LANES, Vector};
use std::marker::PhantomData;
use std::ops::Range;

/// What was not finite.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Replaced {
    /// Samples.
    pub(crate) count: u64,
    /// From the vector of the first one to that of the last one; empty if there is none.
    pub(crate) places: Range<usize>,
}

/// Zeros in place of NaN and infinity.
pub(crate) fn replace_not_finite<T: SimdElement>(isa: Isa, samples: &mut [T]) -> Replaced {
    // SAFETY: the kernel asks nothing of its job.
    unsafe { compiled::<ReplaceNotFinite<T>>(isa)(samples) }
}

struct ReplaceNotFinite<T>(PhantomData<T>);

impl<T: SimdElement> Kernel for ReplaceNotFinite<T> {
    type Sample = T;
    type Job<'a> = &'a mut [T];
    type Output = Replaced;

    #[inline(always)]
    unsafe fn run<V: Vector<Sample = T>>(samples: &mut [T]) -> Replaced {
        let (mut counts, mut places) = ([0u32; MOST_LANES], 0..0);
        let mut replace = |place: usize, samples: &mut [T]| {
            for (count, sample) in counts.iter_mut().zip(&mut *samples) {
                *count += u32::from(!sample.is_finite());
                *sample = if sample.is_finite() { *sample } else { T::default() };
            }
            places = if places.is_empty() { place } else { places.start }..place + samples.len();
        };
        let whole = samples.len() / V::LANES * V::LANES;
        let (vectors, rest) = samples.split_at_mut(whole);
        for (index, vector) in vectors.chunks_exact_mut(V::LANES).enumerate() {
            // The slice holds a vector.
            if !V::load(vector.as_ptr()).finite() {
                replace(index * V::LANES, vector);
            }
        }
        if rest.iter().any(|sample| !sample.is_finite()) {
            replace(whole, rest);
        }
        Replaced { count: counts.into_iter().map(u64::from).sum(), places }
    }
}

/// From the first sample that is not finite to the last one; none if all are.
pub(crate) fn not_finite<T: SimdElement>(samples: &[T]) -> Range<usize> {
    let is_lost = |sample: &T| !sample.is_finite();
    let first = samples.iter().position(is_lost).unwrap_or(samples.len());
    first..samples[first..].iter().rposition(is_lost).map_or(first, |last| first + last + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Zeros stand at some places after a call, and all others stay.
    fn check_replaced(isa: Isa, mut samples: Vec<f32>, places: &[usize]) {
        let (first, last) = (*places.iter().min().unwrap(), *places.iter().max().unwrap());
        let mut want = samples.clone();
        places.iter().for_each(|&place| want[place] = 0.0);
        let replaced = replace_not_finite(isa, &mut samples);
        assert_eq!((samples, replaced.count), (want, if first == last { 1 } else { 2 }));
        let Range { start, end } = replaced.places;
        assert!(
            (start..start + MOST_LANES).contains(&first) && (last + 1..=last + MOST_LANES).contains(&end)
        );
    }

    #[test]
    fn sums_that_overflow_are_finite_samples() {
        for isa in Isa::available() {
            let mut samples = [f32::MAX; 200];
            assert!(not_finite(&samples).is_empty());
            assert_eq!(replace_not_finite(isa, &mut samples), Replaced { count: 0, places: 0..0 });
        }
    }

    #[test]
    fn what_is_not_finite_is_noticed_wherever_it_is() {
        for isa in Isa::available() {
            // Miri takes a thousand times as long.
            let lengths: &[usize] = if cfg!(miri) { &[1, 35] } else { &[1, 7, 63, 64, 65, 200] };
            for &len in lengths {
                let clean: Vec<f32> = (0..len).map(|i| i as f32 - 50.0).collect();
                assert!(not_finite(&clean).is_empty());
                for place in 0..len {
                    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
                        let mut samples = clean.clone();
                        samples[place] = bad;
                        assert!(not_finite(&samples).contains(&place), "{bad} at {place} of {len}");
                        check_replaced(isa, samples.clone(), &[place]);
                        // Two infinities do not cancel.
                        samples[(place + 64) % len] = -bad;
                        assert!(!not_finite(&samples).is_empty());
                        check_replaced(isa, samples.clone(), &[place, (place + 64) % len]);
                        let wide: Vec<f64> = samples.iter().map(|&x| f64::from(x)).collect();
                        assert!(!not_finite(&wide).is_empty());
                    }
                }
            }
        }
    }
}
