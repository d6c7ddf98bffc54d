//! Why recordings cannot be merged, and what a reader of the result must know.

use crate::align::{AlignError, AlignWarning};
use crate::design::DesignError;
use crate::instants::ClockError;
use crate::linalg::LinalgError;
use crate::messages::{Quoted, counted};
use crate::quantity::readable;
use crate::units::Hertz;

/// Why recordings cannot be merged.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MergeError {
    /// There is none.
    #[error("no recording is given; give at least one")]
    NoSources,
    /// The rate of the output cannot be.
    #[error("the output cannot have a rate of {rate}; ask for more than 0 and at most {most}")]
    Rate {
        /// The rate that was asked for.
        rate: Hertz,
        /// The highest one.
        most: Hertz,
    },
    /// Some have time stamps, others not.
    #[error(
        "{} has time stamps and {} has none; give all of them stamps on one clock, or none",
        Quoted(.stamped), Quoted(.plain)
    )]
    SomeStamps {
        /// One that has.
        stamped: String,
        /// One that has not.
        plain: String,
    },
    /// Time stamps are no clock.
    #[error("{}: {problem}", Quoted(.name))]
    Stamps {
        /// The source.
        name: String,
        /// What is wrong with them.
        problem: ClockError,
    },
    /// Samples come far more rarely than those of the converter.
    #[error(
        "{name} has {} on average, but the bank is designed for {}; design a bank for this rate, or merge the recordings with \
         a --rate",
        readable(found.0, "S/s"), readable(wanted.0, "S/s")
    )]
    Sparse {
        /// The channel.
        name: String,
        /// Its mean rate.
        found: Hertz,
        /// That of the bank.
        wanted: Hertz,
    },
    /// Nothing but one value.
    #[error("{} has no signal: all its samples are equal or lost; leave it out", Quoted(.name))]
    NoSignal {
        /// The source.
        name: String,
    },
    /// The result is too long.
    #[error(
        "there is no memory for the {samples} samples of the result; ask for a lower rate, or merge parts"
    )]
    Memory {
        /// How many it has.
        samples: usize,
    },
    /// They lie at different times.
    #[error(
        "all recordings together have {seconds:.3} s in common, of up to {samples} samples; give recordings of one event \
         that overlap"
    )]
    Overlap {
        /// Time in common.
        seconds: f64,
        /// Samples of the longest one.
        samples: usize,
    },
    /// More recordings than a spec has channels.
    #[error("{channels} recordings are too many: {refused}")]
    Count {
        /// How many there are.
        channels: usize,
        /// What a spec says of them.
        refused: String,
    },
    /// A bank whose converters have rates of their own.
    #[error(
        "the converters of the bank have rates of their own; moving delays are followed for converters of one rate"
    )]
    OwnRates,
    /// A table of delays of other converters.
    #[error(
        "the table has {} of delays, and the bank has {wanted} channels; give a time and a delay for each channel",
        counted(.given, "column")
    )]
    Columns {
        /// Columns of the table.
        given: usize,
        /// Channels of the bank.
        wanted: usize,
    },
    /// A table without delays.
    #[error("the table has no line with the delays of all channels; give at least one")]
    NoDelays,
    /// Nothing to fuse.
    #[error("no samples to fuse (the length is zero); give longer recordings")]
    NoSamples,
    /// A delay that is no number, or delays that turn time back.
    #[error(
        "at frame {frame} a delay of channel {channel} is missing, or grows by more than the time since the line before; \
         correct the line"
    )]
    Track {
        /// From 1.
        channel: usize,
        /// Where, from 0.
        frame: f64,
    },
    /// A pilot that has no phase of its own.
    #[error(
        "the pilot at {frequency} lies too near to a multiple of half the converters' rate of {}, where it meets its mirror \
         image; choose a frequency that is {} or more away from these",
        readable(rate.0, "S/s"), readable(apart.0, "Hz")
    )]
    Pilot {
        /// Its frequency.
        frequency: Hertz,
        /// The rate of a converter.
        rate: Hertz,
        /// How far away it must be.
        apart: Hertz,
    },
    /// The converters of a bank are not known.
    #[error(transparent)]
    Design(#[from] DesignError),
    /// Starts and clocks cannot be found.
    #[error(transparent)]
    Align(#[from] AlignError),
    /// The model has no taps.
    #[error("two samples of one recorder lie at one instant ({0}); remove lines of one time")]
    Singular(#[from] LinalgError),
}

/// What a reader of merged recordings must know.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MergeWarning {
    /// Found on the way.
    #[error(transparent)]
    Align(#[from] AlignWarning),
    /// Samples that are not used.
    #[error("{clipped} clipped samples of {} are left out", Quoted(.name))]
    Clipped {
        /// The source.
        name: String,
        /// How many.
        clipped: usize,
    },
    /// Zeros in a row, as recorders write them for what they have not.
    #[error("{zeros} zeros in rows of {} are left out: they are no samples", Quoted(.name))]
    Zeros {
        /// The source.
        name: String,
        /// How many.
        zeros: usize,
    },
    /// Means that differ, of sources with stamps.
    #[error(
        "the mean of {} differs by {bias:.4} from that of {} over the time that both cover; the difference is subtracted",
        Quoted(.name),
        Quoted(.first)
    )]
    Bias {
        /// The source.
        name: String,
        /// The first source.
        first: String,
        /// By how much its mean is above that of the first.
        bias: f64,
    },
}
