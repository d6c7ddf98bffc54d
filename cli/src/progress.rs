//! Tells on stderr what a long design is doing: a line that changes on a terminal, else a line every half
//! minute.

use super::print::say_line;
use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, bounded};
use hybank::design::Stage;
use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

/// Shorter designs say nothing on a terminal.
const PATIENCE: Duration = Duration::from_secs(1);
/// Time between two updates of the display on a terminal.
const REDRAW_INTERVAL: Duration = Duration::from_millis(125);
/// Time between two lines where stderr is no terminal.
const LINE: Duration = Duration::from_secs(30);

/// What a design does now, and the seconds that all of it takes by the estimate.
#[derive(Default)]
pub(super) struct Progress {
    now: Mutex<Option<(Stage, f64)>>,
}

impl Progress {
    /// The step that begins.
    pub(super) fn note(&self, stage: Stage, seconds: f64) {
        *self.now.lock().unwrap_or_else(PoisonError::into_inner) = Some((stage, seconds));
    }

    /// Runs `work` and shows meanwhile what it does; calls `give_up` if it has not ended by the `limit`.
    /// Without threads for that, nothing is shown and nothing limited.
    pub(super) fn during<T>(
        &self,
        limit: Option<Duration>,
        give_up: impl FnOnce() + Send,
        work: impl FnOnce() -> T,
    ) -> T {
        thread::scope(|scope| {
            let (done_sender, done): (Sender<()>, _) = bounded(0);
            let end = done.clone();
            let overdue = move || {
                if limit.is_some_and(|limit| wait(&end, limit)) {
                    give_up()
                }
            };
            // A thread that cannot be started is no reason to fail.
            let begin = |name: &str| thread::Builder::new().name(name.into());
            let display = begin("progress").spawn_scoped(scope, move || self.report(&done));
            let limiter = begin("limit").spawn_scoped(scope, overdue);
            let result = work();
            drop((done_sender, display, limiter));
            result
        })
    }

    fn report(&self, done: &Receiver<()>) {
        let begin = Instant::now();
        if std::io::stderr().is_terminal() {
            self.draw(begin, done);
        } else {
            while wait(done, LINE) {
                self.text(begin).iter().for_each(|line| say_line(line));
            }
        }
    }

    fn draw(&self, begin: Instant, done: &Receiver<()>) {
        if !wait(done, PATIENCE) {
            return;
        }
        let bar = ProgressBar::new_spinner();
        let bar = ProgressStyle::with_template("{spinner} {msg}")
            .map_or(bar.clone(), |style| bar.with_style(style));
        while wait(done, REDRAW_INTERVAL) {
            bar.set_message(self.text(begin).unwrap_or_default());
            bar.tick();
        }
        bar.finish_and_clear();
    }

    fn text(&self, begin: Instant) -> Option<String> {
        let (stage, seconds) = (*self.now.lock().unwrap_or_else(PoisonError::into_inner))?;
        Some(line(stage, begin.elapsed(), seconds))
    }
}

/// Whether the time is over; false if the work is done.
fn wait(done: &Receiver<()>, time: Duration) -> bool {
    done.recv_timeout(time) == Err(RecvTimeoutError::Timeout)
}

fn line(stage: Stage, elapsed: Duration, seconds: f64) -> String {
    let elapsed = elapsed.as_secs();
    if seconds > elapsed as f64 {
        format!("{stage}: {elapsed} s of about {seconds:.0} s")
    } else {
        format!("{stage}: {elapsed} s")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_says_the_step_and_the_time_that_is_expected() {
        let said = |seconds| line(Stage::Latency { designs: 7 }, Duration::from_secs(31), seconds);
        assert_eq!(said(120.4), "choosing the latency (7 designs compared): 31 s of about 120 s");
        // An estimate that has passed says nothing any more.
        assert_eq!(said(20.0), "choosing the latency (7 designs compared): 31 s");
    }

    #[test]
    fn the_result_of_the_work_comes_back() {
        assert_eq!(Progress::default().during(None, || (), || 7), 7);
    }

    #[test]
    fn work_that_does_not_end_in_time_is_given_up() {
        let (given_up, done) = bounded(1);
        let waited = || done.recv_timeout(Duration::from_secs(60));
        let waited = Progress::default().during(Some(Duration::ZERO), || given_up.send(()).unwrap(), waited);
        assert_eq!(waited, Ok(()));
        Progress::default().during(Some(Duration::from_secs(60)), || panic!("in time"), || ());
    }
}
