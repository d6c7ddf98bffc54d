//! The order search: weighted truncations of the full bank, each with its best output matrices.

use super::plant_samples::PlantSamples;
use super::settings::SETTINGS;
use super::truncation::{ReducedRecursion, balanced, mean_square_bank};
use super::{Aim, OrderErrorPoint, OrderReduction, ReductionErrors, ReductionProblem};
use crate::design::DesignError;
use crate::lti::StateSpace;
use crate::lti::gramian::h2_norm;
use crate::lti::peak::hinf_norm;
use std::collections::BTreeMap;

/// Orders on each side of the chosen one in the order/error trade-off.
const BESIDE: usize = 2;

/// The bank found for an order.
#[derive(Debug, Clone)]
struct ReducedBank {
    bank: StateSpace,
    figures: ReductionErrors,
}

/// The search along the orders.
pub(super) struct OrderSearch<'a> {
    problem: &'a ReductionProblem<'a>,
    samples: PlantSamples<'a>,
    /// All states of the full bank, balanced.
    balanced: StateSpace,
    full: ReductionErrors,
    banks: BTreeMap<usize, ReducedBank>,
    zero: f64,
}

impl<'a> OrderSearch<'a> {
    pub(super) fn new(problem: &'a ReductionProblem<'a>) -> Result<Self, DesignError> {
        let system = problem.plant.system();
        Ok(Self {
            problem,
            samples: PlantSamples::new(problem.plant, problem.stop)?,
            balanced: balanced(problem.plant, problem.bank)?,
            full: figures(problem, problem.bank)?,
            banks: BTreeMap::new(),
            zero: SETTINGS.zero_error * (system.c().norm() * system.b().norm() + system.d().norm()),
        })
    }

    /// Finds banks of `order` states and of some more and fewer.
    pub(super) fn around(&mut self, order: usize) -> Result<(), DesignError> {
        let last = (order + BESIDE + 1).min(self.problem.order);
        (order.saturating_sub(BESIDE)..last).try_for_each(|order| self.visit(order))
    }

    /// The least order found whose loss is at most `db`.
    pub(super) fn within(&mut self, db: f64) -> Result<usize, DesignError> {
        let (mut low, mut high) = (0, self.problem.order);
        while low < high && !self.problem.stop.is_due() {
            let middle = low + (high - low) / 2;
            self.visit(middle)?;
            if self.loss_of(middle) <= db + SETTINGS.rounding_db { high = middle } else { low = middle + 1 }
        }
        Ok(high)
    }

    /// The quantity that the method minimises.
    fn merit(&self, figures: &ReductionErrors) -> f64 {
        match self.problem.aim {
            Aim::WorstCase => figures.gamma,
            Aim::MeanSquare => figures.rms_error,
        }
    }

    fn loss(&self, figures: &ReductionErrors) -> f64 {
        let size = |figures| self.merit(figures).max(self.zero);
        20.0 * (size(figures) / size(&self.full)).log10()
    }

    fn loss_of(&self, order: usize) -> f64 {
        self.best(order).map_or(f64::INFINITY, |found| self.loss(&found.figures))
    }

    /// The best bank found of at most `order` states; the smaller one if two are equal.
    fn best(&self, order: usize) -> Option<&ReducedBank> {
        let merit = |found: &ReducedBank| self.merit(&found.figures);
        self.banks.range(..=order).map(|(_, found)| found).min_by(|a, b| merit(a).total_cmp(&merit(b)))
    }

    /// Finds a bank of `order` states by truncation, unless there is one.
    fn visit(&mut self, order: usize) -> Result<(), DesignError> {
        if !self.banks.contains_key(&order) {
            let found = self.with_best_outputs(&ReducedRecursion::of(&self.balanced, order))?;
            self.banks.insert(order, found);
        }
        Ok(())
    }

    /// The best bank with this recursion.
    fn with_best_outputs(&self, recursion: &ReducedRecursion) -> Result<ReducedBank, DesignError> {
        let bank = match self.problem.aim {
            Aim::WorstCase => self.samples.best_bank(recursion, self.problem.gamma_margin)?,
            Aim::MeanSquare => mean_square_bank(self.problem.plant, recursion)?,
        };
        Ok(ReducedBank { figures: figures(self.problem, &bank)?, bank })
    }

    fn point(&self, order: usize, figures: ReductionErrors) -> OrderErrorPoint {
        OrderErrorPoint { order, figures, loss_db: self.loss(&figures) }
    }

    /// The bank of `order` states, unless that is the full one, and the trade-off.
    pub(super) fn finish(&self, order: usize) -> (Option<StateSpace>, OrderReduction) {
        let full = self.point(self.problem.order, self.full);
        let chosen = self.best(order).filter(|_| order < self.problem.order);
        let reduced = chosen.map_or(full, |found| self.point(found.bank.order(), found.figures));
        let orders = self.banks.keys().filter_map(|&k| Some(self.point(k, self.best(k)?.figures)));
        let orders = orders.chain([full]).collect();
        (chosen.map(|found| found.bank.clone()), OrderReduction { full, reduced, orders })
    }
}

/// The error of a bank.
fn figures(problem: &ReductionProblem<'_>, bank: &StateSpace) -> Result<ReductionErrors, DesignError> {
    let error = problem.plant.error_system(bank);
    let gamma = hinf_norm(&error)?.gain;
    Ok(ReductionErrors { gamma, rms_error: h2_norm(&error)? / (problem.plant.ratio() as f64).sqrt() })
}
