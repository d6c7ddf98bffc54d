//! Many numbered cases, on as many threads as there are processors.
// Each test program uses a part of it.
#![allow(dead_code)]

use std::ops::Range;
use std::panic::resume_unwind;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::ScopedJoinHandle;

/// The results for all numbers of a range.
pub(crate) fn each<T: Send>(range: Range<u64>, task: impl Fn(u64) -> T + Sync) -> Vec<T> {
    let next = AtomicU64::new(range.start);
    let work = || -> Vec<T> {
        let mine = std::iter::from_fn(|| Some(next.fetch_add(1, Ordering::Relaxed)));
        mine.take_while(|&number| number < range.end).map(&task).collect()
    };
    std::thread::scope(|scope| {
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        let join =
            |worker: ScopedJoinHandle<'_, Vec<T>>| worker.join().unwrap_or_else(|fault| resume_unwind(fault));
        workers.into_iter().flat_map(join).collect()
    })
}
