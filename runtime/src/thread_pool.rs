//! Threads for calls of any streams.

use std::io;

/// Threads that wait for work; any number of streams may use them.
///
/// ```
/// use hybank_runtime::{Interleaved, Options, Plan, Stream, ThreadPool};
///
/// let pool = ThreadPool::new(2)?;
/// let taps = [vec![0.5, 1.0, 0.5, 0.0], vec![0.0, 0.5, 1.0, 0.5]];
/// let plan = Plan::from_taps(&taps, 2, 1, Options::default())?;
/// let (input, mut output) = (vec![0.5f32; 2000], vec![0.0f32; 2000]);
/// Stream::new(&plan).run_parallel(&Interleaved::new(&input, 2)?, &mut output[..], &pool)?;
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
