//! Gamma-iteration: the search for the least gamma for which the filtering Riccati equation has a solution.

use super::filtering::{Innovations, ReferenceFilter, RiccatiSolver, Trial};
use super::{GAMMA_ACCURACY, Synthesis};
use crate::design::DesignError;
use crate::design::filters::to_block;
use crate::design::limits::Stop;
use crate::design::plant::LiftedPlant;
use crate::lti::LtiError;
use crate::lti::peak::{Peak, hinf_norm};
use hybank_core::bank::SynthesisFilters;
use std::rc::Rc;

/// What gamma-iteration tolerates. The shares are of [`GAMMA_ACCURACY`], the accuracy that is promised.
struct Settings {
    /// What a computed norm may exceed the gamma that a filter was promised for. It adds up to less than
    /// one with the bracket.
    norm_share: f64,
    /// How far above the lower bound is tried first: a filter there is accurate enough.
    lower_bound_share: f64,
    /// Width of the bracket that ends the bisection.
    bracket_share: f64,
    /// Gammas below this fraction of ||W|| count as zero: the references are reproduced up to rounding
    /// errors.
    zero_gamma: f64,
    /// Relative distance below the least gamma found at which a more precise solver must find no filter:
    /// four times the accuracy, so that rounding does not decide.
    confirmed_below: f64,
}

/// Of every iteration.
const SETTINGS: Settings = Settings {
    norm_share: 0.1,
    lower_bound_share: 0.8,
    bracket_share: 0.5,
    zero_gamma: 1e-12,
    confirmed_below: 2e-6,
};

/// The bracket halves (on the logarithmic scale) in each trial.
const TRIAL_LIMIT: usize = 80;

/// Filters with the norm of their error system.
#[derive(Debug, Clone)]
pub(super) struct EvaluatedFilters {
    filters: ReferenceFilter,
    pub(super) peak: Peak,
}

/// The state of the search: [lower, best] with the filters that attain the upper end.
pub(super) struct GammaIteration<'a> {
    plant: &'a LiftedPlant,
    solvers: Vec<Rc<dyn RiccatiSolver>>,
    /// The noncausal bound and the frequency at which it is attained.
    noncausal: Peak,
    /// The error that the inputs cause which no measurement contains in time.
    feedthrough: f64,
    /// No causal filter achieves less.
    lower: f64,
    best: Option<EvaluatedFilters>,
    /// Ends the search between two trials, with the best filters so far.
    stop: Stop,
    negligible: f64,
}

impl<'a> GammaIteration<'a> {
    pub(super) fn new(
        plant: &'a LiftedPlant,
        innovations: &[Rc<Innovations>],
        stop: &Stop,
    ) -> Result<Self, DesignError> {
        let noncausal = plant.noncausal_bound()?;
        let feedthrough = innovations.first().map_or(Ok(0.0), |form| form.unmeasured_feedthrough())?;
        let system = plant.system();
        Ok(Self {
            plant,
            solvers: innovations.iter().map(|form| Rc::clone(form) as Rc<dyn RiccatiSolver>).collect(),
            noncausal,
            feedthrough,
            lower: noncausal.gain.max(feedthrough),
            best: None,
            stop: stop.clone(),
            negligible: SETTINGS.zero_gamma * (system.c().norm() * system.b().norm() + system.d().norm()),
        })
    }

    /// Whether the least gamma found is zero or that of a bound on all causal filters, up to the accuracy.
    pub(super) fn attains_a_bound(&self) -> bool {
        let bound = self.noncausal.gain.max(self.feedthrough);
        self.is_negligible(self.upper())
            || (self.done() && self.upper() * (1.0 - SETTINGS.confirmed_below) <= bound)
    }

    /// Whether the search has ended and `solver`, which is more precise, finds no filter for a smaller
    /// gamma.
    pub(super) fn is_confirmed_by(&self, solver: &dyn RiccatiSolver) -> bool {
        let below = self.upper() * (1.0 - SETTINGS.confirmed_below);
        self.done() && matches!(solver.h_infinity(below), Trial::Impossible)
    }

    /// The solvers that are tried, one after the other, for each gamma.
    pub(super) fn solvers(&self) -> Vec<Rc<dyn RiccatiSolver>> {
        self.solvers.clone()
    }

    /// Goes on with `solver` alone. What less precise ones found impossible may be possible.
    pub(super) fn go_on_with(&mut self, solver: Rc<dyn RiccatiSolver>) {
        self.solvers = vec![solver];
        self.lower = self.noncausal.gain.max(self.feedthrough);
    }

    /// The filters with their norm; `None` if rounding errors made the filters unstable or are as large as
    /// the norm.
    pub(super) fn evaluate(&self, filters: ReferenceFilter) -> Result<Option<EvaluatedFilters>, DesignError> {
        let norm = self.plant.norm(&filters);
        match norm.and_then(|peak| Ok((self.plant.rounding(&filters)? < peak.gain, peak))) {
            Ok((is_known, peak)) if is_known || self.is_negligible(peak.gain) => {
                Ok(Some(EvaluatedFilters { filters, peak }))
            }
            Ok(_) => Ok(None),
            Err(DesignError::Lti(LtiError::Unstable { .. } | LtiError::IterationLimit { .. })) => Ok(None),
            Err(other) => Err(other),
        }
    }

    fn keep(&mut self, found: EvaluatedFilters) {
        if self.best.as_ref().is_none_or(|best| found.peak.gain < best.peak.gain) {
            self.best = Some(found);
        }
    }

    /// Keeps the first of the mean-square optimal filters that is stable.
    pub(super) fn start_from(
        &mut self,
        mean_square: impl Iterator<Item = ReferenceFilter>,
    ) -> Result<(), DesignError> {
        for filters in mean_square {
            if let Some(found) = self.evaluate(filters)? {
                self.keep(found);
                break;
            }
        }
        Ok(())
    }

    fn upper(&self) -> f64 {
        self.best.as_ref().map_or(f64::INFINITY, |best| best.peak.gain)
    }

    pub(super) fn is_negligible(&self, gain: f64) -> bool {
        gain <= self.negligible
    }

    pub(super) fn done(&self) -> bool {
        let is_least = self.upper() <= self.lower * (1.0 + GAMMA_ACCURACY);
        is_least || self.is_negligible(self.upper()) || self.is_stopped()
    }

    /// Whether the search is to end, with the filters that it has.
    pub(super) fn is_stopped(&self) -> bool {
        self.best.is_some() && self.stop.is_due()
    }

    /// Tries one gamma. A filter counts as found only if its computed norm confirms gamma.
    fn attempt(&mut self, gamma: f64) -> Result<Trial, DesignError> {
        for solver in self.solvers() {
            match solver.h_infinity(gamma) {
                Trial::Achieved(filters) => {
                    let Some(found) = self.evaluate(filters.clone())? else { continue };
                    let promise_kept =
                        found.peak.gain <= gamma * (1.0 + SETTINGS.norm_share * GAMMA_ACCURACY);
                    self.keep(found);
                    if promise_kept {
                        return Ok(Trial::Achieved(filters));
                    }
                }
                Trial::Impossible => return Ok(Trial::Impossible),
                Trial::Unresolved => {}
            }
        }
        Ok(Trial::Unresolved)
    }

    /// In most problems a causal filter achieves the noncausal bound, so it is tried first.
    pub(super) fn try_the_lower_bound(&mut self) -> Result<(), DesignError> {
        if !self.done() {
            self.attempt(self.lower * (1.0 + SETTINGS.lower_bound_share * GAMMA_ACCURACY))?;
        }
        Ok(())
    }

    /// Halves the bracket until it is narrow. A gamma that is not resolved counts as too small.
    pub(super) fn bisect(&mut self) -> Result<(), DesignError> {
        let mut floor = self.lower.max(self.negligible);
        let mut ceiling = self.upper();
        if ceiling.is_infinite() {
            ceiling = self.zero_output_norm()?;
        }
        for _ in 0..TRIAL_LIMIT {
            if self.done() || ceiling <= floor * (1.0 + SETTINGS.bracket_share * GAMMA_ACCURACY) {
                break;
            }
            let gamma = (floor * ceiling).sqrt();
            match self.attempt(gamma)? {
                Trial::Achieved(_) => ceiling = gamma.min(self.upper()),
                Trial::Impossible => (floor, self.lower) = (gamma, gamma),
                Trial::Unresolved => floor = gamma,
            }
        }
        Ok(())
    }

    /// ||W||, the gamma of the bank that outputs zeros.
    fn zero_output_norm(&self) -> Result<f64, DesignError> {
        Ok(hinf_norm(&self.plant.reference())?.gain)
    }

    /// The filters of least norm that were found.
    ///
    /// # Errors
    /// [`DesignError::RiccatiFailed`] if there are none.
    pub(super) fn best(&self) -> Result<EvaluatedFilters, DesignError> {
        match &self.best {
            Some(best) => Ok(best.clone()),
            None => Err(self.failed(Some(self.zero_output_norm()?))),
        }
    }

    /// No Riccati equation could be solved; `None` for that of the mean-square optimum.
    pub(super) fn failed(&self, gamma: Option<f64>) -> DesignError {
        DesignError::RiccatiFailed { gamma, states: self.plant.system().order() }
    }

    /// `chosen` with the bounds that were found.
    pub(super) fn synthesis(&self, chosen: EvaluatedFilters) -> Synthesis {
        let EvaluatedFilters { filters, peak } = chosen;
        Synthesis {
            filters: SynthesisFilters::StateSpace(to_block(&filters)),
            peak,
            lower: self.lower.min(peak.gain),
            noncausal: self.noncausal.gain.min(peak.gain),
            robust: None,
        }
    }
}
