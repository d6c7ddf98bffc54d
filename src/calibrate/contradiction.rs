//! In what captures contradict a spec.

use super::error::list;
use crate::quantity::readable;
use crate::sine_fit::Estimate;
use crate::units::{FastPeriods, Seconds};

/// In what captures contradict a spec.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Contradiction {
    /// Two captures hold the same samples.
    #[error(
        "channels {first} and {second} hold the same samples, but the spec gives them different delays; was one recording given twice?"
    )]
    Repeated {
        /// From 1.
        first: usize,
        /// From 1.
        second: usize,
    },
    /// The captures are those of the channels in another order.
    #[error(
        "the channels seem to be in the wrong order: their delays are those of the channels {}",
        list(.order)
    )]
    WrongOrder {
        /// The channel that each capture belongs to, from 1.
        order: Vec<usize>,
    },
    /// A capture holds next to nothing.
    #[error(
        "channel {channel} has no signal: its level is {level:.1e} of that of the strongest channel; check its cable, \
         its converter, and the order of the captures"
    )]
    NoSignal {
        /// From 1.
        channel: usize,
        /// Its rms over that of the loudest channel.
        level: f64,
    },
    /// A capture has the other sign.
    #[error(
        "channel {channel} is inverted; swap its leads, or give the channel the opposite sign of `gain` in the spec \
         and design the bank again"
    )]
    Inverted {
        /// From 1.
        channel: usize,
    },
    /// A capture is larger or smaller than the others.
    #[error(
        "the gain of channel {channel} is {ratio:.4} times that of the spec, relative to the other channels; write \
         `gain = {gain:.4}` in the spec, or measure it with `hybank calibrate`, and design the bank again"
    )]
    Gain {
        /// From 1.
        channel: usize,
        /// Its gain over that of the spec, relative to the first of two channels, or to the median of more.
        ratio: f64,
        /// What the gain of the spec would be.
        gain: f64,
    },
    /// A capture has another mean than the others.
    #[error(
        "the samples of channel {channel} lie {apart:.4} of full scale from the mean of all channels: an offset gives spurs \
         at the sample rate; write `offset = {offset:.4}` in the spec, or measure it with `hybank calibrate`, and design \
         the bank again"
    )]
    Offset {
        /// From 1.
        channel: usize,
        /// Its mean less that of all channels, each less the offset of the spec.
        apart: f64,
        /// What the offset of the spec would be.
        offset: f64,
    },
    /// Samples are far beyond full scale.
    #[error(
        "the samples of channel {channel} have an rms of {level:.1e} times full scale; state the full scale, or look for \
         damaged samples"
    )]
    Beyond {
        /// From 1.
        channel: usize,
        /// The rms.
        level: f64,
    },
    /// A capture began before the others, or after them.
    #[error("the capture of channel {channel} began {}", began(*early, *seconds))]
    Start {
        /// From 1.
        channel: usize,
        /// Samples by which it began too early; below 0 if too late.
        early: i64,
        /// The same as a time, unless the spec is in normalised time.
        seconds: Option<Seconds>,
    },
    /// A delay is outside its interval.
    #[error(
        "the delay of channel {channel} relative to channel {reference} differs from that of the spec by {:.4} fast periods (± {:.1e}), \
         more than the {:.1e} that the spec allows; measure it with `hybank calibrate`",
        deviation.value.0, 2.0 * deviation.sigma.0, half_width.0
    )]
    Delay {
        /// From 1.
        channel: usize,
        /// From 1.
        reference: usize,
        /// Found delay minus that of the spec.
        deviation: Estimate<FastPeriods>,
        /// Half-width of the interval of the spec.
        half_width: FastPeriods,
    },
}

/// When the capture of a channel began, and what to cut.
fn began(early: i64, seconds: Option<Seconds>) -> String {
    let count = early.unsigned_abs();
    let samples = if count == 1 { "sample" } else { "samples" };
    let time = seconds.map_or_else(String::new, |time| format!(" ({})", readable(time.0, "s")));
    let (when, whose) =
        if early > 0 { ("before", "of this channel") } else { ("after", "of the other channels") };
    format!("{count} {samples}{time} {when} the others; cut the first {count} {samples} {whose}")
}
