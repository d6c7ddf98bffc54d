//! One stream through a plan: its state, and the calls that take samples.

#[cfg(feature = "rayon")]
use crate::adapters::SplitOutput;
use crate::adapters::{Corrected, FrameSink, FrameSource, Interleaved, Zeros};
use crate::engine::Engine;
use crate::state::{Count, StateHeader, StateNumbers};
use crate::{Plan, ProcessError, Sample, StateError};

/// Filters the frames of one stream: y[kM + p] = sum_i sum_j f_i[p + jM] x_i[k - j], with x_i = 0 before the
/// first frame, and x_i the samples without the [offsets](Plan::with_corrections) and nonlinearities of
/// their converters.
///
/// A frame is one sample of each of the N channels; each gives M output samples, p = 0..M - 1. All calls
/// take whole frames and return the samples written. They allocate nothing and lock nothing (except those of
/// a [`ThreadPool`](crate::ThreadPool)), and the same frames give the same bits however they are cut into
/// calls. [Offsets](Plan::with_corrections) cost a copy of the samples.
///
/// # Worst case of a call
/// NaN and infinity in the input become 0 and are counted, see [`Stream::replaced`]. Whatever the input
/// holds, a frame is filtered at most twice, so that a call does at most twice the multiply-adds that it
/// would do for ordinary numbers:
///
/// | | NaN or infinity in the input | sums that overflow |
/// |---|---|---|
/// | direct | seen in the outputs; frames that they reach filtered again | filtered again at most once |
/// | overlap-save | replaced first; filtered once | filtered once; all outputs of the batch may be NaN |
/// | recursive | replaced first; filtered once | filtered once; state 0, [counted](Self::state_resets) |
///
/// The search for what is not finite passes over the input at most three times.
///
/// Denormals change none of these counts: numbers below 1.2e-38 in f32 and below 2.3e-308 in f64 count as 0,
/// on every processor, whatever floating-point mode the thread has; that mode is as before after the call.
/// Otherwise a signal that fades away would run at a hundredth of the speed on some of them.
/// Recursions flush their states every 64 frames: those below 1e-280 become 0.
///
/// A clone is a second stream at the same place.
#[derive(Debug, Clone)]
pub struct Stream {
    plan: Plan,
    engine: Engine,
    /// Frames since the beginning.
    position: u64,
    replaced: u64,
}

impl Stream {
    /// A stream at its beginning.
    pub fn new(plan: &Plan) -> Self {
        Self { plan: plan.clone(), engine: plan.start(), position: 0, replaced: 0 }
    }

    /// What the stream runs by.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// N, samples per frame of the input.
    pub fn channels(&self) -> usize {
        self.plan.channels()
    }

    /// M, output samples per frame.
    pub fn ratio(&self) -> usize {
        self.plan.ratio()
    }

    /// Frames since the beginning.
    pub fn position(&self) -> u64 {
        self.position
    }

    /// Input samples that were NaN or infinite and became 0, since the beginning.
    pub fn replaced(&self) -> u64 {
        self.replaced
    }

    /// Times a recursion's state was not finite and became 0, since the beginning.
    pub fn state_resets(&self) -> u64 {
        self.engine.resets()
    }

    /// Back to the beginning, without allocating; gives the same bits as a new stream.
    pub fn reset(&mut self) {
        self.engine.reset();
        (self.position, self.replaced) = (0, 0);
    }

    /// Filters interleaved samples in f32 or f64 (whatever the precision of the kernels): sample of channel
    /// i in frame k at `input[k N + i]`, output sample p of that frame at `output[k M + p]`. Returns the
    /// samples written, `input.len() / N * M`.
    ///
    /// # Errors
    /// [`ProcessError`] if the slices do not fit; nothing is processed then.
    pub fn process<S: Sample>(&mut self, input: &[S], mut output: &mut [S]) -> Result<usize, ProcessError> {
        self.run(&Interleaved::new(input, self.channels())?, &mut output)
    }

    /// As [`Stream::process`], from any input and to any output.
    ///
    /// # Errors
    /// As [`Stream::process`].
    pub fn run(
        &mut self,
        input: &dyn FrameSource,
        output: &mut dyn FrameSink,
    ) -> Result<usize, ProcessError> {
        let frames = self.check(input, output)?;
        self.replaced += match self.plan.corrections() {
            Some(corrections) => self.engine.process(&Corrected { input, corrections }, output),
            None => self.engine.process(input, output),
        };
        self.position += frames as u64;
        Ok(frames * self.ratio())
    }

    /// As [`Stream::run`], on all threads of `pool` at once, with the same bits: each takes chunks of frames
    /// and begins with the history before them. Recursions, overlap-save, and calls of less than some two
    /// million multiply-adds stay on this thread. Unlike `run` it allocates (the states of the chunks) and
    /// waits for the threads.
    ///
    /// # Errors
    /// As [`Stream::process`].
    #[cfg(feature = "rayon")]
    pub fn run_parallel(
        &mut self,
        input: &dyn FrameSource,
        output: &mut dyn SplitOutput,
        pool: &crate::ThreadPool,
    ) -> Result<usize, ProcessError> {
        let frames = self.check(input, output)?;
        self.replaced += match self.plan.corrections() {
            Some(corrections) => {
                self.engine.process_parallel(&Corrected { input, corrections }, output, pool)
            }
            None => self.engine.process_parallel(input, output, pool),
        };
        self.position += frames as u64;
        Ok(frames * self.ratio())
    }

    /// Brings out the last samples by [`Plan::flush_frames`] frames of zeros, which are part of the stream
    /// like any others. Returns the samples written, that many frames times M; `output` needs room for them.
    ///
    /// # Errors
    /// [`ProcessError::OutputTooShort`]; nothing is processed then.
    pub fn flush(&mut self, output: &mut dyn FrameSink) -> Result<usize, ProcessError> {
        let zeros = Zeros { channels: self.channels(), frames: self.plan.flush_frames() };
        let frames = self.check(&zeros, output)?;
        // Zeros without offsets: what no converter delivered.
        self.engine.process(&zeros, output);
        self.position += frames as u64;
        Ok(frames * self.ratio())
    }

    /// The state as bytes, from which [`Stream::resume`] goes on, in this process or another one, on any
    /// processor. Allocates them; [`Stream::save`] need not.
    pub fn state(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(self.state_bytes());
        self.save(&mut bytes);
        bytes
    }

    /// Bytes of the [state](Stream::state) at this frame. Plans of FIR filters keep their history;
    /// overlap-save keeps a batch too, and a recursion its states.
    pub fn state_bytes(&self) -> usize {
        StateHeader::bytes(self.count(self.position))
    }

    /// Appends the [state](Stream::state) to `bytes`. Allocates only where these have no room for it.
    pub fn save(&self, bytes: &mut Vec<u8>) {
        let Self { position, replaced, .. } = *self;
        let header =
            StateHeader { position, replaced, resets: self.state_resets(), digest: self.plan.digest() };
        header.write(self.plan.alignment(), bytes);
        let mut put = |number: f64| bytes.extend_from_slice(&number.to_le_bytes());
        self.engine.save(&mut put);
    }

    /// Makes this stream, whatever it was, the continuation of the one that gave `state`: the same frames
    /// give the same bits and counts. Does not allocate.
    ///
    /// # Errors
    /// [`StateError`] if the bytes are not a state of this plan, that is of the same filters, offsets,
    /// algorithm, number type and latency; the stream is as before then.
    pub fn resume(&mut self, state: &[u8]) -> Result<(), StateError> {
        let (header, numbers) = self.read(state)?;
        let place = header.position % self.plan.alignment() as u64;
        self.engine.resume(place as usize, numbers, header.resets);
        (self.position, self.replaced) = (header.position, header.replaced);
        Ok(())
    }

    /// The parts of a state of this plan.
    fn read<'a>(&self, state: &'a [u8]) -> Result<(StateHeader, StateNumbers<'a>), StateError> {
        let count = |place: usize| self.count(place as u64);
        StateHeader::read(state, self.plan.digest(), self.plan.alignment(), count)
    }

    /// Numbers of the state at a frame.
    fn count(&self, position: u64) -> Count {
        self.engine.count((position % self.plan.alignment() as u64) as usize)
    }

    /// The frames of a call, if everything fits.
    fn check(&self, input: &dyn FrameSource, output: &dyn FrameSink) -> Result<usize, ProcessError> {
        if input.channels() != self.channels() {
            return Err(ProcessError::Channels { given: input.channels(), wanted: self.channels() });
        }
        let (frames, ratio) = (input.frames(), self.ratio());
        let Some(wanted) = frames.checked_mul(ratio) else {
            return Err(ProcessError::TooManyFrames { frames, ratio });
        };
        if output.capacity() < wanted {
            return Err(ProcessError::OutputTooShort { given: output.capacity(), wanted });
        }
        Ok(frames)
    }
}
