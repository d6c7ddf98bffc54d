//! The estimator of the target of a bank from samples at known instants, which need not repeat.

use super::DesignError;
use super::deviations::Deviations;
use super::problem::{Channel, Problem};
use super::root_covariance::RootCovariance;
use hybank_core::bank::Bank;
use hybank_core::spec::{ROUNDING_16_BITS, Spec, USUAL_RMS};
use hybank_core::units::{CyclesPerFastPeriod, FastPeriods, RadiansPerFastPeriod};
use hybank_instants::{Converter, Estimator, Signals, Spectrum};
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
