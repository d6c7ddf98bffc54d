//! Along the orders: candidates by truncation, each read in the best way; the poles of the chosen one moved.

use super::dynamics::Dynamics;
use super::poles::{Aim, moved};
use super::readout::{Samples, mean_square};
use super::{Figures, OrderReduction, OrderWorth, Subject};
use crate::design::{DesignError, error_system};
use crate::lti::TappedRecursion;
use crate::lti::gramian::h2_norm;
use std::collections::BTreeMap;

/// Lengths of the line that are tried.
const LINES: usize = 8;
/// Splits of the states whose gamma is computed, those of least mean-square error.
const FINALISTS: usize = 3;
/// A longer line is taken if gamma (as roughly known) is worse by no more than this: lines run faster than recursions.
const WORSE: f64 = 1e-4;
/// All orders are looked at while the squares of the unknowns of all of them are fewer than this.
const CHEAP: f64 = 1e5;
/// Evaluations of a descent: at most these, and fewer where each takes long.
const EVALUATIONS: f64 = 80.0;
const EFFORT: f64 = 4e5;
/// Poles of a reduced bank keep this distance from the unit circle.
const MARGIN: f64 = 1e-9;
/// Losses below this are rounding, decibels.
const ROUNDING_DB: f64 = 5e-5;
/// Errors below this fraction of the plant's size are zero.
const ZERO: f64 = 1e-12;

/// A bank of some order.
#[derive(Debug, Clone)]
struct Found<'a> {
    dynamics: Dynamics,
    bank: TappedRecursion,
    figures: Figures,
    /// With the frequencies that matter to it.
    samples: Samples<'a>,
}

pub(super) struct Walk<'a> {
    subject: &'a Subject<'a>,
    samples: Samples<'a>,
    /// For each length of the line the whole recursion behind it, balanced.
    splits: Vec<Dynamics>,
    full: Figures,
    found: BTreeMap<usize, Found<'a>>,
    zero: f64,
}

impl<'a> Walk<'a> {
    pub(super) fn new(subject: &'a Subject<'a>) -> Result<Self, DesignError> {
        let system = &subject.plant.system;
        Ok(Self {
            subject,
            samples: Samples::new(subject.plant)?,
            splits: splits(subject)?,
            full: figures(subject, &TappedRecursion::new(subject.bank)?)?,
            found: BTreeMap::new(),
            zero: ZERO * (system.c().norm() * system.b().norm() + system.d().norm()),
        })
    }

    /// The order of the best bank of at most `order` states.
    pub(super) fn at_most(&mut self, order: usize) -> Result<usize, DesignError> {
        if self.is_cheap() {
            (0..self.subject.order).try_for_each(|order| self.visit(order))?;
        }
        if order >= self.subject.order {
            return Ok(self.subject.order);
        }
        // Order 0 always has a stable candidate.
        for order in (0..=order).rev() {
            self.visit(order)?;
            if self.best(order).is_some() {
                break;
            }
        }
        self.move_poles(order)?;
        Ok(order)
    }

    /// The least order found whose loss is at most `db`.
    pub(super) fn within(&mut self, db: f64) -> Result<usize, DesignError> {
        let allowed = db + ROUNDING_DB;
        let mut order = if self.is_cheap() { self.first_within(allowed)? } else { self.bisect(allowed)? };
        // Moving the poles of a smaller one may bring it within the loss.
        while order > 0 {
            self.visit(order - 1)?;
            self.move_poles(order - 1)?;
            if self.loss_of(order - 1) > allowed {
                break;
            }
            order -= 1;
        }
        Ok(order)
    }

    fn is_cheap(&self) -> bool {
        let orders = self.subject.order as f64;
        orders * self.unknowns(self.subject.order).powi(2) <= CHEAP
    }

    /// Numbers that are read from a bank with so many states.
    fn unknowns(&self, order: usize) -> f64 {
        let plant = self.subject.plant;
        (plant.wanted * (order + plant.measured)) as f64
    }

    fn first_within(&mut self, allowed: f64) -> Result<usize, DesignError> {
        (0..self.subject.order).try_for_each(|order| self.visit(order))?;
        let within = |order: &usize| self.loss_of(*order) <= allowed;
        Ok((0..self.subject.order).find(within).unwrap_or(self.subject.order))
    }

    fn bisect(&mut self, allowed: f64) -> Result<usize, DesignError> {
        let (mut low, mut high) = (0, self.subject.order);
        while low < high {
            let middle = low + (high - low) / 2;
            self.visit(middle)?;
            if self.loss_of(middle) <= allowed { high = middle } else { low = middle + 1 }
        }
        Ok(high)
    }

    /// What the method minimises.
    fn merit(&self, figures: &Figures) -> f64 {
        match self.subject.aim {
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

    /// The best bank found of at most `order` states; the smaller one where two are alike.
    fn best(&self, order: usize) -> Option<&Found<'a>> {
        let merit = |found: &Found<'_>| self.merit(&found.figures);
        self.found.range(..=order).map(|(_, found)| found).min_by(|a, b| merit(a).total_cmp(&merit(b)))
    }

    /// Finds a bank of `order` states by truncation, unless that has been done.
    fn visit(&mut self, order: usize) -> Result<(), DesignError> {
        if self.found.contains_key(&order) {
            return Ok(());
        }
        let mut best: Option<(f64, Dynamics)> = None;
        for (norm, dynamics) in self.finalists(order)? {
            let rough = match self.subject.aim {
                Aim::WorstCase => self.samples.rough_gamma(&dynamics)?,
                Aim::MeanSquare => norm,
            };
            if best.as_ref().is_none_or(|(least, _)| rough <= least * (1.0 + WORSE)) {
                best = Some((rough, dynamics));
            }
        }
        if let Some((_, dynamics)) = best {
            let found = self.read(dynamics, &self.samples)?;
            self.found.insert(order, found);
        }
        Ok(())
    }

    /// The splits of `order` states with the least mean-square error, that error first; short lines first.
    fn finalists(&self, order: usize) -> Result<Vec<(f64, Dynamics)>, DesignError> {
        let mut tried = Vec::new();
        for split in &self.splits {
            let line = split.ticks * self.subject.width;
            if line > order {
                continue;
            }
            let dynamics = split.truncated(order - line);
            if dynamics.radius() < 1.0 - MARGIN {
                tried.push((mean_square(self.subject.plant, &dynamics)?.1, dynamics));
            }
        }
        tried.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        tried.truncate(FINALISTS);
        tried.sort_by_key(|(_, dynamics)| dynamics.ticks);
        Ok(tried)
    }

    /// The best bank with these dynamics.
    fn read(&self, dynamics: Dynamics, samples: &Samples<'a>) -> Result<Found<'a>, DesignError> {
        let mut samples = samples.clone();
        let bank = match self.subject.aim {
            Aim::WorstCase => samples.best_bank(&dynamics, self.subject.gamma_margin)?,
            Aim::MeanSquare => dynamics.read_by(&mean_square(self.subject.plant, &dynamics)?.0)?,
        };
        let figures = figures(self.subject, &bank)?;
        Ok(Found { dynamics, bank, figures, samples })
    }

    /// Improves the bank of `order` states by moving its poles.
    fn move_poles(&mut self, order: usize) -> Result<(), DesignError> {
        let Some(start) = self.found.get(&order) else { return Ok(()) };
        let budget = (EFFORT / self.unknowns(order).powi(2)).clamp(0.0, EVALUATIONS) as usize;
        if self.merit(&start.figures) <= self.merit(&self.full).max(self.zero) {
            return Ok(());
        }
        let dynamics = moved(self.subject.aim, &start.samples, &start.dynamics, budget)?;
        let found = self.read(dynamics, &start.samples)?;
        if self.merit(&found.figures) < self.merit(&self.found[&order].figures) {
            self.found.insert(order, found);
        }
        Ok(())
    }

    fn worth(&self, order: usize, figures: Figures) -> OrderWorth {
        OrderWorth { order, figures, loss_db: self.loss(&figures) }
    }

    /// The bank of `order` states, unless that is the full one, and the record.
    pub(super) fn finish(&self, order: usize) -> (Option<TappedRecursion>, OrderReduction) {
        let full = self.worth(self.subject.order, self.full);
        let chosen = self.best(order).filter(|_| order < self.subject.order);
        let states = |found: &Found<'_>| found.dynamics.tail() + found.dynamics.ticks * self.subject.width;
        let reduced = chosen.map_or(full, |found| self.worth(states(found), found.figures));
        let orders = self.found.keys().filter_map(|&k| Some(self.worth(k, self.best(k)?.figures)));
        let record = OrderReduction { full, reduced, orders: orders.chain([full]).collect() };
        (chosen.map(|found| found.bank.clone()), record)
    }
}

/// The exact figures of a bank.
fn figures(subject: &Subject<'_>, bank: &TappedRecursion) -> Result<Figures, DesignError> {
    let error = error_system::error_system(subject.plant, &bank.realise()?)?;
    let gamma = crate::lti::peak::hinf_norm(&error)?.gain;
    Ok(Figures { gamma, rms_error: h2_norm(&error)? / (subject.plant.wanted as f64).sqrt() })
}

/// The full bank, for some lengths of the line with the recursion behind it balanced.
fn splits(subject: &Subject<'_>) -> Result<Vec<Dynamics>, DesignError> {
    let longest = TappedRecursion::new(subject.bank)?.ticks();
    let reach = super::readout::reach(subject.plant, subject.bank)?;
    let mut lengths: Vec<usize> =
        (0..=LINES.min(longest)).map(|k| k * longest / LINES.min(longest).max(1)).collect();
    lengths.dedup();
    lengths.into_iter().map(|ticks| Dynamics::balanced(subject.bank, ticks, &reach)).collect()
}
