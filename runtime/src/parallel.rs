//! Calls on several threads.
//!
//! A call is halved until its chunks are short, or many; each chunk has a state of its own, made from the
//! history before it, so its outputs have the bits that one thread would give them. There are more chunks
//! than threads: a thread that is done takes the next one, so that a thread that was held up does not hold
//! up all.

use crate::Sample;
use crate::adapters::{FrameSink, FrameSource, Frames, SplitOutput};
use crate::algorithms::Filter;
use crate::algorithms::direct::{Direct, DirectState};
use crate::simd::flushing;
use std::io;
use std::ops::Range;

/// Multiply-adds that are worth a chunk: some tens of microseconds, many times what it costs to hand it
/// over.
const CHUNK_MULTIPLY_ADDS: usize = 1 << 20;

/// Chunks of a long call for each thread, at most: enough for those that are faster to help out, and each
/// long against making its state.
const CHUNKS_PER_THREAD: usize = 8;

/// Runs a call on all threads and leaves the state after its last frame; returns how many samples were not
/// finite.
pub(crate) fn process<T: Sample>(
    filter: &Direct<T>,
    state: &mut DirectState<T>,
    input: &dyn FrameSource,
    output: &mut dyn SplitOutput,
    pool: &ThreadPool,
) -> u64 {
    let frames = input.frames();
    let frame_multiply_adds = (filter.multiply_adds() * filter.ratio as f64) as usize;
    let least = CHUNK_MULTIPLY_ADDS.div_ceil(frame_multiply_adds).max(4 * filter.history_frames());
    if pool.threads() == 1 || frames < 2 * least {
        return flushing(|| filter.process(state, input, output));
    }
    let chunk = least.max(frames / (CHUNKS_PER_THREAD * pool.threads()));
    let call = Call { filter, input, chunk };
    let (replaced, last) = pool.install(|| call.chunks(0..frames, Some(state), output));
    if let Some(last) = last {
        *state = last;
    }
    replaced
}

/// A call whose chunks are shared out.
struct Call<'a, T: Sample> {
    filter: &'a Direct<T>,
    input: &'a dyn FrameSource,
    /// Least frames of a chunk.
    chunk: usize,
}

impl<T: Sample> Call<'_, T> {
    /// The frames of a range to an output of their own. The first chunk has the stream's `state`, the others
    /// make theirs; returns how many samples were not finite, and the state after the last chunk if it is
    /// not the stream's.
    fn chunks(
        &self,
        frames: Range<usize>,
        mut state: Option<&mut DirectState<T>>,
        output: &mut dyn SplitOutput,
    ) -> (u64, Option<DirectState<T>>) {
        if frames.len() < 2 * self.chunk {
            return self.chunk(frames, state, output);
        }
        let middle = frames.start + frames.len() / 2;
        let mut done = (0, None);
        output.halves((middle - frames.start) * self.filter.ratio, &mut |earlier, later| {
            let state = state.take();
            let ((some, _), (more, last)) = rayon::join(
                || self.chunks(frames.start..middle, state, earlier),
                || self.chunks(middle..frames.end, None, later),
            );
            done = (some + more, last);
        });
        done
    }

    fn chunk(
        &self,
        frames: Range<usize>,
        state: Option<&mut DirectState<T>>,
        output: &mut dyn FrameSink,
    ) -> (u64, Option<DirectState<T>>) {
        let chunk = Frames::new(self.input, frames.clone());
        match state {
            Some(state) => (flushing(|| self.filter.process(state, &chunk, output)), None),
            None => {
                let mut own = self.filter.state_at(self.input, frames.start);
                (flushing(|| self.filter.process(&mut own, &chunk, output)), Some(own))
            }
        }
    }
}

/// Threads that wait for work; any number of streams may use them.
///
/// ```
/// use hybank_runtime::{Interleaved, Options, Plan, Stream, ThreadPool};
///
/// let pool = ThreadPool::new(2)?;
/// let taps = [vec![0.5, 1.0, 0.5, 0.0], vec![0.0, 0.5, 1.0, 0.5]];
/// let plan = Plan::from_taps(&taps, 2, 1, Options::default())?;
/// let (input, mut output) = (vec![0.5f32; 2000], vec![0.0f32; 2000]);
/// Stream::new(&plan).run_parallel(&Interleaved::new(&input, 2)?, &mut output.as_mut_slice(), &pool)?;
/// assert_eq!(output[1998..], [1.0, 1.0]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct ThreadPool {
    pool: rayon::ThreadPool,
}

impl ThreadPool {
    /// Starts `threads` threads, one for each processor if that is 0.
    ///
    /// # Errors
    /// If the system starts no more threads.
    pub fn new(threads: usize) -> io::Result<Self> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        Ok(Self { pool: pool.map_err(io::Error::other)? })
    }

    /// How many there are.
    pub fn threads(&self) -> usize {
        self.pool.current_num_threads()
    }

    /// Runs a task on these threads and waits for it; what it joins may go to any of them.
    pub(crate) fn install<R: Send>(&self, task: impl FnOnce() -> R + Send) -> R {
        self.pool.install(task)
    }
}
