//! The order search: candidates by truncation, each with its best output matrices; the poles of the chosen
//! one are refined.

use super::dynamics::Dynamics;
use super::dynamics::{mean_square, state_covariance_root};
use super::plant_samples::PlantSamples;
use super::pole_refinement::{Refined, refined};
use super::{Aim, Figures, OrderErrorPoint, OrderReduction, ReductionProblem};
use crate::design::DesignError;
use crate::lti::FirWithTail;
use crate::lti::gramian::h2_norm;
use rand_core::SeedableRng;
use rand_pcg::Pcg64;
use std::collections::BTreeMap;

/// Relative accuracy of a gamma that only ranks candidates.
const RANKING_ACCURACY: f64 = 1e-4;
/// Lengths of the FIR head that are tried.
const HEADS: usize = 8;
/// Splits of the states whose gamma is computed: those of least mean-square error.
const FINALISTS: usize = 3;
/// Relative excess of the rough gamma up to which a longer FIR head is preferred, because it runs faster
/// than a recursion.
const HEAD_PREFERENCE: f64 = 1e-4;
/// All orders are searched if the squares of their unknowns sum to at most this.
const MAX_WORK_OF_ALL_ORDERS: f64 = 1e5;
/// Limit on the evaluations of a pole refinement, and the effort (evaluations times squared unknowns) that
/// lowers it.
const EVALUATIONS: usize = 80;
const MAX_REFINEMENT_WORK: f64 = 4e5;
/// Random poles from which a refinement starts, and the evaluations that rank them. The best ones go on.
const STARTS: usize = 10;
const SCREENING: usize = 16;
/// Evaluations of all starts.
const MULTI_START: usize = STARTS * SCREENING + 2 * EVALUATIONS;
const SEED: u64 = 2007;
/// Poles of a reduced bank keep this distance from the unit circle.
const STABILITY_MARGIN: f64 = 1e-9;
/// Losses below this are rounding errors, in decibels.
const ROUNDING_DB: f64 = 5e-5;
/// Errors below this fraction of the plant's gain count as zero.
const ZERO_ERROR: f64 = 1e-12;

/// The bank found for an order.
#[derive(Debug, Clone)]
struct ReducedBank<'a> {
    dynamics: Dynamics,
    bank: FirWithTail,
    figures: Figures,
    /// With the frequencies of its peaks.
    samples: PlantSamples<'a>,
}

/// The search along the orders.
pub(super) struct OrderSearch<'a> {
    problem: &'a ReductionProblem<'a>,
    samples: PlantSamples<'a>,
    /// For each length of the FIR head, all states of the tail, balanced.
    splits: Vec<Dynamics>,
    full: Figures,
    banks: BTreeMap<usize, ReducedBank<'a>>,
    /// The first failure of a pole refinement.
    failure: Option<DesignError>,
    zero: f64,
}

impl<'a> OrderSearch<'a> {
    pub(super) fn new(problem: &'a ReductionProblem<'a>) -> Result<Self, DesignError> {
        let system = problem.plant.system();
        Ok(Self {
            problem,
            samples: PlantSamples::new(problem.plant, problem.stop)?,
            splits: splits(problem)?,
            full: figures(problem, &FirWithTail::new(problem.bank)?)?,
            banks: BTreeMap::new(),
            failure: None,
            zero: ZERO_ERROR * (system.c().norm() * system.b().norm() + system.d().norm()),
        })
    }

    /// The order of the best bank of at most `order` states.
    pub(super) fn at_most(&mut self, order: usize) -> Result<usize, DesignError> {
        if self.is_cheap() {
            self.visit_all()?;
        }
        if order >= self.problem.order {
            return Ok(self.problem.order);
        }
        // Order 0 always has a stable candidate.
        for order in (0..=order).rev() {
            self.visit(order)?;
            if self.best(order).is_some() {
                break;
            }
        }
        self.refine_poles(order)?;
        Ok(order)
    }

    /// The least order found whose loss is at most `db`.
    pub(super) fn within(&mut self, db: f64) -> Result<usize, DesignError> {
        let allowed = db + ROUNDING_DB;
        let mut order = if self.is_cheap() { self.first_within(allowed)? } else { self.bisect(allowed)? };
        // Pole refinement may bring a smaller order within the loss.
        while order > 0 && !self.problem.stop.is_due() {
            self.visit(order - 1)?;
            self.refine_poles(order - 1)?;
            if self.loss_of(order - 1) > allowed {
                break;
            }
            order -= 1;
        }
        Ok(order)
    }

    fn is_cheap(&self) -> bool {
        let orders = self.problem.order as f64;
        orders * self.unknowns(self.problem.order).powi(2) <= MAX_WORK_OF_ALL_ORDERS
    }

    /// Entries of the output matrices of a bank with so many states.
    fn unknowns(&self, order: usize) -> f64 {
        let plant = self.problem.plant;
        (plant.ratio() * (order + plant.channels())) as f64
    }

    /// Every order below the full one, unless the search is ended.
    fn visit_all(&mut self) -> Result<(), DesignError> {
        let stop = self.problem.stop;
        (0..self.problem.order).take_while(|_| !stop.is_due()).try_for_each(|order| self.visit(order))
    }

    fn first_within(&mut self, allowed: f64) -> Result<usize, DesignError> {
        self.visit_all()?;
        let within = |order: &usize| self.loss_of(*order) <= allowed;
        Ok((0..self.problem.order).find(within).unwrap_or(self.problem.order))
    }

    fn bisect(&mut self, allowed: f64) -> Result<usize, DesignError> {
        let (mut low, mut high) = (0, self.problem.order);
        while low < high && !self.problem.stop.is_due() {
            let middle = low + (high - low) / 2;
            self.visit(middle)?;
            if self.loss_of(middle) <= allowed { high = middle } else { low = middle + 1 }
        }
        Ok(high)
    }

    /// The quantity that the method minimises.
    fn merit(&self, figures: &Figures) -> f64 {
        match self.problem.aim {
            Aim::WorstCase => figures.gamma,
            Aim::MeanSquare => figures.rms_error,
        }
    }

    fn loss(&self, figures: &Figures) -> f64 {
        let size = |figures| self.merit(figures).max(self.zero);
        20.0 * (size(figures) / size(&self.full)).log10()
    }

    fn loss_of(&self, order: usize) -> f64 {
        self.best(order).map_or(f64::INFINITY, |found| self.loss(&found.figures))
    }

    /// The best bank found of at most `order` states; the smaller one if two are equal.
    fn best(&self, order: usize) -> Option<&ReducedBank<'a>> {
        let merit = |found: &ReducedBank<'_>| self.merit(&found.figures);
        self.banks.range(..=order).map(|(_, found)| found).min_by(|a, b| merit(a).total_cmp(&merit(b)))
    }

    /// Finds a bank of `order` states by truncation, unless there is one.
    fn visit(&mut self, order: usize) -> Result<(), DesignError> {
        if self.banks.contains_key(&order) {
            return Ok(());
        }
        let mut best: Option<(f64, Dynamics)> = None;
        for (norm, dynamics) in self.finalists(order)? {
            let rough = match self.problem.aim {
                Aim::WorstCase => self.samples.worst_case(&dynamics, RANKING_ACCURACY)?.gamma,
                Aim::MeanSquare => norm,
            };
            if best.as_ref().is_none_or(|(least, _)| rough <= least * (1.0 + HEAD_PREFERENCE)) {
                best = Some((rough, dynamics));
            }
        }
        if let Some((_, dynamics)) = best {
            let found = self.with_best_outputs(dynamics, &self.samples)?;
            self.banks.insert(order, found);
        }
        Ok(())
    }

    /// The splits of `order` states with the least mean-square errors, which are returned beside them; short
    /// heads first.
    fn finalists(&self, order: usize) -> Result<Vec<(f64, Dynamics)>, DesignError> {
        let mut tried = Vec::new();
        for split in &self.splits {
            let head = split.lags * self.problem.width;
            if head > order {
                continue;
            }
            let dynamics = split.truncated(order - head);
            if dynamics.spectral_radius() < 1.0 - STABILITY_MARGIN {
                tried.push((mean_square(self.problem.plant, &dynamics)?.1, dynamics));
            }
        }
        tried.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        tried.truncate(FINALISTS);
        tried.sort_by_key(|(_, dynamics)| dynamics.lags);
        Ok(tried)
    }

    /// The best bank with these dynamics.
    fn with_best_outputs(
        &self,
        dynamics: Dynamics,
        samples: &PlantSamples<'a>,
    ) -> Result<ReducedBank<'a>, DesignError> {
        let mut samples = samples.clone();
        let bank = match self.problem.aim {
            Aim::WorstCase => samples.best_bank(&dynamics, self.problem.gamma_margin)?,
            Aim::MeanSquare => dynamics.with_outputs(&mean_square(self.problem.plant, &dynamics)?.0),
        };
        let figures = figures(self.problem, &bank)?;
        Ok(ReducedBank { dynamics, bank, figures, samples })
    }

    /// Improves the bank of `order` states by pole refinement. That is a local search: it starts from the
    /// truncation and, as far as the effort allows, from random poles.
    fn refine_poles(&mut self, order: usize) -> Result<(), DesignError> {
        let Some(truncation) = self.banks.get(&order) else { return Ok(()) };
        if self.problem.stop.is_due() {
            return Ok(());
        }
        if self.merit(&truncation.figures) <= self.merit(&self.full).max(self.zero) {
            return Ok(());
        }
        let affordable = (MAX_REFINEMENT_WORK / self.unknowns(order).powi(2)) as usize;
        let refine = |start: &Dynamics| {
            refined(self.problem.aim, &truncation.samples, start, affordable.min(EVALUATIONS))
        };
        let Refined { dynamics, failure, .. } = refine(&truncation.dynamics)?;
        let mut ends = vec![dynamics];
        if affordable >= MULTI_START {
            let promising = self.promising_start(order, &truncation.samples.coarse())?;
            ends.extend(promising.map(|start| refine(&start)).transpose()?.map(|end| end.dynamics));
        }
        let mut best = truncation.clone();
        for dynamics in ends {
            let found = self.with_best_outputs(dynamics, &truncation.samples)?;
            if self.merit(&found.figures) < self.merit(&best.figures) {
                best = found;
            }
        }
        self.banks.insert(order, best);
        self.failure = self.failure.take().or(failure);
        Ok(())
    }

    /// The best of the random dynamics after a short refinement.
    fn promising_start(
        &self,
        order: usize,
        samples: &PlantSamples<'_>,
    ) -> Result<Option<Dynamics>, DesignError> {
        let screened: Result<Vec<Refined>, _> = self
            .random_starts(order)
            .iter()
            .map(|start| refined(self.problem.aim, samples, start, SCREENING))
            .collect();
        let best = screened?.into_iter().min_by(|a, b| a.error.total_cmp(&b.error));
        Ok(best.map(|found| found.dynamics))
    }

    /// Random dynamics of `order` states, in turn for each head that leaves a tail of two states or more.
    fn random_starts(&self, order: usize) -> Vec<Dynamics> {
        let tail = |lags: usize| order.checked_sub(lags * self.problem.width).filter(|&r| r > 1);
        let shapes: Vec<(usize, usize)> =
            self.splits.iter().filter_map(|split| Some((split.lags, tail(split.lags)?))).collect();
        let mut generator = Pcg64::seed_from_u64(SEED);
        let inputs = self.problem.plant.channels();
        (0..STARTS)
            .zip(shapes.iter().cycle())
            .map(|(_, &(lags, r))| Dynamics::random(lags, r, inputs, &mut generator))
            .collect()
    }

    fn point(&self, order: usize, figures: Figures) -> OrderErrorPoint {
        OrderErrorPoint { order, figures, loss_db: self.loss(&figures) }
    }

    /// The bank of `order` states, unless that is the full one, and the trade-off.
    pub(super) fn finish(&self, order: usize) -> (Option<FirWithTail>, OrderReduction) {
        let full = self.point(self.problem.order, self.full);
        let chosen = self.best(order).filter(|_| order < self.problem.order);
        let states =
            |found: &ReducedBank<'_>| found.dynamics.tail_order() + found.dynamics.lags * self.problem.width;
        let reduced = chosen.map_or(full, |found| self.point(states(found), found.figures));
        let orders = self.banks.keys().filter_map(|&k| Some(self.point(k, self.best(k)?.figures)));
        let orders = orders.chain([full]).collect();
        let record = OrderReduction { full, reduced, orders, unrefined: self.failure.clone() };
        (chosen.map(|found| found.bank.clone()), record)
    }
}

/// The error of a bank.
fn figures(problem: &ReductionProblem<'_>, bank: &FirWithTail) -> Result<Figures, DesignError> {
    let error = problem.plant.error_system(&bank.realise());
    let gamma = crate::lti::peak::hinf_norm(&error)?.gain;
    Ok(Figures { gamma, rms_error: h2_norm(&error)? / (problem.plant.ratio() as f64).sqrt() })
}

/// The full bank with FIR heads of several lengths and balanced tails.
fn splits(problem: &ReductionProblem<'_>) -> Result<Vec<Dynamics>, DesignError> {
    let longest = FirWithTail::new(problem.bank)?.head_length();
    let state_root = state_covariance_root(problem.plant, problem.bank)?;
    let mut lengths: Vec<usize> =
        (0..=HEADS.min(longest)).map(|k| k * longest / HEADS.min(longest).max(1)).collect();
    lengths.dedup();
    lengths.into_iter().map(|lags| Dynamics::balanced(problem.bank, lags, &state_root)).collect()
}
