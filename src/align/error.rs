//! Why recordings cannot be aligned, and what a reader of an alignment must know.

use super::clock::ClockStep;
use crate::calibrate::{CalibrateError, CalibrationWarning};
use crate::design::DesignError;
use crate::units::{FastPeriods, Seconds};
use std::ops::Range;

/// Why recordings cannot be aligned.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AlignError {
    /// The spec and its reference do not fit the recordings, or a front end cannot be realised.
    #[error(transparent)]
    Spec(#[from] CalibrateError),
    /// The noise of the recorders cannot be measured.
    #[error("the noise of the recorders cannot be measured: {0}")]
    Noise(#[from] DesignError),
    /// Channels with rates of their own.
    #[error(
        "recordings are aligned sample by sample, so all channels need one rate; give no rates of their own"
    )]
    Rates,
    /// A recording holds no signal.
    #[error(
        "the recording of channel {channel} holds no signal: all its samples are equal; check its cable and its level"
    )]
    Silent {
        /// From 1.
        channel: usize,
    },
    /// No lag stands out.
    #[error(
        "the recordings of channels {reference} and {channel} have nothing in common: at no lag do they correlate more \
         than chance explains; check that both recorded the same event, for at least a quarter of the shorter one, and \
         that neither is drowned in noise"
    )]
    NothingInCommon {
        /// From 1.
        reference: usize,
        /// From 1.
        channel: usize,
    },
    /// Several lags explain the recordings alike.
    #[error(
        "the recordings of channels {reference} and {channel} agree at several lags, as those of a tone or of a loop do: \
         channel {channel} may have begun {} samples earlier; say how far apart they began at most, or record a sound \
         that does not repeat",
        numbers(lags)
    )]
    Ambiguous {
        /// From 1.
        reference: usize,
        /// From 1.
        channel: usize,
        /// Samples by which the channel may have begun before the reference.
        lags: Vec<i64>,
    },
    /// Most pieces have no lag, or another one than those beside them.
    #[error(
        "only {agreeing} of {pieces} pieces of the recordings of channels {reference} and {channel} show one lag and agree on \
         it with those beside them, and most must, by their level. Check that both recorded the same event, and that \
         neither is drowned in noise, stretched in time or cut together. If at each instant the signal has a narrow band, as \
         a sweep has, record a broad sound (noise, speech, claps)"
    )]
    Disagree {
        /// From 1.
        reference: usize,
        /// From 1.
        channel: usize,
        /// Pieces that agree.
        agreeing: usize,
        /// Pieces that were compared.
        pieces: usize,
    },
    /// The recordings were made at the same time for too short a while.
    #[error("all recordings together have {frames} samples in common; at least {needed} are needed")]
    Overlap {
        /// Samples of each that the others have too.
        frames: usize,
        /// Samples needed.
        needed: usize,
    },
    /// The lags were found, but not the delays.
    #[error(
        "the recordings agree, but in too few pieces to measure how their clocks differ ({measured} of {pieces}){}",
        because(reason)
    )]
    NotMeasured {
        /// Pieces that gave delays.
        measured: usize,
        /// Pieces that were tried.
        pieces: usize,
        /// What is wrong with the others, if anything is.
        reason: Option<CalibrateError>,
    },
}

/// What a reader of an alignment must know.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AlignWarning {
    /// A delay moves, and the taps are fixed.
    #[error(
        "the delay of channel {channel} moves by {:.3} fast periods while the recordings last, and the taps of a bank are \
         fixed; let the taps follow the delays over time, or fuse shorter pieces, each with a bank of its own",
        moved.0
    )]
    FixedTaps {
        /// From 1.
        channel: usize,
        /// Largest minus smallest delay.
        moved: FastPeriods,
    },
    /// Samples were lost, or came in.
    #[error(
        "the recording of channel {channel} {}: they are left out, and the delays follow the step",
        stepped(step)
    )]
    Step {
        /// From 1.
        channel: usize,
        /// Where, and how many.
        step: ClockStep,
    },
    /// Zeros that others lack.
    #[error(
        "the recording of channel {channel} has {zeros} zeros in rows, which are no samples: nothing was measured by \
         them; leave them out of the result, as a merge of the recordings does"
    )]
    Zeros {
        /// From 1.
        channel: usize,
        /// Their number.
        zeros: usize,
    },
    /// Two channels come to sample at one instant.
    #[error(
        "{at:.3} after the first frame the channels {} and {} sample at one instant: no bank recovers the signal there. \
         Leave that stretch out, or use more recorders than the ratio",
        channels[0], channels[1]
    )]
    Coincidence {
        /// From 1.
        channels: [usize; 2],
        /// Time from the first frame on.
        at: Seconds,
    },
    /// What the values mean.
    #[error(transparent)]
    Values(#[from] CalibrationWarning),
}

fn numbers(lags: &[i64]) -> String {
    lags.iter().map(i64::to_string).collect::<Vec<_>>().join(" or ")
}

fn because(reason: &Option<CalibrateError>) -> String {
    reason.as_ref().map_or_else(String::new, |reason| format!(": {reason}"))
}

fn stepped(ClockStep { samples, lost }: &ClockStep) -> String {
    let Range { start, end } = samples;
    let place = if start == end {
        format!("at sample {start}")
    } else {
        format!("between samples {start} and {end}")
    };
    match lost {
        1.. => format!("lost {lost} samples {place}"),
        _ => format!(
            "has {} samples {place} that the reference lacks, because they came in or it lost them",
            -lost
        ),
    }
}
