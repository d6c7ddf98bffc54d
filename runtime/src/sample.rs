//! The two number types that kernels run in, and how many samples a frame has.

use crate::simd::SimdElement;

/// The numbers of samples per frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shape {
    /// N, channels of the input.
    pub channels: usize,
    /// M, output samples.
    pub ratio: usize,
}

/// f32 or f64: what kernels compute in, and what samples in memory are. No other type can be one.
#[allow(private_bounds, reason = "the private bound closes the trait")]
pub trait Sample: SimdElement + PartialOrd {
    /// Rounds to the nearest.
    fn from_f64(value: f64) -> Self;
    /// Exact.
    fn to_f64(self) -> f64;
    /// The least and the most of some samples and 0, without NaN.
    fn extremes(samples: &[Self]) -> (Self, Self);
}

/// Samples that are compared side by side, which vectors do at once.
const LANES: usize = 16;

#[inline(always)]
fn extremes<T: Sample>(samples: &[T]) -> (T, T) {
    let zero = T::from_f64(0.0);
    let (mut least, mut most) = ([zero; LANES], [zero; LANES]);
    let mut take = |samples: &[T]| {
        for ((least, most), &x) in least.iter_mut().zip(&mut most).zip(samples) {
            *least = if x < *least { x } else { *least };
            *most = if x > *most { x } else { *most };
        }
    };
    let chunks = samples.chunks_exact(LANES);
    take(chunks.remainder());
    chunks.for_each(take);
    let least = least.into_iter().fold(zero, |a, b| if b < a { b } else { a });
    (least, most.into_iter().fold(zero, |a, b| if b > a { b } else { a }))
}

impl Sample for f32 {
    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        value as f32
    }

    #[inline(always)]
    fn to_f64(self) -> f64 {
        f64::from(self)
    }

    fn extremes(samples: &[Self]) -> (Self, Self) {
        extremes(samples)
    }
}

impl Sample for f64 {
    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        value
    }

    #[inline(always)]
    fn to_f64(self) -> f64 {
        self
    }

    fn extremes(samples: &[Self]) -> (Self, Self) {
        extremes(samples)
    }
}

/// The samples themselves, if they are of type `T`.
pub(crate) fn same<S: Sample, T: Sample>(samples: &[S]) -> Option<&[T]> {
    // Of the two types no other has the size of this one.
    (size_of::<S>() == size_of::<T>()).then(|| bytemuck::cast_slice(samples))
}

/// The samples themselves, if they are of type `T`.
pub(crate) fn same_mut<S: Sample, T: Sample>(samples: &mut [S]) -> Option<&mut [T]> {
    (size_of::<S>() == size_of::<T>()).then(|| bytemuck::cast_slice_mut(samples))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extremes_are_those_of_a_search() {
        for count in 0..40 {
            let at = |k: usize| ((k * 7919 + count) % 101) as f64 - 50.0;
            let mut samples: Vec<f64> = (0..count).map(at).collect();
            let least = samples.iter().copied().fold(0.0, f64::min);
            let most = samples.iter().copied().fold(0.0, f64::max);
            samples.insert(count / 2, f64::NAN);
            assert_eq!(f64::extremes(&samples), (least, most));
            let single: Vec<f32> = samples.iter().map(|x| *x as f32).collect();
            assert_eq!(f32::extremes(&single), (least as f32, most as f32));
        }
    }
}
