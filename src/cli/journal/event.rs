//! What happens during a run, as a line of text and as JSON.

use crate::io::Stall;
use crate::pipeline::Gap;
use std::fmt;

/// An event of a run.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub(in crate::cli) enum Event {
    /// A gap that has ended.
    Gap(Gap),
    /// A gap that has lasted for a while and goes on.
    GapGoesOn(Gap),
    /// Input samples that were NaN or infinite became 0.
    Replaced(Span),
    /// Output samples saturated.
    Clipped(Span),
    /// An input gives nothing.
    Stall(Wait),
    /// It does again.
    StallOver(Wait),
    /// A fault that is known before the end.
    Warning {
        /// What it is.
        text: String,
    },
}

/// Some of the samples (of the output) or frames (of the input) from `first` to `last`, from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub(in crate::cli) struct Span {
    pub(in crate::cli) first: u64,
    pub(in crate::cli) last: u64,
    /// How many samples.
    pub(in crate::cli) samples: u64,
}

/// A wait for an input.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub(in crate::cli) struct Wait {
    input: String,
    /// First and last channel, from 1.
    channels: [usize; 2],
    seconds: f64,
}

impl From<&Stall> for Event {
    fn from(stall: &Stall) -> Self {
        let wait = Wait {
            input: stall.input.clone(),
            channels: [*stall.channels.start(), *stall.channels.end()],
            // Rounded to milliseconds.
            seconds: stall.waited.as_millis() as f64 / 1e3,
        };
        if stall.is_over { Self::StallOver(wait) } else { Self::Stall(wait) }
    }
}

impl Wait {
    fn who(&self) -> String {
        let Self { input, channels: [first, last], .. } = self;
        match first == last {
            true => format!("channel {first} ({input})"),
            false => format!("channels {first} to {last} ({input})"),
        }
    }
}

impl Span {
    /// Both together.
    pub(super) fn merge(&mut self, later: Self) {
        self.last = self.last.max(later.last);
        self.samples += later.samples;
    }
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Gap(Gap { channel, first, length }) => {
                write!(f, "gap: channel {channel}, sample {first}, {length} missing")
            }
            Self::GapGoesOn(Gap { channel, first, length }) => {
                write!(f, "gap: channel {channel}, sample {first}, {length} missing so far")
            }
            Self::Replaced(Span { first, last, samples }) => {
                write!(f, "not finite: {samples} input samples of frames {first} to {last} became 0")
            }
            Self::Clipped(Span { first, last, samples }) => {
                write!(f, "clipped: {samples} of the output samples {first} to {last}")
            }
            Self::Stall(wait) => write!(f, "waiting for {}", wait.who()),
            Self::StallOver(wait) => write!(f, "{} goes on after {:.1} s", wait.who(), wait.seconds),
            Self::Warning { text } => write!(f, "warning: {text}"),
        }
    }
}
