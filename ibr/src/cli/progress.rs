//! How far a command is: a bar with the time that is left, on a terminal.

use indicatif::{ProgressBar, ProgressStyle};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// Parts of a step that the bar shows.
const PARTS: u64 = 100;

/// Time between two updates of the bar: its clock runs on in a part of a step that takes long.
const REDRAW: Duration = Duration::from_millis(250);

/// The steps of a command.
pub(super) struct Progress {
    bar: ProgressBar,
    begun: AtomicU64,
}

impl Progress {
    pub(super) fn new(steps: u64) -> Self {
        let bar = ProgressBar::new(steps * PARTS);
        let style = ProgressStyle::with_template("{bar:30} {percent:>3} % {msg} [{elapsed}, {eta} left]");
        let bar = style.map_or(bar.clone(), |style| bar.with_style(style));
        if !bar.is_hidden() {
            bar.enable_steady_tick(REDRAW);
        }
        Self { bar, begun: AtomicU64::new(0) }
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

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
