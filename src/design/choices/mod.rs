//! What a spec leaves open: the latency, and the number of taps.
//!
//! What counts is the whole error: the mean square of the error for the signal plus the noise of the
//! converters at the output. The latency is the shortest one whose whole error is within 0.1 dB of the
//! least over all latencies, with the length of the spec. Where the spec states no noise, the samples are
//! rounded to 16 bits: beyond that no latency pays. For `fir`, `iir` and `h2` the error is
//! the least that banks of that length can reach, which a smoother finds without a design; for `sinc` and
//! `separation`, which minimise nothing, it is that of their banks.

mod causal;
mod length;
mod reach;
mod search;

use super::DesignError;
use super::effort::{self, Limits};
use super::filters;
use super::merging::Repeats;
use super::methods::scenarios::RobustProblem;
use super::methods::{self, Deviations, Filters, Settings};
use super::plant::LiftedPlant;
use super::problem::{Problem, common_delay};
use crate::analog::SignalFilter;
use crate::lti::StateSpace;
use crate::lti::gramian::h2_norm;
use crate::spec::{MAX_OPTIMISED_TAPS, Method, Spec};
use crate::units::Seconds;
use causal::CausalErrors;
use length::LengthAndLatency;
use reach::Reach;
use search::Search;

/// A longer latency is chosen only if it lowers the whole error by more than 0.1 dB: less than the error of
/// a measured SNR, while the last tenth of a decibel may take many times the latency.
const WORTHWHILE_DB: f64 = 0.1;
/// Bits of a converter of which nothing is said.
const USUAL_BITS: u32 = 16;
/// Bits by which the rounding lies below a wanted SNR: 24 dB.
const SPARE_BITS: f64 = 4.0;

/// Lengths that are designed at most for a wanted SNR, each a tenth longer than the one before.
const LENGTHENINGS: usize = 16;

/// Called with the number of designs that were compared.
type Compared<'a> = &'a dyn Fn(usize);

/// The spec with the number of taps that the comparison methods use, and with a latency that these taps
/// reach or none. The taps of `fir` and `h2` may still be open.
///
/// # Errors
/// [`DesignError::OutOfReach`] for a latency that the taps do not reach; [`DesignError`] if the spec has no
/// [`Problem`].
pub(super) fn with_taps(spec: &Spec) -> Result<Spec, DesignError> {
    let mut complete = spec.clone();
    if matches!(spec.design.method, Method::Sinc | Method::Separation) {
        // 23 for M = 2, as in the thesis.
        complete.design.taps = Some(spec.design.taps.unwrap_or(12 * spec.ratio - 1));
    }
    if let (Some(taps), Some(latency)) = (complete.design.taps, spec.latency) {
        reach::check(&Problem::new(spec, latency)?, taps)?;
    }
    Ok(complete)
}

/// The spec of [`with_taps`] with nothing left open: a latency and a number of taps as well. `compared`
/// receives the number of designs that were compared.
///
/// # Errors
/// As [`latency`]; [`DesignError::SnrOutOfReach`] if no number of taps reaches the SNR that the spec asks
/// for.
pub(super) fn completed(spec: &Spec, compared: Compared<'_>) -> Result<Spec, DesignError> {
    let mut complete = spec.clone();
    if spec.is_fir() && spec.design.taps.is_none() {
        let LengthAndLatency { taps, latency } = length(spec, compared)?;
        complete.latency = Some(latency);
        (complete.design.taps, complete.design.target_snr_db) = (Some(taps), None);
    } else if spec.latency.is_none() {
        complete.latency = Some(choose_latency(spec, compared)?);
    }
    if let Some((signal, filter)) = complete.signal.as_mut().zip(SignalFilter::of(spec)) {
        signal.floor_db = filter.floor_db;
    }
    // The delays may ask for more than the longest latency.
    complete.check()?;
    Ok(complete)
}

/// The latency m0 of a spec in fast samples: the number in the spec, or the designer's choice.
///
/// # Errors
/// If it is to be chosen: [`DesignError`] if the spec has no [`Problem`]; [`DesignError::TooLong`] or
/// [`DesignError::TooLarge`] if the design cannot be made.
pub fn latency(spec: &Spec) -> Result<usize, DesignError> {
    if let Some(latency) = spec.latency {
        return Ok(latency);
    }
    let open = with_taps(spec)?;
    effort::check(&open, false, Limits::Enforced)?;
    if open.is_fir() && open.design.taps.is_none() {
        return Ok(length(&open, &|_| ())?.latency);
    }
    choose_latency(&open, &|_| ())
}

/// The taps of a FIR spec that leaves them open, and its latency.
fn length(spec: &Spec, compared: Compared<'_>) -> Result<LengthAndLatency, DesignError> {
    let found = match spec.latency {
        Some(latency) => LengthAndLatency { taps: length::fewest_taps(spec)?, latency },
        None => length::with_latency(spec)?,
    };
    let is_minimax = spec.design.method == Method::Fir && RobustProblem::of(spec).is_none();
    match spec.design.target_snr_db.filter(|_| is_minimax) {
        Some(wanted) => lengthened(spec, found, wanted, compared),
        None => Ok(found),
    }
}

/// At least `found`, and as long as it takes until the bank of least gamma has the `wanted` SNR: it does not
/// aim at that. If no length of [`LENGTHENINGS`] has it, the last one.
fn lengthened(
    spec: &Spec,
    found: LengthAndLatency,
    wanted: f64,
    compared: Compared<'_>,
) -> Result<LengthAndLatency, DesignError> {
    let LengthAndLatency { mut taps, mut latency } = found;
    let noisy = with_uncertain_instants(spec);
    let problem =
        Problem::new(&noisy, latency)?.merge_channels(Repeats::AtOneInstant).of_unit_size()?.problem;
    for designs in 0..LENGTHENINGS {
        compared(designs);
        let mut settings = settings(spec)?;
        settings.taps = taps;
        let plant = LiftedPlant::new(&Problem { latency, ..problem.clone() })?;
        let error = whole_error(&plant, &methods::synthesise(Method::Fir, &plant, &settings)?.filters)?;
        let target = h2_norm(&plant.reference()?)? / (plant.ratio() as f64).sqrt();
        if error <= target * 10f64.powf(-wanted / 20.0) {
            break;
        }
        taps = (taps + (taps / 10).max(1)).min(MAX_OPTIMISED_TAPS / spec.channels.len());
        if spec.latency.is_none() {
            let common = common_delay(spec);
            latency = common + length::latency_of(&problem.clone().earlier(common.min(latency)), taps)?;
        }
    }
    Ok(LengthAndLatency { taps, latency })
}

/// The settings of the method, from a spec with nothing left open.
///
/// # Errors
/// [`DesignError`] if the spec has no [`Problem`] at the slow rate.
pub(super) fn settings(spec: &Spec) -> Result<Settings, DesignError> {
    settings_earlier(spec, 0)
}

/// The settings with all delays shorter by so many fast periods, a multiple of the slow period.
fn settings_earlier(spec: &Spec, fast_periods: usize) -> Result<Settings, DesignError> {
    let at_slow_rate = || {
        let signal = SignalFilter::written_out(spec);
        let slow = Spec { fast_period: spec.fast_period * spec.ratio as f64, signal, ..spec.clone() };
        // The method replaces the latency. With this one no delay chain is long.
        let latency = common_delay(&slow);
        let problem = Problem::new(&slow, latency.max(fast_periods / spec.ratio))?;
        let problem = problem.earlier(fast_periods / spec.ratio);
        Ok::<_, DesignError>(problem.merge_channels(Repeats::AtOneInstant).of_unit_size()?.problem)
    };
    let separate = spec.design.method == Method::Separation;
    Ok(Settings {
        taps: spec.design.taps.unwrap_or_default(),
        robust: RobustProblem::of(spec),
        deviations: Deviations::of(spec),
        gamma_margin: spec.design.gamma_margin,
        solver: spec.design.solver,
        at_slow_rate: separate.then(at_slow_rate).transpose()?,
    })
}

fn choose_latency(spec: &Spec, compared: Compared<'_>) -> Result<usize, DesignError> {
    // Delays that all channels have only add to the latency.
    let common = common_delay(spec);
    let problem = Problem::new(&with_usual_noise(spec), common)?.earlier(common);
    let problem = problem.merge_channels(Repeats::of(spec)).of_unit_size()?.problem;
    compared(0);
    let latency = match (spec.design.method, spec.design.taps) {
        (Method::Sinc | Method::Separation, _) => {
            for_comparison(spec.design.method, &problem, &settings_earlier(spec, common)?, compared)
        }
        (_, Some(taps)) => length::latency_of(&problem, taps),
        (_, None) => Ok(shortest(CausalErrors::new(&problem)?.rms())),
    };
    Ok(common + latency?)
}

/// The spec with the usual resolution, if no channel has any noise; and where the method averages over
/// delays that are uncertain, with these as jitter: about as bad, but other at each sample, which a
/// smoother can weigh.
fn with_usual_noise(spec: &Spec) -> Spec {
    let mut noisy = spec.clone();
    if spec.channels.iter().all(|channel| channel.sample_noise() == 0.0 && channel.jitter.0 == 0.0) {
        noisy.channels.iter_mut().for_each(|channel| channel.bits = Some(assumed_bits(spec)));
    }
    with_uncertain_instants(&noisy)
}

/// The spec with uncertain delays as jitter, for a method that averages over them.
fn with_uncertain_instants(spec: &Spec) -> Spec {
    let mut noisy = spec.clone();
    for (channel, deviations) in noisy.channels.iter_mut().zip(Deviations::of(spec).unwrap_or_default()) {
        let delay = spec.fast_period * deviations.delay.0;
        channel.jitter = Seconds(channel.jitter.0.hypot(delay.0));
    }
    noisy
}

/// [`USUAL_BITS`], or as many as leave the rounding well below the error of the wanted SNR.
fn assumed_bits(spec: &Spec) -> u32 {
    let decibels_per_bit = 20.0 * 2f64.log10();
    let wanted = spec.design.target_snr_db.map_or(0.0, |snr| (snr / decibels_per_bit).ceil() + SPARE_BITS);
    USUAL_BITS.max(wanted as u32)
}

/// The index of the first error that is within [`WORTHWHILE_DB`] of the least.
fn shortest(rms: &[f64]) -> usize {
    let least = rms.iter().copied().fold(f64::INFINITY, f64::min);
    rms.iter().position(|rms| *rms <= least * worthwhile()).unwrap_or(0)
}

/// [`WORTHWHILE_DB`] as a factor.
fn worthwhile() -> f64 {
    10f64.powf(WORTHWHILE_DB / 20.0)
}

/// The shortest latency whose whole error is almost the best of a method that does not minimise it.
fn for_comparison(
    method: Method,
    problem: &Problem,
    settings: &Settings,
    compared: Compared<'_>,
) -> Result<usize, DesignError> {
    let latencies = reach::candidates(problem, settings.taps);
    let reach = Reach::new(problem, settings.taps, &latencies)?;
    Search::new(latencies.map(|latency| reach.lower_bound(latency))).shortest(compared, |latency| {
        let problem = Problem { latency, ..problem.clone() };
        problem.check_size()?;
        let plant = LiftedPlant::new(&problem)?;
        whole_error(&plant, &methods::synthesise(method, &plant, settings)?.filters)
    })
}

/// The root of the mean square of error and noise together, per fast sample.
fn whole_error(plant: &LiftedPlant, filters: &Filters) -> Result<f64, DesignError> {
    let system = match filters {
        Filters::Fir(taps) => StateSpace::fir(&filters::polyphase(taps, plant.ratio()))?,
        Filters::StateSpace(system) => system.clone(),
    };
    let error = plant.with_noise()?.error_system(&system)?;
    Ok(h2_norm(&error)? / (plant.ratio() as f64).sqrt())
}

#[cfg(test)]
mod tests;
