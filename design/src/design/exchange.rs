//! The exchange algorithm for an error that is affine in the unknowns.
//!
//! Over real matrices `F_0 .. F_{J-1}` (M x N) minimise
//!
//! ```text
//! gamma = max over omega in [0, pi] of sigma_max(K(omega)),
//! K(omega) = W(omega) - sum_j e^{-i omega j} F_j H(omega),
//! ```
//!
//! This is a semi-infinite problem with one constraint per frequency. [`sampled`] solves it and its dual at
//! finitely many points. The optimum at the points is a lower bound of the optimum over all frequencies,
//! because it has fewer constraints. The peaks of the error between the points are added to them until the
//! largest peak meets the bound.
//!
//! Optimal unknowns are not unique. Among those whose gamma is within a margin of the optimum, the exchange
//! chooses the ones with the least weighted mean square (the secondary objective). Peaks above the margin
//! are again added as points.
//!
//! FIR design uses it with the taps as unknowns (thesis 5.4), order reduction with the output matrices of
//! given dynamics (J = 1). Source: Hettich and Kortanek, "Semi-infinite programming", SIAM Review 35 (1993),
//! exchange methods.

use super::DesignError;
use super::error_grid::{AffineError, GridFrequency};
use super::limits::Stop;
use crate::lmi::FINEST_GAP;
use crate::lmi::sampled::{self, FrequencyPoint, MeanSquareObjective, SampledProblem};
use crate::lti::FirMatrix;

/// What the exchange tolerates.
pub(super) struct Settings {
    /// Least relative margin of gamma for the secondary objective. Optimal unknowns are not unique, so even
    /// this margin lets the mean square improve.
    pub(super) least_margin: f64,
    /// Tolerance of the optimum on the points, relative to the accuracy of gamma: little of it, as most is
    /// needed for the peaks between them.
    pub(super) points_accuracy: f64,
    /// Excess of a peak over the optimum on the points, relative to the accuracy of gamma, from which it
    /// becomes a point: beyond the tolerance of that optimum.
    pub(super) peak_excess: f64,
    /// Fraction of the margin that the secondary objective may use at the points. The rest is left to the
    /// peaks between them.
    pub(super) margin_at_points: f64,
}

/// Of every exchange.
pub(super) const SETTINGS: Settings =
    Settings { least_margin: 4e-7, points_accuracy: 0.1, peak_excess: 0.2, margin_at_points: 0.75 };

/// Relative width of the interval `[lower, gamma]` at which the exchange ends.
pub(crate) const GAMMA_ACCURACY: f64 = 5e-7;

/// Limit on the rounds of each objective.
const MOST_ROUNDS: usize = 32;

/// Unknowns with what their error peaks at.
#[derive(Debug, Clone)]
pub(super) struct TapCandidate<S> {
    /// `F_j`, M x N.
    pub(super) taps: FirMatrix,
    /// Estimate of their gamma; equal to gamma if no peak was missed.
    pub(super) estimate: f64,
    /// The locations of the peaks that belong among the points.
    above: Vec<GridFrequency<S>>,
}

/// The state of the exchange: the points so far and the lower bound that they give.
#[derive(Debug)]
pub(super) struct Exchange<E: AffineError> {
    /// The error that is minimised. The points stay when its scenarios are refined, so known ones must not
    /// change.
    pub(super) error: E,
    problem: SampledProblem,
    /// Of the points of the problem, in the order in which they were added.
    pub(super) locations: Vec<GridFrequency<E::Scenario>>,
    /// Added points have the weight zero.
    objective: MeanSquareObjective,
    gamma_margin: f64,
    /// Lower bound on gamma for all unknowns of a size that matters: see [`sampled::Solution`].
    pub(super) lower: f64,
    /// Ends the exchange with the best unknowns so far.
    pub(super) stop: Stop,
    /// Problems solved.
    pub(super) rounds: usize,
}

impl<E: AffineError> Exchange<E> {
    /// Starts from the points of `problem`, which belong to these scenarios. `objective` has a weight for
    /// each of them, `gamma_margin` is the relative excess of gamma granted to it, at least
    /// [`Settings::least_margin`].
    pub(super) fn new(
        error: E,
        problem: SampledProblem,
        scenarios: impl IntoIterator<Item = E::Scenario>,
        objective: MeanSquareObjective,
        gamma_margin: f64,
    ) -> Self {
        let frequencies = problem.points().iter().map(|point| point.omega);
        let located =
            frequencies.zip(scenarios).map(|(frequency, scenario)| GridFrequency { frequency, scenario });
        let locations = located.collect();
        let gamma_margin = gamma_margin.max(SETTINGS.least_margin);
        Self {
            error,
            problem,
            locations,
            objective,
            gamma_margin,
            lower: 0.0,
            stop: Stop::default(),
            rounds: 0,
        }
    }

    /// Unknowns with gamma within the margin of the optimum and the least secondary objective.
    ///
    /// # Errors
    /// [`DesignError`] if a decomposition does not converge.
    pub(super) fn optimise(&mut self) -> Result<TapCandidate<E::Scenario>, DesignError> {
        self.optimise_to(GAMMA_ACCURACY, FINEST_GAP)
    }

    /// As [`Exchange::optimise`], with gamma within this `accuracy` before the margin is spent, and the
    /// secondary objective to this relative `gap`.
    ///
    /// # Errors
    /// As [`Exchange::optimise`].
    pub(super) fn optimise_to(
        &mut self,
        accuracy: f64,
        gap: f64,
    ) -> Result<TapCandidate<E::Scenario>, DesignError> {
        let least = self.minimise_gamma(accuracy)?;
        self.minimise_mean_square(least, gap)
    }

    /// Adds points at the given locations, except where there is one. Returns whether any was added.
    pub(super) fn add(&mut self, locations: &[GridFrequency<E::Scenario>]) -> bool {
        let known = self.locations.len();
        for location in locations {
            if !self.locations.iter().any(|other| other.is_near(location)) {
                self.locations.push(location.clone());
            }
        }
        let added = &self.locations[known..];
        let points: Vec<FrequencyPoint> = added.iter().map(|location| self.error.at(location)).collect();
        self.objective.weights.extend(std::iter::repeat_n(0.0, added.len()));
        self.problem = self.problem.with_points(points);
        known < self.locations.len()
    }

    fn minimise_gamma(&mut self, accuracy: f64) -> Result<TapCandidate<E::Scenario>, DesignError> {
        let mut last = self.round(accuracy)?;
        let mut best = last.clone();
        for _ in 1..MOST_ROUNDS {
            let is_enough = best.estimate <= self.lower * (1.0 + accuracy);
            if is_enough || self.stop.is_due() || !self.add(&last.above) {
                break;
            }
            last = self.round(accuracy)?;
            // Once the design is stopped, the estimate of the new taps is that of the points alone.
            if !self.stop.is_due() && last.estimate < best.estimate {
                best = last.clone();
            }
        }
        Ok(best)
    }

    /// Solves the problem on the points.
    fn round(&mut self, accuracy: f64) -> Result<TapCandidate<E::Scenario>, DesignError> {
        let tolerance = SETTINGS.points_accuracy * accuracy;
        let solution = sampled::minimise(&self.problem, tolerance, &|| self.stop.is_due())?;
        self.rounds += 1;
        self.lower = self.lower.max(solution.lower);
        let level = solution.gamma * (1.0 + SETTINGS.peak_excess * accuracy);
        self.judge(solution.taps, solution.gamma, level)
    }

    /// The least secondary objective with gamma at most `(1 + gamma_margin)` times that of `start`. Returns
    /// `start` if the interior-point method makes no progress from there.
    fn minimise_mean_square(
        &mut self,
        start: TapCandidate<E::Scenario>,
        gap: f64,
    ) -> Result<TapCandidate<E::Scenario>, DesignError> {
        let cap = start.estimate * (1.0 + self.gamma_margin);
        let cap_at_points = start.estimate * (1.0 + SETTINGS.margin_at_points * self.gamma_margin);
        for _ in 0..MOST_ROUNDS {
            if self.stop.is_due() {
                return Ok(start);
            }
            let found = sampled::mean_square_under_cap(
                &self.problem,
                &self.objective,
                cap_at_points,
                &start.taps,
                gap,
                &|| self.stop.is_due(),
            )?;
            // Gamma may be zero up to rounding: no cap lies above it then, and no other unknowns are better.
            let Some(found) = found else { return Ok(start) };
            self.rounds += 1;
            let candidate = self.judge(found.taps, found.gamma, cap_at_points)?;
            if candidate.estimate <= cap {
                return Ok(candidate);
            }
            if !self.add(&candidate.above) {
                break;
            }
        }
        Ok(start)
    }

    /// The taps with the peaks of their error. None is searched once the design is stopped: `gamma`, that of
    /// the points, stands for them.
    fn judge(
        &self,
        taps: FirMatrix,
        gamma: f64,
        level: f64,
    ) -> Result<TapCandidate<E::Scenario>, DesignError> {
        let peaks = if self.stop.is_due() { Vec::new() } else { self.error.peaks(&taps, level)? };
        let estimate = peaks.iter().map(|peak| peak.gain).fold(gamma, f64::max);
        let above = peaks.into_iter().filter(|peak| peak.gain > level).map(|peak| peak.location).collect();
        Ok(TapCandidate { taps, estimate, above })
    }
}

#[cfg(test)]
mod tests;
