//! Inputs that give nothing for a while.

use std::fmt;
use std::ops::RangeInclusive;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Without a watch a wait is cut into pieces of this length, to no effect.
const LONG: Duration = Duration::from_secs(3600);

/// An input that is waited for, or that was and goes on.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Stall {
    /// Name of the input.
    pub input: String,
    /// Its channels among those of all inputs, from 1.
    pub channels: RangeInclusive<usize>,
    /// How long it has been waited for.
    pub waited: Duration,
    /// It goes on.
    pub is_over: bool,
}

/// Where to report stalls, and after what time.
#[derive(Clone)]
pub struct StallWatch {
    /// The time without a sample after which an input counts as stalled.
    pub patience: Duration,
    /// Called once when a stall begins and once when it is over. The samples wait for it.
    pub report: Arc<dyn Fn(&Stall) + Send + Sync>,
}

impl fmt::Debug for StallWatch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("StallWatch").field("patience", &self.patience).finish_non_exhaustive()
    }
}

/// One wait for one input.
pub(super) struct Wait<'a> {
    watch: Option<&'a StallWatch>,
    /// The input, as it will be reported.
    stall: Stall,
    began: Instant,
    is_reported: bool,
}

impl<'a> Wait<'a> {
    pub(super) fn new(watch: Option<&'a StallWatch>, input: &str, channels: RangeInclusive<usize>) -> Self {
        let stall = Stall { input: input.to_owned(), channels, waited: Duration::ZERO, is_over: false };
        Self { watch, stall, began: Instant::now(), is_reported: false }
    }

    /// The time after which [`Wait::go_on`] is due.
    pub(super) fn patience(&self) -> Duration {
        self.watch.map_or(LONG, |watch| watch.patience)
    }

    /// Nothing has come yet.
    pub(super) fn go_on(&mut self) {
        self.go_on_after(self.began.elapsed());
    }

    /// Something has come.
    pub(super) fn end(self) {
        let waited = self.began.elapsed();
        self.end_after(waited);
    }

    fn go_on_after(&mut self, waited: Duration) {
        self.stall.waited = waited;
        if let Some(watch) = self.watch.filter(|watch| !self.is_reported && waited >= watch.patience) {
            (watch.report)(&self.stall);
            self.is_reported = true;
        }
    }

    fn end_after(mut self, waited: Duration) {
        if let Some(watch) = self.watch.filter(|_| self.is_reported) {
            (self.stall.waited, self.stall.is_over) = (waited, true);
            (watch.report)(&self.stall);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    #[test]
    fn a_stall_is_reported_once_and_its_end_once() {
        let reported = Arc::new(Mutex::new(Vec::new()));
        let list = Arc::clone(&reported);
        let report = Arc::new(move |stall: &Stall| list.lock().unwrap().push((stall.waited, stall.is_over)));
        let watch = StallWatch { patience: Duration::from_millis(100), report };
        let wait = |steps: u64, end: u64| {
            let mut wait = Wait::new(Some(&watch), "x", 2..=2);
            (1..=steps).for_each(|k| wait.go_on_after(Duration::from_millis(50 * k)));
            wait.end_after(Duration::from_millis(end));
        };
        wait(1, 99);
        assert!(reported.lock().unwrap().is_empty());
        wait(5, 270);
        let times = [(100, false), (270, true)].map(|(time, over)| (Duration::from_millis(time), over));
        assert_eq!(*reported.lock().unwrap(), times);
    }
}
