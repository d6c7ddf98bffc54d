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

use super::scenarios::{ACCURACY, MARGIN, MovedPlant, RobustNorms, RobustProblem, largest};
use super::{Filters, Settings, Synthesis, fir, tap_lags};
use crate::bank::TapSlopes;
use crate::design::DesignError;
use crate::design::error_grid::{ErrorGrid, Scenario};
use crate::design::exchange::{Exchange, Tolerances};
use crate::design::filters::impulse_responses;
use crate::design::plant::LiftedPlant;
use crate::linalg::Mat;
use crate::lmi::sampled::{MeanSquareObjective, Point, Problem as SampledProblem, Taps};
use crate::units::{FastPeriods, Seconds};
use crate::verify::uncertainty::{ErrorBox, ErrorPoint};

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
    /// Least norm of a bank that is designed for the delays at which the tracked norm is largest.
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
    /// By how much the worst norm exceeds that of a redesign, relative to it.
    pub fn excess(&self) -> f64 {
        if self.redesigned > 0.0 { self.tracked.worst / self.redesigned - 1.0 } else { 0.0 }
    }
}

/// Slopes of the taps, and the error that they reach.
#[derive(Debug, Clone)]
pub(crate) struct AffineDesign {
    pub(crate) slopes: TapSlopes,
    pub(crate) study: TrackingStudy,
}

/// The affine taps of least norm over the scenarios, relative to what is within reach there, within 3e-4.
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
    let moved = problem.moved_plants(plant)?;
    let (nominal, within_reach) = within_reach(&moved, fixed.peak.gain)?;
    let sides = Sides::new(problem);
    let grid = sides.grid((plant, nominal), &moved, &within_reach, settings);
    let mut exchange = sides.exchange(plant, grid, settings)?;
    exchange.stop = settings.stop.clone();
    let found = exchange.optimise_at(Tolerances::gradual(ACCURACY))?;
    let (taps, slopes) = sides.split(&found.taps, settings.taps);
    let norm = |moved: &MovedPlant| {
        Ok(moved.plant.fir_norm(&slopes.moved(&taps, &sides.errors(&moved.point)))?.gain)
    };
    let norms = moved.iter().map(norm).collect::<Result<Vec<_>, DesignError>>()?;
    let worst = (0..norms.len()).max_by(|&a, &b| norms[a].total_cmp(&norms[b])).unwrap_or(0);
    let peak = plant.fir_norm(&taps)?;
    let tracked = RobustNorms { nominal: peak.gain, worst: norms[worst].max(peak.gain) };
    let of_fixed = largest(moved.iter().map(|moved| Ok(moved.plant.fir_norm(fixed_taps)?.gain)))?;
    let ratios = norms.iter().zip(&within_reach).map(|(norm, reach)| norm / reach);
    let ratio = ratios.fold(peak.gain / nominal, f64::max);
    let (_, redesigned) = fir::bracket(&moved[worst].plant, settings.taps, ACCURACY)?;
    let study = TrackingStudy {
        errors: problem.errors.clone(),
        tracked,
        fixed: RobustNorms { nominal: fixed.peak.gain, worst: of_fixed },
        redesigned,
        ratio,
        least_ratio: exchange.lower.min(ratio),
        scenarios: moved.len(),
        pairs: exchange.frequencies().count(),
    };
    Ok(Synthesis {
        filters: Filters::Fir(taps),
        peak,
        lower: fixed.lower.min(peak.gain),
        noncausal: fixed.noncausal.min(peak.gain),
        iterations: fixed.iterations + exchange.iterations,
        dual: fixed.dual,
        robust: None,
        affine: Some(AffineDesign { slopes, study }),
    })
}

/// The norms that are within reach without errors, where a fixed bank has gain `nominal`, and of each plant.
fn within_reach(moved: &[MovedPlant], nominal: f64) -> Result<(f64, Vec<f64>), DesignError> {
    let bounds = moved.iter().map(|moved| Ok(moved.plant.noncausal_bound()?.gain.max(nominal)));
    let mut within_reach = bounds.collect::<Result<Vec<_>, DesignError>>()?;
    let floor = LEAST_REACH * within_reach.iter().copied().fold(0.0, f64::max);
    within_reach.iter_mut().for_each(|reach| *reach = reach.max(floor));
    Ok((nominal.max(floor), within_reach))
}

/// The delays that move.
struct Sides {
    /// The channels, from 0.
    channels: Vec<usize>,
    /// By how much the delay of each of them may be off.
    halves: Vec<Seconds>,
    fast_period: Seconds,
    /// N.
    count: usize,
}

impl Sides {
    fn new(problem: &RobustProblem) -> Self {
        let delays = &problem.errors.delays;
        let channels: Vec<usize> = (0..delays.len()).filter(|&j| delays[j].0 > 0.0).collect();
        let halves = channels.iter().map(|&j| delays[j]).collect();
        Self { channels, halves, fast_period: problem.spec.fast_period, count: delays.len() }
    }

    /// Of one scenario: 1, and the share of each half-width.
    fn factors(&self, point: &ErrorPoint) -> Vec<f64> {
        let share = |(&j, half): (&usize, &Seconds)| point.delays[j].0 / half.0;
        std::iter::once(1.0).chain(self.channels.iter().zip(&self.halves).map(share)).collect()
    }

    fn errors(&self, point: &ErrorPoint) -> Vec<FastPeriods> {
        point.delays.iter().map(|delay| delay.in_fast_periods(self.fast_period)).collect()
    }

    /// F_0 as taps per channel, and the slopes per fast period.
    fn split(&self, found: &Taps, length: usize) -> (Vec<Vec<f64>>, TapSlopes) {
        let part = |k: usize, scale: f64| {
            let lags: Vec<Mat> =
                found.iter().map(|lag| lag.columns(k * self.count, self.count) / scale).collect();
            impulse_responses(&lags, length)
        };
        let mut by_delay = vec![Vec::new(); self.count];
        for (k, (&j, half)) in self.channels.iter().zip(&self.halves).enumerate() {
            by_delay[j] = part(k + 1, half.in_fast_periods(self.fast_period).0);
        }
        (part(0, 1.0), TapSlopes { by_delay })
    }

    /// The plant without errors, then the scenarios, each relative to what is within reach there.
    fn grid<'a>(
        &self,
        (plant, nominal): (&'a LiftedPlant, f64),
        moved: &'a [MovedPlant],
        within_reach: &[f64],
        settings: &Settings,
    ) -> ErrorGrid<'a> {
        let scenario = |plant: &'a LiftedPlant, point: &ErrorPoint, reach: f64| {
            Scenario::new(plant, self.factors(point), 1.0 / reach)
        };
        let mut scenarios = vec![scenario(plant, &ErrorPoint::none(self.count), nominal)];
        let with_errors = moved.iter().zip(within_reach);
        scenarios.extend(with_errors.map(|(moved, reach)| scenario(&moved.plant, &moved.point, *reach)));
        ErrorGrid::of_scenarios(scenarios, tap_lags(plant.ratio(), settings.taps)[0])
    }

    fn exchange<'a>(
        &self,
        plant: &LiftedPlant,
        grid: ErrorGrid<'a>,
        settings: &Settings,
    ) -> Result<Exchange<ErrorGrid<'a>>, DesignError> {
        let (points, weights) = self.first_points(&grid);
        let noise = self.noise(&plant.problem().noise, grid.scenarios());
        let margin = settings.gamma_margin.unwrap_or(MARGIN).max(MARGIN);
        let problem = SampledProblem::new(points, tap_lags(plant.ratio(), settings.taps))?;
        Exchange::new(grid, problem, MeanSquareObjective { weights, noise }, margin)
    }

    /// Some points of each scenario with their weights: the scenarios take turns, so that there are about as
    /// many points as for the centre and the ends of each side alone.
    fn first_points(&self, grid: &ErrorGrid<'_>) -> (Vec<Point>, Vec<f64>) {
        let count = grid.scenarios().len();
        let stride = count.div_ceil(2 * self.channels.len() + 1);
        let (mut points, mut weights) = (Vec::new(), Vec::new());
        for scenario in 0..count {
            let (coarse, of_coarse) = grid.coarse(scenario);
            for k in (scenario % stride..coarse.len()).step_by(stride) {
                points.push(coarse[k].clone());
                weights.push(of_coarse[k] * stride as f64 / count as f64);
            }
        }
        (points, weights)
    }

    /// Power of the noise of the channels `[H; delta_1 H; ..]`: that of the output's noise, averaged over
    /// the scenarios, whose shares are uncorrelated.
    fn noise(&self, of_channels: &[f64], scenarios: &[Scenario<'_>]) -> Vec<f64> {
        let square = |k: usize| scenarios.iter().map(|scenario| scenario.factors[k].powi(2)).sum::<f64>();
        let mean = |k: usize| square(k) / scenarios.len() as f64;
        (0..=self.channels.len()).flat_map(|k| of_channels.iter().map(move |power| power * mean(k))).collect()
    }
}
