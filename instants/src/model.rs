//! The model of recordings that states nothing: spectrum and noise, from the recordings themselves.

use super::estimator::{Estimator, MeanSquare};
use super::fusion::{FusionSettings, fuse};
use super::heldout::{HeldOut, Trials};
use super::learned::learned;
use super::noise::NoiseSearch;
use super::recording::Recording;
use super::signals::{Converter, Signals};
use super::spectrum::Spectrum;
use hybank_core::units::{CyclesPerFastPeriod, FastPeriods};
use hybank_linalg::{Complex, LinalgError};
use std::ops::Range;

/// Passes in which a spectrum is learned; a third gains nothing.
pub const PASSES: usize = 2;
/// Parts of the run from which the spectrum is learned, and outputs of each.
const PARTS: usize = 48;
const OUTPUTS_OF_PART: usize = 2048;
/// Instants at which samples are left out, to judge a band and a model.
const BAND_TRIALS: usize = 32;
pub(super) const TRIALS: usize = 64;
/// The same for the last measurement of the noise: with fewer, a difference of 6 dB between the noises of
/// recordings may not be significant.
const NOISE_TRIALS: usize = 256;
/// Noises that are tried with each band, over the power of the signal: as of recorders with 30, 50 and 70
/// dB.
const FIRST_NOISES: [f64; 3] = [1e-3, 1e-5, 1e-7];
/// Bands that are tried: so many parts of half of the output's rate, and then one more or less than the best
/// one.
const BANDS: [u32; 5] = [4, 7, 10, 13, PARTS_OF_BAND];
const PARTS_OF_BAND: u32 = 16;
/// The density beyond the band over that within, before the spectrum is learned: so little that noise is not
/// taken for signal.
const BEYOND: f64 = 1e-10;
/// The gain of an estimate below which too little of the signal is in it to be restored.
const LEAST_GAIN: f64 = 0.3;
/// Twice the gain of log-likelihood that says that a recording has a noise of its own: once in a hundred by
/// chance.
const SIGNIFICANT: f64 = 6.6;

/// A signal with its recorders.
#[derive(Debug, Clone)]
pub struct Model {
    /// S.
    pub spectrum: Spectrum,
    /// The power of the signal.
    pub power: f64,
    /// Variance of the noise of each recording.
    pub noise: Vec<f64>,
    /// For samples of these recordings; its signal has the power 1.
    pub estimator: Estimator,
}

/// A model, and how badly samples that are left out are predicted by it.
struct Judged {
    misfit: f64,
    model: Model,
}

/// A response at a frequency.
pub type Response<'a> = &'a dyn Fn(CyclesPerFastPeriod) -> Complex<f64>;

/// What is known of recordings before they are looked at.
#[derive(Clone)]
pub struct Prior<'a> {
    /// The signal's band; measured if `None`.
    pub band: Option<Range<CyclesPerFastPeriod>>,
    /// The front end of each recorder over that of the target, whose output is the signal; 1 for those
    /// beyond the end.
    pub front_ends: &'a [Response<'a>],
    /// How often the spectrum is learned from the result; 0 keeps it flat over the band.
    pub passes: usize,
    /// The gain of each recording.
    pub gains: Vec<f64>,
    /// Standard deviations of these, relative to them.
    pub gain_deviations: Vec<f64>,
    /// Standard deviation of an error that all instants of a recording share.
    pub delay_deviations: Vec<FastPeriods>,
    /// The least variance of the noise of each recording: of its rounding.
    pub least_noise: Vec<f64>,
}

impl Model {
    /// The model of `recordings`, which the converters 0, 1, .. made in their order.
    ///
    /// Samples that are left out and predicted from those around them judge a model, by their likelihood. So
    /// the band is chosen, and the noise of each recording. The estimate with a spectrum that is flat over
    /// the band then shows the spectrum (Welch), over the half of the run where the predicted error is
    /// least: elsewhere what is not resolved would be taken for signal. What the estimate takes away is
    /// restored, and the noise subtracted.
    ///
    /// # Errors
    /// [`LinalgError::NotPositiveDefinite`] for samples that are given twice.
    pub fn learn(
        recordings: &[Recording],
        prior: &Prior<'_>,
        settings: FusionSettings,
    ) -> Result<Self, LinalgError> {
        let longest = settings.longest(recordings);
        let power = mean_power(recordings, &prior.gains);
        let noise = |share: f64| -> Vec<f64> {
            let all = prior.gains.iter().zip(&prior.least_noise);
            all.map(|(gain, least)| least.max(share * power * gain * gain)).collect()
        };
        let mut model = Self::best(recordings, prior, settings, power, &noise)?;
        model.measure_noise(recordings, prior, settings, 0)?;
        for pass in 1..=prior.passes {
            let Some((spectrum, power)) = model.relearned(recordings, settings, longest)? else { break };
            model = Self::new(spectrum, power, model.noise, prior);
            model.measure_noise(recordings, prior, settings, pass)?;
        }
        Ok(model)
    }

    /// The model of a flat band, of those with some noises, by which samples that are left out are predicted
    /// best.
    fn best(
        recordings: &[Recording],
        prior: &Prior<'_>,
        settings: FusionSettings,
        power: f64,
        noise: &dyn Fn(f64) -> Vec<f64>,
    ) -> Result<Self, LinalgError> {
        let longest = settings.longest(recordings);
        let (low, high) = (CyclesPerFastPeriod(0.0), CyclesPerFastPeriod(0.5));
        let judged = |spectrum: Spectrum| -> Result<Judged, LinalgError> {
            let candidate = Self::new(spectrum, power, noise(FIRST_NOISES[0]), prior);
            let trials = candidate.trials(recordings, settings, BAND_TRIALS);
            let mut best = Judged { misfit: f64::INFINITY, model: candidate.clone() };
            for noise in FIRST_NOISES.map(noise) {
                let misfit = candidate.misfit(&trials, &noise)?;
                if misfit < best.misfit {
                    best = Judged { misfit, model: candidate.with_noise(noise) };
                }
            }
            Ok(best)
        };
        if let Some(band) = prior.band.clone() {
            return Ok(judged(Spectrum::flat(band, longest))?.model);
        }
        let of_parts = |parts: u32| {
            let band = CyclesPerFastPeriod(0.5 * f64::from(parts) / f64::from(PARTS_OF_BAND));
            judged(Spectrum::of_pieces([(low..band, 1.0), (band..high, BEYOND)], longest))
        };
        let (mut middle, mut best) = (BANDS[0], of_parts(BANDS[0])?);
        let mut take_if_better = |parts: u32, middle: &mut u32| -> Result<(), LinalgError> {
            let candidate = of_parts(parts)?;
            if candidate.misfit < best.misfit {
                (*middle, best) = (parts, candidate);
            }
            Ok(())
        };
        BANDS[1..].iter().try_for_each(|parts| take_if_better(*parts, &mut middle))?;
        let beside = [middle - 1, (middle + 1).min(PARTS_OF_BAND)];
        beside.into_iter().try_for_each(|parts| take_if_better(parts, &mut middle))?;
        Ok(best.model)
    }

    fn trials(&self, recordings: &[Recording], settings: FusionSettings, count: usize) -> Trials {
        let instants = instants(settings, count);
        Trials::new(&self.estimator, recordings, settings.reach, self.power, &instants)
    }

    /// How badly samples that are left out are predicted with these variances of the noise.
    fn misfit(&self, trials: &Trials, noise: &[f64]) -> Result<f64, LinalgError> {
        let relative: Vec<f64> = noise.iter().map(|noise| noise / self.power).collect();
        let found = trials.held_out(&self.estimator.signals().raised(&relative))?;
        Ok(misfit(&found, self.power))
    }

    fn with_noise(&self, noise: Vec<f64>) -> Self {
        let relative: Vec<f64> = noise.iter().map(|noise| noise / self.power).collect();
        let estimator = Estimator::new(self.estimator.signals().with_noise(&relative));
        Self { spectrum: self.spectrum.clone(), power: self.power, noise, estimator }
    }

    fn new(spectrum: Spectrum, power: f64, noise: Vec<f64>, prior: &Prior<'_>) -> Self {
        let flat: Response<'_> = &|_| Complex::from(1.0);
        let responses: Vec<Response<'_>> =
            std::iter::once(flat).chain(prior.front_ends.iter().copied()).collect();
        let converter = |i: usize| Converter {
            front_end: if i < prior.front_ends.len() { i + 1 } else { 0 },
            gain: prior.gains[i],
            noise: noise[i] / power,
            delay_deviation: prior.delay_deviations[i],
            gain_deviation: prior.gain_deviations[i],
        };
        let converters = (0..noise.len()).map(converter).collect();
        let signals = Signals::new(&spectrum, &responses, 0, converters);
        Self { spectrum, power, noise, estimator: Estimator::new(signals) }
    }

    /// Spectrum and power of the estimate by this model; `None` if there is too little of it, or silence.
    fn relearned(
        &self,
        recordings: &[Recording],
        settings: FusionSettings,
        longest: FastPeriods,
    ) -> Result<Option<(Spectrum, f64)>, LinalgError> {
        let count = settings.count.min(OUTPUTS_OF_PART);
        let room = settings.count - count;
        let parts = PARTS.min(room / count + 1);
        let first = |part: usize| room * part / (parts - 1).max(1);
        let part = |number: usize| {
            let first = settings.first + FastPeriods(first(number) as f64);
            fuse(&self.estimator, recordings, FusionSettings { first, count, ..settings })
        };
        let all = (0..parts).map(part).collect::<Result<Vec<_>, _>>()?;
        let mut errors: Vec<f64> = all.iter().map(|fused| MeanSquare::mean(&fused.errors).total()).collect();
        let good = errors.clone();
        errors.sort_by(f64::total_cmp);
        let median = errors[parts / 2];
        let chosen =
            all.iter().zip(good).filter(|(_, error)| *error <= median).map(|(fused, _)| &fused.samples);
        let signal: Vec<f64> = chosen.flatten().copied().collect();
        let ranges: Vec<_> = (0..signal.len() / count).map(|k| k * count..(k + 1) * count).collect();
        let noise = self.noise_density(recordings);
        Ok(learned(&signal, &ranges, noise, &|band| self.gain_of_estimate(band, noise), longest))
    }

    /// Wiener's gain `S / (S + N)` in a band, for noise of the density N; 1 where nothing can be restored.
    fn gain_of_estimate(&self, band: Range<CyclesPerFastPeriod>, noise: f64) -> f64 {
        let within = self
            .spectrum
            .nodes()
            .iter()
            .filter(|node| (band.start.0..band.end.0).contains(&node.frequency.0));
        let share: f64 = within.map(|node| node.power).sum();
        let signal = self.power * share / (2.0 * (band.end.0 - band.start.0));
        let gain = signal / (signal + noise);
        if gain < LEAST_GAIN { 1.0 } else { gain }
    }

    /// Density of the noise of an estimate, where the signal is far above it: samples carry as much as their
    /// gains and noises say, and as often as they come.
    fn noise_density(&self, recordings: &[Recording]) -> f64 {
        let converters = self.estimator.signals().converters();
        let carried = |recording: &Recording| {
            let gain = converters[recording.converter()].gain;
            gain * gain / (self.noise[recording.converter()] * recording.period())
        };
        1.0 / recordings.iter().map(carried).sum::<f64>()
    }

    /// One level for all recordings, and then each of its own where that is significantly likelier:
    /// recordings that have little in common tell hardly more than the sum of their noises.
    fn measure_noise(
        &mut self,
        recordings: &[Recording],
        prior: &Prior<'_>,
        settings: FusionSettings,
        pass: usize,
    ) -> Result<(), LinalgError> {
        let count = if pass == prior.passes { NOISE_TRIALS } else { TRIALS };
        let trials = self.trials(recordings, settings, count);
        let full: Vec<f64> = prior.gains.iter().map(|gain| self.power * gain * gain).collect();
        let bounded = |levels: &[f64]| -> Vec<f64> {
            let all = levels.iter().zip(&full).zip(&prior.least_noise);
            all.map(|((level, full), least)| (level * full).max(*least)).collect()
        };
        let misfit = |levels: &[f64]| self.misfit(&trials, &bounded(levels));
        let levels = self.noise.iter().zip(&full).map(|(noise, full)| noise / full).collect();
        let mut search = NoiseSearch::new(levels, &misfit)?;
        search.together(pass > 0)?;
        // Recorders of one kind have one noise, whatever their distances are.
        let noises = search.levels().iter().zip(&full).map(|(level, full)| (level * full).ln());
        let one = (noises.sum::<f64>() / full.len() as f64).exp();
        if search.take_if_better(full.iter().map(|full| one / full).collect(), 0.0)? {
            search.together(true)?;
        }
        (0..recordings.len()).try_for_each(|i| search.alone(i, SIGNIFICANT))?;
        *self = self.with_noise(bounded(search.levels()));
        Ok(())
    }
}

/// `sum ln s^2 + e^2 / s^2` over the residuals e with their variances s^2: minus twice their log-likelihood.
fn misfit(found: &[HeldOut], power: f64) -> f64 {
    let of = |one: &HeldOut| {
        let variance = one.variance * power;
        variance.ln() + one.residual.powi(2) / variance
    };
    found.iter().map(of).sum()
}

/// Instants over the whole run that meet no pattern: multiples of the golden ratio.
pub(super) fn instants(settings: FusionSettings, count: usize) -> Vec<FastPeriods> {
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let at = |k: usize| settings.first + FastPeriods(settings.count as f64 * (k as f64 * golden).fract());
    (0..count).map(at).collect()
}

/// Of all samples, over the squares of their gains.
fn mean_power(recordings: &[Recording], gains: &[f64]) -> f64 {
    let power = |(recording, gain): (&Recording, &f64)| {
        let there = recording.samples().iter().filter(|x| x.is_finite());
        let (sum, count) = there.fold((0.0, 0_usize), |(sum, count), x| (sum + x * x, count + 1));
        sum / (count.max(1) as f64 * gain * gain)
    };
    let powers = recordings.iter().zip(gains).map(power);
    powers.sum::<f64>() / recordings.len() as f64
}
