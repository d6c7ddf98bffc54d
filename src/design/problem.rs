//! The design problem in normalised time: what is left of a spec when the units are gone.

use super::DesignError;
use crate::analog::StrictlyProper;
use crate::spec::{FilterSpec, Spec};

/// Most states of the delay chains of the blocked system. Its matrices are dense: at this size one of them takes
/// 128 MiB, and a norm some of these and a cubic number of operations.
pub const MAX_CHAIN_STATES: usize = 4096;

/// Front ends, delays and rates in units of the fast period (h = 1).
#[derive(Debug, Clone)]
pub struct Problem {
    /// M.
    pub ratio: usize,
    /// m0, fast samples.
    pub latency: usize,
    /// The distinct analog filters. Channels with equal filters share one, and so its state.
    pub front_ends: Vec<StrictlyProper>,
    /// Index of Phi_0 in `front_ends`.
    pub target: usize,
    /// The slow channels.
    pub channels: Vec<Channel>,
}

/// One slow channel of a [`Problem`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Channel {
    /// Index of Phi_i in [`Problem::front_ends`].
    pub front_end: usize,
    /// D_i in fast periods.
    pub delay: f64,
}

impl Problem {
    /// Normalises `spec` with the given latency (fast samples).
    pub fn new(spec: &Spec, latency: usize) -> Result<Self, DesignError> {
        let mut front_ends = Vec::new();
        let realise = |filter: &FilterSpec, place: &dyn Fn() -> String| {
            StrictlyProper::new(filter, spec.fast_period)
                .map_err(|source| DesignError::Analog { place: place(), source })
        };
        let target = intern(&mut front_ends, realise(&spec.target, &|| "target.filter".to_owned())?);
        let mut channels = Vec::with_capacity(spec.channels.len());
        for (i, (channel, delay)) in spec.channels.iter().zip(spec.delays_in_fast_periods()).enumerate() {
            let filter = realise(&channel.filter, &|| format!("filter of channel {}", i + 1))?;
            let front_end = intern(&mut front_ends, filter);
            channels.push(Channel { front_end, delay });
        }
        let problem = Self { ratio: spec.ratio, latency, front_ends, target, channels };
        problem.check_size()?;
        Ok(problem)
    }

    /// Delay chains of bounded length.
    ///
    /// # Errors
    /// [`DesignError::TooLate`] if latency and delays lie so far apart that the chains between them have more than
    /// [`MAX_CHAIN_STATES`] states.
    pub fn check_size(&self) -> Result<(), DesignError> {
        let wanted = (0..self.ratio).map(|p| p as f64 - self.latency as f64);
        let times: Vec<f64> = self.channels.iter().map(|channel| -channel.delay).chain(wanted).collect();
        let latest = times.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let ticks = |time: f64| ((latest - time) / self.ratio as f64).floor();
        let states: f64 = times.into_iter().map(ticks).sum();
        if states <= MAX_CHAIN_STATES as f64 {
            return Ok(());
        }
        let (latency, longest_delay) = (self.latency, self.longest_delay());
        Err(DesignError::TooLate { latency, longest_delay, states, limit: MAX_CHAIN_STATES })
    }

    /// The same problem with `errors[i]` (fast periods) added to the delays.
    pub fn with_delay_errors(&self, errors: &[f64]) -> Self {
        let mut moved = self.clone();
        for (channel, error) in moved.channels.iter_mut().zip(errors) {
            channel.delay += error;
        }
        moved
    }

    /// The same problem with each group of indistinguishable channels (same filter, same delay)
    /// replaced by its first member, and for each channel the index of its representative.
    pub(super) fn without_duplicates(&self) -> (Self, Vec<usize>) {
        let mut reduced = self.clone();
        reduced.channels.clear();
        let representative = self
            .channels
            .iter()
            .map(|channel| match reduced.channels.iter().position(|seen| seen == channel) {
                Some(known) => known,
                None => {
                    reduced.channels.push(*channel);
                    reduced.channels.len() - 1
                }
            })
            .collect();
        (reduced, representative)
    }

    /// The largest delay, in fast periods.
    pub fn longest_delay(&self) -> f64 {
        self.channels.iter().map(|channel| channel.delay).fold(0.0, f64::max)
    }
}

fn intern(front_ends: &mut Vec<StrictlyProper>, filter: StrictlyProper) -> usize {
    if let Some(known) = front_ends.iter().position(|seen| *seen == filter) {
        return known;
    }
    front_ends.push(filter);
    front_ends.len() - 1
}
