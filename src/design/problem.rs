//! The design problem in normalised time: a spec without its units.

use super::DesignError;
use crate::analog::StrictlyProper;
use crate::linalg::Mat;
use crate::spec::{FilterSpec, Spec};
use crate::units::FastPeriods;

/// Maximum number of states of the delay chains of the lifted system. Its matrices are dense: at this size
/// one matrix takes 128 MiB. A norm needs several of them, and its time grows with the cube of the states.
pub const MAX_CHAIN_STATES: usize = 4096;

/// Front ends, delays and rates in units of the fast period (h = 1).
#[derive(Debug, Clone)]
pub struct Problem {
    /// M, the ratio of output rate to input rate.
    pub ratio: usize,
    /// The latency m0 in fast samples.
    pub latency: usize,
    /// The distinct analog filters. Channels with equal filters share one filter and its state.
    pub front_ends: Vec<StrictlyProper>,
    /// Index of Phi_0 in `front_ends`.
    pub target: usize,
    /// The slow channels.
    pub channels: Vec<Channel>,
    /// Power sigma_i^2 of the noise that each channel adds to its samples.
    pub noise: Vec<f64>,
}

/// One slow channel of a [`Problem`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Channel {
    /// Index of Phi_i in [`Problem::front_ends`].
    pub front_end: usize,
    /// D_i.
    pub delay: FastPeriods,
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
        let noise = spec.channels.iter().map(|channel| channel.noise * channel.noise).collect();
        let problem = Self { ratio: spec.ratio, latency, front_ends, target, channels, noise };
        problem.check_size()?;
        Ok(problem)
    }

    /// Checks that the delay chains are not too long.
    ///
    /// # Errors
    /// [`DesignError::TooLate`] if latency and delays lie so far apart that the chains between them have
    /// more than [`MAX_CHAIN_STATES`] states.
    pub fn check_size(&self) -> Result<(), DesignError> {
        let references = (0..self.ratio).map(|p| p as f64 - self.latency as f64);
        let times: Vec<f64> =
            self.channels.iter().map(|channel| -channel.delay.0).chain(references).collect();
        let latest = times.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let periods = |time: f64| ((latest - time) / self.ratio as f64).floor();
        let states: f64 = times.into_iter().map(periods).sum();
        if states <= MAX_CHAIN_STATES as f64 {
            return Ok(());
        }
        let (latency, longest_delay) = (self.latency, self.longest_delay());
        Err(DesignError::TooLate { latency, longest_delay, states, limit: MAX_CHAIN_STATES })
    }

    /// The same problem with `errors[i]` added to the delays.
    pub fn with_delay_errors(&self, errors: &[FastPeriods]) -> Self {
        let mut moved = self.clone();
        for (channel, &error) in moved.channels.iter_mut().zip(errors) {
            channel.delay += error;
        }
        moved
    }

    /// Replaces each group of identical channels (same filter, same delay) by one channel, their weighted
    /// mean.
    pub(super) fn merge_channels(&self) -> MergedChannels {
        let mut merged = self.clone();
        merged.channels.clear();
        for channel in &self.channels {
            if !merged.channels.contains(channel) {
                merged.channels.push(*channel);
            }
        }
        merged.noise = vec![0.0; merged.channels.len()];
        let mut shares = vec![Share { representative: 0, share: 0.0 }; self.channels.len()];
        for (representative, common) in merged.channels.iter().enumerate() {
            let group: Vec<usize> = (0..shares.len()).filter(|&i| self.channels[i] == *common).collect();
            let noise: Vec<f64> = group.iter().map(|&i| self.noise[i]).collect();
            for (&i, share) in group.iter().zip(least_noise_shares(&noise)) {
                shares[i] = Share { representative, share };
                merged.noise[representative] += share * share * self.noise[i];
            }
        }
        MergedChannels { problem: merged, shares }
    }

    /// The largest delay.
    pub fn longest_delay(&self) -> FastPeriods {
        FastPeriods(self.channels.iter().map(|channel| channel.delay.0).fold(0.0, f64::max))
    }
}

/// A problem without identical channels, and the share of each original channel in its merged channel.
#[derive(Debug, Clone)]
pub(super) struct MergedChannels {
    /// The problem with each distinct channel once.
    pub(super) problem: Problem,
    /// One for each of the original channels.
    pub(super) shares: Vec<Share>,
}

/// The merged channel to which a channel belongs, and its weight there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Share {
    /// Index of the merged channel.
    pub(super) representative: usize,
    /// The shares of a group sum to 1.
    pub(super) share: f64,
}

impl MergedChannels {
    /// Whether the original channels were all distinct.
    pub(super) fn are_all(&self) -> bool {
        self.problem.channels.len() == self.shares.len()
    }

    /// Distributes each merged filter over its identical channels by their shares. The error stays the
    /// same, and the noise is least.
    pub(super) fn share_taps(&self, taps: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let share = |part: &Share| taps[part.representative].iter().map(|tap| tap * part.share).collect();
        self.shares.iter().map(share).collect()
    }

    /// The matrix that maps the original channels to the merged ones: F of the merged channels times this
    /// matrix is F of the original channels.
    pub(super) fn shares(&self) -> Mat {
        let entry = |merged: usize, channel: usize| {
            let part = self.shares[channel];
            if part.representative == merged { part.share } else { 0.0 }
        };
        Mat::from_fn(self.problem.channels.len(), self.shares.len(), entry)
    }
}

/// Weights of sum 1 for the mean of equal signals with the least noise, given the noise power of each. They
/// are inversely proportional to the powers. If any signals are noiseless, only these have weight.
fn least_noise_shares(noise: &[f64]) -> Vec<f64> {
    let least = noise.iter().copied().fold(f64::INFINITY, f64::min);
    let weight = |power: f64| if least == 0.0 { f64::from(u8::from(power == 0.0)) } else { least / power };
    let total: f64 = noise.iter().map(|&power| weight(power)).sum();
    noise.iter().map(|&power| weight(power) / total).collect()
}

fn intern(front_ends: &mut Vec<StrictlyProper>, filter: StrictlyProper) -> usize {
    if let Some(known) = front_ends.iter().position(|seen| *seen == filter) {
        return known;
    }
    front_ends.push(filter);
    front_ends.len() - 1
}
