//! The design problem in normalised time: a spec without its units.

use super::DesignError;
use hybank_core::bank::Bank;
use hybank_core::spec::{MAX_ERROR_STATES, Spec};
use hybank_core::units::{FastPeriods, GridTime, RadiansPerFastPeriod, Seconds, Timeline};
use hybank_linalg::Complex;
use hybank_verify::analog::{StableFilter, StrictlyProper};
use std::ops::Range;

/// Slow periods of delay up to which latencies that predict are compared, too.
const KEPT_PERIODS: usize = 16;

/// Delays of like channels closer than this (in fast periods, and up to whole slow periods) are not
/// resolved: the difference of their samples has lost half of its digits or more, and a bank of large taps
/// may gain by it what no computation in doubles shows.
const DELAY_RESOLUTION: f64 = 1e-8;

/// Front ends, delays and rates in units of the fast period (h = 1).
#[derive(Debug, Clone)]
pub struct Problem {
    /// h: the grid of all instants.
    pub fast_period: Seconds,
    /// M, the ratio of output rate to input rate.
    pub ratio: usize,
    /// The latency m0 in fast samples.
    pub latency: usize,
    /// W, the filter of the signal: the front ends see white noise, or an input of bounded energy, through
    /// it. `None` stands for W = 1.
    pub signal: Option<StableFilter>,
    /// The ends of the band of the signal, of which W is a model: mean squares are those for a flat spectrum
    /// there. `None` stands for the spectrum |W|^2.
    pub band: Option<[RadiansPerFastPeriod; 2]>,
    /// The distinct analog filters Phi. Channels whose filters are proportional share one filter and its
    /// state.
    pub front_ends: Vec<StrictlyProper>,
    /// Index of Phi_0 in `front_ends`.
    pub target: usize,
    /// The slow channels, in the order of [`FrameLayout::iter`](hybank_core::spec::FrameLayout::iter).
    pub channels: Vec<Channel>,
    /// The wait S for the last sample of a frame, which is part of the delays and of the latency; 0 for
    /// converters of one rate.
    pub wait: usize,
    /// Power s_i^2 of the noise that each channel adds to its samples, relative to an input of unit density.
    pub noise: Vec<f64>,
}

/// One slow channel of a [`Problem`]: a converter, or one of its samples in a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Channel {
    /// Index of a filter in [`Problem::front_ends`] to which Phi_i is proportional.
    pub front_end: usize,
    /// The samples over that filter's output: Phi_i over that filter, times `converter_gain`.
    pub gain: f64,
    /// g_i, the converter's own gain.
    pub converter_gain: f64,
    /// The converter.
    pub converter: usize,
    /// D_i, or D_ij + S.
    pub delay: GridTime,
}

impl Problem {
    /// The problem of a spec whose latency may be open; it then has the latency that all delays have in
    /// common.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub(super) fn before_sizing(spec: &Spec) -> Result<Self, DesignError> {
        Self::new(spec, spec.latency.unwrap_or_else(|| common_delay(spec)))
    }

    /// The same problem `fast_periods` earlier: a common shift of all delays and of the latency changes
    /// neither the error nor the filters.
    pub(super) fn earlier(mut self, fast_periods: usize) -> Self {
        for channel in &mut self.channels {
            channel.delay = channel.delay.later_by(-(fast_periods as f64));
        }
        self.latency -= fast_periods;
        self
    }

    /// The response Phi W of the front end of this index, after the signal's filter.
    pub fn response(&self, front_end: usize, w: RadiansPerFastPeriod) -> Complex<f64> {
        let response = self.front_ends[front_end].response(w);
        self.signal.as_ref().map_or(response, |signal| response * signal.response(w))
    }

    /// The delays of the channels.
    pub fn delays(&self) -> Vec<FastPeriods> {
        self.channels.iter().map(|channel| channel.delay.in_fast_periods()).collect()
    }

    /// The channels of each converter.
    pub fn converters(&self) -> Vec<Range<usize>> {
        let of_one = self.channels.chunk_by(|a, b| a.converter == b.converter);
        let next = |first: &mut usize, channels: &[Channel]| {
            let range = *first..*first + channels.len();
            *first = range.end;
            Some(range)
        };
        of_one.scan(0, next).collect()
    }

    /// Checks that the delay chains are not too long.
    ///
    /// # Errors
    /// [`DesignError::TooLate`] if latency and delays lie so far apart that the chains between them have
    /// more than [`MAX_ERROR_STATES`] states.
    pub fn check_size(&self) -> Result<(), DesignError> {
        let states = self.chain_states();
        if states <= MAX_ERROR_STATES as f64 {
            return Ok(());
        }
        let (latency, longest_delay) = (self.latency, self.longest_delay());
        Err(DesignError::TooLate { latency, longest_delay, states, limit: MAX_ERROR_STATES })
    }

    /// The instants of the samples of one slow period: those of the channels, then those of the target.
    pub(super) fn timeline(&self) -> Timeline {
        let reference = |p: usize| GridTime::fast_sample(p as f64 - self.latency as f64, self.fast_period);
        let sampled = self.channels.iter().map(|channel| channel.delay.negative());
        Timeline::new(&sampled.chain((0..self.ratio).map(reference)).collect::<Vec<_>>(), self.ratio)
    }

    /// States of all delay chains: one for each whole slow period by which a sample is older than the
    /// newest.
    pub(super) fn chain_states(&self) -> f64 {
        self.timeline().delay_periods().iter().sum()
    }

    /// Whether the delays of all channels with the same front end are equal or far enough apart for bounds
    /// that hold for all banks.
    pub(super) fn resolves_delays(&self) -> bool {
        let resolved = |a: GridTime, b: GridTime| {
            let (_, apart) = a.from_whole_periods(b, self.ratio);
            a.periods_since(b, self.ratio).is_some() || apart.0.abs() >= DELAY_RESOLUTION
        };
        self.channels.iter().enumerate().all(|(i, a)| {
            let mut alike = self.channels[..i].iter().filter(|b| b.front_end == a.front_end);
            alike.all(|b| resolved(a.delay, b.delay))
        })
    }

    /// The problem that a bank solves.
    ///
    /// # Errors
    /// [`DesignError::NoSpec`] for a bank without front ends; as [`new`](Self::new).
    pub fn of_bank(bank: &Bank) -> Result<Self, DesignError> {
        let spec = bank.spec.as_ref().ok_or(DesignError::NoSpec)?;
        Self::new(spec, bank.latency)
    }

    /// The largest delay.
    pub fn longest_delay(&self) -> FastPeriods {
        FastPeriods(self.delays().iter().map(|delay| delay.0).fold(0.0, f64::max))
    }
}

/// The delay in whole slow periods that all channels have, in fast periods, beyond [`KEPT_PERIODS`] of them.
/// A bank of less latency would predict the target from samples that much older.
pub(super) fn common_delay(spec: &Spec) -> usize {
    let delays =
        spec.layout().waited_delays(&spec.delays()).into_iter().map(|delay| delay.in_fast_periods().0);
    let least = delays.fold(f64::INFINITY, f64::min);
    let periods = (least / spec.ratio as f64).floor().max(0.0) as usize;
    periods.saturating_sub(KEPT_PERIODS) * spec.ratio
}
