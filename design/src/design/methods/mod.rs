//! The design methods. Each has its own file; all have the same signature.
//!
//! | method | minimises | filters | lower end |
//! |---|---|---|---|
//! | [`fir`] | the norm of the error, for given length (thesis 5.4) | FIR | dual of the sampled problem |
//! | [`iir`] | the norm of the error (thesis 5.3) | state space | unsolvable Riccati equation |
//! | [`h2`] | the mean-square error: `iir` at gamma = infinity | state space | noncausal bound |
//! | [`mean_square_fir`] | the same, for given length, and on average over errors of the converters: `h2` with taps | FIR | noncausal bound |
//! | [`comparison::sinc`] | nothing: Yen's interpolation, truncated (thesis 5.6.3) | FIR | noncausal bound |
//! | [`comparison::separation`] | delays and bank one after the other (thesis 5.6.3) | FIR | noncausal bound |

mod comparison;
pub(super) mod filtering;
pub(crate) mod fir;
mod gamma_iteration;
pub(crate) mod h2;
pub(crate) mod iir;
pub(crate) mod mean_square_fir;
mod precise_filtering;
pub(crate) mod robust_fir;

use super::DesignError;
use super::deviations::Deviations;
pub(crate) use super::exchange::GAMMA_ACCURACY;
use super::limits::Stop;
use super::plant::LiftedPlant;
use super::problem::Problem;
use crate::lti::peak::Peak;
use hybank_core::bank::SynthesisFilters;
use hybank_core::spec::{ErrorBox, Method};

/// Settings of a method, in addition to the plant.
#[derive(Debug, Clone, Default)]
pub(crate) struct MethodSettings {
    /// Taps per channel at the fast rate; 0 for recursive filters.
    pub(crate) taps: usize,
    /// Relative excess over the least gamma that may be spent on a smaller mean square; `None` is the
    /// method's default.
    pub(crate) gamma_margin: Option<f64>,
    /// The errors that `fir` has to expect; `None` if there are none.
    pub(crate) robust: Option<ErrorBox>,
    /// For mean-square designs, how well each converter is known; none if all are exact.
    pub(crate) deviations: Vec<Deviations>,
    /// Ends the search with the best filters so far.
    pub(crate) stop: Stop,
    /// The channels of the plant in units of the slow period, for `separation`.
    pub(crate) at_slow_rate: Option<Problem>,
}

/// The result of a method.
#[derive(Debug, Clone)]
pub(crate) struct Synthesis {
    pub(crate) filters: SynthesisFilters,
    /// The norm of the error system of these filters, and the frequency of its peak in radians per slow
    /// period.
    pub(crate) peak: Peak,
    /// Lower bound of the norm over all filters of the method's kind. At most `peak.gain`.
    pub(crate) lower: f64,
    /// Lower bound of the norm over all filters of any latency. At most `peak.gain`.
    pub(crate) noncausal: f64,
    /// For a robust design.
    pub(crate) robust: Option<robust_fir::RobustStudy>,
}

impl Synthesis {
    /// FIR filters of a method that minimises nothing. The only lower bound is the one for all filters.
    pub(crate) fn of_taps(plant: &LiftedPlant, taps: Vec<Vec<f64>>) -> Result<Self, DesignError> {
        let peak = plant.fir_norm(&taps)?;
        Self::of_least_gamma(plant, taps, peak, 0.0)
    }

    /// FIR filters of the norm `peak` with a lower bound for all filters of their length.
    pub(crate) fn of_least_gamma(
        plant: &LiftedPlant,
        taps: Vec<Vec<f64>>,
        peak: Peak,
        lower: f64,
    ) -> Result<Self, DesignError> {
        let noncausal = plant.noncausal_bound()?.gain.min(peak.gain);
        Ok(Self {
            filters: SynthesisFilters::Fir(taps),
            lower: lower.min(peak.gain).max(noncausal),
            peak,
            noncausal,
            robust: None,
        })
    }
}

/// Lags of the output samples p of a slow period, for so many taps per channel at the fast rate.
pub(crate) fn tap_lags(ratio: usize, taps: usize) -> Vec<usize> {
    (0..ratio).map(|p| taps.saturating_sub(p).div_ceil(ratio)).collect()
}

/// The filters of `method` for the channels of `plant`.
///
/// # Errors
/// As the method's own `synthesise`.
pub(crate) fn synthesise(
    method: Method,
    plant: &LiftedPlant,
    settings: &MethodSettings,
) -> Result<Synthesis, DesignError> {
    if let (Method::Fir, Some(errors)) = (method, &settings.robust) {
        return robust_fir::synthesise(plant, settings, errors);
    }
    match method {
        Method::Fir => fir::synthesise(plant, settings),
        Method::Iir => iir::synthesise(plant, settings),
        Method::H2 if settings.taps > 0 => mean_square_fir::synthesise(plant, settings),
        Method::H2 => h2::synthesise(plant, &settings.stop),
        Method::Sinc => comparison::sinc(plant, settings),
        Method::Separation => comparison::separation(plant, settings),
    }
}

#[cfg(test)]
mod tests;
