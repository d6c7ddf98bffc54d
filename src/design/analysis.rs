//! Judging a bank: exact gamma with the delays it was designed for or with others, mean-square error,
//! noise gain.

use super::equivalence::BlockedPlant;
use super::iir::noncausal_bound;
use super::problem::Problem;
use super::{DesignError, error_system};
use crate::bank::Bank;
use crate::lti::gramian::h2_norm;

/// What a bank does on given front ends and delays.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Analysis {
    /// ||K||, h = 1.
    pub gamma: f64,
    /// Where the worst case sits, cycles a second at the fast rate's scale (0 .. 1/(2 M h)): frequencies
    /// of the slow rate, to which all fast ones alias.
    pub peak_hertz: f64,
    /// No bank at all does better on these front ends and delays.
    pub noncausal: f64,
    /// Root mean square of e for white noise f of unit density (h = 1).
    pub rms_error: f64,
    /// RMS of the output noise for independent noise of unit RMS on all slow samples.
    pub noise_gain: f64,
}

/// Analyses `bank` with `delay_errors[i]` (seconds) added to its delays; an empty slice means none.
///
/// # Errors
/// [`DesignError::NoSpec`] for a bank without front ends, [`DesignError::DelayErrorCount`] unless there is one error a
/// channel, [`DesignError::TooLate`] for delays out of all proportion, [`DesignError::Lti`] for unstable filters.
pub fn analyze(bank: &Bank, delay_errors: &[f64]) -> Result<Analysis, DesignError> {
    let problem = bank_problem(bank)?;
    let count = problem.channels.len();
    if !delay_errors.is_empty() && delay_errors.len() != count {
        return Err(DesignError::DelayErrorCount { given: delay_errors.len(), channels: count });
    }
    let normalised: Vec<f64> = delay_errors.iter().map(|error| error / bank.fast_period).collect();
    let moved = problem.with_delay_errors(&normalised);
    moved.check_size()?;
    let plant = BlockedPlant::new(&moved);
    let filters = error_system::block_system(&bank.filters, bank.ratio)?;
    let error = error_system::error_system(&plant, &filters)?;
    let peak = crate::lti::peak::hinf_norm(&error)?;
    let distinct = BlockedPlant::new(&moved.without_duplicates().0);
    let per_sample = (bank.ratio as f64).sqrt();
    Ok(Analysis {
        gamma: peak.gain,
        peak_hertz: peak.frequency / (std::f64::consts::TAU * bank.slow_period()),
        noncausal: noncausal_bound(&distinct)?.min(peak.gain),
        rms_error: h2_norm(&error)? / per_sample,
        noise_gain: h2_norm(&filters)? / per_sample,
    })
}

/// The problem that a bank solves.
pub fn bank_problem(bank: &Bank) -> Result<Problem, DesignError> {
    let spec = bank.spec.as_ref().ok_or(DesignError::NoSpec)?;
    Problem::new(spec, bank.latency)
}
