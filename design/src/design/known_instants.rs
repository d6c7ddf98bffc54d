//! The estimator of the target of a bank from samples at known instants, which need not repeat.

use super::DesignError;
use super::deviations::Deviations;
use super::problem::{Channel, Problem};
use super::root_covariance::RootCovariance;
use hybank_core::bank::Bank;
use hybank_core::spec::{ROUNDING_16_BITS, Spec, USUAL_RMS};
use hybank_core::units::{CyclesPerFastPeriod, FastPeriods, RadiansPerFastPeriod};
use hybank_instants::{
    Converter, Estimator, FusionSettings, Model, PASSES, Prior, Recording, Response, Signals, Spectrum,
};
use hybank_linalg::Complex;
use std::f64::consts::TAU;

/// The estimator of the target of a bank, for samples up to `longest` apart: front ends, gains and noise are
/// those of its spec, delays and gains as uncertain as it says, and the signal is flat over its band, of
/// power 1. There is a converter for each sample of a frame.
///
/// # Errors
/// [`DesignError::NoSpec`] for a bank without front ends, [`DesignError::NoBand`] for a signal without a
/// band; as [`Problem::new`].
pub fn instants_estimator(bank: &Bank, longest: FastPeriods) -> Result<Estimator, DesignError> {
    let problem = Problem::of_bank(bank)?;
    let [low, high] = problem.band.ok_or(DesignError::NoBand)?.map(|end| CyclesPerFastPeriod(end.0 / TAU));
    let problem = with_noise(problem, bank.spec.as_ref());
    // Noise counts for unit density in the band and its mirror there, and for a signal of power 1 here.
    let scale = RootCovariance::new(&problem, &[], 1, 0..=0).noise_scale / (2.0 * (high - low).0);
    let deviations = bank.spec.as_ref().map(Deviations::of_spec).unwrap_or_default();
    let converter = |(channel, noise): (&Channel, &f64)| {
        let Deviations { delay, gain, .. } = deviations.get(channel.converter).copied().unwrap_or_default();
        Converter {
            front_end: channel.front_end,
            gain: channel.gain,
            noise: noise * scale,
            delay_deviation: delay,
            gain_deviation: gain,
        }
    };
    let converters = problem.channels.iter().zip(&problem.noise).map(converter).collect();
    let response = |front_end: usize| {
        let filter = &problem.front_ends[front_end];
        move |f: CyclesPerFastPeriod| filter.response(RadiansPerFastPeriod(TAU * f.0))
    };
    let responses: Vec<_> = (0..problem.front_ends.len()).map(response).collect();
    let responses: Vec<&dyn Fn(CyclesPerFastPeriod) -> Complex<f64>> =
        responses.iter().map(|response| response as _).collect();
    let spectrum = Spectrum::flat(low..high, longest);
    Ok(Estimator::new(Signals::new(&spectrum, &responses, problem.target, converters)))
}

/// Spectrum and power of the signal at the output of the target, and the noise of the converters of a spec,
/// from recordings of its channels at known instants, without their offsets: all that the channels do not
/// have in common is noise. Instants of a recording share an error of its deviation.
///
/// # Errors
/// [`DesignError::NoBand`] for a signal without a band, [`DesignError::Linalg`] for samples that are given
/// twice; as [`Problem::new`].
pub fn learned_model(
    spec: &Spec,
    recordings: &[Recording],
    delay_deviations: Vec<FastPeriods>,
    settings: FusionSettings,
) -> Result<Model, DesignError> {
    let problem = Problem::before_sizing(spec)?;
    let [low, high] = problem.band.ok_or(DesignError::NoBand)?.map(|end| CyclesPerFastPeriod(end.0 / TAU));
    let response = |channel: &Channel| {
        let [own, target] = [channel.front_end, problem.target].map(|i| &problem.front_ends[i]);
        move |f: CyclesPerFastPeriod| {
            let w = RadiansPerFastPeriod(TAU * f.0);
            own.response(w) / target.response(w)
        }
    };
    let is_target = problem.channels.iter().all(|channel| channel.front_end == problem.target);
    let responses: Vec<_> = problem.channels.iter().filter(|_| !is_target).map(response).collect();
    let responses: Vec<Response<'_>> = responses.iter().map(|response| response as _).collect();
    let deviations = Deviations::of_spec(spec);
    let prior = Prior {
        band: Some(low..high),
        front_ends: &responses,
        passes: PASSES,
        gains: problem.channels.iter().map(|channel| channel.gain).collect(),
        gain_deviations: deviations.iter().map(|converter| converter.gain).collect(),
        delay_deviations,
        least_noise: spec.channels.iter().map(|channel| channel.rounding().powi(2)).collect(),
    };
    Ok(Model::learn(recordings, &prior, settings)?)
}

/// With the noise of 16 bits for converters without any: else tiny differences of their samples would count.
pub(super) fn with_noise(mut problem: Problem, spec: Option<&Spec>) -> Problem {
    if problem.noise.iter().all(|power| *power > 0.0) {
        return problem;
    }
    let rms = spec.and_then(|spec| spec.signal.as_ref()).map_or(USUAL_RMS, |signal| signal.rms);
    let target = RootCovariance::new(&problem, &[], 1, 0..=0);
    let rounding = ROUNDING_16_BITS / (rms * rms) * target.power / target.noise_scale;
    problem.noise.iter_mut().filter(|power| **power == 0.0).for_each(|power| *power = rounding);
    problem
}
