//! IIR design: the least achievable gamma by a-posteriori H-infinity filtering and gamma-iteration
//! (thesis 5.3), and the mean-square optimal filter as its limit.

use super::DesignError;
use super::equivalence::BlockedPlant;
use super::error_system;
use super::filtering::{Filter, Innovations, Trial};
use crate::linalg;
use crate::linalg::Complex;
use crate::lti::LtiError;
use crate::lti::peak::{Peak, hinf_norm, unexplained_peak};

/// Relative width of the interval [lower, upper] at which gamma-iteration ends.
pub const GAMMA_ACCURACY: f64 = 5e-7;
/// Gammas below this fraction of ||W|| are zero: the wanted samples are reproduced to rounding.
const NEGLIGIBLE: f64 = 1e-12;
/// The bracket halves (on the logarithmic scale) in each trial.
const TRIAL_LIMIT: usize = 80;
/// Gammas tried below one that was not resolved.
const LOOKS: usize = 8;
/// Gamma-iterations with looks below between them.
const ROUNDS: usize = 4;
/// A look below is worth another gamma-iteration if it makes gamma this much smaller.
const WORTH_IT: f64 = 0.9;

/// A state-space design.
#[derive(Debug, Clone)]
pub struct StateSpaceDesign {
    /// N slow samples in, M fast samples out, a tick.
    pub filters: Filter,
    /// The exact norm of the error system with these filters.
    pub upper: f64,
    /// No causal filter reaches less.
    pub lower: f64,
    /// No filter at all, causal or not, reaches less.
    pub noncausal: f64,
    /// Where on the unit circle the worst case sits, radians a slow tick.
    pub peak_frequency: f64,
    /// Riccati equations solved.
    pub trials: usize,
}

/// The bound that no latency can beat: the peak of what the slow samples leave unexplained.
pub fn noncausal_bound(plant: &BlockedPlant) -> Result<f64, DesignError> {
    Ok(noncausal_peak(plant)?.gain)
}

fn noncausal_peak(plant: &BlockedPlant) -> Result<Peak, DesignError> {
    Ok(unexplained_peak(&plant.system, plant.measured)?)
}

/// The least gamma of any causal bank, within [`GAMMA_ACCURACY`]; with `gamma_margin` > 0 the central filter
/// at (1 + gamma_margin) times the optimum instead, which is kinder to all other frequencies.
pub fn design_iir(plant: &BlockedPlant, gamma_margin: f64) -> Result<StateSpaceDesign, DesignError> {
    let innovations = Innovations::in_all_coordinates(plant)?;
    let mut search = Search::new(plant, &innovations)?;
    let mut mean_square = innovations.iter().filter_map(Innovations::h2).peekable();
    // The mean-square optimum is mostly the worst-case one too or far from it, and one frequency tells which.
    let promising =
        mean_square.peek().map(|filters| search.may_be_optimal(filters)).transpose()? == Some(true);
    if !promising {
        search.try_the_lower_bound()?;
    }
    if !search.done() {
        search.start_from(mean_square)?;
    }
    if promising {
        search.try_the_lower_bound()?;
    }
    search.bisect()?;
    search.finish(gamma_margin)
}

/// The mean-square optimal bank.
pub fn design_h2(plant: &BlockedPlant) -> Result<StateSpaceDesign, DesignError> {
    let innovations = Innovations::in_all_coordinates(plant)?;
    let mut search = Search::new(plant, &innovations)?;
    search.start_from(innovations.iter().filter_map(Innovations::h2))?;
    search
        .best
        .map(|best| search.report.fill(best))
        .ok_or(DesignError::RiccatiFailed { gamma: f64::INFINITY })
}

/// A filter with its verified norm.
#[derive(Debug, Clone)]
struct Verified {
    filters: Filter,
    norm: f64,
    frequency: f64,
}

#[derive(Debug, Clone, Copy)]
struct Report {
    lower: f64,
    noncausal: f64,
    trials: usize,
}

impl Report {
    fn fill(self, best: Verified) -> StateSpaceDesign {
        StateSpaceDesign {
            filters: best.filters,
            upper: best.norm,
            lower: self.lower.min(best.norm),
            noncausal: self.noncausal.min(best.norm),
            peak_frequency: best.frequency,
            trials: self.trials,
        }
    }
}

/// What gamma-iteration ended at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Floor {
    /// A gamma that no filter reaches.
    Proven,
    /// One at which the trial failed for whatever reason.
    Doubtful,
}

struct Search<'a> {
    plant: &'a BlockedPlant,
    innovations: &'a [Innovations],
    /// Where the noncausal bound is attained, radians a slow tick.
    hardest: f64,
    best: Option<Verified>,
    report: Report,
    negligible: f64,
}

impl<'a> Search<'a> {
    fn new(plant: &'a BlockedPlant, innovations: &'a [Innovations]) -> Result<Self, DesignError> {
        let noncausal = noncausal_peak(plant)?;
        let fresh = innovations.first().map_or(Ok(0.0), Innovations::fresh_error)?;
        let negligible =
            NEGLIGIBLE * (plant.system.c().norm() * plant.system.b().norm() + plant.system.d().norm());
        Ok(Self {
            plant,
            innovations,
            hardest: noncausal.frequency,
            best: None,
            report: Report { lower: noncausal.gain.max(fresh), noncausal: noncausal.gain, trials: 0 },
            negligible,
        })
    }

    /// `None` for filters that rounding has made unstable.
    fn verify(&self, filters: Filter) -> Result<Option<Verified>, DesignError> {
        match error_system::gamma(self.plant, &filters) {
            Ok(peak) => Ok(Some(Verified { filters, norm: peak.gain, frequency: peak.frequency })),
            Err(DesignError::Lti(LtiError::Unstable { .. })) => Ok(None),
            Err(other) => Err(other),
        }
    }

    fn keep(&mut self, found: Verified) {
        if self.best.as_ref().is_none_or(|best| found.norm < best.norm) {
            self.best = Some(found);
        }
    }

    /// Whether the error where the noncausal bound is attained is within the accuracy of the least that any filter can have.
    fn may_be_optimal(&self, filters: &Filter) -> Result<bool, DesignError> {
        let error = error_system::error_system(self.plant, filters)?;
        let response = error.response_at(Complex::from_polar(1.0, self.hardest));
        let gain = linalg::largest_singular_value_c(&response)?;
        Ok(gain <= self.report.lower * (1.0 + GAMMA_ACCURACY) || gain <= self.negligible)
    }

    /// Keeps the first of the mean-square optimal filters that is stable.
    fn start_from(&mut self, mean_square: impl Iterator<Item = Filter>) -> Result<(), DesignError> {
        self.report.trials += 1;
        for filters in mean_square {
            if let Some(found) = self.verify(filters)? {
                self.keep(found);
                break;
            }
        }
        Ok(())
    }

    fn upper(&self) -> f64 {
        self.best.as_ref().map_or(f64::INFINITY, |best| best.norm)
    }

    fn done(&self) -> bool {
        let upper = self.upper();
        upper <= self.report.lower * (1.0 + GAMMA_ACCURACY) || upper <= self.negligible
    }

    /// One gamma; only a filter whose exact norm keeps the promise counts.
    fn attempt(&mut self, gamma: f64) -> Result<Trial, DesignError> {
        for k in 0..self.innovations.len() {
            self.report.trials += 1;
            match self.innovations[k].h_infinity(gamma) {
                Trial::Achieved(filters) => {
                    let Some(found) = self.verify(filters.clone())? else { continue };
                    let promise_kept = found.norm <= gamma * (1.0 + 0.1 * GAMMA_ACCURACY);
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

    /// In most problems the non-causal bound is reached: look there first.
    fn try_the_lower_bound(&mut self) -> Result<(), DesignError> {
        if !self.done() {
            let gamma = self.report.lower * (1.0 + 0.8 * GAMMA_ACCURACY);
            self.attempt(gamma)?;
        }
        Ok(())
    }

    /// Gamma-iteration, and where trials were not resolved a few looks below them: near the edge of double precision a smaller
    /// gamma may well be solvable.
    fn bisect(&mut self) -> Result<(), DesignError> {
        for _ in 0..ROUNDS {
            if self.bisect_once()? == Floor::Proven {
                break;
            }
            let before = self.upper();
            self.look_below()?;
            // False also where nothing was found at all.
            let gained = self.upper() < WORTH_IT * before;
            if !gained {
                break;
            }
        }
        Ok(())
    }

    fn look_below(&mut self) -> Result<(), DesignError> {
        let start = self.ceiling();
        let ratio = self.floor() / start;
        for k in 1..=LOOKS {
            let gamma = start * ratio.powf(k as f64 / (LOOKS + 1) as f64);
            if matches!(self.try_to_prove(gamma)?, Trial::Impossible) {
                break;
            }
        }
        Ok(())
    }

    fn bisect_once(&mut self) -> Result<Floor, DesignError> {
        let mut kind = Floor::Proven;
        let (mut floor, mut ceiling) = (self.floor(), self.ceiling());
        for _ in 0..TRIAL_LIMIT {
            if self.done() || ceiling <= floor * (1.0 + 0.5 * GAMMA_ACCURACY) {
                break;
            }
            let gamma = (floor * ceiling).sqrt();
            match self.try_to_prove(gamma)? {
                Trial::Achieved(_) => ceiling = gamma.min(self.upper()),
                Trial::Impossible => (floor, kind) = (gamma, Floor::Proven),
                Trial::Unresolved => (floor, kind) = (gamma, Floor::Doubtful),
            }
        }
        Ok(kind)
    }

    /// As [`Search::attempt`]; a proof that no filter reaches `gamma` moves the reported bound.
    fn try_to_prove(&mut self, gamma: f64) -> Result<Trial, DesignError> {
        let trial = self.attempt(gamma)?;
        if matches!(trial, Trial::Impossible) {
            self.report.lower = self.report.lower.max(gamma);
        }
        Ok(trial)
    }

    /// The least gamma that is worth a trial.
    fn floor(&self) -> f64 {
        self.report.lower.max(self.negligible)
    }

    /// A gamma that some filter reaches.
    fn ceiling(&self) -> f64 {
        if self.upper().is_finite() { self.upper() } else { self.first_ceiling() }
    }

    /// ||W||, the gamma of the bank that outputs nothing, bounded by its Frobenius pieces.
    fn first_ceiling(&self) -> f64 {
        let (m, n) = (self.plant.measured, self.plant.wanted);
        let reference = self.plant.system.select_outputs(m..m + n).map_err(LtiError::from);
        reference.and_then(|w| hinf_norm(&w)).map_or(f64::MAX.sqrt(), |peak| peak.gain)
    }

    fn finish(mut self, gamma_margin: f64) -> Result<StateSpaceDesign, DesignError> {
        let best = self.best.take();
        let optimum = best.ok_or_else(|| DesignError::RiccatiFailed { gamma: self.first_ceiling() })?;
        if gamma_margin > 0.0 && optimum.norm > self.negligible {
            let cap = optimum.norm * (1.0 + gamma_margin);
            for innovations in self.innovations {
                let Trial::Achieved(filters) = innovations.h_infinity(cap) else { continue };
                let Some(relaxed) = self.verify(filters)? else { continue };
                if relaxed.norm <= cap {
                    return Ok(self.report.fill(relaxed));
                }
            }
        }
        Ok(self.report.fill(optimum))
    }
}
