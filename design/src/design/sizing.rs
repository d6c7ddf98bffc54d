//! What a spec leaves open: the latency, and the number of taps.
//!
//! What counts is the whole error: the mean square of the error for the signal plus the noise of the
//! converters at the output. With a number of taps the latency is the one of the least whole error that FIR
//! banks of this length can reach. The error of a recursive bank falls with every latency, so it takes the
//! shortest one within 0.1 dB of the least; a spec that states no noise is taken for one of 16-bit
//! converters there. `sinc` and `separation` minimise nothing: the output instant lies in the middle of the
//! samples that their taps see. The number of taps follows from a [`Goal`].

use super::DesignError;
use super::causal_errors::{CausalErrors, is_almost};
use super::filters;
use super::fir_errors::{BankSize, check_reach};
use super::length::{Goal, Lengths};
use super::limits::Stop;
use super::merging::Repeats;
use super::methods::{self, MethodSettings};
use super::plant::LiftedPlant;
use super::preparation::{SizingControl, settings, with_usual_noise};
use super::problem::{Problem, common_delay};
use super::realise::realise;
use crate::lti::gramian::h2_norm;
use hybank_core::bank::SynthesisFilters;
use hybank_core::spec::{Method, Spec};

/// Latency and number of taps of a bank: those of its spec, and what was chosen where the spec leaves them
/// open.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sizing {
    /// m0, in fast samples.
    pub latency: usize,
    /// Taps per channel at the fast rate; 0 for recursive filters.
    pub taps: usize,
    /// The latency was left to the designer.
    pub latency_chosen: bool,
    /// The number of taps was left to the designer.
    pub taps_chosen: bool,
}

impl Sizing {
    /// The sizes of the bank that `spec` asks for.
    ///
    /// # Errors
    /// As [`design`](super::design).
    pub fn of(spec: &Spec) -> Result<Self, DesignError> {
        let comparison = SizingControl { observer: &|_| (), stop: &Stop::default() };
        Self::new(spec, &Problem::before_sizing(spec)?, comparison)
    }

    /// The sizes for `spec` and its `problem`. `comparison` follows and ends the designs that are compared.
    ///
    /// # Errors
    /// [`DesignError::OutOfReach`] for a latency that the taps do not reach;
    /// [`DesignError::FigureOutOfReach`] or [`DesignError::FigureMissed`] if no number of taps has the SNR
    /// that the spec asks for; [`DesignError::Stopped`].
    pub(super) fn new(
        spec: &Spec,
        problem: &Problem,
        comparison: SizingControl<'_>,
    ) -> Result<Self, DesignError> {
        let taps = spec.design.taps.or(usual_taps(spec));
        let BankSize { taps, latency } = match (taps, spec.latency) {
            (Some(taps), Some(latency)) => {
                check_reach(problem.clone(), taps)?;
                BankSize { taps, latency }
            }
            (None, Some(latency)) if !spec.is_fir() => BankSize { taps: 0, latency },
            _ => choose(spec, taps, problem, comparison)?,
        };
        let taps_chosen = spec.is_fir() && spec.design.taps.is_none();
        let sizing = Self { latency, taps, latency_chosen: spec.latency.is_none(), taps_chosen };
        // The delays may ask for more than the longest latency.
        sizing.applied_to(spec).check()?;
        Ok(sizing)
    }

    /// The spec with these sizes and nothing left open.
    pub(super) fn applied_to(&self, spec: &Spec) -> Spec {
        let mut sized = Spec { latency: Some(self.latency), ..spec.clone() };
        if self.taps_chosen {
            sized.design = sized.design.with_taps(Some(self.taps));
        }
        sized
    }
}

/// The number of taps of the comparison methods: 23 for M = 2, as in the thesis.
fn usual_taps(spec: &Spec) -> Option<usize> {
    let compares = matches!(spec.design.method, Method::Sinc | Method::Separation);
    compares.then(|| 12 * spec.ratio - 1)
}

/// Taps and latency where at least one of them is open.
fn choose(
    spec: &Spec,
    taps: Option<usize>,
    problem: &Problem,
    comparison: SizingControl<'_>,
) -> Result<BankSize, DesignError> {
    comparison.after(0)?;
    // Delays that all channels have only add to the latency.
    let common = if spec.latency.is_some() { 0 } else { common_delay(spec) };
    let whole = problem.clone().earlier(common);
    let chosen = match (spec.design.method, taps) {
        (Method::Sinc | Method::Separation, taps) => middle(&whole, taps.unwrap_or_default()),
        (_, None) if !spec.is_fir() => {
            BankSize { taps: 0, latency: causal_latency(spec, whole, comparison)? }
        }
        (_, taps) => {
            let lengths = Lengths::new(spec, &whole)?;
            match taps {
                Some(taps) => lengths.best(taps),
                None => lengths.fewest(Goal::of(spec), comparison)?,
            }
        }
    };
    Ok(BankSize { latency: common + chosen.latency, ..chosen })
}

/// The latency of a recursive bank.
fn causal_latency(
    spec: &Spec,
    problem: Problem,
    comparison: SizingControl<'_>,
) -> Result<usize, DesignError> {
    let whole = Problem { noise: problem.noise_powers(&with_usual_noise(spec))?, ..problem };
    let merged = whole.merge_channels(Repeats::of(spec)).of_unit_size()?;
    let errors = CausalErrors::new(&merged.problem)?;
    match spec.design.order {
        Some(_) => latency_of_order(spec, &whole, &errors, comparison),
        None => Ok(errors.shortest()),
    }
}

/// The latency at which the output instant lies in the middle of the samples that the taps see.
fn middle(problem: &Problem, taps: usize) -> BankSize {
    let delays: f64 = problem.delays().iter().map(|delay| delay.0).sum();
    let mean = delays / problem.channels.len() as f64;
    BankSize { taps, latency: ((0.5 * (taps - 1) as f64 + mean).round() as usize).max(problem.wait) }
}

/// The shortest latency at which a bank with as few states as `spec` asks for is almost the best, of those
/// up to the latency of banks with any number of states, whose errors are `errors`. The states that a long
/// latency takes are missing elsewhere, so there is a best latency, which only designs show. A latency at
/// which banks with any number of states are worse than one that was found needs no design.
///
/// # Errors
/// [`DesignError`] of a design, where none succeeds.
fn latency_of_order(
    spec: &Spec,
    problem: &Problem,
    errors: &CausalErrors,
    comparison: SizingControl<'_>,
) -> Result<usize, DesignError> {
    let (mut found, mut least, mut refused) = (Vec::new(), f64::INFINITY, None);
    for latency in (problem.wait..=errors.shortest()).rev() {
        if !is_almost(errors.rms(latency), least) {
            break;
        }
        comparison.after(found.len())?;
        match error_of_order(spec, &Problem { latency, ..problem.clone() }, comparison.stop) {
            Ok(error) => {
                least = least.min(error);
                found.push((latency, error));
            }
            Err(why) => refused = Some(why),
        }
        comparison.go_on()?;
    }
    let shortest = found.into_iter().rfind(|(_, error)| is_almost(*error, least));
    match (shortest, refused) {
        (None, Some(refused)) => Err(refused),
        (shortest, _) => Ok(shortest.map_or(errors.shortest(), |(latency, _)| latency)),
    }
}

/// The whole error of the bank of least mean square with as few states as `spec` asks for.
fn error_of_order(spec: &Spec, problem: &Problem, stop: &Stop) -> Result<f64, DesignError> {
    let mut spec = spec.clone();
    spec.design.method = Method::H2;
    let merged = problem.merge_channels(Repeats::of(&spec)).of_unit_size()?;
    let plant = LiftedPlant::new(&merged.problem);
    let settings = MethodSettings { stop: stop.clone(), ..settings(&spec, 0)? };
    let synthesis = methods::synthesise(Method::H2, &plant, &settings)?;
    let realised = realise(&spec, problem, &merged, &plant, &synthesis, stop)?;
    whole_error(&LiftedPlant::new(problem), &realised.filters)
}

/// The root of the mean square of error and noise together, per fast sample.
fn whole_error(plant: &LiftedPlant, filters: &SynthesisFilters) -> Result<f64, DesignError> {
    let error = plant.with_noise().error_system(&filters::lifted(filters, plant.ratio()));
    Ok(h2_norm(&error)? / (plant.ratio() as f64).sqrt())
}

#[cfg(test)]
mod tests;
