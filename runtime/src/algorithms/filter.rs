//! What all algorithms have in common.

use crate::adapters::{FrameSink, FrameSource};
use crate::state::{Count, StateNumbers};
use crate::{BuildError, Sample};
use std::fmt::Debug;

/// Coefficients in the order of use; shared by all streams of a bank.
pub(crate) trait Filter: Debug + Send + Sync {
    /// What one stream needs besides.
    type State: Clone + Debug + Send + Sync;

    /// Facts for users.
    fn facts(&self) -> AlgorithmFacts;

    /// The state before the first frame.
    fn state(&self) -> Self::State;

    /// Makes a state what [`Filter::state`] gives, without allocating.
    fn reset(state: &mut Self::State);

    /// Filters all frames of the input; returns how many samples were not finite and were taken as 0. Does
    /// not allocate.
    fn process(&self, state: &mut Self::State, input: &dyn FrameSource, output: &mut dyn FrameSink) -> u64;

    /// How many numbers make up a state `place` frames after a multiple of the alignment.
    fn count(&self, place: usize) -> Count;

    /// Passes the numbers that [`Filter::count`] counts to `put`, one after another.
    fn save(&self, state: &Self::State, put: &mut dyn FnMut(f64));

    /// Makes the state that [`Filter::save`] gave as `numbers`, as many as [`Filter::count`] says. Does not
    /// allocate.
    fn resume(&self, state: &mut Self::State, place: usize, numbers: StateNumbers<'_>);
}

/// What an algorithm says of itself.
#[derive(Debug, Clone, Copy)]
pub(crate) struct AlgorithmFacts {
    pub(crate) name: &'static str,
    /// Frames after which an input is forgotten; `None` if it never is.
    pub(crate) history: Option<usize>,
    /// Frames by which outputs are later than the direct algorithm's.
    pub(crate) delay: usize,
    /// Frames that the stream is processed by.
    pub(crate) alignment: usize,
    /// F and B of overlap-save.
    pub(crate) transform: Option<(usize, usize)>,
    /// For each output sample.
    pub(crate) multiply_adds: Option<f64>,
}

/// K: taps per phase of the longest filter, at least one.
pub(crate) fn phase_taps(taps: &[Vec<f64>], ratio: usize) -> usize {
    taps.iter().map(|f| f.len().div_ceil(ratio)).max().unwrap_or(0).max(1)
}

/// Refuses taps that are not finite in the kernels' precision.
pub(super) fn check_finite<T: Sample>(taps: &[Vec<f64>]) -> Result<(), BuildError> {
    for (i, f) in taps.iter().enumerate() {
        if let Some(index) = f.iter().position(|&value| !T::from_f64(value).is_finite()) {
            let location = format!("the filter of channel {}", i + 1);
            return Err(BuildError::NotFinite { location, index, value: f[index] });
        }
    }
    Ok(())
}
