//! A bank made ready to run: coefficients in the order of use, shared by any number of streams.

use super::BuildError;
use super::fir_bank::{FirBankPlan, FirBankState};
use super::form::Form;
use super::sample::Sample;
use super::simd::Isa;
use super::state_space::{StateSpacePlan, StateSpaceState};
use std::sync::Arc;

/// Number type of the kernels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Precision {
    /// Coefficients and sums in f32: error about 1e-7 of full scale.
    #[default]
    Single,
    /// Coefficients and sums in f64, at half the speed.
    Double,
}

/// How a bank is made ready to run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Options {
    /// Number type of the FIR kernels.
    pub precision: Precision,
    /// Number type of recursions, [`Precision::Double`] unless asked for otherwise: a recursion feeds its rounding
    /// errors back, and in f32 the error is about 1e-7 of full scale divided by 1 - |pole|.
    pub recursion: Precision,
    /// Form of FIR banks, [`Form::Direct`] unless asked for otherwise, because the others round otherwise or are later.
    pub form: Form,
    /// Instruction set, the widest one unless asked for otherwise.
    pub isa: Isa,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            precision: Precision::default(),
            recursion: Precision::Double,
            form: Form::default(),
            isa: Isa::detect(),
        }
    }
}

/// A filter in state space, one step for each frame: x+ = a x + b u, y = c x + d u; u the N samples of a frame, y its
/// M output samples. Row-major lists of rows.
#[derive(Debug, Clone, PartialEq)]
pub struct StateSpace {
    /// n x n.
    pub a: Vec<Vec<f64>>,
    /// n x N.
    pub b: Vec<Vec<f64>>,
    /// M x n.
    pub c: Vec<Vec<f64>>,
    /// M x N.
    pub d: Vec<Vec<f64>>,
}

/// How a bank runs, for reports.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanSummary {
    /// `direct`, `fast` or `overlap-save` (FIR), `modal` (delay lines and parallel sections) or `dense` (delay lines and any
    /// other states).
    pub form: &'static str,
    /// Number type of the sums: `f32` or `f64`.
    pub numbers: &'static str,
    /// Instruction set of the kernels.
    pub isa: String,
    /// F, ticks of a transform, if the form has one.
    pub transform: Option<usize>,
    /// B, ticks of a block, of which a transform makes the outputs.
    pub block: Option<usize>,
    /// Fast samples by which the form is later than the bank's own latency.
    pub extra_latency: usize,
    /// Multiply-adds for each fast sample; additions of the fast form and of transforms count as such. `None` for recursions.
    pub multiply_adds: Option<f64>,
}

/// A bank made ready to run. A clone shares the coefficients.
#[derive(Debug, Clone)]
pub struct Plan {
    engine: Arc<Engine>,
    channels: usize,
    ratio: usize,
    latency: usize,
    isa: Isa,
}

/// Coefficients in the order of use.
#[derive(Debug)]
pub(crate) enum Engine {
    FirSingle(FirBankPlan<f32>),
    FirDouble(FirBankPlan<f64>),
    RecursionSingle(StateSpacePlan<f32>),
    RecursionDouble(StateSpacePlan<f64>),
}

/// The state of one stream, of the engine's kind.
#[derive(Debug, Clone)]
pub(crate) enum State {
    FirSingle(FirBankState<f32>),
    FirDouble(FirBankState<f64>),
    RecursionSingle(StateSpaceState<f32>),
    RecursionDouble(StateSpaceState<f64>),
}

impl Plan {
    /// FIR filters: `taps[i][n]` = f_i\[n\] at the fast rate, for i = 1..N, n = 0..L_i; M = `ratio`; `latency` = m0, the fast
    /// samples by which the filters were designed to be late.
    ///
    /// # Errors
    /// [`BuildError`] if N or M is 0, a tap is not finite, or the filters are too long, for the chosen form or at all.
    pub fn from_taps(
        taps: &[Vec<f64>],
        ratio: usize,
        latency: usize,
        options: Options,
    ) -> Result<Self, BuildError> {
        check_counts(taps.len(), ratio)?;
        let choice = options.form.choose(taps, ratio, options.precision)?;
        let engine = match options.precision {
            Precision::Single => FirBankPlan::new(taps, ratio, choice, options.isa).map(Engine::FirSingle),
            Precision::Double => FirBankPlan::new(taps, ratio, choice, options.isa).map(Engine::FirDouble),
        }?;
        Ok(Self::new(engine, [taps.len(), ratio], latency, options.isa))
    }

    /// Recursive filters for N = `channels` and M = `ratio`; `latency` as in [`Plan::from_taps`].
    ///
    /// # Errors
    /// [`BuildError`] if N or M is 0, the matrices do not fit together, or an entry is not finite.
    pub fn from_state_space(
        filter: &StateSpace,
        [channels, ratio]: [usize; 2],
        latency: usize,
        options: Options,
    ) -> Result<Self, BuildError> {
        check_counts(channels, ratio)?;
        options.form.check_recursive()?;
        let engine = match options.recursion {
            Precision::Single => {
                StateSpacePlan::new(filter, channels, ratio, options.isa).map(Engine::RecursionSingle)
            }
            Precision::Double => {
                StateSpacePlan::new(filter, channels, ratio, options.isa).map(Engine::RecursionDouble)
            }
        }?;
        Ok(Self::new(engine, [channels, ratio], latency, options.isa))
    }

    fn new(engine: Engine, [channels, ratio]: [usize; 2], latency: usize, isa: Isa) -> Self {
        let latency = latency + engine.delay() * ratio;
        Self { engine: Arc::new(engine), channels, ratio, latency, isa }
    }

    pub(crate) fn engine(&self) -> &Engine {
        &self.engine
    }

    /// N, samples a tick in.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// M, samples a tick out.
    pub fn ratio(&self) -> usize {
        self.ratio
    }

    /// m0 and what the form adds to it: output sample n belongs to the time of fast sample n - latency.
    pub fn latency(&self) -> usize {
        self.latency
    }

    /// The part of the latency that is due to the form: y\[n\] of the direct form comes as sample n + extra.
    pub fn extra_latency(&self) -> usize {
        self.engine.delay() * self.ratio
    }

    /// Ticks after which an input is forgotten; `None` for a recursion, which never forgets.
    pub fn memory(&self) -> Option<usize> {
        match &*self.engine {
            Engine::FirSingle(plan) => Some(plan.memory()),
            Engine::FirDouble(plan) => Some(plan.memory()),
            Engine::RecursionSingle(_) | Engine::RecursionDouble(_) => None,
        }
    }

    /// How the bank runs.
    pub fn summary(&self) -> PlanSummary {
        match &*self.engine {
            Engine::FirSingle(plan) => self.fir_summary(plan, "f32"),
            Engine::FirDouble(plan) => self.fir_summary(plan, "f64"),
            Engine::RecursionSingle(plan) => self.any_summary(recursion_form(plan.is_modal()), "f32"),
            Engine::RecursionDouble(plan) => self.any_summary(recursion_form(plan.is_modal()), "f64"),
        }
    }

    /// What every form reports.
    fn any_summary(&self, form: &'static str, numbers: &'static str) -> PlanSummary {
        PlanSummary {
            form,
            numbers,
            isa: self.isa.to_string(),
            transform: None,
            block: None,
            extra_latency: self.extra_latency(),
            multiply_adds: None,
        }
    }

    fn fir_summary<T: Sample>(&self, plan: &FirBankPlan<T>, numbers: &'static str) -> PlanSummary {
        let form = plan.summary();
        PlanSummary {
            transform: form.transform.map(|(len, _)| len),
            block: form.transform.map(|(_, block)| block),
            multiply_adds: Some(form.multiply_adds),
            ..self.any_summary(form.name, numbers)
        }
    }
}

fn check_counts(channels: usize, ratio: usize) -> Result<(), BuildError> {
    match (channels, ratio) {
        (_, 0) => Err(BuildError::NoRatio),
        (0, _) => Err(BuildError::NoChannels),
        _ => Ok(()),
    }
}

fn recursion_form(modal: bool) -> &'static str {
    if modal { "modal" } else { "dense" }
}

impl Engine {
    /// Ticks by which outputs are later than their last input.
    fn delay(&self) -> usize {
        match self {
            Self::FirSingle(plan) => plan.delay(),
            Self::FirDouble(plan) => plan.delay(),
            Self::RecursionSingle(_) | Self::RecursionDouble(_) => 0,
        }
    }

    pub(crate) fn state(&self) -> State {
        match self {
            Self::FirSingle(plan) => State::FirSingle(plan.state()),
            Self::FirDouble(plan) => State::FirDouble(plan.state()),
            Self::RecursionSingle(plan) => State::RecursionSingle(plan.state()),
            Self::RecursionDouble(plan) => State::RecursionDouble(plan.state()),
        }
    }
}
