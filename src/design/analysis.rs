//! Judging a bank: exact gamma with the delays it was designed for or with others, mean-square error,
//! noise gain.

use super::equivalence::BlockedPlant;
use super::iir::noncausal_bound;
use super::problem::Problem;
use super::{DesignError, error_system};
use crate::bank::Bank;
use crate::lti::StateSpace;
use crate::lti::gramian::h2_norm;
use crate::units::{FastPeriods, RadiansPerSlowPeriod, Seconds};

/// What a bank does on given front ends and delays.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Analysis {
    /// ||K||, h = 1.
    pub gamma: f64,
    /// The frequency of the worst case, hertz, 0 .. 1/(2 M h): all frequencies that alias to it take part.
    pub peak_hertz: f64,
    /// No bank at all does better on these front ends and delays.
    pub noncausal: f64,
    /// What it does on average.
    #[serde(flatten)]
    pub mean: MeanAnalysis,
}

/// What a bank does on average over time and inputs.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct MeanAnalysis {
    /// Root mean square of e for white noise f of unit density (h = 1): `||K||_2 / sqrt(M)`.
    pub rms_error: f64,
    /// RMS of the output noise for independent noise of unit RMS on all slow samples: `sqrt(sum_i ||f_i||^2 / M)`.
    pub noise_gain: f64,
    /// RMS of the output noise for the noise of the converters as the spec gives it, relative to full scale:
    /// `sqrt(sum_i sigma_i^2 ||f_i||^2 / M)`.
    pub output_noise: f64,
}

/// Analyses `bank` with `delay_errors[i]` added to its delays; an empty slice means none.
///
/// # Errors
/// [`DesignError::NoSpec`] for a bank without front ends, [`DesignError::DelayErrorCount`] unless there is one error a
/// channel, [`DesignError::TooLate`] for delays out of all proportion, [`DesignError::Lti`] for unstable filters.
pub fn analyze(bank: &Bank, delay_errors: &[Seconds]) -> Result<Analysis, DesignError> {
    let problem = bank_problem(bank)?;
    let count = problem.channels.len();
    if !delay_errors.is_empty() && delay_errors.len() != count {
        return Err(DesignError::DelayErrorCount { given: delay_errors.len(), channels: count });
    }
    let fast_period = Seconds(bank.fast_period);
    let normalised: Vec<FastPeriods> =
        delay_errors.iter().map(|error| error.in_fast_periods(fast_period)).collect();
    let moved = problem.with_delay_errors(&normalised);
    moved.check_size()?;
    let plant = BlockedPlant::new(&moved);
    let peak = error_system::bank_gamma(&plant, &bank.filters)?;
    let distinct = BlockedPlant::new(&moved.without_duplicates().0);
    Ok(Analysis {
        gamma: peak.gain,
        peak_hertz: RadiansPerSlowPeriod(peak.frequency).in_hertz(Seconds(bank.slow_period())).0,
        noncausal: noncausal_bound(&distinct)?.min(peak.gain),
        mean: mean_of(bank, &plant, &moved.noise)?,
    })
}

/// The averages alone, of a bank on its own front ends and delays: far less work than the norm of a large bank.
///
/// # Errors
/// As [`analyze`].
pub fn analyze_mean(bank: &Bank) -> Result<MeanAnalysis, DesignError> {
    let problem = bank_problem(bank)?;
    mean_of(bank, &BlockedPlant::new(&problem), &problem.noise)
}

fn mean_of(bank: &Bank, plant: &BlockedPlant, noise: &[f64]) -> Result<MeanAnalysis, DesignError> {
    let filters = error_system::block_system(&bank.filters, bank.ratio)?;
    let error = error_system::error_system(plant, &filters)?;
    let per_sample = (bank.ratio as f64).sqrt();
    Ok(MeanAnalysis {
        rms_error: h2_norm(&error)? / per_sample,
        noise_gain: h2_norm(&filters)? / per_sample,
        output_noise: h2_norm(&behind_noise(&filters, noise)?)? / per_sample,
    })
}

/// The filters with independent noise of the given powers on their inputs.
fn behind_noise(filters: &StateSpace, noise: &[f64]) -> Result<StateSpace, DesignError> {
    let rms: Vec<f64> = noise.iter().map(|power| power.sqrt()).collect();
    Ok(filters.scale_inputs(&rms)?)
}

/// The problem that a bank solves.
pub fn bank_problem(bank: &Bank) -> Result<Problem, DesignError> {
    let spec = bank.spec.as_ref().ok_or(DesignError::NoSpec)?;
    Problem::new(spec, bank.latency)
}
