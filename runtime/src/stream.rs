//! One stream through a plan: its state, and the calls that take samples.

#[cfg(feature = "rayon")]
use super::Workers;
use super::fir_bank::{FirBankPlan, FirBankState};
use super::plan::{Engine, Plan, State};
use super::sample::Sample;
use super::ticks::{FastSink, Interleaved, PcmOutput, TickSource};
use super::{PcmFrames, ProcessError};

/// Fuses the ticks of one stream: y[kM + p] = sum_i sum_j f_i[p + jM] x_i[k - j], with x_i = 0
/// before the first tick.
///
/// The coefficients are shared: a clone is a second stream at the same place, and
/// [`Stream::fresh`] one at its beginning. [`Stream::process`] allocates nothing and
/// locks nothing, and the same ticks give the same bits however they are cut into calls.
///
/// ```
/// use hybank_runtime::{Options, Plan, Stream};
/// let taps = [vec![1.0, 0.0], vec![0.0, 1.0]];
/// let plan = Plan::from_taps(&taps, 2, 1, Options::default())?;
/// let mut stream = Stream::new(&plan);
/// let mut fast = vec![0.0; 2 * plan.ratio()];
/// for ticks in [[1.0, 10.0, 2.0, 20.0], [3.0, 30.0, 4.0, 40.0]] {
///     let written = stream.process(&ticks, &mut fast)?;
///     println!("{:?}, {} samples late", &fast[..written], plan.latency());
/// }
/// assert_eq!(fast, [3.0, 30.0, 4.0, 40.0]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct Stream {
    plan: Plan,
    state: State,
    replaced: u64,
}

/// Runs the FIR plan of a call, on one thread or on several.
trait FirRunner {
    fn run<T: Sample>(
        &self,
        plan: &FirBankPlan<T>,
        state: &mut FirBankState<T>,
        source: &(impl TickSource + ?Sized),
        sink: &mut (impl FastSink + ?Sized),
    ) -> u64;
}

/// On this thread.
struct Here;

impl FirRunner for Here {
    fn run<T: Sample>(
        &self,
        plan: &FirBankPlan<T>,
        state: &mut FirBankState<T>,
        source: &(impl TickSource + ?Sized),
        sink: &mut (impl FastSink + ?Sized),
    ) -> u64 {
        plan.process(state, source, sink)
    }
}

#[cfg(feature = "rayon")]
impl FirRunner for Workers {
    fn run<T: Sample>(
        &self,
        plan: &FirBankPlan<T>,
        state: &mut FirBankState<T>,
        source: &(impl TickSource + ?Sized),
        sink: &mut (impl FastSink + ?Sized),
    ) -> u64 {
        plan.process_parallel(state, source, sink, self)
    }
}

impl Stream {
    /// A stream at its beginning.
    pub fn new(plan: &Plan) -> Self {
        Self { plan: plan.clone(), state: plan.engine().state(), replaced: 0 }
    }

    /// How the stream runs.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// N, samples a tick in.
    pub fn channels(&self) -> usize {
        self.plan.channels()
    }

    /// M, samples a tick out.
    pub fn ratio(&self) -> usize {
        self.plan.ratio()
    }

    /// See [`Plan::latency`].
    pub fn latency(&self) -> usize {
        self.plan.latency()
    }

    /// See [`Plan::extra_latency`].
    pub fn extra_latency(&self) -> usize {
        self.plan.extra_latency()
    }

    /// See [`Plan::memory`].
    pub fn memory(&self) -> Option<usize> {
        self.plan.memory()
    }

    /// Ticks of zeros that bring out the last samples, as many as the latency.
    pub fn flush_ticks(&self) -> usize {
        self.latency().div_ceil(self.ratio())
    }

    /// Input samples that were NaN or infinite and became 0, since the beginning.
    pub fn replaced(&self) -> u64 {
        self.replaced
    }

    /// Times a recursion's state was not finite and began anew, since the beginning.
    pub fn state_resets(&self) -> u64 {
        match &self.state {
            State::RecursionSingle(state) => state.resets,
            State::RecursionDouble(state) => state.resets,
            _ => 0,
        }
    }

    /// A stream of the same bank at its beginning.
    pub fn fresh(&self) -> Self {
        Self::new(&self.plan)
    }

    /// Back to the beginning; gives the same bits as a new one.
    pub fn reset(&mut self) {
        self.replaced = 0;
        match &mut self.state {
            State::FirSingle(state) => state.reset(),
            State::FirDouble(state) => state.reset(),
            State::RecursionSingle(state) => state.reset(),
            State::RecursionDouble(state) => state.reset(),
        }
    }

    /// Takes whole ticks (N samples each, interleaved) and writes M samples for each; returns the
    /// samples written, `input.len() / N * M`. NaN and infinity in the input become 0 and are counted, see
    /// [`Stream::replaced`].
    ///
    /// # Errors
    /// [`ProcessError`] if the slices do not fit; nothing is processed then.
    pub fn process(&mut self, input: &[f32], output: &mut [f32]) -> Result<usize, ProcessError> {
        let source = self.interleaved(input)?;
        self.run(&source, output, &Here)
    }

    /// As [`Stream::process`], on all `workers` at once, with the same bits: each takes spans of ticks and
    /// begins with the filter memory before them. Recursions, overlap-save, and calls of less than some two million
    /// multiply-adds stay on this thread. Unlike `process` it allocates (the states of the spans) and waits for the workers.
    ///
    /// # Errors
    /// As [`Stream::process`].
    #[cfg(feature = "rayon")]
    pub fn process_parallel(
        &mut self,
        input: &[f32],
        output: &mut [f32],
        workers: &Workers,
    ) -> Result<usize, ProcessError> {
        let source = self.interleaved(input)?;
        self.run(&source, output, workers)
    }

    /// As [`Stream::process_pcm`], on all `workers` at once; see [`Stream::process_parallel`].
    ///
    /// # Errors
    /// As [`Stream::process`].
    #[cfg(feature = "rayon")]
    pub fn process_pcm_parallel(
        &mut self,
        input: &[PcmFrames<'_>],
        output: &mut PcmOutput<'_>,
        workers: &Workers,
    ) -> Result<usize, ProcessError> {
        self.run(input, output, workers)
    }

    /// As [`Stream::process`], for f64 samples (whatever the precision of the kernels).
    ///
    /// # Errors
    /// As [`Stream::process`].
    pub fn process_f64(&mut self, input: &[f64], output: &mut [f64]) -> Result<usize, ProcessError> {
        let source = self.interleaved(input)?;
        self.run(&source, output, &Here)
    }

    /// As [`Stream::process`], from and to samples as they lie in files and pipes: the
    /// channels are those of all `input` recordings one after another, the ticks those that all of
    /// them have. Outputs that do not fit an integer format saturate and are counted.
    ///
    /// # Errors
    /// As [`Stream::process`].
    pub fn process_pcm(
        &mut self,
        input: &[PcmFrames<'_>],
        output: &mut PcmOutput<'_>,
    ) -> Result<usize, ProcessError> {
        self.run(input, output, &Here)
    }

    fn interleaved<'a, S>(&self, samples: &'a [S]) -> Result<Interleaved<'a, S>, ProcessError> {
        let channels = self.channels();
        Interleaved::new(samples, channels).ok_or(ProcessError::CutTick { samples: samples.len(), channels })
    }

    fn run(
        &mut self,
        source: &(impl TickSource + ?Sized),
        sink: &mut (impl FastSink + ?Sized),
        runner: &impl FirRunner,
    ) -> Result<usize, ProcessError> {
        let wanted = self.check(source, sink)?;
        self.replaced += match (self.plan.engine(), &mut self.state) {
            (Engine::FirSingle(plan), State::FirSingle(state)) => runner.run(plan, state, source, sink),
            (Engine::FirDouble(plan), State::FirDouble(state)) => runner.run(plan, state, source, sink),
            (Engine::RecursionSingle(plan), State::RecursionSingle(state)) => {
                plan.process(state, source, sink)
            }
            (Engine::RecursionDouble(plan), State::RecursionDouble(state)) => {
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
