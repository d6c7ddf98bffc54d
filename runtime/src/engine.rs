//! One of the algorithms in one of the number types, with the state of one stream.
//!
//! A state stands beside the coefficients that made it and is never apart from them, so that no call can
//! meet the state of another algorithm. A [`Plan`](crate::Plan) holds an engine at its beginning, and each
//! stream a copy, which shares the coefficients.

#[cfg(feature = "rayon")]
use crate::adapters::SplitOutput;
use crate::adapters::{FrameSink, FrameSource};
use crate::algorithms::{AlgorithmFacts, Direct, Filter, OverlapSave, Recursive};
use crate::sample::Sample;
use crate::simd::flushing;
use crate::state::{Count, StateNumbers};
use std::sync::Arc;

/// A filter with its state, in the number type of its sums.
#[derive(Debug, Clone)]
pub(crate) enum Engine {
    F32(Fir<f32>),
    F64(Fir<f64>),
    /// A recursion feeds its rounding errors back: always in f64.
    Recursive(StatefulFilter<Recursive>),
}

/// One of the algorithms for FIR filters.
#[derive(Debug, Clone)]
pub(crate) enum Fir<T: Sample> {
    Direct(StatefulFilter<Direct<T>>),
    OverlapSave(StatefulFilter<OverlapSave<T>>),
}

/// Coefficients, which streams share, and a state that they made.
#[derive(Debug)]
pub(crate) struct StatefulFilter<F: Filter> {
    filter: Arc<F>,
    state: F::State,
}

/// `$body` for whatever `$engine` holds.
macro_rules! each {
    ($engine:expr, $it:ident => $body:expr) => {
        match $engine {
            Engine::F32(Fir::Direct($it)) => $body,
            Engine::F32(Fir::OverlapSave($it)) => $body,
            Engine::F64(Fir::Direct($it)) => $body,
            Engine::F64(Fir::OverlapSave($it)) => $body,
            Engine::Recursive($it) => $body,
        }
    };
}

impl Engine {
    /// See [`Filter::facts`].
    pub(crate) fn facts(&self) -> AlgorithmFacts {
        each!(self, it => it.filter.facts())
    }

    /// `f32` or `f64`.
    pub(crate) fn numbers(&self) -> &'static str {
        if matches!(self, Self::F32(_)) { "f32" } else { "f64" }
    }

    /// See [`Filter::process`].
    pub(crate) fn process(&mut self, input: &dyn FrameSource, output: &mut dyn FrameSink) -> u64 {
        each!(self, it => flushing(|| it.filter.process(&mut it.state, input, output)))
    }

    /// As [`Engine::process`], on several threads if the algorithm is the direct one.
    #[cfg(feature = "rayon")]
    pub(crate) fn process_parallel(
        &mut self,
        input: &dyn FrameSource,
        output: &mut dyn SplitOutput,
        pool: &crate::ThreadPool,
    ) -> u64 {
        use crate::parallel::process;
        match self {
            Self::F32(Fir::Direct(it)) => process(&*it.filter, &mut it.state, input, output, pool),
            Self::F64(Fir::Direct(it)) => process(&*it.filter, &mut it.state, input, output, pool),
            _ => self.process(input, output),
        }
    }

    /// See [`Filter::reset`].
    pub(crate) fn reset(&mut self) {
        each!(self, it => reset(it));
    }

    /// Times that the state of a recursion was not finite and became 0.
    pub(crate) fn resets(&self) -> u64 {
        if let Self::Recursive(it) = self { it.state.resets } else { 0 }
    }

    /// See [`Filter::count`].
    pub(crate) fn count(&self, place: usize) -> Count {
        each!(self, it => it.filter.count(place))
    }

    /// See [`Filter::save`].
    pub(crate) fn save(&self, put: &mut dyn FnMut(f64)) {
        each!(self, it => it.filter.save(&it.state, put));
    }

    /// The state `place` frames after a multiple of the alignment that [`Engine::save`] gave as `numbers`,
    /// after so many `resets`. Does not allocate.
    pub(crate) fn resume(&mut self, place: usize, numbers: StateNumbers<'_>, resets: u64) {
        each!(self, it => it.filter.resume(&mut it.state, place, numbers));
        if let Self::Recursive(it) = self {
            it.state.resets = resets;
        }
    }
}

fn reset<F: Filter>(running: &mut StatefulFilter<F>) {
    F::reset(&mut running.state);
}

impl<F: Filter> StatefulFilter<F> {
    /// At its beginning.
    pub(crate) fn new(filter: F) -> Self {
        Self { state: filter.state(), filter: Arc::new(filter) }
    }
}

impl<F: Filter> Clone for StatefulFilter<F> {
    fn clone(&self) -> Self {
        Self { filter: Arc::clone(&self.filter), state: self.state.clone() }
    }
}
