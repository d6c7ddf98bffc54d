//! The way from a spec to a finished bank.

use super::choices::completed;
use super::methods::{self, DualPoint, Settings, Synthesis};
use super::plant::LiftedPlant;
use super::problem::Problem;
use super::quantise::WordStudy;
use super::realise::{Realised, realise};
use super::reduction::OrderReduction;
use super::{DesignError, prove};
use crate::bank::{Bank, Gamma};
use crate::spec::{Method, Spec};
use crate::units::RadiansPerSlowPeriod;
use crate::verify::Verified;
use std::time::{Duration, Instant};

/// A bank with the record of its design.
#[derive(Debug, Clone)]
pub struct Design {
    /// The bank, whole; with its proof where one was found.
    pub bank: Bank,
    /// The latency was left to the designer.
    pub latency_chosen: bool,
    /// The number of taps was left to the designer.
    pub taps_chosen: bool,
    /// Where the worst case sits.
    pub peak_frequency: RadiansPerSlowPeriod,
    /// Riccati equations or interior-point iterations.
    pub iterations: usize,
    /// For integer taps what they cost.
    pub words: Option<WordStudy>,
    /// What became of the order, where the spec asks for fewer states.
    pub reduction: Option<OrderReduction>,
    /// What the bank's proof proves, or the reason why the bank carries none.
    pub proof: Result<Verified, DesignError>,
    /// Time that the search for the proof took.
    pub proof_time: Duration,
}

/// Whether a design looks for the proof of its gammas, which may take longer than the design itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ProofSearch {
    /// The bank carries its proof, if one is found.
    Run,
    /// The bank carries none, and [`Design::proof`] says that none was looked for.
    Skip,
}

/// Designs the bank that `spec` asks for, with the proof of its gammas.
///
/// # Errors
/// [`DesignError`]: a spec that breaks the rules of [`Spec::check`], front ends that are none, a comparison
/// method that does not apply, numerics that gave no bank at all. A bank without proof is no error: see
/// [`Design::proof`].
pub fn design(spec: &Spec) -> Result<Design, DesignError> {
    design_with(spec, ProofSearch::Run)
}

/// As [`design`], with the search for the proof left to the caller.
///
/// # Errors
/// As [`design`].
pub fn design_with(spec: &Spec, search: ProofSearch) -> Result<Design, DesignError> {
    spec.check()?;
    let (complete, problem) = normalise(spec)?;
    let merged = problem.merge_channels();
    let plant = LiftedPlant::new(&merged.problem)?;
    let synthesis = methods::synthesise(spec.design.method, &plant, &settings(&complete)?)?;
    let realised = realise(&complete, &problem, &merged, &plant, &synthesis)?;
    Ok(judge(spec, complete, realised, &synthesis).proved(&synthesis.dual, search))
}

/// The spec with nothing left open, and the problem that it states when the units are gone.
fn normalise(spec: &Spec) -> Result<(Spec, Problem), DesignError> {
    let complete = completed(spec)?;
    let problem = Problem::new(&complete, complete.latency.unwrap_or_default())?;
    Ok((complete, problem))
}

/// The settings of a method by a complete spec.
fn settings(spec: &Spec) -> Result<Settings, DesignError> {
    let at_slow_rate = || {
        let slow = Spec { fast_period: spec.fast_period * spec.ratio as f64, ..spec.clone() };
        Ok::<_, DesignError>(Problem::new(&slow, 0)?.merge_channels().problem)
    };
    let separate = spec.design.method == Method::Separation;
    Ok(Settings {
        taps: spec.design.taps.unwrap_or_default(),
        gamma_margin: spec.design.gamma_margin,
        solver: spec.design.solver,
        at_slow_rate: separate.then(at_slow_rate).transpose()?,
    })
}

/// The bank with the norm of its very coefficients, below which all lower bounds stay, and the whole of its
/// spec.
fn judge(spec: &Spec, complete: Spec, realised: Realised, synthesis: &Synthesis) -> Design {
    let Realised { filters, peak, reduction, integers } = realised;
    let (fixed_point, words) = integers.unzip();
    let bank = Bank {
        fast_period: complete.fast_period.0,
        ratio: complete.ratio,
        latency: complete.latency.unwrap_or_default(),
        method: complete.design.method,
        delays: complete.channels.iter().map(|channel| channel.delay.0).collect(),
        filters,
        gamma: Gamma::computed(peak.gain, synthesis.lower, synthesis.noncausal),
        proof: None,
        fixed_point,
        spec: Some(complete),
    };
    Design {
        latency_chosen: spec.latency.is_none(),
        taps_chosen: spec.design.method.has_taps() && spec.design.taps.is_none(),
        peak_frequency: RadiansPerSlowPeriod(peak.frequency),
        iterations: synthesis.iterations,
        words,
        reduction,
        proof: Err(DesignError::ProofSkipped),
        proof_time: Duration::ZERO,
        bank,
    }
}

impl Design {
    /// With the proof in the bank, if one is looked for and found.
    fn proved(mut self, dual: &[DualPoint], search: ProofSearch) -> Self {
        if search == ProofSearch::Run {
            let begin = Instant::now();
            self.proof = prove::attach_proof(&mut self.bank, dual);
            self.proof_time = begin.elapsed();
        }
        self
    }
}

#[cfg(test)]
mod tests;
