//! Repeats a task and says how long it takes. Each benchmark uses it as a module.

use std::hint::black_box;
use std::time::{Duration, Instant};

/// Time for the repeats of one task.
const EACH: Duration = Duration::from_secs(3);
const FEWEST: usize = 5;
const MOST: usize = 200;

/// Prints the median and the least time of a task; gives the median.
pub(crate) fn time<T>(name: &str, mut task: impl FnMut() -> T) -> Duration {
    black_box(task());
    let begin = Instant::now();
    let mut times = Vec::new();
    while times.len() < FEWEST || (times.len() < MOST && begin.elapsed() < EACH) {
        let start = Instant::now();
        black_box(task());
        times.push(start.elapsed());
    }
    times.sort_unstable();
    let (median, least) = (times[times.len() / 2], times[0]);
    println!("{name}: {median:.3?} (median), {least:.3?} (least of {})", times.len());
    median
}
