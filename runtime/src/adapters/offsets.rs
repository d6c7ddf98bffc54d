//! The offsets of the converters, subtracted from the samples on their way to the kernels.

use super::FrameSource;
use crate::{BuildError, Isa, Sample};

/// Samples after which the pattern of offsets repeats, at least: long enough for whole vectors.
const PATTERN: usize = 256;

/// The offsets of N channels, frame after frame, in both number types.
#[derive(Debug)]
pub(crate) struct Offsets {
    single: Vec<f32>,
    double: Vec<f64>,
}

impl Offsets {
    /// `None` if all offsets are zero.
    ///
    /// # Errors
    /// [`BuildError::OffsetCount`] unless there is one for each of N = `channels`;
    /// [`BuildError::NotFinite`].
    pub(crate) fn new(offsets: &[f64], channels: usize) -> Result<Option<Self>, BuildError> {
        if offsets.len() != channels {
            return Err(BuildError::OffsetCount { offsets: offsets.len(), channels });
        }
        if let Some(index) = offsets.iter().position(|&offset| !f32::from_f64(offset).is_finite()) {
            let location = "the offsets of the channels".to_owned();
            return Err(BuildError::NotFinite { location, index, value: offsets[index] });
        }
        if offsets.iter().all(|&offset| offset == 0.0) {
            return Ok(None);
        }
        let double = offsets.repeat(PATTERN.div_ceil(channels));
        Ok(Some(Self { single: double.iter().map(|&offset| f32::from_f64(offset)).collect(), double }))
    }
}

/// The frames of an input without the offsets. What is not finite stays so.
pub(crate) struct WithoutOffsets<'a> {
    pub(crate) input: &'a dyn FrameSource,
    pub(crate) offsets: &'a Offsets,
}

impl FrameSource for WithoutOffsets<'_> {
    fn channels(&self) -> usize {
        self.input.channels()
    }

    fn frames(&self) -> usize {
        self.input.frames()
    }

    fn load_f32(&self, isa: Isa, first: usize, samples: &mut [f32]) {
        self.input.load_f32(isa, first, samples);
        subtract(&self.offsets.single, samples);
    }

    fn load_f64(&self, isa: Isa, first: usize, samples: &mut [f64]) {
        self.input.load_f64(isa, first, samples);
        subtract(&self.offsets.double, samples);
    }
}

/// Subtracts a pattern of offsets from whole frames.
fn subtract<T: Sample>(pattern: &[T], samples: &mut [T]) {
    for part in samples.chunks_mut(pattern.len()) {
        part.iter_mut().zip(pattern).for_each(|(sample, &offset)| *sample = *sample - offset);
    }
}
