//! Inputs that give nothing for a while.

use crate::messages::Quoted;
use std::fmt;
use std::time::{Duration, Instant};

/// The time without a sample after which an input counts as stalled.
pub(super) const PATIENCE: Duration = Duration::from_secs(1);

/// An input that is waited for, or that was and goes on.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Stall {
    /// Name of the input.
    pub input: String,
    /// The first and the last of its channels among those of all inputs, from 1.
    pub channels: [usize; 2],
    /// How long it has been waited for, in seconds, to the millisecond.
    pub seconds: f64,
    /// It goes on.
    #[serde(skip)]
    pub is_over: bool,
}

impl fmt::Display for Stall {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [first, last] = self.channels;
        let channels =
            if first == last { format!("channel {first}") } else { format!("channels {first} to {last}") };
        let input = Quoted(&self.input);
        match self.is_over {
            true => write!(f, "{channels} ({input}) goes on after {:.1} s", self.seconds),
            false => write!(f, "waiting for {channels} ({input})"),
        }
    }
}

/// Called once when a stall begins and once when it is over. The samples wait for it.
pub type OnStall<'a> = &'a mut dyn FnMut(&Stall);

/// One wait for one input.
pub(super) struct Wait<'a> {
    report: OnStall<'a>,
    /// The input, as it will be reported.
    stall: Stall,
    began: Instant,
    is_reported: bool,
}

impl<'a> Wait<'a> {
    pub(super) fn new(report: OnStall<'a>, input: &str, channels: [usize; 2]) -> Self {
        let stall = Stall { input: input.to_owned(), channels, seconds: 0.0, is_over: false };
        Self { report, stall, began: Instant::now(), is_reported: false }
    }

    /// Nothing has come yet.
    pub(super) fn go_on(&mut self) {
        if !self.is_reported && self.began.elapsed() >= PATIENCE {
            self.is_reported = true;
            self.report();
        }
    }

    /// Something has come.
    pub(super) fn end(mut self) {
        if self.is_reported {
            self.stall.is_over = true;
            self.report();
        }
    }

    fn report(&mut self) {
        self.stall.seconds = self.began.elapsed().as_millis() as f64 / 1e3;
        (self.report)(&self.stall);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stall_is_reported_once_and_its_end_once() {
        let mut reported = Vec::new();
        let mut wait = |steps: u64, end: u64| {
            let mut report = |stall: &Stall| reported.push(stall.to_string());
            let mut wait = Wait::new(&mut report, "x", [2, 2]);
            let ago = |milliseconds| Instant::now() - Duration::from_millis(milliseconds);
            for k in 1..=steps {
                wait.began = ago(500 * k);
                wait.go_on();
            }
            wait.began = ago(end);
            wait.end();
        };
        wait(1, 990);
        wait(5, 2655);
        assert_eq!(reported, ["waiting for channel 2 (x)", "channel 2 (x) goes on after 2.7 s"]);
    }
}
