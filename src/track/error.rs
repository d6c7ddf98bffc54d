//! Why delays cannot be followed.

use crate::calibrate::CalibrateError;
use crate::units::Hertz;

/// Why delays cannot be followed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TrackError {
    /// The taps are fixed.
    #[error(
        "the taps of this bank do not follow delays; design it with tracking = \"affine\" in [design] (or --tracking affine) \
         and with [uncertainty] delay in its spec"
    )]
    NoTapSlopes,
    /// The filters are recursive.
    #[error(
        "this bank is recursive: its states belong to its coefficients, so it cannot follow delays; design an FIR bank with \
         method = \"fir\" and tracking = \"affine\""
    )]
    Recursive,
    /// The front ends are unknown.
    #[error(
        "this bank carries no spec (\"spec\": null): its front ends are unknown, so no delay can be measured"
    )]
    NoSpec,
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
    /// A line of a file of delays.
    #[error("{file}: line {line}: {problem}")]
    Reading {
        /// The file.
        file: String,
        /// The line, from 1.
        line: usize,
        /// What is wrong with it.
        problem: String,
    },
}
