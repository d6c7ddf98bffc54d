//! The FIR bank with the least mean-square error of all banks of its length, for the signal of the spec and
//! the noise of the converters; where delays and gains are uncertain, on average over Gaussian errors that
//! each converter keeps.
//!
//! The phases of the output do not depend on one another: phase p estimates the target at the instant p - m0
//! from the newest `J_p = ceil((taps - p) / M)` frames. A channel of which little is known gets little
//! weight, and the bank is never worse than the best single channel.

use super::{MethodSettings, Synthesis};
use crate::design::DesignError;
use crate::design::fir_errors::{BankSize, FirErrors};
use crate::design::plant::LiftedPlant;
use crate::design::preparation::with_usual_noise;
use crate::design::problem::Problem;
use hybank_core::spec::Spec;

/// The `settings.taps` taps per channel with the least mean square of error and noise. Their norm is that
/// for channels without errors.
///
/// # Errors
/// [`DesignError::Lti`] for unstable plants.
pub(crate) fn synthesise(plant: &LiftedPlant, settings: &MethodSettings) -> Result<Synthesis, DesignError> {
    let problem = plant.problem();
    let latency = problem.latency;
    let errors = FirErrors::new(problem, &settings.deviations, settings.taps, latency..=latency);
    Synthesis::of_taps(plant, errors.taps(BankSize { taps: settings.taps, latency }))
}

/// The same taps for a spec with this latency whose delays and gains count as exact. Converters of which
/// nothing is said have 16 bits.
///
/// # Errors
/// As [`Problem::new`].
pub(crate) fn least_squares_taps(
    spec: &Spec,
    latency: usize,
    taps: usize,
) -> Result<Vec<Vec<f64>>, DesignError> {
    let problem = Problem::new(spec, latency)?;
    let problem = Problem { noise: problem.noise_powers(&with_usual_noise(spec))?, ..problem };
    Ok(FirErrors::new(&problem, &[], taps, latency..=latency).taps(BankSize { taps, latency }))
}

#[cfg(test)]
mod tests;
