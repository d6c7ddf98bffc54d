//! What a spec leaves open: the latency, and the number of taps of the comparison methods.
//!
//! The latency is the shortest one whose error is within 0.1 % of the least over all latencies, by the
//! method and with the length of the spec. The error is what the method minimises: gamma for `fir` (of real
//! taps, without regard to noise) and `iir`, the rms for `h2`; for `sinc` and `separation` it is their
//! gamma.

mod reach;
mod recursive;
mod search;

use super::DesignError;
use super::effort::{self, Limits};
use super::merging::Repeats;
use super::methods::robust_fir::RobustProblem;
use super::methods::{self, Settings, fir, iir};
use super::plant::LiftedPlant;
use super::problem::{Channel, Problem, common_delay};
use crate::analog::SignalFilter;
use crate::spec::{Method, Spec};
use crate::units::FastPeriods;
use reach::Reach;
use recursive::{CausalErrors, NEGLIGIBLE};
use search::Search;

/// Relative accuracy of the gammas of `fir` that are compared.
const ACCURACY: f64 = 1e-4;

/// Called with the number of designs that were compared.
type Compared<'a> = &'a dyn Fn(usize);

/// The spec with the number of taps that the methods which make FIR filters use, and with a latency that
/// these taps reach or none.
///
/// # Errors
/// [`DesignError::OutOfReach`] for a latency that the taps do not reach; [`DesignError`] if the spec has no
/// [`Problem`].
pub(super) fn with_taps(spec: &Spec) -> Result<Spec, DesignError> {
    let mut complete = spec.clone();
    if spec.design.is_fir() {
        complete.design.taps = Some(taps(spec));
        if let Some(latency) = spec.latency {
            reach::check(&Problem::new(spec, latency)?, taps(spec))?;
        }
    }
    Ok(complete)
}

/// The spec of [`with_taps`] with nothing left open: a latency as well. `compared` receives the number of
/// designs that were compared.
///
/// # Errors
/// As [`latency`].
pub(super) fn completed(spec: &Spec, compared: Compared<'_>) -> Result<Spec, DesignError> {
    let latency = spec.latency.map_or_else(|| choose_latency(spec, compared), Ok)?;
    let mut complete = Spec { latency: Some(latency), ..spec.clone() };
    if let Some((signal, filter)) = complete.signal.as_mut().zip(SignalFilter::of(spec)) {
        signal.floor_db = filter.floor_db;
    }
    // The delays may ask for more than the longest latency.
    complete.check()?;
    Ok(complete)
}

/// Taps per channel: the number in the spec, or 12 M - 1 for the comparison methods (23 for M = 2, as in
/// the thesis); 0 for recursive filters. The method `fir` has no default; [`Spec::check`] asks for the number.
fn taps(spec: &Spec) -> usize {
    let usual = if spec.design.is_fir() { 12 * spec.ratio - 1 } else { 0 };
    spec.design.taps.unwrap_or(usual)
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
    choose_latency(&open, &|_| ())
}

/// The settings of the method, from a spec with taps.
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
        taps: taps(spec),
        robust: RobustProblem::of(spec),
        gamma_margin: spec.design.gamma_margin,
        solver: spec.design.solver,
        at_slow_rate: separate.then(at_slow_rate).transpose()?,
    })
}

fn choose_latency(spec: &Spec, compared: Compared<'_>) -> Result<usize, DesignError> {
    let repeats = Repeats::of(&spec.design);
    // Delays that all channels have only add to the latency.
    let common = common_delay(spec);
    let problem = Problem::new(spec, common)?.earlier(common).merge_channels(repeats).of_unit_size()?.problem;
    compared(0);
    let latency = match spec.design.method {
        Method::Fir => for_fir(&problem, taps(spec), compared),
        Method::Iir => for_iir(&problem, compared),
        Method::H2 => Ok(CausalErrors::new(&problem)?.shortest()),
        Method::Sinc | Method::Separation => {
            for_comparison(spec.design.method, &problem, &settings_earlier(spec, common)?, compared)
        }
    };
    Ok(common + latency?)
}

/// The shortest latency whose least gamma with `taps` taps per channel is almost the best.
fn for_fir(problem: &Problem, taps: usize, compared: Compared<'_>) -> Result<usize, DesignError> {
    let latencies = reach::candidates(problem, taps);
    let reach = Reach::new(problem, taps, &latencies)?;
    let floor = floor(problem, reach.zero_output())?;
    let search = Search::new(latencies.map(|latency| reach.bound_of_choice(latency)), floor);
    search.shortest(compared, |latency, hopeless| {
        fir::bracket(&plant(problem, latency)?, taps, ACCURACY, hopeless)
    })
}

/// The shortest latency whose least gamma is almost the best. Where the designer fails, other latencies
/// are tried.
fn for_iir(problem: &Problem, compared: Compared<'_>) -> Result<usize, DesignError> {
    let errors = CausalErrors::new(problem)?;
    let floor = floor(problem, errors.zero_output())?;
    let mut designs = 0;
    let gamma = |latency: usize| {
        designs += 1;
        compared(designs);
        let designed =
            plant(problem, latency).and_then(|plant| iir::synthesise(&plant, &Settings::default()));
        designed.map_or(f64::INFINITY, |synthesis| synthesis.peak.gain)
    };
    Ok(recursive::shortest(&errors, problem.ratio, floor, gamma))
}

/// The shortest latency whose gamma is almost the best of a method that does not minimise it.
fn for_comparison(
    method: Method,
    problem: &Problem,
    settings: &Settings,
    compared: Compared<'_>,
) -> Result<usize, DesignError> {
    let latencies = reach::candidates(problem, settings.taps);
    let reach = Reach::new(problem, settings.taps, &latencies)?;
    let search = Search::new(latencies.map(|latency| reach.bound_of_choice(latency)), 0.0);
    search.shortest(compared, |latency, _| {
        let synthesis = methods::synthesise(method, &plant(problem, latency)?, settings)?;
        Ok((synthesis.peak.gain, synthesis.peak.gain))
    })
}

/// The plant with another latency.
fn plant(problem: &Problem, latency: usize) -> Result<LiftedPlant, DesignError> {
    let problem = Problem { latency, ..problem.clone() };
    problem.check_size()?;
    LiftedPlant::new(&problem)
}

/// A lower bound of gamma for all filters of any latency: the noncausal bound. Delays by whole slow periods
/// do not change it, so it is computed without them. Gammas that are [`NEGLIGIBLE`] relative to
/// `zero_output` count as equal.
fn floor(problem: &Problem, zero_output: f64) -> Result<f64, DesignError> {
    let within_a_period = |channel: &Channel| Channel {
        delay: FastPeriods(channel.delay.0.rem_euclid(problem.ratio as f64)),
        ..*channel
    };
    let channels = problem.channels.iter().map(within_a_period).collect();
    let prompt = Problem { latency: problem.ratio - 1, channels, ..problem.clone() };
    let noncausal = LiftedPlant::new(&prompt)?.noncausal_bound()?.gain;
    Ok(noncausal.max(NEGLIGIBLE * zero_output))
}

#[cfg(test)]
mod tests;
