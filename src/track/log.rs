//! What is known of the delays at some frame, as a line of a log, and what a user should know at once.

use super::filter::{DelayMeasurement, DelayState};
use super::tracker::Lock;
use crate::sampling::SamplingError;
use crate::spec::{HALF_WIDTH, Spec};
use crate::units::Seconds;
use serde::Serialize;

/// What is known of all channels. As JSON it is a line that [`super::Reading::parse`] reads.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Logged {
    /// The frame, from 0.
    pub frame: u64,
    /// Its time.
    pub time: Seconds,
    /// D_i; the reference has that of the spec.
    pub delay: Vec<Seconds>,
    /// Half-widths of their 95 % intervals; zero where a delay counts as exact.
    pub half_width: Vec<Seconds>,
    /// By how much the delays err at most between readings that are known beforehand: if each reading is
    /// within its half-width and no rate changes by more than [`super::Tracking::wander`]. None
    /// outside the readings.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bound: Option<Vec<Option<Seconds>>>,
    /// Changes of the delays in parts per million.
    pub rate_ppm: Vec<f64>,
    /// Whether each delay is known.
    pub lock: Vec<Lock>,
    /// The delays that were measured and taken.
    pub measured: Vec<Option<Seconds>>,
    /// Why nothing was measured; the delays go on as they were expected to.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub held: Option<String>,
}

impl Logged {
    /// All channels as the spec says.
    pub(super) fn of_reference(spec: &Spec, frame: f64, period: Seconds, held: Option<String>) -> Self {
        let count = spec.channels.len();
        Self {
            frame: frame as u64,
            time: period * frame,
            delay: spec.channels.iter().map(|channel| channel.delay).collect(),
            half_width: vec![Seconds(0.0); count],
            bound: None,
            rate_ppm: vec![0.0; count],
            lock: vec![Lock::Locked; count],
            measured: vec![None; count],
            held,
        }
    }

    /// Channel `i` as it is followed.
    pub(super) fn put(
        &mut self,
        i: usize,
        state: DelayState,
        lock: Lock,
        measured: Option<DelayMeasurement>,
    ) {
        self.delay[i] = state.delay;
        self.half_width[i] = state.deviation() * HALF_WIDTH;
        self.rate_ppm[i] = 1e6 * state.rate;
        self.lock[i] = lock;
        self.measured[i] = measured.map(|measured| measured.delay);
    }
}

/// What a user should know at once.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TrackWarning {
    /// Measurements contradicted a delay again and again; it was taken from the last of them.
    #[error(
        "the delay of channel {channel} was lost at frame {frame}: measurements contradicted it again and again; it starts again"
    )]
    Lost {
        /// From 1.
        channel: usize,
        /// The frame.
        frame: u64,
    },
    /// No curve through the readings of a channel was found, so a filter follows them, which knows the past
    /// only.
    #[error(
        "channel {channel}: no curve goes through its readings, so each is followed with those before it only: \
         {reason}; check their frames, delays and half-widths"
    )]
    NotSmoothed {
        /// From 1.
        channel: usize,
        /// Why.
        reason: SamplingError,
    },
    /// Two channels will sample at one instant.
    #[error(
        "{at:.3} after the beginning the channels {} and {} will sample at one instant: no bank recovers the signal there",
        channels[0], channels[1]
    )]
    Coincidence {
        /// From 1.
        channels: [usize; 2],
        /// Time from the first frame on.
        at: Seconds,
    },
}

impl TrackWarning {
    /// Whether another warning says the same of the same channels.
    pub(super) fn is_like(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Lost { channel: a, .. }, Self::Lost { channel: b, .. }) => a == b,
            (Self::Coincidence { channels: a, .. }, Self::Coincidence { channels: b, .. }) => a == b,
            _ => false,
        }
    }
}
