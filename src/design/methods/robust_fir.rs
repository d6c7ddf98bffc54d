//! FIR design for delays, gains and cut-offs that are known up to a box of errors only.
//!
//! The taps minimise the largest norm over scenarios: points of the box, each with a plant of its own. A
//! scenario is nothing but more frequencies, so the exchange of [`crate::design::exchange`] solves it: it adds
//! pairs of a frequency and a scenario where the error peaks, not whole grids per scenario, and its dual stays
//! a lower bound for all banks of that length over the box. Scenario s is put at the frequencies 2 pi s +
//! omega. All responses in whole lags are the same there, so the exchange needs to know nothing of scenarios.

use super::{Filters, Settings, Synthesis, fir};
use crate::design::DesignError;
use crate::design::error_grid::ErrorGrid;
use crate::design::exchange::{AffineError, Exchange, Peaks};
use crate::design::filters::impulse_responses;
use crate::design::plant::LiftedPlant;
use crate::design::problem::Problem;
use crate::design::uncertainty::sides::{Side, point_at, sides};
use crate::linalg::CMat;
use crate::lmi::sampled::{MeanSquareObjective, Point, Problem as SampledProblem, Taps};
use crate::lti::peak::Peak;
use crate::spec::Spec;
use crate::verify::uncertainty::{ErrorBox, ErrorPoint};
use std::f64::consts::{PI, TAU};

/// Relative width of the interval of the worst norm over the scenarios.
const ACCURACY: f64 = 1e-4;
/// Relative margin of that norm for the least mean square without errors.
const MARGIN: f64 = 2e-4;
/// A nominal bank whose worst norm is within this of a lower bound is kept.
const NO_GAIN: f64 = 1e-3;
/// Most scenarios.
const MAX_SCENARIOS: usize = 64;
/// Points on each side of the box that are tried, most first.
const STEPS: [usize; 4] = [9, 5, 3, 2];

/// What a robust design is made for.
#[derive(Debug, Clone)]
pub(crate) struct RobustProblem {
    /// The spec with all defaults.
    pub(crate) spec: Spec,
    /// The box.
    pub(crate) errors: ErrorBox,
}

/// The norms of a bank, computed (h = 1).
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct RobustNorms {
    /// Without errors.
    pub nominal: f64,
    /// The largest over the scenarios.
    pub worst: f64,
}

/// The comparison of a robust design with one that takes the errors for zero.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct RobustStudy {
    /// The box.
    pub errors: ErrorBox,
    /// Of this bank.
    pub robust: RobustNorms,
    /// Of the bank that is optimal without errors.
    pub nominal: RobustNorms,
    /// No FIR bank of this length has a smaller worst norm over the box (computed).
    pub lower: f64,
    /// Points of the box with a plant of their own.
    pub scenarios: usize,
    /// Pairs of a frequency and a scenario at the end; 0 if the nominal bank was kept.
    pub pairs: usize,
}

impl RobustStudy {
    /// The share by which the robust bank lowers the worst norm.
    pub fn gain(&self) -> f64 {
        if self.nominal.worst > 0.0 { 1.0 - self.robust.worst / self.nominal.worst } else { 0.0 }
    }
}

/// The `settings.taps` taps per channel of least norm over the scenarios, within 3e-4.
///
/// # Errors
/// As [`fir::synthesise`].
pub(crate) fn synthesise(
    plant: &LiftedPlant,
    settings: &Settings,
    problem: &RobustProblem,
) -> Result<Synthesis, DesignError> {
    let nominal = fir::synthesise(plant, settings)?;
    let Filters::Fir(taps) = &nominal.filters else { return Ok(nominal) };
    let points = scenarios(&problem.errors);
    let plants =
        points.iter().map(|point| moved_plant(problem, plant, point)).collect::<Result<Vec<_>, _>>()?;
    let worst = |taps: &[Vec<f64>]| largest(plants.iter().map(|plant| Ok(plant.fir_norm(taps)?.gain)));
    let of_nominal = RobustNorms { nominal: nominal.peak.gain, worst: worst(taps)? };
    // Whatever the taps, each scenario alone has the error that no bank avoids.
    let unavoidable =
        largest(plants.iter().map(|plant| Ok(plant.noncausal_bound()?.gain)))?.max(nominal.lower);
    let study = RobustStudy {
        errors: problem.errors.clone(),
        robust: of_nominal,
        nominal: of_nominal,
        lower: unavoidable.min(of_nominal.worst),
        scenarios: plants.len(),
        pairs: 0,
    };
    if of_nominal.worst <= unavoidable * (1.0 + NO_GAIN) {
        return Ok(Synthesis { robust: Some(study), ..nominal });
    }
    let mut exchange = exchange(plant, &plants, settings)?;
    let found = exchange.optimise_to(ACCURACY)?;
    let robust_taps = impulse_responses(&found.taps, settings.taps);
    let peak = plant.fir_norm(&robust_taps)?;
    let robust = RobustNorms { nominal: peak.gain, worst: worst(&robust_taps)? };
    let lower = exchange.lower.max(unavoidable).min(robust.worst);
    let pairs = exchange.frequencies().count();
    let study = RobustStudy { robust, lower, pairs, ..study };
    // The nominal bank is one of the candidates.
    if robust.worst >= of_nominal.worst {
        return Ok(Synthesis { robust: Some(RobustStudy { robust: of_nominal, ..study }), ..nominal });
    }
    Ok(Synthesis {
        filters: Filters::Fir(robust_taps),
        peak,
        lower: nominal.lower.min(peak.gain),
        noncausal: nominal.noncausal.min(peak.gain),
        iterations: nominal.iterations + exchange.iterations,
        dual: nominal.dual,
        robust: Some(study),
    })
}

fn largest(mut values: impl Iterator<Item = Result<f64, DesignError>>) -> Result<f64, DesignError> {
    values.try_fold(0.0, |most, value| Ok(f64::max(most, value?)))
}

fn exchange<'a>(
    plant: &'a LiftedPlant,
    plants: &'a [LiftedPlant],
    settings: &Settings,
) -> Result<Exchange<Sheets<'a>>, DesignError> {
    let ratio = plant.ratio();
    let lags: Vec<usize> = (0..ratio).map(|p| settings.taps.saturating_sub(p).div_ceil(ratio)).collect();
    let grids: Vec<ErrorGrid<'a>> =
        std::iter::once(plant).chain(plants).map(|plant| ErrorGrid::new(plant, lags[0])).collect();
    let (points, weights) = grids[0].coarse();
    let noise = plant.problem().noise.clone();
    let sheets = Sheets { grids, inputs: plant.channels() + ratio };
    let points = points.into_iter().map(|point| sheets.padded(point)).collect();
    let margin = settings.gamma_margin.unwrap_or(MARGIN).max(MARGIN);
    Exchange::new(sheets, SampledProblem::new(points, lags)?, MeanSquareObjective { weights, noise }, margin)
}

/// The errors of all scenarios, each on its own stretch of frequencies; the first one is that without errors.
struct Sheets<'a> {
    grids: Vec<ErrorGrid<'a>>,
    /// Columns of all responses.
    inputs: usize,
}

impl Sheets<'_> {
    /// Responses with columns of zeros, where a scenario with coinciding instants has fewer.
    fn padded(&self, point: Point) -> Point {
        let pad = |m: CMat| m.resize_horizontally(self.inputs, Default::default());
        Point { omega: point.omega, w: pad(point.w), h: pad(point.h) }
    }
}

impl AffineError for Sheets<'_> {
    fn at(&self, omega: f64) -> Point {
        // Frequencies lie in [0, pi] of their stretch; half a radian keeps clear of the rounding at its ends.
        let sheet = (((omega + 0.5) / TAU).floor() as usize).min(self.grids.len() - 1);
        let frequency = (omega - TAU * sheet as f64).clamp(0.0, PI);
        Point { omega, ..self.padded(self.grids[sheet].at(frequency)) }
    }

    fn peaks(&self, taps: &Taps, _gamma: f64, level: f64) -> Result<Peaks, DesignError> {
        let mut all = Peaks { estimate: 0.0, peaks: Vec::new() };
        for (sheet, grid) in self.grids.iter().enumerate() {
            let Peaks { estimate, peaks } = grid.peaks(taps)?;
            all.estimate = all.estimate.max(estimate);
            let shifted = |peak: Peak| Peak { frequency: peak.frequency + TAU * sheet as f64, ..peak };
            // Of each scenario the highest peak: the others mostly fall with it.
            let highest =
                peaks.into_iter().filter(|peak| peak.gain > level).max_by(|a, b| a.gain.total_cmp(&b.gain));
            all.peaks.extend(highest.map(shifted));
        }
        Ok(all)
    }
}

/// The plant at a point of the box.
fn moved_plant(
    problem: &RobustProblem,
    plant: &LiftedPlant,
    point: &ErrorPoint,
) -> Result<LiftedPlant, DesignError> {
    let moved = Problem::with_errors(&problem.spec, plant.problem().latency, point)?;
    LiftedPlant::new(&moved)
}

/// Points of the box: a lattice over all sides, or its ends where there are many, or its most different
/// corners where there are very many.
fn scenarios(errors: &ErrorBox) -> Vec<ErrorPoint> {
    let sides = sides(errors);
    // The error is affine in the gains: only their ends matter.
    let steps = |side: &Side, most: usize| if matches!(side, Side::Gain(_)) { 2 } else { most };
    let count = |most: usize| sides.iter().fold(1usize, |all, side| all.saturating_mul(steps(side, most)));
    match STEPS.into_iter().find(|&most| count(most) <= MAX_SCENARIOS) {
        Some(most) => {
            let per_side: Vec<usize> = sides.iter().map(|side| steps(side, most)).collect();
            (0..count(most)).map(|index| lattice_point(errors, &sides, &per_side, index)).collect()
        }
        None => corners(errors, &sides),
    }
}

fn lattice_point(errors: &ErrorBox, sides: &[Side], per_side: &[usize], index: usize) -> ErrorPoint {
    let mut rest = index;
    let shares: Vec<f64> = per_side
        .iter()
        .map(|&count| {
            let step = rest % count;
            rest /= count;
            2.0 * step as f64 / (count - 1) as f64 - 1.0
        })
        .collect();
    point_at(errors, sides, &shares)
}

/// Rows of a Hadamard matrix and their opposites: corners that differ from each other in half of the sides.
fn corners(errors: &ErrorBox, sides: &[Side]) -> Vec<ErrorPoint> {
    let sign = |row: usize, side: usize| if (row & side).count_ones().is_multiple_of(2) { 1.0 } else { -1.0 };
    (0..MAX_SCENARIOS)
        .map(|corner| {
            let (row, opposite) = (corner / 2, if corner % 2 == 0 { 1.0 } else { -1.0 });
            let shares: Vec<f64> = (0..sides.len()).map(|side| opposite * sign(row, side)).collect();
            point_at(errors, sides, &shares)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::{ProofSearch, design_with};
    use crate::units::Seconds;

    /// The thesis example with 22 taps and delays that are off by up to `half`, all of them.
    fn thesis(half: f64) -> Spec {
        let text = format!(
            "{}\n[uncertainty]\ndelay = {half}\nreference = 0\n",
            include_str!("../../../filters/thesis-fir.toml")
        );
        Spec::from_toml(&text, "spec.toml").unwrap()
    }

    /// By an independent semidefinite program on 5 x 5 delays and 61 frequencies.
    #[test]
    fn robust_optima_are_those_of_a_semidefinite_program() {
        for (half, robust, nominal) in
            [(0.05, 0.0421756, 0.0421799), (0.1, 0.0442877, 0.0478338), (0.2, 0.0635326, 0.0682)]
        {
            let designed = design_with(&thesis(half), ProofSearch::Skip).unwrap();
            let study = designed.robust.unwrap();
            assert!((study.robust.worst / robust - 1.0).abs() < 1e-3, "{study:?}");
            assert!((study.nominal.worst / nominal - 1.0).abs() < 1e-3, "{study:?}");
            assert!(
                study.lower <= study.robust.worst && study.lower > study.robust.worst * (1.0 - 1e-3),
                "{study:?}"
            );
            assert_eq!(designed.bank.gamma.norm, Some(study.robust.nominal));
            assert!(study.robust.nominal < 1.04 * 0.039932 && study.pairs < 400, "{study:?}");
        }
    }

    /// The file states a worst case that `verify` proves, and it refuses a smaller one.
    #[test]
    fn the_worst_case_is_stated_and_proven() {
        let mut bank = design_with(&thesis(0.1), ProofSearch::Run).unwrap().bank;
        let stated = bank.gamma.worst_case.unwrap();
        assert!(stated > 0.0442877 * (1.0 - 1e-3) && stated < 0.0442877 * 1.007, "{stated}");
        assert!(crate::verify::verify(&bank).is_ok());
        bank.gamma.worst_case = Some(0.98 * stated);
        let refused = crate::verify::verify(&bank).unwrap_err();
        assert_eq!(refused, crate::verify::VerifyError::WorstCase { stated: 0.98 * stated });
    }

    #[test]
    fn a_table_without_errors_changes_nothing() {
        let plain = Spec { uncertainty: None, ..thesis(0.1) };
        let (with, without) = (
            design_with(&thesis(0.0), ProofSearch::Skip).unwrap(),
            design_with(&plain, ProofSearch::Skip).unwrap(),
        );
        assert_eq!((with.bank.filters, with.robust), (without.bank.filters, None));
    }

    #[test]
    fn scenarios_reach_the_ends_of_every_side() {
        let none = ErrorBox::none(8);
        let two =
            ErrorBox { delays: [vec![Seconds(0.1); 2], vec![Seconds(0.0); 6]].concat(), ..none.clone() };
        let both = ErrorBox { gains: vec![0.01; 8], ..two.clone() };
        for (errors, count) in [(none.clone(), 1), (two, 25), (both, MAX_SCENARIOS)] {
            let points = scenarios(&errors);
            assert_eq!(points.len(), count);
            for i in 0..8 {
                let (delay, gain) = (errors.delays[i], errors.gains[i]);
                assert!(points.iter().any(|point| point.delays[i] == delay && point.gains[i] == gain));
                assert!(points.iter().any(|point| point.delays[i] == -delay || delay.0 == 0.0));
                assert!(
                    points
                        .iter()
                        .all(|point| point.delays[i].0.abs() <= delay.0 && point.gains[i].abs() <= gain)
                );
            }
        }
    }
}
