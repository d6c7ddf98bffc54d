//! Defaults for what a spec leaves open: the latency, and the number of taps of the comparison methods.

use super::DesignError;
use super::merging::Repeats;
use super::methods::{Settings, iir};
use super::plant::LiftedPlant;
use super::problem::Problem;
use crate::spec::Spec;

/// Latencies tried beyond the longest delay, in slow periods.
const LATENCY_LADDER: [usize; 6] = [1, 2, 3, 4, 6, 8];
/// A longer latency is chosen only if it lowers gamma by at least this fraction.
const WORTHWHILE: f64 = 1e-3;

/// The spec with nothing left open: latency, and taps for the methods that make FIR filters.
///
/// # Errors
/// As [`latency`].
pub(super) fn completed(spec: &Spec) -> Result<Spec, DesignError> {
    let mut complete = spec.clone();
    complete.latency = Some(latency(spec)?);
    complete.design.taps = spec.design.method.has_taps().then(|| taps(spec));
    Ok(complete)
}

/// Taps per channel: the number in the spec, or 12 M - 1 for the comparison methods (23 for M = 2, as in
/// the thesis). The method `fir` has no default; [`Spec::check`] asks for the number.
fn taps(spec: &Spec) -> usize {
    spec.design.taps.unwrap_or(12 * spec.ratio - 1)
}

/// The latency m0 of a spec in fast samples: the number in the spec, or the designer's choice.
///
/// # Errors
/// [`DesignError`] if the spec has no [`Problem`], or no IIR optimum to choose by.
pub fn latency(spec: &Spec) -> Result<usize, DesignError> {
    spec.latency.map_or_else(|| choose_latency(spec), Ok)
}

/// The shortest latency of the ladder whose IIR optimum is within [`WORTHWHILE`] of the best; for FIR banks
/// at least half of their taps, so that the filters use samples on both sides of the output instant.
fn choose_latency(spec: &Spec) -> Result<usize, DesignError> {
    let base = Problem::new(spec, 0)?.longest_delay().0.ceil() as usize;
    let ladder = optima(spec, base)?;
    let best = ladder.iter().map(|&(_, gamma)| gamma).fold(f64::INFINITY, f64::min);
    let enough = |&&(_, gamma): &&(usize, f64)| gamma <= best * (1.0 + WORTHWHILE);
    let chosen = ladder.iter().find(enough).map_or(base, |&(latency, _)| latency);
    Ok(if spec.design.method.has_taps() { chosen.max(centre(spec, base)) } else { chosen })
}

/// Latencies beyond `base` with their IIR optima, up to the first latency whose optimum is almost the
/// noncausal bound.
fn optima(spec: &Spec, base: usize) -> Result<Vec<(usize, f64)>, DesignError> {
    let mut ladder = Vec::new();
    for periods in LATENCY_LADDER {
        let latency = base + periods * spec.ratio;
        let merged = Problem::new(spec, latency)?.merge_channels(Repeats::AtWholePeriods);
        let optimum = iir::synthesise(&LiftedPlant::new(&merged.problem)?, &Settings::default())?;
        ladder.push((latency, optimum.peak.gain));
        if optimum.peak.gain <= optimum.noncausal * (1.0 + WORTHWHILE) {
            break;
        }
    }
    Ok(ladder)
}

/// The latency at which FIR filters of the spec's length are centred on their output sample.
fn centre(spec: &Spec, longest_delay: usize) -> usize {
    let taps = taps(spec);
    (taps / 2).max(longest_delay.min(taps))
}
