//! Follows a design or the search for its proof: shows what it does, and ends it at an interrupt.

use super::print::say_line;
use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, bounded};
use hybank::design::{Stage, Stop};
use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

/// Shorter designs say nothing on a terminal.
const SILENCE: Duration = Duration::from_secs(1);
/// Time between two looks at a design that runs.
pub(super) const LOOK: Duration = Duration::from_millis(125);
/// Time between two lines where stderr is no terminal.
const LINE: Duration = Duration::from_secs(30);

/// Follows work: shows what it does, ends it at an interrupt, and gives it up long after its limit.
pub(super) struct DesignWatch<'a> {
    pub(super) stop: Stop,
    pub(super) interrupts: Receiver<()>,
    /// What is said at an interrupt.
    pub(super) at_interrupt: &'static str,
    pub(super) limit: Option<Duration>,
    pub(super) give_up: &'a (dyn Fn() + Sync),
    /// What is done now.
    pub(super) stage: Mutex<Option<Stage>>,
}

impl DesignWatch<'_> {
    /// The step that begins.
    pub(super) fn note(&self, stage: Stage) {
        *self.stage.lock().unwrap_or_else(PoisonError::into_inner) = Some(stage);
    }

    /// Runs `work` and follows it meanwhile. Without a thread for that, nothing is shown and nothing
    /// limited.
    pub(super) fn during<T>(&self, work: impl FnOnce() -> T) -> T {
        thread::scope(|scope| {
            let (done_sender, done): (Sender<()>, _) = bounded(0);
            // A thread that cannot be started is no reason to fail.
            let follower = thread::Builder::new().name("progress".into());
            let follower = follower.spawn_scoped(scope, move || self.follow(&done));
            let result = work();
            drop((done_sender, follower));
            result
        })
    }

    fn follow(&self, done: &Receiver<()>) {
        let (begin, is_terminal) = (Instant::now(), std::io::stderr().is_terminal());
        let mut due = if is_terminal { SILENCE } else { LINE };
        let bar = ProgressBar::new_spinner();
        let bar = ProgressStyle::with_template("{spinner} {msg}")
            .map_or(bar.clone(), |style| bar.with_style(style));
        while done.recv_timeout(LOOK) == Err(RecvTimeoutError::Timeout) {
            let elapsed = begin.elapsed();
            if self.interrupts.try_recv().is_ok() {
                bar.suspend(|| say_line(self.at_interrupt));
                self.stop.now();
            }
            if self.limit.is_some_and(|limit| elapsed > limit) {
                (self.give_up)();
            }
            match self.text(elapsed).filter(|_| elapsed >= due) {
                Some(line) if is_terminal => {
                    bar.set_message(line);
                    bar.tick();
                }
                Some(line) => {
                    say_line(&line);
                    due += LINE;
                }
                None => {}
            }
        }
        bar.finish_and_clear();
    }

    fn text(&self, elapsed: Duration) -> Option<String> {
        let stage = (*self.stage.lock().unwrap_or_else(PoisonError::into_inner))?;
        Some(format!("{stage}: {} s", elapsed.as_secs()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PATIENCE: Duration = Duration::from_secs(60);

    fn watch<'a>(limit: Option<Duration>, give_up: &'a (dyn Fn() + Sync)) -> DesignWatch<'a> {
        DesignWatch {
            stop: Stop::default(),
            interrupts: crossbeam_channel::never(),
            at_interrupt: "interrupted",
            limit,
            give_up,
            stage: Mutex::default(),
        }
    }

    #[test]
    fn the_line_says_the_step_and_its_time_so_far() {
        let watch = watch(None, &|| ());
        assert_eq!(watch.text(Duration::from_secs(31)), None);
        watch.note(Stage::Latency { designs: 7 });
        let line = watch.text(Duration::from_secs(31)).unwrap();
        assert_eq!(line, "choosing the latency (7 designs compared): 31 s");
    }

    #[test]
    fn the_result_of_the_work_comes_back() {
        assert_eq!(watch(None, &|| ()).during(|| 7), 7);
    }

    #[test]
    fn work_that_does_not_end_in_time_is_given_up() {
        let (given_up, done) = bounded(1);
        let give_up = || _ = given_up.try_send(());
        let waited = watch(Some(Duration::ZERO), &give_up).during(|| done.recv_timeout(PATIENCE));
        assert_eq!(waited, Ok(()));
        watch(Some(PATIENCE), &|| panic!("in time")).during(|| ());
    }

    #[test]
    fn an_interrupt_stops_the_design() {
        let (interrupt, interrupts) = bounded(1);
        let watch = DesignWatch { interrupts, ..watch(None, &|| ()) };
        let begin = Instant::now();
        watch.during(|| {
            interrupt.send(()).unwrap();
            while !watch.stop.is_due() && begin.elapsed() < PATIENCE {
                thread::yield_now();
            }
        });
        assert!(watch.stop.is_due());
    }
}
