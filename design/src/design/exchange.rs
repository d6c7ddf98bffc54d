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
use crate::lmi::sampled::{self, FrequencyPoint, LowerBound, MeanSquareObjective, SampledProblem};
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
    /// Share of the distance between the largest peak and the bound to which the next problem is solved: a
    /// closer solution would change with the next points.
    pub(super) share_of_width: f64,
}

/// Of every exchange.
pub(super) const SETTINGS: Settings = Settings {
    least_margin: 4e-7,
    points_accuracy: 0.1,
    peak_excess: 0.2,
    margin_at_points: 0.75,
    share_of_width: 0.3,
};

/// Relative width of the interval `[lower, gamma]` at which the exchange ends.
pub(crate) const GAMMA_ACCURACY: f64 = 5e-7;

/// The tolerance schedule: how closely the problems of the rounds are solved.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tolerances {
    /// Relative width of the interval `[lower, gamma]` at which the exchange ends.
    accuracy: f64,
    /// Largest tolerance of the optimum on the points.
    loosest: f64,
    /// Tolerance of the secondary objective.
    mean_square: f64,
    /// Added points whose gain is below this share of gamma are left out of the secondary objective.
    active: f64,
    /// Limit on the rounds of each objective.
    rounds: usize,
}

impl Tolerances {
    /// Every problem as closely as the last one, for few rounds: five are rarely needed.
    fn steady(accuracy: f64) -> Self {
        let loosest = SETTINGS.points_accuracy * accuracy;
        Self { accuracy, loosest, mean_square: FINEST_GAP, active: 0.0, rounds: 16 }
    }

    /// For many rounds. Each problem is solved only as closely as the peaks between its points require: an
    /// iterate in the middle of the set of nearly optimal unknowns has lower peaks than one at its boundary.
    pub(super) fn gradual(accuracy: f64) -> Self {
        Self { accuracy, loosest: 0.1, mean_square: 1e-3, active: 0.95, rounds: 32 }
    }

    fn finest(&self) -> f64 {
        SETTINGS.points_accuracy * self.accuracy
    }

    /// Of a problem whose predecessor left an interval of this relative width.
    fn tolerance(&self, width: f64) -> f64 {
        (SETTINGS.share_of_width * width).min(self.loosest).max(self.finest())
    }
}

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

/// The solution on the points.
struct Round<S> {
    candidate: TapCandidate<S>,
    is_solved: bool,
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
    /// Lower bound on gamma for all unknowns, or for those of any size that matters ([`LowerBound`]).
    pub(super) lower: f64,
    /// The largest lower bound for all unknowns, however large.
    pub(super) lower_for_all: f64,
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
            lower_for_all: 0.0,
            stop: Stop::default(),
            rounds: 0,
        }
    }

    /// Unknowns with gamma within the margin of the optimum and the least secondary objective.
    ///
    /// # Errors
    /// [`DesignError`] if a decomposition does not converge.
    pub(super) fn optimise(&mut self) -> Result<TapCandidate<E::Scenario>, DesignError> {
        self.optimise_at(Tolerances::steady(GAMMA_ACCURACY))
    }

    /// As [`Exchange::optimise`], with gamma within the accuracy of `tolerances` before the margin is spent.
    ///
    /// # Errors
    /// As [`Exchange::optimise`].
    pub(super) fn optimise_at(
        &mut self,
        tolerances: Tolerances,
    ) -> Result<TapCandidate<E::Scenario>, DesignError> {
        let least = self.minimise_gamma(tolerances)?;
        self.leave_out_inactive(&least, tolerances.active)?;
        self.minimise_mean_square(least, tolerances)
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

    fn minimise_gamma(&mut self, tolerances: Tolerances) -> Result<TapCandidate<E::Scenario>, DesignError> {
        let mut tolerance = tolerances.tolerance(f64::INFINITY);
        let mut last = self.round(tolerances, tolerance)?;
        let mut best = last.candidate.clone();
        for _ in 1..tolerances.rounds {
            let gamma = best.estimate;
            if gamma <= self.lower * (1.0 + tolerances.accuracy) || self.stop.is_due() {
                break;
            }
            // Without a peak to add it is the problem on the points that is not solved closely enough. If
            // it cannot be, that is the end.
            let added = self.add(&last.candidate.above);
            if !added && (!last.is_solved || tolerance <= tolerances.finest()) {
                break;
            }
            tolerance = tolerances.tolerance(if added { gamma / self.lower - 1.0 } else { 0.0 });
            last = self.round(tolerances, tolerance)?;
            // Once the design is stopped, the estimate of the new taps is that of the points alone.
            if !self.stop.is_due() && last.candidate.estimate < best.estimate {
                best = last.candidate.clone();
            }
        }
        Ok(best)
    }

    /// Solves the problem on the points.
    fn round(&mut self, tolerances: Tolerances, tolerance: f64) -> Result<Round<E::Scenario>, DesignError> {
        let solution = sampled::minimise(&self.problem, tolerance, &|| self.stop.is_due())?;
        self.rounds += 1;
        self.raise_lower_bound(solution.lower);
        // The optimum lies anywhere between the two.
        let optimum = if tolerance > tolerances.finest() { self.lower } else { solution.gamma };
        let level = optimum * (1.0 + SETTINGS.peak_excess * tolerances.accuracy);
        let candidate = self.judge(solution.taps, solution.gamma, level)?;
        Ok(Round { candidate, is_solved: solution.is_solved })
    }

    /// Leaves out the added points where the gain of `start` is below a share of its gamma. If the secondary
    /// objective raises the gain there, it is a peak and becomes a point again.
    fn leave_out_inactive(
        &mut self,
        start: &TapCandidate<E::Scenario>,
        share: f64,
    ) -> Result<(), DesignError> {
        if share == 0.0 {
            return Ok(());
        }
        let least = share * start.estimate;
        let (mut points, mut weights, mut locations) = (Vec::new(), Vec::new(), Vec::new());
        for (l, point) in self.problem.points().iter().enumerate() {
            let weight = self.objective.weights[l];
            let gain = hybank_linalg::largest_singular_value(&self.problem.error_at(l, &start.taps))?;
            if weight > 0.0 || gain >= least {
                points.push(point.clone());
                weights.push(weight);
                locations.push(self.locations[l].clone());
            }
        }
        self.objective.weights = weights;
        self.locations = locations;
        self.problem = SampledProblem::new(points, self.problem.lags().to_vec());
        Ok(())
    }

    /// The least secondary objective with gamma at most `(1 + gamma_margin)` times that of `start`. Returns
    /// `start` if the interior-point method makes no progress from there.
    fn minimise_mean_square(
        &mut self,
        start: TapCandidate<E::Scenario>,
        tolerances: Tolerances,
    ) -> Result<TapCandidate<E::Scenario>, DesignError> {
        let cap = start.estimate * (1.0 + self.gamma_margin);
        let cap_at_points = start.estimate * (1.0 + SETTINGS.margin_at_points * self.gamma_margin);
        for _ in 0..tolerances.rounds {
            if self.stop.is_due() {
                return Ok(start);
            }
            let found = sampled::mean_square_under_cap(
                &self.problem,
                &self.objective,
                cap_at_points,
                &start.taps,
                tolerances.mean_square,
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

    fn raise_lower_bound(&mut self, lower: LowerBound) {
        if lower.covers_all {
            self.lower_for_all = self.lower_for_all.max(lower.value);
        }
        self.lower = self.lower.max(lower.value);
    }
}

#[cfg(test)]
mod tests;
