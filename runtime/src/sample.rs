//! The two number types that kernels run in, and how many samples a frame has.

use crate::simd::Element;

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
pub trait Sample: Element + PartialOrd {
    /// Rounds to the nearest.
    fn from_f64(value: f64) -> Self;
    /// Exact.
    fn to_f64(self) -> f64;
    /// The samples, with their type as a value.
    fn typed(samples: &[Self]) -> Samples<'_>;
    /// The samples, with their type as a value.
    fn typed_mut(samples: &mut [Self]) -> SamplesMut<'_>;
    /// The samples themselves, if they are of this type.
    fn same<S: Sample>(samples: &[S]) -> Option<&[Self]>;
    /// The samples themselves, if they are of this type.
    fn same_mut<S: Sample>(samples: &mut [S]) -> Option<&mut [Self]>;
}

/// Samples in memory.
#[derive(Debug)]
pub enum Samples<'a> {
    /// In f32.
    F32(&'a [f32]),
    /// In f64.
    F64(&'a [f64]),
}

/// Room for samples in memory.
#[derive(Debug)]
pub enum SamplesMut<'a> {
    /// In f32.
    F32(&'a mut [f32]),
    /// In f64.
    F64(&'a mut [f64]),
}

macro_rules! sample {
    ($number:ty, $variant:ident) => {
        impl Sample for $number {
            #[inline(always)]
            fn from_f64(value: f64) -> Self {
                value as $number
            }

            #[inline(always)]
            fn to_f64(self) -> f64 {
                f64::from(self)
            }

            fn typed(samples: &[Self]) -> Samples<'_> {
                Samples::$variant(samples)
            }

            fn typed_mut(samples: &mut [Self]) -> SamplesMut<'_> {
                SamplesMut::$variant(samples)
            }

            fn same<S: Sample>(samples: &[S]) -> Option<&[Self]> {
                if let Samples::$variant(samples) = S::typed(samples) { Some(samples) } else { None }
            }

            fn same_mut<S: Sample>(samples: &mut [S]) -> Option<&mut [Self]> {
                if let SamplesMut::$variant(samples) = S::typed_mut(samples) { Some(samples) } else { None }
            }
        }
    };
}

sample!(f32, F32);
sample!(f64, F64);
