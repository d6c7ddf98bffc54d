//! What all algorithms have in common.

#[cfg(feature = "rayon")]
use crate::adapters::SplitOutput;
use crate::adapters::{Input, Output};
use crate::state::{Count, Numbers};
use crate::{BuildError, Sample};
use std::fmt::Debug;

/// Coefficients in the order of use; shared by all streams of a bank.
pub(crate) trait Filter: Debug + Send + Sync {
    /// What one stream needs besides.
    type State: Clone + Debug + Send + Sync;

    /// Facts for users.
    fn facts(&self) -> Facts;

    /// The state before the first frame.
    fn state(&self) -> Self::State;

    /// Makes a state what [`Filter::state`] gives, without allocating.
    fn reset(state: &mut Self::State);

    /// Filters all frames of the input; returns how many samples were not finite and were taken as 0. Does
    /// not allocate.
    fn process(
        &self,
        state: &mut Self::State,
        input: &(impl Input + ?Sized),
        output: &mut (impl Output + ?Sized),
    ) -> u64;

    /// As [`Filter::process`] on several threads, where calls can be cut into chunks.
    #[cfg(feature = "rayon")]
    fn process_parallel(
        &self,
        state: &mut Self::State,
        input: &(impl Input + Sync + ?Sized),
        output: &mut (impl SplitOutput + ?Sized),
        _pool: &crate::ThreadPool,
    ) -> u64 {
        self.process(state, input, output)
    }

    /// Times that the state was not finite and became 0.
    fn resets(_state: &Self::State) -> u64 {
        0
    }

    /// The recent input, if the state is nothing else.
    fn recent_input(_state: &Self::State) -> Option<&dyn RecentInput> {
        None
    }

    /// Makes the state what it would be after `position` frames, of which the last ones are `recent`. Does
    /// not allocate; false, with the state as before, if recent input does not determine the state.
    fn load(&self, _state: &mut Self::State, _recent: &dyn RecentInput, _position: u64) -> bool {
        false
    }

    /// Takes over the state of another stream, if it means the same to these coefficients. Does not
    /// allocate; false, with the state as before, if it does not. `same` if the coefficients are the other
    /// stream's own.
    fn take_over(&self, _state: &mut Self::State, _other: (&Self, &Self::State), _same: bool) -> bool {
        false
    }

    /// How many numbers make up a state `place` frames after a multiple of the alignment; none if recent
    /// input determines the state.
    fn count(&self, _place: usize) -> Count {
        Count { inputs: 0, sums: 0 }
    }

    /// Passes the numbers that [`Filter::count`] counts to `put`, one after another.
    fn save(&self, _state: &Self::State, _put: &mut dyn FnMut(f64)) {}

    /// Makes the state that [`Filter::save`] gave as `numbers`, as many as [`Filter::count`] says. Does not
    /// allocate.
    fn resume(&self, _state: &mut Self::State, _place: usize, _numbers: Numbers<'_>) {}

    /// The states of a recursion were reset so many times.
    fn set_resets(_state: &mut Self::State, _resets: u64) {}
}

/// Recent input of a stream.
pub(crate) trait RecentInput {
    /// The sample of `channel` that came `age` >= 1 frames before the next one; 0 where it is not known.
    fn sample(&self, age: usize, channel: usize) -> f64;
}

/// What an algorithm says of itself.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Facts {
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
        if let Some(index) = f.iter().position(|&value| !T::from_f64(value).finite()) {
            let location = format!("the filter of channel {}", i + 1);
            return Err(BuildError::NotFinite { location, index, value: f[index] });
        }
    }
    Ok(())
}

/// Zeros in place of NaN and infinity, counted.
pub(super) fn replace_not_finite<T: Sample>(samples: &mut [T]) -> u64 {
    let mut count = 0;
    for slot in samples.iter_mut().filter(|value| !value.finite()) {
        *slot = T::default();
        count += 1;
    }
    count
}
