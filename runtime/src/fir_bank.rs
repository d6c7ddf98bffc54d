//! A FIR bank in the form that was chosen for it.

use super::BuildError;
#[cfg(feature = "rayon")]
use super::fast_fir;
use super::fast_fir::{FastFirPlan, FastFirState};
use super::fir::{FirPlan, FirState};
use super::form::Choice;
use super::overlap_save::{OverlapSavePlan, OverlapSaveState};
use super::sample::Sample;
use super::simd::Isa;
use super::ticks::{FastSink, TickSource};
#[cfg(feature = "rayon")]
use super::workers::{self, Spans, Workers};

/// Coefficients in the order of use; shared by all streams of a bank.
#[derive(Debug)]
pub(crate) enum FirBankPlan<T: Sample> {
    Direct(FirPlan<T>),
    Fast(Box<FastFirPlan<T>>),
    OverlapSave(OverlapSavePlan<T>),
}

/// The state of one stream, of the plan's form.
#[derive(Debug, Clone)]
pub(crate) enum FirBankState<T: Sample> {
    Direct(FirState<T>),
    Fast(Box<FastFirState<T>>),
    OverlapSave(OverlapSaveState<T>),
}

/// What a form reports.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FormSummary {
    pub(crate) name: &'static str,
    /// F and B.
    pub(crate) transform: Option<(usize, usize)>,
    /// For each fast sample.
    pub(crate) multiply_adds: f64,
}

impl<T: Sample> FirBankPlan<T> {
    pub(crate) fn new(taps: &[Vec<f64>], ratio: usize, choice: Choice, isa: Isa) -> Result<Self, BuildError> {
        match choice {
            Choice::Direct => FirPlan::new(taps, ratio, isa).map(Self::Direct),
            Choice::Fast => FastFirPlan::new(taps, ratio, isa).map(Box::new).map(Self::Fast),
            Choice::OverlapSave(len) => OverlapSavePlan::new(taps, ratio, len, isa).map(Self::OverlapSave),
        }
    }

    /// A stream's state before its first tick.
    pub(crate) fn state(&self) -> FirBankState<T> {
        match self {
            Self::Direct(plan) => FirBankState::Direct(plan.state()),
            Self::Fast(plan) => FirBankState::Fast(Box::new(plan.state())),
            Self::OverlapSave(plan) => FirBankState::OverlapSave(plan.state()),
        }
    }

    /// Ticks by which outputs are later than their last input.
    pub(crate) fn delay(&self) -> usize {
        match self {
            Self::Direct(_) | Self::Fast(_) => 0,
            Self::OverlapSave(plan) => plan.shape.delay(),
        }
    }

    /// Ticks after which an input is forgotten.
    pub(crate) fn memory(&self) -> usize {
        match self {
            Self::Direct(plan) => plan.history,
            Self::Fast(plan) => plan.memory(),
            Self::OverlapSave(plan) => plan.shape.history,
        }
    }

    pub(crate) fn summary(&self) -> FormSummary {
        let summary = |name, multiply_adds| FormSummary { name, transform: None, multiply_adds };
        match self {
            Self::Direct(plan) => summary("direct", plan.multiply_adds()),
            Self::Fast(plan) => summary("fast", plan.multiply_adds()),
            Self::OverlapSave(plan) => FormSummary {
                transform: Some((plan.shape.len, plan.shape.block())),
                ..summary("overlap-save", plan.shape.multiply_adds())
            },
        }
    }

    /// All ticks of `source` to `sink`; returns how many samples were not finite.
    pub(crate) fn process(
        &self,
        state: &mut FirBankState<T>,
        source: &(impl TickSource + ?Sized),
        sink: &mut (impl FastSink + ?Sized),
    ) -> u64 {
        match (self, state) {
            (Self::Direct(plan), FirBankState::Direct(state)) => plan.process(state, source, sink),
            (Self::Fast(plan), FirBankState::Fast(state)) => plan.process(state, source, sink),
            (Self::OverlapSave(plan), FirBankState::OverlapSave(state)) => plan.process(state, source, sink),
            // A state is only ever made by its plan.
            _ => 0,
        }
    }

    /// As [`FirBankPlan::process`], on all `workers` if the form has spans.
    #[cfg(feature = "rayon")]
    pub(crate) fn process_parallel(
        &self,
        state: &mut FirBankState<T>,
        source: &(impl TickSource + ?Sized),
        sink: &mut (impl FastSink + ?Sized),
        workers: &Workers,
    ) -> u64 {
        match (self, state) {
            (Self::Direct(plan), FirBankState::Direct(state)) => {
                workers::process(plan, state, source, sink, workers)
            }
            (Self::Fast(plan), FirBankState::Fast(state)) => {
                workers::process(&**plan, state, source, sink, workers)
            }
            (_, state) => self.process(state, source, sink),
        }
    }
}

impl<T: Sample> FirBankState<T> {
    /// As new.
    pub(crate) fn reset(&mut self) {
        match self {
            Self::Direct(state) => state.reset(),
            Self::Fast(state) => state.reset(),
            Self::OverlapSave(state) => state.reset(),
        }
    }
}

#[cfg(feature = "rayon")]
macro_rules! spans {
    ($plan:ident, $state:ident, $period:expr, $lead:expr) => {
        impl<T: Sample> Spans for $plan<T> {
            type State = $state<T>;
            const PERIOD: usize = $period;

            fn products(&self) -> usize {
                (self.multiply_adds() * self.ratio as f64) as usize
            }

            fn ratio(&self) -> usize {
                self.ratio
            }

            fn reach(&self) -> usize {
                self.reach()
            }

            fn lead(state: &$state<T>) -> usize {
                $lead(state)
            }

            fn process(
                &self,
                state: &mut $state<T>,
                source: &(impl TickSource + ?Sized),
                sink: &mut (impl FastSink + ?Sized),
            ) -> u64 {
                self.process(state, source, sink)
            }

            fn state_at(&self, source: &(impl TickSource + ?Sized), first: usize) -> $state<T> {
                self.state_at(source, first)
            }
        }
    };
}

#[cfg(feature = "rayon")]
spans!(FirPlan, FirState, 1, |_| 0);
#[cfg(feature = "rayon")]
spans!(FastFirPlan, FastFirState, fast_fir::PERIOD, FastFirState::lead);
