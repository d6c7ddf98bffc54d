//! Captures that cannot be used.

use crate::io::{IoError, OfflineError};
use crate::messages::Quoted;
use crate::pipeline::matching::InputMismatch;
use crate::spec::SpecProblem;

/// Why captures cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CaptureError {
    /// A file cannot be read.
    #[error(transparent)]
    Io(#[from] IoError),
    /// Its samples cannot be read.
    #[error(transparent)]
    Samples(#[from] OfflineError),
    /// They do not fit the bank or the spec.
    #[error(transparent)]
    Mismatch(#[from] InputMismatch),
    /// Several channels where one is needed.
    #[error("{} has {channels} channels, and one is needed; say which", Quoted(.name))]
    NotMono {
        /// The file.
        name: String,
        /// Its channels.
        channels: usize,
    },
    /// A gain of a table that is above 0 at one time and below at another.
    #[error("the gain of channel {channel} changes its sign, so it is 0 between; give one polarity")]
    Polarity {
        /// From 1.
        channel: usize,
    },
    /// A gain or an offset of a table.
    #[error("a {what} of channel {channel}: {problem}")]
    Level {
        /// Gain or offset.
        what: &'static str,
        /// From 1.
        channel: usize,
        /// The rule.
        problem: Box<SpecProblem>,
    },
    /// A sample that is no number.
    #[error("sample {sample} is {value}, and all are needed; repair the recording first")]
    NotFinite {
        /// From 0.
        sample: usize,
        /// Infinite, or NaN.
        value: f64,
    },
    /// All samples would be left out.
    #[error("{skip} samples at either end leave nothing of {count}; leave out fewer than {}", .count.div_ceil(2))]
    NothingLeft {
        /// Samples to leave out at either end.
        skip: usize,
        /// Samples that there are.
        count: usize,
    },
}
