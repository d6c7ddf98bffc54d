//! What a calibration found, and a spec with these values.

use super::fit::ChannelParameter;
use super::model::{ChannelModel, ChannelValues, Parameter};
use super::warning::CalibrationWarning;
use crate::linalg::Mat;
use crate::runtime::Nonlinearity;
use crate::sine_fit::Estimate;
use crate::spec::{Cutoff, HALF_WIDTH, OneOrEach, Spec, UncertaintySpec};
use crate::units::{FastPeriods, Hertz};

/// Largest condition of an information matrix with unit diagonal. Beyond it two parameters have the same
/// effect to five digits, and the fit follows the noise.
pub(super) const WORST_CONDITION: f64 = 1e10;
/// A misfit counts only if chance produces it once in a thousand runs: standard deviations of a Gaussian.
const CHANCE_SIGMAS: f64 = 3.09;

/// What a calibration found.
#[derive(Debug, Clone, Default)]
pub struct Calibration {
    /// The reference channel, from 0.
    pub reference: usize,
    /// One per channel.
    pub channels: Vec<ChannelEstimate>,
    /// The part of the front ends whose cut-offs were fitted.
    pub cutoff: Option<Cutoff>,
    /// The static nonlinearity of each channel, if it was fitted: none where a curve does not lower what the
    /// tones leave of samples that it was not fitted to.
    pub nonlinearity: Option<Vec<Nonlinearity>>,
    /// The tones, if there were any.
    pub tones: Vec<CalibrationTone>,
    /// Delays are known modulo this, if tones were used and leave a second value within a thousand periods
    /// of the highest one.
    pub modulus: Option<FastPeriods>,
    /// Frames that took part.
    pub frames: usize,
    /// Clipped samples of each channel, all left out.
    pub clipped: Vec<usize>,
    /// Square root of chi squared per degree of freedom: 1 where the model fits to the noise. `None` if
    /// there is nothing left to judge it by.
    pub misfit: Option<f64>,
    /// What a reader of the estimates must know.
    pub warnings: Vec<CalibrationWarning>,
}

/// The values of one channel; `None` where the value of the spec stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChannelEstimate {
    /// D_i.
    pub delay: Option<Estimate<FastPeriods>>,
    /// g_i.
    pub gain: Option<Estimate<f64>>,
    /// o_i, in the unit of the samples.
    pub offset: Option<Estimate<f64>>,
    /// The factor of the cut-off frequency of Phi_i, or of its stage that was fitted.
    pub cutoff: Option<Estimate<f64>>,
}

/// A tone that was used.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CalibrationTone {
    /// Its analog frequency.
    pub frequency: Estimate<Hertz>,
    /// Its Nyquist zone of the slow rate, from 1: zone z lies between (z - 1)/2 and z/2 of the rate.
    pub zone: usize,
    /// Amplitude in the reference channel.
    pub amplitude: Estimate<f64>,
}

/// Fitted values and their covariance: what all three methods end with.
#[derive(Debug, Clone)]
pub(super) struct Fitted {
    pub(super) point: ChannelValues,
    /// Of the parameters of `point`.
    pub(super) covariance: Mat,
    /// o_i.
    pub(super) offsets: Option<Vec<Estimate<f64>>>,
    pub(super) tones: Vec<CalibrationTone>,
    pub(super) modulus: Option<FastPeriods>,
    /// Square root of chi squared per degree of freedom, if it could be judged.
    pub(super) misfit: Option<f64>,
    /// Frames that took part.
    pub(super) frames: usize,
    pub(super) warnings: Vec<CalibrationWarning>,
    /// The nonlinearities of the channels, if they were asked for.
    pub(super) curves: Vec<Nonlinearity>,
}

impl Fitted {
    pub(super) fn new(point: ChannelValues, covariance: Mat, frames: usize) -> Self {
        Self {
            point,
            covariance,
            offsets: None,
            tones: Vec::new(),
            modulus: None,
            misfit: None,
            frames,
            warnings: Vec::new(),
            curves: Vec::new(),
        }
    }

    /// Notes the misfit, and widens the intervals by it if it is more than chance; returns it then.
    pub(super) fn widen(&mut self, squares: f64, freedom: usize) -> Option<f64> {
        if freedom == 0 {
            return None;
        }
        self.misfit = Some((squares / freedom as f64).sqrt());
        let clear = contradiction(squares, freedom);
        self.covariance *= clear.map_or(1.0, |misfit| misfit * misfit);
        clear
    }

    /// Widens the interval of a fitted value so that one standard deviation reaches to another value, so far
    /// away.
    pub(super) fn reach(&mut self, Parameter { channel, kind }: Parameter, distance: f64) {
        if let Some(k) = self.point.index(channel, kind) {
            self.covariance[(k, k)] += distance.powi(2);
        }
    }

    /// The channels' values; nominal ones have no standard deviation.
    pub(super) fn channels(&self, model: &ChannelModel) -> Vec<ChannelEstimate> {
        let sigma = |i, kind| self.point.index(i, kind).map(|k| self.covariance[(k, k)].max(0.0).sqrt());
        let channel = |i: usize| {
            let (gain, cutoff) = (self.point.gain(i, model), self.point.ln_cutoffs[i].exp());
            let delay = FastPeriods(self.point.delays[i]);
            let of_delay = |sigma| Estimate { value: delay, sigma: FastPeriods(sigma) };
            // The parameters are logarithms, so their errors are relative ones.
            let of_factor = |value: f64, sigma: f64| Estimate { value, sigma: sigma * value.abs() };
            ChannelEstimate {
                delay: sigma(i, ChannelParameter::Delay).map(of_delay),
                gain: sigma(i, ChannelParameter::Gain).map(|sigma| of_factor(gain, sigma)),
                cutoff: sigma(i, ChannelParameter::Cutoff).map(|sigma| of_factor(cutoff, sigma)),
                offset: self.offsets.as_ref().map(|all| all[i]),
            }
        };
        (0..model.channels()).map(channel).collect()
    }
}

/// The square root of chi squared per degree of freedom, if it is more than chance.
pub(super) fn contradiction(squares: f64, freedom: usize) -> Option<f64> {
    let is_clear = freedom > 0 && squares > chi_squared_quantile(freedom, CHANCE_SIGMAS);
    is_clear.then(|| (squares / freedom as f64).sqrt())
}

/// The weighted mean of estimates of one value. Where they contradict each other by more than chance, its
/// standard deviation is as much larger.
pub(super) fn pooled(all: impl Iterator<Item = Estimate<f64>> + Clone) -> Estimate<f64> {
    let count = all.clone().count();
    if let (1, Some(one)) = (count, all.clone().next()) {
        return one;
    }
    let weight = |one: &Estimate<f64>| one.sigma.powi(2).max(f64::MIN_POSITIVE).recip();
    let weights: f64 = all.clone().map(|one| weight(&one)).sum();
    let value = all.clone().map(|one| weight(&one) * one.value).sum::<f64>() / weights;
    let squares: f64 = all.map(|one| weight(&one) * (one.value - value).powi(2)).sum();
    let widening = contradiction(squares, count - 1).unwrap_or(1.0);
    Estimate { value, sigma: widening / weights.sqrt() }
}

/// The value that chi squared exceeds as rarely as a Gaussian exceeds `z` standard deviations (Wilson and
/// Hilferty, 1931).
fn chi_squared_quantile(freedom: usize, z: f64) -> f64 {
    let v = freedom as f64;
    let t = 2.0 / (9.0 * v);
    v * (1.0 - t + z * t.sqrt()).powi(3)
}

/// `spec` with the values of `calibration` and an `[uncertainty]` table with their half-widths. Values that
/// were not fitted stay, and so do their half-widths. Delays that would be negative raise all
/// delays and the latency by whole fast periods.
pub fn applied(spec: &Spec, calibration: &Calibration) -> (Spec, Vec<CalibrationWarning>) {
    let (mut new, h) = (spec.clone(), spec.fast_period);
    for (channel, found) in new.channels.iter_mut().zip(&calibration.channels) {
        channel.delay = found.delay.map_or(channel.delay, |delay| delay.value.in_seconds(h));
        channel.gain = found.gain.map_or(channel.gain, |gain| gain.value);
        channel.offset = found.offset.map_or(channel.offset, |offset| offset.value);
        if let (Some(cutoff), Some(part)) = (found.cutoff, calibration.cutoff)
            && let Some(filter) = part.scaled(&channel.filter, cutoff.value)
        {
            channel.filter = filter;
        }
    }
    if let Some(curves) = &calibration.nonlinearity {
        new.channels
            .iter_mut()
            .zip(curves)
            .for_each(|(channel, curve)| channel.nonlinearity.clone_from(curve));
    }
    let before = spec.uncertainty.clone().unwrap_or_default();
    let channels = &calibration.channels;
    new.uncertainty = Some(UncertaintySpec {
        delay: half_widths(channels, before.delay, |c| Some(c.delay?.sigma.in_seconds(h) * HALF_WIDTH)),
        gain: half_widths(channels, before.gain, |c| Some(c.gain?.sigma * HALF_WIDTH)),
        offset: half_widths(channels, before.offset, |c| Some(c.offset?.sigma * HALF_WIDTH)),
        cutoff: half_widths(channels, before.cutoff, |c| {
            c.cutoff.map(|cutoff| cutoff.sigma / cutoff.value * HALF_WIDTH)
        }),
        reference: Some(calibration.reference + 1),
    });
    let warnings = raise(&mut new, spec.wait()).map(|periods| CalibrationWarning::Shifted { periods });
    (new, warnings.into_iter().collect())
}

/// The half-widths that were found, 0 for a channel without one; those of before if none was found.
fn half_widths<T: Default>(
    channels: &[ChannelEstimate],
    before: Option<OneOrEach<T>>,
    of: impl Fn(&ChannelEstimate) -> Option<T>,
) -> Option<OneOrEach<T>> {
    let found: Vec<Option<T>> = channels.iter().map(of).collect();
    if found.iter().all(Option::is_none) {
        return before;
    }
    Some(OneOrEach::Each(found.into_iter().map(Option::unwrap_or_default).collect()))
}

/// Adds the whole fast periods that make all delays positive, if there must be any, also to the latency,
/// which included the wait for a frame of `before`.
fn raise(spec: &mut Spec, before: usize) -> Option<usize> {
    let h = spec.fast_period;
    let least = spec.channels.iter().map(|channel| channel.delay / h).fold(0.0, f64::min);
    let periods = (-least).ceil() as usize;
    spec.channels.iter_mut().for_each(|channel| channel.delay += h * periods as f64);
    let waited = spec.wait() + periods;
    spec.latency = spec.latency.map(|latency| (latency + waited).saturating_sub(before));
    (periods > 0).then_some(periods)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_tables() {
        // The 99.9 % points of 1, 10 and 100 degrees of freedom.
        for (freedom, table) in [(1, 10.828), (10, 29.588), (100, 149.449)] {
            let ours = chi_squared_quantile(freedom, CHANCE_SIGMAS);
            assert!((ours / table - 1.0).abs() < 0.04, "{freedom}: {ours}");
        }
    }
}
