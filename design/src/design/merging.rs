//! Channels that measure the same thing are designed as one.
//!
//! Two channels whose filters are proportional and that sample at one instant carry one measurement. For
//! recursive filters, so do two that sample whole slow periods apart: the later sample of one is the earlier
//! sample of the other, which a filter with memory has seen. Kept apart, they would make the plant singular.
//! Order reduction keeps these apart (`realise`): a filter of few states has seen less.

use super::DesignError;
use super::lifting::JointState;
use super::problem::{Channel, Problem};
use crate::lti::gramian::controllability_root;
use hybank_core::spec::{Method, Spec};
use hybank_linalg::{Mat, power_of_two};

/// Sizes of measurements within this factor of one are not changed: they lose no digits to one another.
const USUAL_SIZE: f64 = 16.0;

/// Which channels count as one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Repeats {
    /// Proportional filters that sample at the same instant.
    AtOneInstant,
    /// Proportional filters that sample at the same instant or whole slow periods apart. The newest sample
    /// stands for all.
    AtWholePeriods,
    /// The same among channels without noise. With noise an older sample says more of its instant, and the
    /// noise keeps the plant regular.
    NoiselessAtWholePeriods,
    /// None: channels that carry one measurement without errors do not with them.
    Never,
}

impl Repeats {
    /// The repeats that carry no information for the bank that `spec` asks for.
    pub(super) fn of(spec: &Spec) -> Self {
        match spec.design.method {
            _ if spec.is_fir() => Self::AtOneInstant,
            Method::H2 => Self::NoiselessAtWholePeriods,
            _ => Self::AtWholePeriods,
        }
    }
}

/// A problem without repeated channels, and the share of each original channel in its merged channel.
#[derive(Debug, Clone)]
pub(super) struct MergedChannels {
    /// The problem with each distinct channel once.
    pub(super) problem: Problem,
    /// One for each of the original channels.
    pub(super) shares: Vec<MergedShare>,
}

/// The merged channel to which a channel belongs, and its weight there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct MergedShare {
    /// Index of the merged channel.
    pub(super) representative: usize,
    /// The merged measurement is the sum of the measurements times their shares. Zero for a channel that
    /// repeats a newer sample.
    pub(super) share: f64,
}

impl Problem {
    /// Replaces each group of repeated channels by one channel, the weighted mean of those with the newest
    /// sample.
    pub(super) fn merge_channels(&self, repeats: Repeats) -> MergedChannels {
        let mut merged = self.clone();
        merged.channels.clear();
        merged.noise.clear();
        let mut shares = vec![MergedShare { representative: 0, share: 0.0 }; self.channels.len()];
        for group in self.groups(repeats) {
            let newest = self.newest(&group);
            let reference = self.channels[newest[0]];
            let gain = |i: usize| self.channels[i].gain / reference.gain;
            // In units of the first channel of the group.
            let relative: Vec<f64> = newest.iter().map(|&i| self.noise[i] / (gain(i) * gain(i))).collect();
            let weights = least_noise_shares(&relative);
            let representative = merged.channels.len();
            group.iter().for_each(|&i| shares[i].representative = representative);
            for (&i, weight) in newest.iter().zip(&weights) {
                shares[i].share = weight / gain(i);
            }
            merged.noise.push(weights.iter().zip(&relative).map(|(w, power)| w * w * power).sum());
            merged.channels.push(reference);
        }
        MergedChannels { problem: merged, shares }
    }

    /// The channels in groups that carry one measurement, in the order of their first channels.
    fn groups(&self, repeats: Repeats) -> Vec<Vec<usize>> {
        let mut groups: Vec<Vec<usize>> = Vec::new();
        for i in 0..self.channels.len() {
            let known = groups.iter_mut().find(|group| self.repeats(i, group[0], repeats));
            match known {
                Some(group) => group.push(i),
                None => groups.push(vec![i]),
            }
        }
        groups
    }

    fn repeats(&self, i: usize, j: usize, repeats: Repeats) -> bool {
        let (a, b) = (&self.channels[i], &self.channels[j]);
        let apart = a.delay.periods_since(b.delay, self.ratio);
        let noisy = self.noise[i] > 0.0 || self.noise[j] > 0.0;
        let alike = match repeats {
            Repeats::Never => false,
            Repeats::NoiselessAtWholePeriods if noisy => apart == Some(0.0),
            Repeats::NoiselessAtWholePeriods | Repeats::AtWholePeriods => apart.is_some(),
            Repeats::AtOneInstant => apart == Some(0.0),
        };
        a.front_end == b.front_end && alike
    }

    /// The channels of `group` with the least delay.
    fn newest(&self, group: &[usize]) -> Vec<usize> {
        let delay = |i: usize| self.channels[i].delay;
        let least = group.iter().map(|&i| delay(i)).min_by(|a, b| a.compare(*b));
        let is_least =
            |&i: &usize| least.and_then(|least| delay(i).periods_since(least, self.ratio)) == Some(0.0);
        group.iter().copied().filter(is_least).collect()
    }
}

/// Units in which every measurement is of about unit size. A gain g of channel i is undone by its filter,
/// `F_i H_i = (F_i / g) (g H_i)`, so gamma does not depend on it. The decompositions of double precision do:
/// next to a large measurement a small one is lost to rounding. The units are powers of two, so a change of
/// units rounds nothing.
impl Problem {
    /// For each channel the unit u_i in which it is designed: u_i times the measurement has about unit size.
    ///
    /// # Errors
    /// [`DesignError::Lti`] if a decomposition does not converge.
    pub(super) fn measurement_units(&self) -> Result<Vec<f64>, DesignError> {
        let joint = JointState::new(self);
        let (transition, input) = joint.over(self.ratio as f64);
        let outputs = joint.c() * controllability_root(&transition, &input)?;
        let unit = |channel: &Channel| {
            let size = channel.gain.abs() * outputs.row(channel.front_end).norm();
            if (1.0 / USUAL_SIZE..=USUAL_SIZE).contains(&size) { 1.0 } else { 1.0 / power_of_two(size) }
        };
        Ok(self.channels.iter().map(unit).collect())
    }
}

impl MergedChannels {
    /// The same channels with measurements of about unit size.
    ///
    /// # Errors
    /// As [`Problem::measurement_units`].
    pub(super) fn of_unit_size(mut self) -> Result<Self, DesignError> {
        let units = self.problem.measurement_units()?;
        for (channel, unit) in self.problem.channels.iter_mut().zip(&units) {
            channel.gain *= unit;
            channel.converter_gain *= unit;
        }
        self.problem.noise.iter_mut().zip(&units).for_each(|(power, unit)| *power *= unit * unit);
        self.shares.iter_mut().for_each(|share| share.share *= units[share.representative]);
        Ok(self)
    }

    /// Whether the channels are the original ones, in their units.
    pub(super) fn are_unchanged(&self) -> bool {
        let unchanged = |(i, share): (usize, &MergedShare)| share.representative == i && share.share == 1.0;
        self.shares.iter().enumerate().all(unchanged)
    }

    /// For each merged channel the first of the original channels whose sample is the newest.
    pub(super) fn representatives(&self) -> Vec<usize> {
        let of = |merged: usize| {
            let belongs = |share: &MergedShare| share.representative == merged && share.share != 0.0;
            self.shares.iter().position(belongs)
        };
        (0..self.problem.channels.len()).filter_map(of).collect()
    }

    /// Distributes each merged filter over its channels by their shares. The error stays the same, and the
    /// noise is least.
    pub(super) fn share_taps(&self, taps: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let share =
            |part: &MergedShare| taps[part.representative].iter().map(|tap| tap * part.share).collect();
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

    /// The matrix that maps the channels of `finer`, which keeps apart some channels that are one here, to
    /// the channels here. Both weigh the channels of one instant in the same proportions.
    pub(super) fn shares_of(&self, finer: &Self) -> Mat {
        let representatives = finer.representatives();
        let entry = |merged: usize, of: usize| {
            let channel = representatives[of];
            let part = self.shares[channel];
            if part.representative == merged { part.share / finer.shares[channel].share } else { 0.0 }
        };
        Mat::from_fn(self.problem.channels.len(), finer.problem.channels.len(), entry)
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

#[cfg(test)]
mod tests {
    use super::*;

    /// M = 2; each channel by its numerator, delay and noise, after num / (s + 1).
    fn problem(channels: &[(f64, f64, f64)]) -> Problem {
        let channel = |&(num, delay, noise): &(f64, f64, f64)| {
            format!(
                "{{ delay = {delay:?}, noise = {noise:?}, filter = {{ num = [{num:?}], den = [1.0, 1.0] }} }}"
            )
        };
        let list: Vec<String> = channels.iter().map(channel).collect();
        let text = format!(
            "fast_period = 1.0\nratio = 2\nlatency = 4\nchannel = [{}]\n\
             target = {{ filter = {{ num = [1.0], den = [1.0, 1.0] }} }}\ndesign = {{ method = \"iir\" }}",
            list.join(", ")
        );
        Problem::new(&Spec::from_toml(&text, "spec.toml").unwrap(), 4).unwrap()
    }

    fn shares(merged: &MergedChannels) -> Vec<(usize, f64)> {
        merged.shares.iter().map(|share| (share.representative, share.share)).collect()
    }

    #[test]
    fn equal_channels_share_by_their_gains_and_noise() {
        // Referred to the input, the second channel has a quarter of the first one's noise power.
        let two = problem(&[(1.0, 0.5, 0.1), (2.0, 0.5, 0.1)]);
        let merged = two.merge_channels(Repeats::AtOneInstant);
        let found = shares(&merged);
        assert!((found[0].1 - 0.2).abs() < 1e-15 && (found[1].1 - 0.4).abs() < 1e-15, "{found:?}");
        // 0.2^2 0.01 + 0.4^2 0.01.
        assert!((merged.problem.noise[0] - 0.002).abs() < 1e-15);
        // The merged measurement of a unit signal is one, whatever the gains are.
        assert!(((merged.shares() * Mat::from_column_slice(2, 1, &[1.0, 2.0]))[0] - 1.0).abs() < 1e-15);
    }

    #[test]
    fn the_newest_sample_stands_for_those_whole_periods_older() {
        let three = problem(&[(1.0, 4.3, 0.0), (1.0, 0.9, 0.0), (3.0, 0.3, 0.0)]);
        let recursive = three.merge_channels(Repeats::AtWholePeriods);
        assert_eq!(shares(&recursive), [(0, 0.0), (1, 1.0), (0, 1.0)]);
        assert_eq!(recursive.representatives(), [2, 1]);
        assert_eq!(recursive.problem.channels[0].delay.in_fast_periods().0, 0.3);
        // Taps reach only so far back, so an older sample adds to a newer one.
        assert!(three.merge_channels(Repeats::AtOneInstant).are_unchanged());
    }

    #[test]
    fn channels_that_differ_stay_apart() {
        let apart = problem(&[(1.0, 0.3, 0.0), (1.0, 1.3, 0.0), (1.0, 0.3 + 1e-9, 0.0)]);
        assert!(apart.merge_channels(Repeats::AtWholePeriods).are_unchanged());
    }
}
