//! What converters make of a signal.

use super::covariance::Covariance;
use super::spectrum::{Node, Spectrum};
use hybank_core::units::{CyclesPerFastPeriod, FastPeriods};
use hybank_linalg::Complex;
use std::f64::consts::TAU;
use std::sync::Arc;

/// Least variance of the noise of a sample, relative to the sample's power: below it covariances have no
/// digits that tell samples apart.
const LEAST_NOISE: f64 = 1e-12;

/// A converter with its front end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Converter {
    /// Number of its front end.
    pub front_end: usize,
    /// The sample over the output of the front end; negative for an inverted converter.
    pub gain: f64,
    /// Variance of its white noise, for a signal of power 1.
    pub noise: f64,
    /// Standard deviation of an error of all its instants.
    pub delay_deviation: FastPeriods,
    /// Standard deviation of its gain, relative to the gain.
    pub gain_deviation: f64,
}

impl Converter {
    /// A converter whose instants and gain are exact.
    pub fn exact(front_end: usize, gain: f64, noise: f64) -> Self {
        Self { front_end, gain, noise, delay_deviation: FastPeriods(0.0), gain_deviation: 0.0 }
    }
}

/// The covariances of all samples and of the target.
///
/// The samples of one converter share the error of its instants, so it leaves their covariances among one
/// another as they are. Those of different converters are multiplied, in the spectrum, by the characteristic
/// functions of both errors, those with the target by that of one.
#[derive(Debug, Clone)]
pub struct Signals {
    converters: Vec<Converter>,
    /// Number of the behaviour of each converter.
    behaviours: Vec<usize>,
    /// Of two samples of one converter, by behaviour, for a gain of 1.
    own: Vec<Arc<Covariance>>,
    /// Of a sample of one behaviour and a sample of another converter: c(t) for the first t later. By pairs
    /// (a, b) with b <= a, at a (a + 1) / 2 + b.
    cross: Vec<Arc<Covariance>>,
    /// Of a sample of each behaviour and the target: c(t) for the sample t later.
    with_target: Vec<Arc<Covariance>>,
    /// P_0.
    target_power: f64,
    longest: FastPeriods,
}

/// What distinguishes the covariances of converters.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Behaviour {
    front_end: usize,
    deviation: f64,
}

impl Signals {
    /// Of `converters` whose front ends have these responses, and the target among them.
    pub fn new(
        spectrum: &Spectrum,
        front_ends: &[&dyn Fn(CyclesPerFastPeriod) -> Complex<f64>],
        target: usize,
        converters: Vec<Converter>,
    ) -> Self {
        let mut kinds: Vec<Behaviour> = Vec::new();
        let of = |converter: &Converter| Behaviour {
            front_end: converter.front_end,
            deviation: converter.delay_deviation.0,
        };
        let behaviours = converters.iter().map(|converter| number_of(&mut kinds, of(converter))).collect();
        let mut tables = Tables(Vec::new());
        let exact = |front_end: usize| Behaviour { front_end, deviation: 0.0 };
        let (mut own, mut cross, mut with_target) = (Vec::new(), Vec::new(), Vec::new());
        for (a, &kind) in kinds.iter().enumerate() {
            own.push(tables.number(exact(kind.front_end), exact(kind.front_end)));
            cross.extend(kinds[..=a].iter().map(|&other| tables.number(kind, other)));
            with_target.push(tables.number(kind, exact(target)));
        }
        let (covariances, target_power) = tables.made(spectrum, front_ends, target);
        let [own, cross, with_target] = [own, cross, with_target].map(|numbers| {
            numbers.into_iter().map(|number: usize| Arc::clone(&covariances[number])).collect()
        });
        let mut signals = Self {
            converters,
            behaviours,
            own,
            cross,
            with_target,
            target_power,
            longest: spectrum.longest(),
        };
        signals.raise_noise();
        signals
    }

    fn raise_noise(&mut self) {
        let noise: Vec<f64> = self.converters.iter().map(|converter| converter.noise).collect();
        let raised = self.raised(&noise);
        self.converters.iter_mut().zip(raised).for_each(|(converter, noise)| converter.noise = noise);
    }

    /// Variances of the noise of the converters, or those that covariances resolve.
    pub(super) fn raised(&self, variances: &[f64]) -> Vec<f64> {
        let all = self.converters.iter().zip(&self.behaviours).zip(variances);
        all.map(|((converter, &behaviour), variance)| {
            variance.max(LEAST_NOISE * converter.gain.powi(2) * self.own[behaviour].at(0.0))
        })
        .collect()
    }

    /// The same with other variances of the noise, one for each converter.
    #[must_use]
    pub fn with_noise(&self, variances: &[f64]) -> Self {
        let mut signals = self.clone();
        signals.converters.iter_mut().zip(variances).for_each(|(converter, noise)| converter.noise = *noise);
        signals.raise_noise();
        signals
    }

    /// Variance of the noise of a converter.
    pub(super) fn noise_of(&self, converter: usize) -> f64 {
        self.converters[converter].noise
    }

    /// The converters, with at least the noise that covariances resolve.
    pub fn converters(&self) -> &[Converter] {
        &self.converters
    }

    /// P_0, the power of the target.
    pub fn target_power(&self) -> f64 {
        self.target_power
    }

    /// The longest time between two instants that the covariances know.
    pub fn longest(&self) -> FastPeriods {
        self.longest
    }

    /// The covariances of a sample of converter `i` and one of converter `k`, without noise.
    pub(super) fn of_samples(&self, i: usize, k: usize) -> Scaled<'_> {
        let gains = self.converters[i].gain * self.converters[k].gain;
        let (a, b) = (self.behaviours[i], self.behaviours[k]);
        if i == k {
            let gains = gains * (1.0 + self.converters[i].gain_deviation.powi(2));
            return Scaled { covariance: &self.own[a], factor: gains, sign: 1.0 };
        }
        let (number, sign) = if b <= a { (a * (a + 1) / 2 + b, 1.0) } else { (b * (b + 1) / 2 + a, -1.0) };
        Scaled { covariance: &self.cross[number], factor: gains, sign }
    }

    /// The covariances of a sample of converter `i` and the target.
    pub(super) fn of_target(&self, i: usize) -> Scaled<'_> {
        let covariance = &self.with_target[self.behaviours[i]];
        Scaled { covariance, factor: self.converters[i].gain, sign: 1.0 }
    }
}

/// A covariance times a factor, forwards or backwards in time.
#[derive(Clone, Copy)]
pub(super) struct Scaled<'a> {
    covariance: &'a Covariance,
    factor: f64,
    sign: f64,
}

impl Scaled<'_> {
    /// For the first sample `later` after the second one, or the target.
    pub(super) fn at(self, later: f64) -> f64 {
        self.factor * self.covariance.at(self.sign * later)
    }

    /// The same for each of some times, in their place.
    pub(super) fn of_times(self, times: &mut [f64]) {
        times.iter_mut().for_each(|later| *later *= self.sign);
        self.covariance.of_times(times);
        times.iter_mut().for_each(|covariance| *covariance *= self.factor);
    }
}

fn number_of<K: PartialEq>(kinds: &mut Vec<K>, kind: K) -> usize {
    kinds.iter().position(|known| *known == kind).unwrap_or_else(|| {
        kinds.push(kind);
        kinds.len() - 1
    })
}

/// The covariances that are needed: of the outputs of two front ends, the first at the later instant, with
/// this variance of the time between them.
struct Tables(Vec<(usize, usize, f64)>);

impl Tables {
    /// The number of a covariance.
    fn number(&mut self, one: Behaviour, two: Behaviour) -> usize {
        let variance = one.deviation.powi(2) + two.deviation.powi(2);
        number_of(&mut self.0, (one.front_end, two.front_end, variance))
    }

    /// All of them, and the power of the target.
    fn made(
        &self,
        spectrum: &Spectrum,
        front_ends: &[&dyn Fn(CyclesPerFastPeriod) -> Complex<f64>],
        target: usize,
    ) -> (Vec<Arc<Covariance>>, f64) {
        let nodes = spectrum.nodes();
        let response = |front_end: &&dyn Fn(CyclesPerFastPeriod) -> Complex<f64>| {
            nodes.iter().map(|node| front_end(node.frequency)).collect()
        };
        let responses: Vec<Vec<Complex<f64>>> = front_ends.iter().map(response).collect();
        let amplitudes = |&(one, two, variance): &(usize, usize, f64)| {
            let amplitude = |(node, (one, two)): (&Node, (&Complex<f64>, &Complex<f64>))| {
                let characteristic = (-0.5 * (TAU * node.frequency.0).powi(2) * variance).exp();
                one * two.conj() * (node.power * characteristic)
            };
            nodes.iter().zip(responses[one].iter().zip(&responses[two])).map(amplitude).collect()
        };
        let all: Vec<Vec<Complex<f64>>> = self.0.iter().map(amplitudes).collect();
        let frequencies: Vec<f64> = nodes.iter().map(|node| node.frequency.0).collect();
        let covariances = Covariance::several(&frequencies, &all, spectrum.longest().0);
        let power =
            nodes.iter().zip(&responses[target]).map(|(node, response)| node.power * response.norm_sqr());
        (covariances.into_iter().map(Arc::new).collect(), power.sum())
    }
}
