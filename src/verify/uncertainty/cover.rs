//! Covers all frequencies with cells and proves a bound in each of them.

use super::super::VerifyError;
use super::angle::{cosine_below, outward};
use super::at_frequency::Verdict;
use super::judge::Judge;
use super::memory::{Lags, Memory};
use super::{ErrorBox, ErrorPoint, WorstCase};
use crate::bank::Bank;
use crate::units::RadiansPerSlowPeriod;
use std::f64::consts::PI;

/// Factor by which the accuracy is relaxed where a frequency does not reach it, and the loosest accuracy.
const RELAXATION: f64 = 1.25;
const LOOSEST_RELAXATION: f64 = 100.0;
/// Limit on the cells of one proof, and more of them for each step by which the accuracy is relaxed.
const MAX_CELLS: usize = 20_000;
const MORE_CELLS: usize = 500;
/// Limit on the operations on balls for the accuracy that is asked for: half a minute or so. The same for
/// each step by which it is relaxed.
const MAX_OPERATIONS: f64 = 1e9;
const MORE_OPERATIONS: f64 = 5e7;
/// Cells whose bound exceeds the value at their centre by less than the square of this are not halved
/// further for the sake of remainders.
const NARROW_CELL: f64 = 0.02;
/// Cells that are so narrow are not halved for any reason.
const NARROWEST_CELL: f64 = 1e-6;
/// Share of the accuracy that the cut of the memory may use.
const TAIL_SHARE: f64 = 1e-3;
/// Relative size of what is not known of recursive filters.
const FILTER_TAIL: f64 = 1e-20;
/// Worst cases below this, relative to the reference samples, are zero up to rounding.
const ZERO_WORST_CASE: f64 = 1e-10;

/// The proof of one worst case.
pub(super) struct Cover<'a> {
    ratio: usize,
    judge: Judge<'a>,
    reference: Memory,
    lags: Lags,
    /// The upper end that is to be proven; without it one relative to the best lower end.
    goal: Option<f64>,
    /// Relative distance of the ends, as far as it is relaxed.
    accuracy: f64,
}

/// The error system as a polynomial in z^-1.
struct Polynomial {
    degree: f64,
    /// Bounds its distance from the error system.
    tail: f64,
}

/// The frequencies from `begin` to `end`.
#[derive(Debug, Clone, Copy)]
struct Cell {
    begin: f64,
    end: f64,
}

/// What is known of a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Outcome {
    Proven,
    /// Its halves may have a bound.
    Wide,
    /// Nothing is won by halving it.
    Narrow,
}

impl Cell {
    fn centre(self) -> f64 {
        0.5 * (self.begin + self.end)
    }

    fn halves(self) -> [Self; 2] {
        let centre = self.centre();
        [Self { end: centre, ..self }, Self { begin: centre, ..self }]
    }
}

impl Polynomial {
    /// Cells that are narrow enough for a bound.
    fn cells(&self) -> usize {
        ((1.6 * self.degree).ceil() as usize).max(4)
    }
}

impl<'a> Cover<'a> {
    /// # Errors
    /// See [`super::worst_case`].
    pub(super) fn new(bank: &'a Bank, errors: &'a ErrorBox) -> Result<Self, VerifyError> {
        let (judge, reference) = Judge::new(bank, errors)?;
        let lags = Lags::new(&bank.filters, bank.ratio, FILTER_TAIL).ok_or(VerifyError::LongMemory)?;
        Ok(Self { ratio: bank.ratio, judge, reference, lags, goal: None, accuracy: 0.0 })
    }

    /// Proves the gain of one point at a frequency, and keeps it if it is the largest so far.
    ///
    /// # Errors
    /// As [`super::worst_case`].
    pub(super) fn try_point(
        &mut self,
        point: &ErrorPoint,
        frequency: RadiansPerSlowPeriod,
    ) -> Result<(), VerifyError> {
        self.judge.try_point(point, frequency)
    }

    /// Both ends, as close as the work allows.
    ///
    /// # Errors
    /// [`VerifyError::WideBox`] if no upper end is proven.
    pub(super) fn prove(mut self, accuracy: f64) -> Result<WorstCase, VerifyError> {
        let upper = self.attempt(accuracy)?;
        let Self { judge, .. } = self;
        match (upper, judge.best) {
            (Some(upper), Some(best)) => Ok(WorstCase {
                lower: best.lower,
                upper,
                point: best.point,
                frequency: RadiansPerSlowPeriod(best.frequency),
                gains_computed: judge.gains_computed,
            }),
            _ => Err(VerifyError::WideBox),
        }
    }

    /// Whether it is proven that no norm in the box exceeds `gamma`.
    ///
    /// # Errors
    /// As [`super::worst_case`].
    pub(super) fn certifies(mut self, gamma: f64) -> Result<bool, VerifyError> {
        self.goal = Some(gamma);
        // The cut of the memory is to cost as little as with an accuracy of a per cent.
        Ok(self.attempt(0.01)?.is_some())
    }

    /// The upper end that is to be proven.
    fn target(&self) -> f64 {
        self.goal
            .unwrap_or_else(|| (self.lower() * (1.0 + self.accuracy)).max(ZERO_WORST_CASE * self.judge.scale))
    }

    fn lower(&self) -> f64 {
        self.judge.best.as_ref().map_or(0.0, |best| best.lower)
    }

    /// Relaxes the accuracy by a step; false where it is not to be relaxed.
    fn relax(&mut self) -> bool {
        self.accuracy *= RELAXATION;
        self.goal.is_none() && self.accuracy < LOOSEST_RELAXATION
    }

    /// Covers all frequencies; `None` if the work does not suffice.
    fn attempt(&mut self, accuracy: f64) -> Result<Option<f64>, VerifyError> {
        self.accuracy = accuracy;
        let mut polynomial = self.polynomial();
        while polynomial.cells() > MAX_CELLS {
            if !self.relax() {
                return Err(VerifyError::LongMemory);
            }
            polynomial = self.polynomial();
        }
        let count = polynomial.cells();
        // The last cell ends beyond pi.
        let end = |k: usize| PI * (1.0 + 1e-15) * k as f64 / count as f64;
        let mut cells: Vec<Cell> = (0..count).map(|k| Cell { begin: end(k), end: end(k + 1) }).collect();
        let mut left = MAX_CELLS;
        self.judge.limit = MAX_OPERATIONS;
        while let Some(cell) = cells.pop() {
            let outcome = self.bound(cell, &polynomial)?;
            if outcome == Outcome::Proven {
                continue;
            }
            left -= 1;
            let refuted = self.goal.is_some_and(|goal| self.lower() > goal);
            let can_halve = outcome == Outcome::Wide && left > 0 && !self.judge.is_used_up();
            if can_halve && !refuted {
                cells.extend(cell.halves());
                continue;
            }
            if refuted || !self.relax() {
                return Ok(None);
            }
            // The cells that are done keep within the looser bound as well.
            cells.push(cell);
            left = left.max(MORE_CELLS);
            self.judge.limit = self.judge.limit.max(self.judge.operations + MORE_OPERATIONS);
        }
        Ok(Some(self.target()))
    }

    /// Tries to prove the bound in a cell.
    fn bound(&mut self, cell: Cell, polynomial: &Polynomial) -> Result<Outcome, VerifyError> {
        let &Polynomial { degree, tail } = polynomial;
        // The centre is not exactly the frequency that is judged.
        let x = 0.5 * degree * (0.5 * (cell.end - cell.begin) + 1e-13);
        let threshold = (self.target() - tail) * cosine_below(x) - tail;
        let narrow = match self.judge.compare(cell.centre(), threshold)? {
            Verdict::Below => return Ok(Outcome::Proven),
            Verdict::Above(_) => x < NARROWEST_CELL,
            Verdict::Open(_) => x < NARROW_CELL,
        };
        Ok(if narrow { Outcome::Narrow } else { Outcome::Wide })
    }

    /// The polynomial whose tail uses its share of the accuracy, if there is one.
    fn polynomial(&self) -> Polynomial {
        let wanted = TAIL_SHARE * self.accuracy * self.target();
        let lags: Vec<usize> = (1..=self.lags.count()).collect();
        let kept = 1 + lags.partition_point(|&kept| self.filter_tail(kept) > 0.5 * wanted);
        let kept = kept.min(lags.len());
        let mut periods = 0;
        let mut tail = self.tail(0, kept);
        while tail > wanted && periods < MAX_CELLS {
            let shorter = tail;
            periods += 1;
            tail = self.tail(periods, kept);
            // What is left are the tails of the filters.
            if periods > 8 && tail > 0.999 * shorter {
                break;
            }
        }
        let late = self.judge.delay_periods();
        let (references, channels) = late.split_at(self.ratio);
        let most = |list: &[usize]| list.iter().copied().max().unwrap_or(0);
        let last = (most(references)).max(most(channels) + kept - 1);
        let first = late.iter().copied().min().unwrap_or(0);
        Polynomial { degree: (last - first + periods) as f64, tail }
    }

    /// Bounds ||K - K_J|| for all errors in the box, with J = `periods` slow periods of the kernels and
    /// `kept` lags of the filters.
    fn tail(&self, periods: usize, kept: usize) -> f64 {
        let reference = (self.ratio as f64).sqrt() * self.reference.tail(periods);
        let channels = self.judge.channels.iter().enumerate();
        let cut = channels.map(|(i, channel)| channel.tail(periods, self.lags.beyond(i, 0)));
        outward(reference + cut.sum::<f64>() + self.filter_tail(kept))
    }

    /// The part of that which the cut of the filters adds.
    fn filter_tail(&self, kept: usize) -> f64 {
        let channels = self.judge.channels.iter().enumerate();
        channels.map(|(i, channel)| channel.whole(self.lags.beyond(i, kept))).sum()
    }
}
