//! How far a command is: a bar with the time that is left on a terminal, else a line every half minute.

use hybank::memory::affordable_threads;
use hybank::program::say;
use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::{Duration, Instant};

/// Parts of a step that the bar shows.
const PARTS: u64 = 100;

/// Time between two updates of the bar: its clock runs on in a part of a step that takes long.
const REDRAW: Duration = Duration::from_millis(250);

/// Time between two lines where standard error is no terminal.
const LINE: Duration = Duration::from_secs(30);

/// The steps of a command.
pub(super) struct Progress {
    bar: ProgressBar,
    begun: AtomicU64,
    /// Dropped with this value, which ends the display.
    _display: Sender<()>,
}

impl Progress {
    pub(super) fn new(steps: u64) -> Self {
        let (length, is_terminal) = (steps * PARTS, std::io::stderr().is_terminal());
        let bar = if is_terminal { ProgressBar::new(length) } else { ProgressBar::hidden() };
        if let Ok(style) =
            ProgressStyle::with_template("{bar:30} {percent:>3} % {msg} [{elapsed}, {eta} left]")
        {
            bar.set_style(style);
        }
        bar.set_length(length);
        let (display, done) = channel();
        let (shown, begin) = (bar.clone(), Instant::now());
        let show = move || match is_terminal {
            true => every(REDRAW, &done, || shown.tick()),
            false => every(LINE, &done, || say(&line(&shown.message(), share(&shown), begin.elapsed()))),
        };
        // Where addresses are limited, the work needs those of a thread. One that cannot be started is no
        // reason to fail.
        if affordable_threads(Some(2)) > 1 {
            let _ = thread::Builder::new().name("progress".into()).spawn(show);
        }
        Self { bar, begun: AtomicU64::new(0), _display: display }
    }

    /// Begins the next step.
    pub(super) fn step(&self, name: &'static str) {
        let begun = self.begun.fetch_add(1, Ordering::Relaxed);
        self.bar.set_position(begun * PARTS);
        self.bar.set_message(name);
    }

    /// The share of the current step that is done, 0 to 1.
    pub(super) fn within(&self, share: f64) {
        let before = self.begun.load(Ordering::Relaxed).saturating_sub(1) * PARTS;
        let here = before + (share.clamp(0.0, 1.0) * PARTS as f64) as u64;
        // Reports come from several threads; the bar does not go back.
        if here > self.bar.position() {
            self.bar.set_position(here);
        }
    }
}

/// Calls `show` once in a while until the other end of `done` is dropped.
fn every(time: Duration, done: &Receiver<()>, show: impl Fn()) {
    while done.recv_timeout(time) == Err(RecvTimeoutError::Timeout) {
        show();
    }
}

/// The share of all steps that is done.
fn share(bar: &ProgressBar) -> f64 {
    bar.position() as f64 / bar.length().unwrap_or(1).max(1) as f64
}

/// What is done, and the time that is left at the pace so far.
fn line(step: &str, done: f64, elapsed: Duration) -> String {
    let seconds = elapsed.as_secs_f64();
    let left = match done > 0.0 {
        true => format!("; about {:.0} s are left", seconds * (1.0 - done) / done),
        false => String::new(),
    };
    format!("hybank-ibr: {step}, {:.0} % done in {seconds:.0} s{left}\n", 100.0 * done)
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_estimate_what_is_left() {
        let said = line("rendering", 0.25, Duration::from_secs(30));
        assert_eq!(said, "hybank-ibr: rendering, 25 % done in 30 s; about 90 s are left\n");
        assert_eq!(line("reading", 0.0, Duration::from_secs(31)), "hybank-ibr: reading, 0 % done in 31 s\n");
    }

    /// A part of a step that reports nothing is shown all the same, until the end.
    #[test]
    fn the_display_goes_on_without_reports() {
        let ((display, done), (shown, times)) = (channel(), channel());
        let thread = thread::spawn(move || every(Duration::ZERO, &done, || shown.send(()).unwrap()));
        (0..3).for_each(|_| times.recv().unwrap());
        drop(display);
        times.iter().for_each(drop);
        thread.join().unwrap();
    }
}
