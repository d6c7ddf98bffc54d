//! How far a command is: a bar with the time that is left on a terminal, else a line every half minute.

use super::failure::say;
use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Parts of a step that the bar shows.
const PARTS: u64 = 100;

/// Time between two lines where standard error is no terminal.
const LINE: Duration = Duration::from_secs(30);

/// The steps of a command.
pub(super) struct Progress {
    bar: ProgressBar,
    begun: AtomicU64,
    begin: Instant,
    /// The name of the step and the time of the last line; `None` on a terminal.
    lines: Option<Mutex<(&'static str, Instant)>>,
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
        let begin = Instant::now();
        let lines = (!is_terminal).then(|| Mutex::new(("", begin)));
        Self { bar, begun: AtomicU64::new(0), begin, lines }
    }

    /// Begins the next step.
    pub(super) fn step(&self, name: &'static str) {
        let begun = self.begun.fetch_add(1, Ordering::Relaxed);
        self.bar.set_position(begun * PARTS);
        self.bar.set_message(name);
        if let Some(lines) = &self.lines {
            lines.lock().unwrap_or_else(PoisonError::into_inner).0 = name;
        }
        self.line();
    }

    /// The share of the current step that is done, 0 to 1.
    pub(super) fn within(&self, share: f64) {
        let before = self.begun.load(Ordering::Relaxed).saturating_sub(1) * PARTS;
        let here = before + (share.clamp(0.0, 1.0) * PARTS as f64) as u64;
        // Reports come from several threads; the bar does not go back.
        if here > self.bar.position() {
            self.bar.set_position(here);
        }
        self.line();
    }

    /// Writes a line if it is time for one and no other thread does.
    fn line(&self) {
        let Some(Ok(mut last)) = self.lines.as_ref().map(Mutex::try_lock) else { return };
        if last.1.elapsed() < LINE {
            return;
        }
        last.1 = Instant::now();
        let done = self.bar.position() as f64 / self.bar.length().unwrap_or(1).max(1) as f64;
        say(&line(last.0, done, self.begin.elapsed()));
    }
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
}
