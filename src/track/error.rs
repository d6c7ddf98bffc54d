//! Why delays cannot be followed.

use crate::calibrate::CalibrateError;
use crate::messages::Quoted;
use crate::sine_fit::SineFitError;
use crate::units::Hertz;

/// Why delays cannot be followed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TrackError {
    /// No delay may move.
    #[error("no delay of this spec may move: give [uncertainty] delay for a channel beside the reference")]
    NoUncertainDelay,
    /// Converters with rates of their own.
    #[error(
        "the converters of this spec have sample rates of their own, and delays are followed only for converters of one rate"
    )]
    OwnRates,
    /// A filter of the spec is not a valid front end.
    #[error(transparent)]
    Model(#[from] CalibrateError),
    /// A pilot that the slow samples do not show as a tone.
    #[error(
        "a pilot of {pilot} lies {cycles:.2} cycles per {frames} frames from a multiple of half the slow rate, {half}, where \
         sine and cosine coincide: choose another frequency, or measure over more frames"
    )]
    PilotPosition {
        /// Its frequency.
        pilot: Hertz,
        /// Distance in cycles per block.
        cycles: f64,
        /// Frames of a block.
        frames: usize,
        /// Half the slow rate.
        half: Hertz,
    },
    /// Too few frames of a measurement.
    #[error("a measurement of delays takes at least {least} frames, not {given}")]
    Frames {
        /// As given.
        given: usize,
        /// Least frames.
        least: usize,
    },
    /// A rate that no clock has.
    #[error("a clock wanders by a positive number of ppm below 1e6 in a second, not by {given}")]
    Wander {
        /// As given.
        given: f64,
    },
    /// A line of a file of delays.
    #[error("{}: line {line}: {problem}", Quoted(.file))]
    Reading {
        /// The file.
        file: String,
        /// The line, from 1.
        line: usize,
        /// What is wrong with it.
        problem: ReadingProblem,
    },
}

/// What is wrong with a line of a file of delays.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ReadingProblem {
    /// It is no JSON object with the keys of a reading.
    #[error("{reason}")]
    Syntax {
        /// Why.
        reason: String,
    },
    /// Not one delay per channel.
    #[error("{given} delays for {channels} channels; give one for each, or null")]
    DelayCount {
        /// Delays of the line.
        given: usize,
        /// Channels of the bank.
        channels: usize,
    },
    /// A delay without its interval.
    #[error("channel {channel}: its delay has no half_width; give one number for all channels or a list")]
    NoHalfWidth {
        /// From 1.
        channel: usize,
    },
    /// A delay or half-width that is none.
    #[error(
        "channel {channel}: delay {delay} with half_width {half_width}; both are finite numbers in seconds, and the \
         half-width is zero or more"
    )]
    Numbers {
        /// From 1.
        channel: usize,
        /// As given.
        delay: f64,
        /// As given.
        half_width: f64,
    },
    /// The lines are not in the order of time.
    #[error("frame {frame} comes after a later one; sort the lines")]
    Order {
        /// Its frame.
        frame: u64,
    },
}

/// Why the delays of a block were not measured.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub(super) enum NotMeasured {
    /// A channel has no signal.
    #[error("silence")]
    Silence,
    /// No channel's delay is known well enough.
    #[error("the signal is too faint or too noisy")]
    TooNoisy,
    /// The file has no line in this block.
    #[error("no reading")]
    NoReading,
    /// The channels do not agree with the spec.
    #[error(transparent)]
    Signal(#[from] CalibrateError),
    /// The pilot cannot be fitted.
    #[error(transparent)]
    Pilot(#[from] SineFitError),
}
