//! One of the algorithms in one of the number types: coefficients alone, and coefficients with the state of
//! a stream.
//!
//! A state stands beside the coefficients that made it and is never apart from them, so that no call can
//! meet the state of another algorithm.

#[cfg(feature = "rayon")]
use crate::adapters::SplitOutput;
use crate::adapters::{Input, Output};
use crate::algorithms::{Direct, Facts, FastFir, Filter, OverlapSave, RecentInput, Recursive};
use crate::state::{Count, Numbers};
use std::sync::Arc;

/// Coefficients that streams share.
#[derive(Debug, Clone)]
pub(crate) enum Coefficients {
    DirectF32(Arc<Direct<f32>>),
    DirectF64(Arc<Direct<f64>>),
    FastFirF32(Arc<FastFir<f32>>),
    FastFirF64(Arc<FastFir<f64>>),
    OverlapSaveF32(Arc<OverlapSave<f32>>),
    OverlapSaveF64(Arc<OverlapSave<f64>>),
    RecursiveF32(Arc<Recursive<f32>>),
    RecursiveF64(Arc<Recursive<f64>>),
}

/// A filter with its state.
#[derive(Debug, Clone)]
pub(crate) enum Engine {
    DirectF32(Pair<Direct<f32>>),
    DirectF64(Pair<Direct<f64>>),
    FastFirF32(Pair<FastFir<f32>>),
    FastFirF64(Pair<FastFir<f64>>),
    OverlapSaveF32(Pair<OverlapSave<f32>>),
    OverlapSaveF64(Pair<OverlapSave<f64>>),
    RecursiveF32(Pair<Recursive<f32>>),
    RecursiveF64(Pair<Recursive<f64>>),
}

/// Coefficients, and a state that they made.
#[derive(Debug)]
pub(crate) struct Pair<F: Filter> {
    filter: Arc<F>,
    state: F::State,
}

/// `$body` for whatever `$value` holds.
macro_rules! each {
    ($enum:ident, $value:expr, $it:ident => $body:expr) => {
        match $value {
            $enum::DirectF32($it) => $body,
            $enum::DirectF64($it) => $body,
            $enum::FastFirF32($it) => $body,
            $enum::FastFirF64($it) => $body,
            $enum::OverlapSaveF32($it) => $body,
            $enum::OverlapSaveF64($it) => $body,
            $enum::RecursiveF32($it) => $body,
            $enum::RecursiveF64($it) => $body,
        }
    };
}

impl Coefficients {
    pub(crate) fn facts(&self) -> Facts {
        each!(Self, self, filter => filter.facts())
    }

    /// `f32` or `f64`.
    pub(crate) fn numbers(&self) -> &'static str {
        match self {
            Self::DirectF32(_) | Self::FastFirF32(_) | Self::OverlapSaveF32(_) | Self::RecursiveF32(_) => {
                "f32"
            }
            Self::DirectF64(_) | Self::FastFirF64(_) | Self::OverlapSaveF64(_) | Self::RecursiveF64(_) => {
                "f64"
            }
        }
    }

    /// With a state at its beginning.
    pub(crate) fn start(&self) -> Engine {
        match self {
            Self::DirectF32(filter) => Engine::DirectF32(Pair::new(filter)),
            Self::DirectF64(filter) => Engine::DirectF64(Pair::new(filter)),
            Self::FastFirF32(filter) => Engine::FastFirF32(Pair::new(filter)),
            Self::FastFirF64(filter) => Engine::FastFirF64(Pair::new(filter)),
            Self::OverlapSaveF32(filter) => Engine::OverlapSaveF32(Pair::new(filter)),
            Self::OverlapSaveF64(filter) => Engine::OverlapSaveF64(Pair::new(filter)),
            Self::RecursiveF32(filter) => Engine::RecursiveF32(Pair::new(filter)),
            Self::RecursiveF64(filter) => Engine::RecursiveF64(Pair::new(filter)),
        }
    }
}

impl Engine {
    /// See [`Filter::process`].
    pub(crate) fn process(
        &mut self,
        input: &(impl Input + ?Sized),
        output: &mut (impl Output + ?Sized),
    ) -> u64 {
        each!(Self, self, pair => pair.filter.process(&mut pair.state, input, output))
    }

    /// See [`Filter::process_parallel`].
    #[cfg(feature = "rayon")]
    pub(crate) fn process_parallel(
        &mut self,
        input: &(impl Input + Sync + ?Sized),
        output: &mut (impl SplitOutput + ?Sized),
        pool: &crate::ThreadPool,
    ) -> u64 {
        each!(Self, self, pair => pair.filter.process_parallel(&mut pair.state, input, output, pool))
    }

    /// See [`Filter::reset`].
    pub(crate) fn reset(&mut self) {
        each!(Self, self, pair => pair.reset());
    }

    /// See [`Filter::resets`].
    pub(crate) fn resets(&self) -> u64 {
        each!(Self, self, pair => pair.resets())
    }

    /// The state becomes that of a stream which has had the input of `running`, `position` frames of it;
    /// false, with the state as before, if that cannot be known.
    pub(crate) fn continue_from(&mut self, running: &Self, position: u64) -> bool {
        self.take_over(running)
            || running.recent_input().is_some_and(
                |recent| each!(Self, self, pair => pair.filter.load(&mut pair.state, recent, position)),
            )
    }

    fn take_over(&mut self, running: &Self) -> bool {
        match (self, running) {
            (Self::OverlapSaveF32(pair), Self::OverlapSaveF32(other)) => pair.take_over(other),
            (Self::OverlapSaveF64(pair), Self::OverlapSaveF64(other)) => pair.take_over(other),
            (Self::RecursiveF32(pair), Self::RecursiveF32(other)) => pair.take_over(other),
            (Self::RecursiveF64(pair), Self::RecursiveF64(other)) => pair.take_over(other),
            // The others hold recent input in different ways, and `load` takes it over.
            _ => false,
        }
    }

    fn recent_input(&self) -> Option<&dyn RecentInput> {
        each!(Self, self, pair => pair.recent_input())
    }

    /// Numbers that make up a state so many frames after a multiple of the alignment, of which the plan has
    /// `channels`.
    pub(crate) fn count(&self, channels: usize, place: usize) -> Count {
        match self.recent_input() {
            Some(_) => Count { inputs: self.history() * channels, sums: 0 },
            None => each!(Self, self, pair => pair.filter.count(place)),
        }
    }

    /// These numbers; of a state that is recent input the samples, the last frame first.
    pub(crate) fn save(&self, channels: usize, put: &mut dyn FnMut(f64)) {
        let Some(recent) = self.recent_input() else {
            return each!(Self, self, pair => pair.filter.save(&pair.state, put));
        };
        for age in 1..=self.history() {
            (0..channels).for_each(|channel| put(recent.sample(age, channel)));
        }
    }

    /// The state after `position` frames that [`Engine::save`] gave as `numbers`. Does not allocate.
    pub(crate) fn resume(&mut self, channels: usize, position: u64, numbers: Numbers<'_>) {
        let frames = SavedFrames { numbers, channels, frames: self.history() };
        each!(Self, self, pair => {
            if !pair.filter.load(&mut pair.state, &frames, position) {
                let place = position % pair.filter.facts().alignment as u64;
                pair.filter.resume(&mut pair.state, place as usize, numbers);
            }
        });
    }

    /// See [`Filter::resets`].
    pub(crate) fn set_resets(&mut self, resets: u64) {
        each!(Self, self, pair => pair.set_resets(resets));
    }

    /// Frames that the filters look back; 0 for recursions.
    fn history(&self) -> usize {
        each!(Self, self, pair => pair.filter.facts().history.unwrap_or(0))
    }
}

/// Frames of a state, the last one first.
struct SavedFrames<'a> {
    numbers: Numbers<'a>,
    channels: usize,
    frames: usize,
}

impl RecentInput for SavedFrames<'_> {
    fn sample(&self, age: usize, channel: usize) -> f64 {
        if age <= self.frames { self.numbers.get((age - 1) * self.channels + channel) } else { 0.0 }
    }
}

impl<F: Filter> Pair<F> {
    fn new(filter: &Arc<F>) -> Self {
        Self { state: filter.state(), filter: Arc::clone(filter) }
    }

    fn reset(&mut self) {
        F::reset(&mut self.state);
    }

    fn resets(&self) -> u64 {
        F::resets(&self.state)
    }

    fn set_resets(&mut self, resets: u64) {
        F::set_resets(&mut self.state, resets);
    }

    fn recent_input(&self) -> Option<&dyn RecentInput> {
        F::recent_input(&self.state)
    }

    fn take_over(&mut self, other: &Self) -> bool {
        let same = Arc::ptr_eq(&self.filter, &other.filter);
        self.filter.take_over(&mut self.state, (&other.filter, &other.state), same)
    }
}

impl<F: Filter> Clone for Pair<F> {
    fn clone(&self) -> Self {
        Self { filter: Arc::clone(&self.filter), state: self.state.clone() }
    }
}
