//! Inputs that give nothing for a while.

use std::fmt;
use std::ops::RangeInclusive;
use std::sync::Arc;
use std::time::Duration;

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
    /// Told once when a stall begins and once when it is over. The samples wait for it.
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
    is_told: bool,
}

impl<'a> Wait<'a> {
    pub(super) fn new(watch: Option<&'a StallWatch>, input: &str, channels: RangeInclusive<usize>) -> Self {
        let stall = Stall { input: input.to_owned(), channels, waited: Duration::ZERO, is_over: false };
        Self { watch, stall, is_told: false }
    }

    /// The time after which [`Wait::passed`] wants to know.
    pub(super) fn patience(&self) -> Duration {
        self.watch.map_or(LONG, |watch| watch.patience)
    }

    /// Nothing came for `time` more.
    pub(super) fn passed(&mut self, time: Duration) {
        self.stall.waited += time;
        if let Some(watch) = self.watch.filter(|watch| !self.is_told && self.stall.waited >= watch.patience) {
            (watch.report)(&self.stall);
            self.is_told = true;
        }
    }

    /// Something came.
    pub(super) fn end(mut self) {
        if let Some(watch) = self.watch.filter(|_| self.is_told) {
            self.stall.is_over = true;
            (watch.report)(&self.stall);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    #[test]
    fn a_stall_is_told_once_and_its_end_once() {
        let reported = Arc::new(Mutex::new(Vec::new()));
        let list = Arc::clone(&reported);
        let report = Arc::new(move |stall: &Stall| list.lock().unwrap().push((stall.waited, stall.is_over)));
        let watch = StallWatch { patience: Duration::from_millis(100), report };
        let wait = |steps: usize| {
            let mut wait = Wait::new(Some(&watch), "x", 2..=2);
            (0..steps).for_each(|_| wait.passed(Duration::from_millis(50)));
            wait.end();
        };
        wait(1);
        assert!(reported.lock().unwrap().is_empty());
        wait(5);
        let times = [(100, false), (250, true)].map(|(time, over)| (Duration::from_millis(time), over));
        assert_eq!(*reported.lock().unwrap(), times);
    }
}
