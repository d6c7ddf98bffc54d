//! A bank at work on one stream.

use super::fir_bank::{FirBankPlan, FirBankState};
use super::form::Form;
use super::sample::Sample;
use super::simd::Isa;
use super::state_space::{StateSpacePlan, StateSpaceState};
use super::ticks::{FastSink, Interleaved, PcmOutput, TickSource};
use super::workers::Workers;
use super::{BuildError, ProcessError};
use crate::bank::{Bank, SynthesisFilters};
use crate::io::PcmFrames;
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

/// How a bank runs, for reports.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct PlanSummary {
    /// `direct`, `fast` or `overlap-save` (FIR), `modal` (delay lines and parallel sections) or `dense` (delay lines and any
    /// other states).
    pub form: &'static str,
    /// Number type of the sums: `f32` or `f64`.
    pub numbers: &'static str,
    /// Instruction set of the kernels.
    pub isa: String,
    /// F, ticks of a transform, if the form has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transform: Option<usize>,
    /// B, ticks of a block, of which a transform makes the outputs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub block: Option<usize>,
    /// Fast samples by which the form is later than the bank's own latency.
    pub extra_latency: usize,
    /// Multiply-adds for each fast sample; additions of the fast form and of transforms count as such. `None` for recursions.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub multiply_adds: Option<f64>,
}

/// Coefficients in the order of use, shared by any number of streams.
#[derive(Debug)]
enum Plan {
    FirSingle(FirBankPlan<f32>),
    FirDouble(FirBankPlan<f64>),
    RecursionSingle(StateSpacePlan<f32>),
    RecursionDouble(StateSpacePlan<f64>),
}

/// The state of one stream, of the plan's kind.
#[derive(Debug, Clone)]
enum StreamState {
    FirSingle(FirBankState<f32>),
    FirDouble(FirBankState<f64>),
    RecursionSingle(StateSpaceState<f32>),
    RecursionDouble(StateSpaceState<f64>),
}

/// Fuses the ticks of one stream: y[kM + p] = sum_i sum_j f_i[p + jM] x_i[k - j], with x_i = 0
/// before the first tick.
///
/// The coefficients are shared: a clone is a second stream at the same place, and
/// [`Reconstructor::fresh`] one at its beginning. [`Reconstructor::process`] allocates nothing and
/// locks nothing, and the same ticks give the same bits however they are cut into calls.
///
/// ```
/// # use hybank::bank::{Bank, SynthesisFilters};
/// use hybank::runtime::Reconstructor;
/// # let taps = SynthesisFilters::Fir(vec![vec![1.0, 0.0], vec![0.0, 1.0]]);
/// # let bank = Bank { latency: 1, delays: vec![0.0, 1.0], ..Bank::bare(taps, 2) };
/// let mut fuse = Reconstructor::new(&bank)?;
/// let mut fast = vec![0.0; 2 * fuse.ratio()];
/// for ticks in [[1.0, 10.0, 2.0, 20.0], [3.0, 30.0, 4.0, 40.0]] {
///     let written = fuse.process(&ticks, &mut fast)?;
///     println!("{:?}, {} samples late", &fast[..written], fuse.latency());
/// }
/// assert_eq!(fast, [3.0, 30.0, 4.0, 40.0]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct Reconstructor {
    plan: Arc<Plan>,
    state: StreamState,
    channels: usize,
    ratio: usize,
    latency: usize,
    isa: Isa,
    replaced: u64,
}

impl Reconstructor {
    /// Makes a bank ready to run in f32 (FIR) or f64 (state space).
    ///
    /// # Errors
    /// [`BuildError`] if the bank's parts do not fit together or hold values that are not finite.
    pub fn new(bank: &Bank) -> Result<Self, BuildError> {
        Self::with_options(bank, Options::default())
    }

    /// Makes a bank ready to run.
    ///
    /// # Errors
    /// As [`Reconstructor::new`].
    pub fn with_options(bank: &Bank, options: Options) -> Result<Self, BuildError> {
        let plan = Plan::new(bank, options)?;
        let state = plan.state();
        let latency = bank.latency + plan.delay() * bank.ratio;
        let (channels, ratio) = (bank.channel_count(), bank.ratio);
        Ok(Self { plan: Arc::new(plan), state, channels, ratio, latency, isa: options.isa, replaced: 0 })
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
        self.plan.delay() * self.ratio()
    }

    /// Ticks after which an input is forgotten; `None` for a recursion, which never forgets.
    pub fn memory(&self) -> Option<usize> {
        match &*self.plan {
            Plan::FirSingle(plan) => Some(plan.memory()),
            Plan::FirDouble(plan) => Some(plan.memory()),
            Plan::RecursionSingle(_) | Plan::RecursionDouble(_) => None,
        }
    }

    /// Ticks of zeros that bring out the last samples, as many as the latency.
    pub fn flush_ticks(&self) -> usize {
        self.latency.div_ceil(self.ratio())
    }

    /// How the bank runs.
    pub fn plan(&self) -> PlanSummary {
        match &*self.plan {
            Plan::FirSingle(plan) => self.fir_summary(plan, "f32"),
            Plan::FirDouble(plan) => self.fir_summary(plan, "f64"),
            Plan::RecursionSingle(plan) => self.summary(recursion_form(plan.is_modal()), "f32"),
            Plan::RecursionDouble(plan) => self.summary(recursion_form(plan.is_modal()), "f64"),
        }
    }

    /// What every form reports.
    fn summary(&self, form: &'static str, numbers: &'static str) -> PlanSummary {
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
            ..self.summary(form.name, numbers)
        }
    }

    /// Input samples that were NaN or infinite and became 0, since the beginning.
    pub fn replaced(&self) -> u64 {
        self.replaced
    }

    /// Times a recursion's state was not finite and began anew, since the beginning.
    pub fn state_resets(&self) -> u64 {
        match &self.state {
            StreamState::RecursionSingle(state) => state.resets,
            StreamState::RecursionDouble(state) => state.resets,
            _ => 0,
        }
    }

    /// A stream of the same bank at its beginning.
    pub fn fresh(&self) -> Self {
        Self { plan: Arc::clone(&self.plan), state: self.plan.state(), replaced: 0, ..*self }
    }

    /// Back to the beginning; gives the same bits as a new one.
    pub fn reset(&mut self) {
        self.replaced = 0;
        match &mut self.state {
            StreamState::FirSingle(state) => state.reset(),
            StreamState::FirDouble(state) => state.reset(),
            StreamState::RecursionSingle(state) => state.reset(),
            StreamState::RecursionDouble(state) => state.reset(),
        }
    }

    /// Takes whole ticks (N samples each, interleaved) and writes M samples for each; returns the
    /// samples written, `input.len() / N * M`. NaN and infinity in the input become 0 and are counted, see
    /// [`Reconstructor::replaced`].
    ///
    /// # Errors
    /// [`ProcessError`] if the slices do not fit; nothing is processed then.
    pub fn process(&mut self, input: &[f32], output: &mut [f32]) -> Result<usize, ProcessError> {
        let source = self.interleaved(input)?;
        self.run(&source, output, None)
    }

    /// As [`Reconstructor::process`], on all `workers` at once, with the same bits: each takes spans of ticks and
    /// begins with the filter memory before them. Recursions, overlap-save, and calls of less than some two million
    /// multiply-adds stay on this thread. Unlike `process` it allocates (the states of the spans) and waits for the workers.
    ///
    /// # Errors
    /// As [`Reconstructor::process`].
    pub fn process_parallel(
        &mut self,
        input: &[f32],
        output: &mut [f32],
        workers: &Workers,
    ) -> Result<usize, ProcessError> {
        let source = self.interleaved(input)?;
        self.run(&source, output, Some(workers))
    }

    /// As [`Reconstructor::process_pcm`], on all `workers` at once; see [`Reconstructor::process_parallel`].
    ///
    /// # Errors
    /// As [`Reconstructor::process`].
    pub fn process_pcm_parallel(
        &mut self,
        input: &[PcmFrames<'_>],
        output: &mut PcmOutput<'_>,
        workers: &Workers,
    ) -> Result<usize, ProcessError> {
        self.run(input, output, Some(workers))
    }

    /// As [`Reconstructor::process`], for f64 samples (whatever the precision of the kernels).
    ///
    /// # Errors
    /// As [`Reconstructor::process`].
    pub fn process_f64(&mut self, input: &[f64], output: &mut [f64]) -> Result<usize, ProcessError> {
        let source = self.interleaved(input)?;
        self.run(&source, output, None)
    }

    /// As [`Reconstructor::process`], from and to samples as they lie in files and pipes: the
    /// channels are those of all `input` recordings one after another, the ticks those that all of
    /// them have. Outputs that do not fit an integer format saturate and are counted.
    ///
    /// # Errors
    /// As [`Reconstructor::process`].
    pub fn process_pcm(
        &mut self,
        input: &[PcmFrames<'_>],
        output: &mut PcmOutput<'_>,
    ) -> Result<usize, ProcessError> {
        self.run(input, output, None)
    }

    fn interleaved<'a, S>(&self, samples: &'a [S]) -> Result<Interleaved<'a, S>, ProcessError> {
        let channels = self.channels();
        Interleaved::new(samples, channels).ok_or(ProcessError::CutTick { samples: samples.len(), channels })
    }

    fn run(
        &mut self,
        source: &(impl TickSource + ?Sized),
        sink: &mut (impl FastSink + ?Sized),
        workers: Option<&Workers>,
    ) -> Result<usize, ProcessError> {
        let wanted = self.check(source, sink)?;
        self.replaced += match (&*self.plan, &mut self.state) {
            (Plan::FirSingle(plan), StreamState::FirSingle(state)) => {
                plan.process(state, source, sink, workers)
            }
            (Plan::FirDouble(plan), StreamState::FirDouble(state)) => {
                plan.process(state, source, sink, workers)
            }
            (Plan::RecursionSingle(plan), StreamState::RecursionSingle(state)) => {
                plan.process(state, source, sink)
            }
            (Plan::RecursionDouble(plan), StreamState::RecursionDouble(state)) => {
                plan.process(state, source, sink)
            }
            // A state is only ever made by its plan.
            _ => 0,
        };
        Ok(wanted)
    }

    /// The samples that will be written, if everything fits.
    fn check(
        &self,
        source: &(impl TickSource + ?Sized),
        sink: &(impl FastSink + ?Sized),
    ) -> Result<usize, ProcessError> {
        if source.channels() != self.channels() {
            return Err(ProcessError::Channels { given: source.channels(), wanted: self.channels() });
        }
        let wanted = source.ticks() * self.ratio();
        if sink.capacity() < wanted {
            return Err(ProcessError::OutputTooShort { given: sink.capacity(), wanted });
        }
        Ok(wanted)
    }
}

fn recursion_form(modal: bool) -> &'static str {
    if modal { "modal" } else { "dense" }
}

impl Plan {
    fn new(bank: &Bank, options: Options) -> Result<Self, BuildError> {
        let (channels, ratio) = (bank.channel_count(), bank.ratio);
        if ratio == 0 {
            return Err(BuildError::NoRatio);
        }
        if channels == 0 {
            return Err(BuildError::NoChannels);
        }
        match (&bank.filters, options.precision) {
            (SynthesisFilters::Fir(taps), _) if taps.len() != channels => {
                Err(BuildError::FilterCount { delays: channels, filters: taps.len() })
            }
            (SynthesisFilters::Fir(taps), precision) => {
                let choice = options.form.choose(taps, ratio, precision)?;
                match precision {
                    Precision::Single => {
                        FirBankPlan::new(taps, ratio, choice, options.isa).map(Self::FirSingle)
                    }
                    Precision::Double => {
                        FirBankPlan::new(taps, ratio, choice, options.isa).map(Self::FirDouble)
                    }
                }
            }
            (SynthesisFilters::StateSpace(filter), _) => {
                options.form.check_recursive()?;
                match options.recursion {
                    Precision::Single => {
                        StateSpacePlan::new(filter, channels, ratio, options.isa).map(Self::RecursionSingle)
                    }
                    Precision::Double => {
                        StateSpacePlan::new(filter, channels, ratio, options.isa).map(Self::RecursionDouble)
                    }
                }
            }
        }
    }

    /// Ticks by which outputs are later than their last input.
    fn delay(&self) -> usize {
        match self {
            Self::FirSingle(plan) => plan.delay(),
            Self::FirDouble(plan) => plan.delay(),
            Self::RecursionSingle(_) | Self::RecursionDouble(_) => 0,
        }
    }

    fn state(&self) -> StreamState {
        match self {
            Self::FirSingle(plan) => StreamState::FirSingle(plan.state()),
            Self::FirDouble(plan) => StreamState::FirDouble(plan.state()),
            Self::RecursionSingle(plan) => StreamState::RecursionSingle(plan.state()),
            Self::RecursionDouble(plan) => StreamState::RecursionDouble(plan.state()),
        }
    }
}
