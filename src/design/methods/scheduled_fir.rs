//! Delay-scheduled taps: affine functions of the delays.
//!
//! With the delays of the channels off by delta_j, the taps are
//!
//! ```text
//! F(delta) = F_0 + sum_j delta_j S_j,
//! ```
//!
//! and the error system is K(delta) = W - F(delta) H(delta). With factors `[1, delta_1, ..]` of the
//! measurements this is a design of fixed taps `[F_0 S_1 ..]` for (J + 1) N channels `[H; delta_1 H; ..]`.
//! So the exchange over scenarios finds the taps of least worst norm, and its dual is a lower bound for all
//! affine taps of that length.
//!
//! The unknowns are delta_j S_j at the end of the box, so that all have the size of taps.
//!
//! What a bank can reach changes over the box: as two delays come closer, the noncausal bound rises. A least
//! worst norm alone would let the error grow wherever it is below that of the worst corner. So the norm of
//! each scenario counts relative to what can be had there: the noncausal bound, or the least gamma without
//! errors if that is larger. Where both are far below the largest of them, a share of that one counts: ideal
//! interleaving has no error at all at its own delays.

use super::robust_fir::worst_of;
use super::robust_fir::{
    MISSED_ERROR_LIMIT, MovedPlant, NORM_ACCURACY, NORM_MARGIN, RobustNorms, RobustProblem,
};
use super::{Filters, Settings, Synthesis, fir, tap_lags};
use crate::bank::TapSlopes;
use crate::design::DesignError;
use crate::design::error_grid::{ErrorGrid, Location, Scenario};
use crate::design::exchange::{Exchange, Tolerances};
use crate::design::filters::impulse_responses;
use crate::design::plant::LiftedPlant;
use crate::design::uncertainty::moving_filters::MovingFilters;
use crate::design::uncertainty::search::BoxSearch;
use crate::linalg::Mat;
use crate::lmi::sampled::{MeanSquareObjective, Point, Problem as SampledProblem, Taps};
use crate::lti::peak::Peak;
use crate::units::{FastPeriods, Seconds};
use crate::verify::uncertainty::{ErrorBox, ErrorPoint};
use std::borrow::Cow;

/// Least of what counts as within reach at some delays, relative to the largest over the box.
const LEAST_REACH: f64 = 0.02;

/// The comparison of delay-scheduled taps with fixed taps.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct TrackingStudy {
    /// The box.
    pub errors: ErrorBox,
    /// Of this bank, its taps scheduled by the delays.
    pub tracked: RobustNorms,
    /// Of the bank that is optimal without errors, its taps fixed.
    pub fixed: RobustNorms,
    /// Least norm of a bank that is designed for the delays at which the largest tracked norm was found.
    pub redesigned: f64,
    /// The largest ratio over the scenarios of the tracked norm to what is within reach there: the noncausal
    /// bound, or the least norm without errors if that is larger, or 2 % of the largest such number. This is
    /// what the design minimises.
    pub ratio: f64,
    /// No affine taps of this length have a smaller ratio (computed).
    pub least_ratio: f64,
    /// Points of the box with a plant of their own.
    pub scenarios: usize,
    /// Pairs of a frequency and a scenario at the end.
    pub pairs: usize,
}

impl TrackingStudy {
    /// By how much the largest norm found exceeds that of a redesign, relative to it.
    pub fn excess(&self) -> f64 {
        if self.redesigned > 0.0 { self.tracked.largest_found / self.redesigned - 1.0 } else { 0.0 }
    }
}

/// Slopes of the taps, and the error that they reach.
#[derive(Debug, Clone)]
pub(crate) struct AffineDesign {
    pub(crate) slopes: TapSlopes,
    pub(crate) study: TrackingStudy,
}

/// The affine taps of least norm over the scenarios, relative to what is within reach there, within 3e-4.
/// Errors for which they are worse than for the scenarios become scenarios.
///
/// # Errors
/// As [`fir::synthesise`].
pub(crate) fn synthesise(
    plant: &LiftedPlant,
    settings: &Settings,
    problem: &RobustProblem,
) -> Result<Synthesis, DesignError> {
    let fixed = fir::synthesise(plant, settings)?;
    let Filters::Fir(fixed_taps) = &fixed.filters else { return Ok(fixed) };
    let search = problem.search(plant, settings.taps)?;
    let moved = problem.moved_plants(plant)?;
    let reach = Reach::new(&moved, fixed.peak.gain)?;
    let sides = Sides::new(problem);
    let grid = sides.grid(plant, moved, &reach, settings)?;
    let mut exchange = sides.exchange(plant, grid, settings);
    exchange.stop = settings.stop.clone();
    let found = sides.least_ratio(&mut exchange, &search, &reach, settings)?;
    let of_fixed = worst_of(&search, fixed_taps)?.peak.gain;
    let worst = &exchange.error().scenarios()[found.worst];
    let redesigned = fir::estimate(&worst.plant, settings.taps, NORM_ACCURACY)?;
    let peak = found.peaks[0];
    let study = TrackingStudy {
        errors: problem.errors.clone(),
        tracked: RobustNorms { nominal: peak.gain, largest_found: found.peaks[found.worst].gain },
        fixed: RobustNorms { nominal: fixed.peak.gain, largest_found: of_fixed },
        redesigned,
        ratio: found.ratio,
        // Without errors, affine taps are fixed ones.
        least_ratio: exchange.lower_for_all.max(fixed.lower / reach.without_errors()).min(found.ratio),
        scenarios: exchange.error().scenarios().len() - 1,
        pairs: exchange.locations().len(),
    };
    Ok(Synthesis {
        filters: Filters::Fir(found.taps),
        peak,
        lower: fixed.lower.min(peak.gain),
        noncausal: fixed.noncausal.min(peak.gain),
        iterations: fixed.iterations + exchange.iterations,
        dual: fixed.dual,
        robust: None,
        affine: Some(AffineDesign { slopes: found.slopes, study }),
    })
}

/// What is within reach.
struct Reach {
    /// Of a fixed bank without errors.
    nominal: f64,
    /// Least of what counts.
    floor: f64,
}

impl Reach {
    /// Over these plants, where a fixed bank has gain `nominal` without errors.
    fn new(moved: &[MovedPlant], nominal: f64) -> Result<Self, DesignError> {
        let most = moved.iter().try_fold(nominal, |most, moved| {
            Ok::<_, DesignError>(f64::max(most, moved.plant.noncausal_bound()?.gain))
        })?;
        Ok(Self { nominal, floor: LEAST_REACH * most })
    }

    /// With the errors of a plant.
    fn of(&self, plant: &LiftedPlant) -> Result<f64, DesignError> {
        Ok(plant.noncausal_bound()?.gain.max(self.nominal).max(self.floor))
    }

    /// Without errors.
    fn without_errors(&self) -> f64 {
        self.nominal.max(self.floor)
    }
}

/// Affine taps with their norms.
struct Scheduled {
    taps: Vec<Vec<f64>>,
    slopes: TapSlopes,
    /// Of each scenario.
    peaks: Vec<Peak>,
    /// The scenario of the largest norm.
    worst: usize,
    /// The largest ratio of a norm to what is within reach.
    ratio: f64,
}

/// The delays that move.
struct Sides {
    /// The channels, from 0.
    channels: Vec<usize>,
    /// By how much the delay of each of them may be off.
    halves: Vec<Seconds>,
    fast_period: Seconds,
    /// Of converters.
    converters: usize,
    /// N, the samples of a frame.
    count: usize,
}

impl Sides {
    fn new(problem: &RobustProblem) -> Self {
        let delays = &problem.errors.delays;
        let channels: Vec<usize> = (0..delays.len()).filter(|&j| delays[j].0 > 0.0).collect();
        let halves = channels.iter().map(|&j| delays[j]).collect();
        let (fast_period, count) = (problem.spec.fast_period, problem.spec.layout().count());
        Self { channels, halves, fast_period, converters: delays.len(), count }
    }

    /// Of one scenario: 1, and the share of each half-width.
    fn factors(&self, point: &ErrorPoint) -> Vec<f64> {
        let share = |(&j, half): (&usize, &Seconds)| point.delays[j].0 / half.0;
        std::iter::once(1.0).chain(self.channels.iter().zip(&self.halves).map(share)).collect()
    }

    /// The errors of the delays of a scenario.
    fn errors(&self, scenario: &Scenario<'_>) -> Vec<FastPeriods> {
        let mut errors = vec![FastPeriods(0.0); self.converters];
        for (k, (&j, half)) in self.channels.iter().zip(&self.halves).enumerate() {
            errors[j] = half.in_fast_periods(self.fast_period) * scenario.factors[k + 1];
        }
        errors
    }

    /// The exchange. Where the taps are worse at errors or frequencies that it does not know, it is repeated
    /// with these.
    fn least_ratio(
        &self,
        exchange: &mut Exchange<ErrorGrid<'_>>,
        search: &BoxSearch,
        reach: &Reach,
        settings: &Settings,
    ) -> Result<Scheduled, DesignError> {
        let mut rounds = 0;
        loop {
            let found = exchange.optimise_at(Tolerances::gradual(NORM_ACCURACY))?;
            let (taps, slopes) = self.split(&found.taps, settings.taps);
            let filters = MovingFilters::scheduled(&taps, &slopes, search.plant().ratio(), self.fast_period);
            let enough = found.peaks.estimate.max(exchange.lower) * (1.0 + NORM_ACCURACY);
            for point in search.worst_points(&filters)? {
                let plant = search.plant().moved(&point)?;
                let weight = 1.0 / reach.of(&plant)?;
                let scenario = Scenario::new(Cow::Owned(plant), self.factors(&point), weight);
                let moved = slopes.moved(&taps, &self.errors(&scenario));
                if weight * scenario.plant.fir_norm(&moved)?.gain > enough {
                    exchange.error_mut().add(scenario);
                }
            }
            let scheduled = self.judged(exchange.error().scenarios(), taps, slopes)?;
            rounds += 1;
            if scheduled.ratio <= enough || rounds == MISSED_ERROR_LIMIT || exchange.stop.is_due() {
                return Ok(scheduled);
            }
            let missed: Vec<Location<usize>> = exchange
                .error()
                .scenarios()
                .iter()
                .zip(&scheduled.peaks)
                .enumerate()
                .filter(|(_, (scenario, peak))| scenario.weight * peak.gain > enough)
                .map(|(scenario, (_, peak))| Location { frequency: peak.frequency, scenario })
                .collect();
            if !exchange.add(&missed) {
                return Ok(scheduled);
            }
        }
    }

    /// The norms of the scenarios.
    fn judged(
        &self,
        scenarios: &[Scenario<'_>],
        taps: Vec<Vec<f64>>,
        slopes: TapSlopes,
    ) -> Result<Scheduled, DesignError> {
        let peak =
            |scenario: &Scenario<'_>| scenario.plant.fir_norm(&slopes.moved(&taps, &self.errors(scenario)));
        let peaks = scenarios.iter().map(peak).collect::<Result<Vec<_>, _>>()?;
        let worst = (0..peaks.len()).max_by(|&a, &b| peaks[a].gain.total_cmp(&peaks[b].gain)).unwrap_or(0);
        let ratios = peaks.iter().zip(scenarios).map(|(peak, scenario)| peak.gain * scenario.weight);
        let ratio = ratios.fold(0.0, f64::max);
        Ok(Scheduled { taps, slopes, peaks, worst, ratio })
    }

    /// F_0 as taps per channel, and the slopes per fast period.
    fn split(&self, found: &Taps, length: usize) -> (Vec<Vec<f64>>, TapSlopes) {
        let part = |k: usize, scale: f64| {
            let lags: Vec<Mat> =
                found.iter().map(|lag| lag.columns(k * self.count, self.count) / scale).collect();
            impulse_responses(&lags, length)
        };
        let mut by_delay = vec![Vec::new(); self.converters];
        for (k, (&j, half)) in self.channels.iter().zip(&self.halves).enumerate() {
            by_delay[j] = part(k + 1, half.in_fast_periods(self.fast_period).0);
        }
        (part(0, 1.0), TapSlopes { by_delay })
    }

    /// The plant without errors, then the scenarios, each relative to what is within reach there.
    fn grid<'a>(
        &self,
        plant: &'a LiftedPlant,
        moved: Vec<MovedPlant>,
        reach: &Reach,
        settings: &Settings,
    ) -> Result<ErrorGrid<'a>, DesignError> {
        let none = self.factors(&ErrorPoint::none(self.converters));
        let mut scenarios = vec![Scenario::new(Cow::Borrowed(plant), none, 1.0 / reach.without_errors())];
        for MovedPlant { plant, point } in moved {
            let weight = 1.0 / reach.of(&plant)?;
            scenarios.push(Scenario::new(Cow::Owned(plant), self.factors(&point), weight));
        }
        ErrorGrid::of_scenarios(scenarios, tap_lags(plant.ratio(), settings.taps)[0])
    }

    fn exchange<'a>(
        &self,
        plant: &LiftedPlant,
        grid: ErrorGrid<'a>,
        settings: &Settings,
    ) -> Exchange<ErrorGrid<'a>> {
        let (points, weights, scenarios) = self.first_points(&grid);
        let noise = self.noise(&plant.problem().noise, grid.scenarios());
        let margin = settings.gamma_margin.unwrap_or(NORM_MARGIN).max(NORM_MARGIN);
        let problem = SampledProblem::new(points, tap_lags(plant.ratio(), settings.taps));
        Exchange::new(grid, problem, scenarios, MeanSquareObjective { weights, noise }, margin)
    }

    /// Some points of each scenario with their weights and their scenarios: the scenarios take turns, so
    /// that there are about as many points as for the centre and the ends of each side alone.
    fn first_points(&self, grid: &ErrorGrid<'_>) -> (Vec<Point>, Vec<f64>, Vec<usize>) {
        let count = grid.scenarios().len();
        let stride = count.div_ceil(2 * self.channels.len() + 1);
        let (mut points, mut weights, mut scenarios) = (Vec::new(), Vec::new(), Vec::new());
        for scenario in 0..count {
            let (coarse, of_coarse) = grid.coarse(scenario);
            for k in (scenario % stride..coarse.len()).step_by(stride) {
                points.push(coarse[k].clone());
                weights.push(of_coarse[k] * stride as f64 / count as f64);
                scenarios.push(scenario);
            }
        }
        (points, weights, scenarios)
    }

    /// Power of the noise of the channels `[H; delta_1 H; ..]`: that of the output's noise, averaged over
    /// the scenarios, whose shares are uncorrelated.
    fn noise(&self, of_channels: &[f64], scenarios: &[Scenario<'_>]) -> Vec<f64> {
        let square = |k: usize| scenarios.iter().map(|scenario| scenario.factors[k].powi(2)).sum::<f64>();
        let mean = |k: usize| square(k) / scenarios.len() as f64;
        (0..=self.channels.len()).flat_map(|k| of_channels.iter().map(move |power| power * mean(k))).collect()
    }
}
