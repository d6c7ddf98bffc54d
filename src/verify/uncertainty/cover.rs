//! Covers all frequencies with cells and proves a bound in each of them.

use super::super::VerifyError;
use super::super::ball::Ball;
use super::super::spectrum::{self, ComplexMatrix};
use super::angle::{Frequency, cosine_below, outward};
use super::at_frequency::{AtFrequency, Attained, Mix, Verdict, Work, lower_gain};
use super::channel::{Channel, Memories, Response, column_norm};
use super::following::{Following, moved};
use super::grid::Grid;
use super::memory::{Lags, Memory};
use super::{ErrorBox, ErrorPoint, Taps, WorstCase};
use crate::bank::{Bank, SynthesisFilters};
use crate::units::RadiansPerSlowPeriod;
use std::f64::consts::PI;

/// Most halvings of the delays.
const MAX_LEVEL: u32 = 5;
/// Most rows of a Gram matrix.
const MAX_ROWS: usize = 160;
/// From this many channels on, the worst point so far is tried at each frequency before all others.
const MANY_CHANNELS: usize = 5;
/// Factors by which the accuracy is relaxed until the work allows it.
const RELAXED: [f64; 6] = [1.0, 2.0, 5.0, 20.0, 100.0, 1e4];
/// Limit on the cells of one attempt.
const MAX_CELLS: usize = 20_000;
/// Limit on the operations on balls in one attempt: half a minute or so.
const MAX_OPERATIONS: f64 = 1e9;
/// Cells whose bound exceeds the value at their centre by less than the square of this are not halved
/// further for the sake of remainders.
const NARROW: f64 = 0.02;
/// Share of the accuracy that the cut of the memory may use.
const TAIL_SHARE: f64 = 1e-3;
/// Relative size of the tails of recursive filters.
const FILTER_TAIL: f64 = 1e-12;
/// Worst cases below this, relative to the reference samples, are zero up to rounding.
const FLOOR: f64 = 1e-10;

/// The proof of one worst case.
pub(super) struct Cover<'a> {
    bank: &'a Bank,
    errors: &'a ErrorBox,
    taps: Taps,
    /// S_j by channel, where the taps follow its delay.
    slopes: Vec<Option<SynthesisFilters>>,
    /// Half-widths of the delays in fast periods.
    halves: Vec<Ball>,
    /// By level; made when needed.
    grids: Vec<Grid>,
    channels: Vec<Channel>,
    reference: Memory,
    lags: Lags,
    /// Size of the reference samples.
    scale: f64,
    best: Option<Best>,
    /// The grid of the point of `best`, where it was needed.
    at_best: Option<(ErrorPoint, Grid)>,
    /// The upper end that is to be proven; without it one relative to the best lower end.
    goal: Option<f64>,
    /// Gains computed so far.
    gains_computed: usize,
    /// Operations on balls in this attempt.
    operations: f64,
}

/// The largest gain found.
struct Best {
    lower: f64,
    point: ErrorPoint,
    frequency: f64,
}

impl<'a> Cover<'a> {
    /// # Errors
    /// See [`super::worst_case`].
    pub(super) fn new(bank: &'a Bank, errors: &'a ErrorBox, taps: Taps) -> Result<Self, VerifyError> {
        let grid = Grid::new(bank, errors, level_of_grid(0, taps))?;
        let memories = Memories::new(&grid, errors)?;
        let fast_period = bank.spec.as_ref().map_or(bank.fast_period, |spec| spec.fast_period);
        let channel = |i: usize| {
            let largest = (errors.delays[i], errors.gains[i], errors.cutoffs[i]);
            Channel::new(&memories, i, largest, fast_period)
        };
        let mut channels: Vec<Channel> = (0..bank.channel_count()).map(channel).collect();
        for i in 0..channels.len() {
            let same = |&j: &usize| {
                grid.has_equal_front_ends(i, j)
                    && errors.cutoffs[i] == errors.cutoffs[j]
                    && !channels[j].is_certain()
            };
            channels[i].like = (0..=i).find(same).filter(|_| !channels[i].is_certain());
        }
        let reference = memories.of_sample(0);
        let mut lags = Lags::new(&bank.filters, bank.ratio, FILTER_TAIL).ok_or(VerifyError::LongMemory)?;
        let halves: Vec<Ball> =
            errors.delays.iter().map(|half| fast_periods(half.0, fast_period.0)).collect();
        let slopes = slopes(bank, taps);
        for (slope, half) in slopes.iter().zip(&halves) {
            let Some(slope) = slope else { continue };
            let moving = Lags::new(slope, bank.ratio, FILTER_TAIL).ok_or(VerifyError::LongMemory)?;
            lags.widen(&moving, half.magnitude());
        }
        let n = grid.period.order();
        let scale = (n..n + bank.ratio).map(|i| grid.period.gram[(i, i)].nearest()).sum::<f64>().sqrt();
        Ok(Self {
            bank,
            errors,
            taps,
            slopes,
            halves,
            grids: vec![grid],
            channels,
            reference,
            lags,
            scale,
            best: None,
            at_best: None,
            goal: None,
            gains_computed: 0,
            operations: 0.0,
        })
    }

    /// Proves the gain of one point at a frequency, and keeps it if it is the largest so far.
    ///
    /// # Errors
    /// As [`Grid::at`].
    pub(super) fn try_point(
        &mut self,
        point: &ErrorPoint,
        frequency: RadiansPerSlowPeriod,
    ) -> Result<(), VerifyError> {
        let grid = Grid::at(self.bank, point)?;
        let near = Frequency::near(frequency.0);
        let mut at = self.plain(&grid, &near);
        let deltas: Vec<Ball> =
            point.delays.iter().map(|delay| fast_periods(delay.0, self.fast_period())).collect();
        at.filters = moved(&at.filters, &self.slopes_at(&near), &deltas);
        let mixes: Vec<Mix> = (0..self.channels.len())
            .map(|i| vec![(grid.channels[i].rows[0][0], 1.0 + point.gains[i])])
            .collect();
        let lower = lower_gain(&at.square(&mixes));
        self.offer(Best { lower, point: point.clone(), frequency: frequency.0 });
        Ok(())
    }

    /// Both ends, as close as the work allows.
    ///
    /// # Errors
    /// [`VerifyError::WideBox`] if no upper end is proven.
    pub(super) fn prove(mut self, accuracy: f64) -> Result<WorstCase, VerifyError> {
        for factor in RELAXED {
            self.operations = 0.0;
            let upper = self.attempt(accuracy * factor)?;
            if let (Some(upper), Some(best)) = (upper, &self.best) {
                return Ok(WorstCase {
                    lower: best.lower,
                    upper,
                    point: best.point.clone(),
                    frequency: RadiansPerSlowPeriod(best.frequency),
                    gains_computed: self.gains_computed,
                });
            }
        }
        Err(VerifyError::WideBox)
    }

    /// Whether it is proven that no norm in the box exceeds `gamma`.
    ///
    /// # Errors
    /// As [`super::worst_case`].
    pub(super) fn proves(mut self, gamma: f64) -> Result<bool, VerifyError> {
        self.goal = Some(gamma);
        // The cut of the memory is to cost as little as with an accuracy of a per cent.
        Ok(self.attempt(0.01)?.is_some())
    }

    /// The upper end that is to be proven.
    fn target(&self, accuracy: f64) -> f64 {
        if let Some(goal) = self.goal {
            return goal;
        }
        let lower = self.best.as_ref().map_or(0.0, |best| best.lower);
        (lower * (1.0 + accuracy)).max(FLOOR * self.scale)
    }

    fn offer(&mut self, found: Best) {
        if self.best.as_ref().is_none_or(|best| best.lower < found.lower) {
            self.best = Some(found);
        }
    }

    /// Covers all frequencies; `None` if the work does not suffice.
    fn attempt(&mut self, accuracy: f64) -> Result<Option<f64>, VerifyError> {
        let (degree, tail) = self.polynomial(TAIL_SHARE * accuracy * self.target(accuracy));
        let count = ((1.6 * degree).ceil() as usize).max(4);
        if count > MAX_CELLS {
            return Err(VerifyError::LongMemory);
        }
        // The last cell ends beyond pi.
        let end = |k: usize| PI * (1.0 + 1e-15) * k as f64 / count as f64;
        let mut cells: Vec<(f64, f64)> = (0..count).map(|k| (end(k), end(k + 1))).collect();
        for _ in 0..MAX_CELLS {
            let Some((begin, end)) = cells.pop() else { return Ok(Some(self.target(accuracy))) };
            let refuted =
                self.goal.is_some_and(|goal| self.best.as_ref().is_some_and(|best| best.lower > goal));
            if refuted || self.operations > MAX_OPERATIONS {
                break;
            }
            // The centre is not exactly the frequency that is judged.
            let x = 0.5 * degree * (0.5 * (end - begin) + 1e-13);
            let threshold = (self.target(accuracy) - tail) * cosine_below(x) - tail;
            let centre = 0.5 * (begin + end);
            let narrow = match self.judge(centre, threshold)? {
                Verdict::Below => continue,
                Verdict::Above(_) => x < 1e-6,
                Verdict::Open(_) => x < NARROW,
            };
            if narrow {
                break;
            }
            cells.extend([(begin, centre), (centre, end)]);
        }
        Ok(None)
    }

    /// Degree d and tail for a memory whose tail is at most `wanted`, if it gets there.
    fn polynomial(&self, wanted: f64) -> (f64, f64) {
        let mut periods = 0;
        let mut tail = self.tail(0);
        while tail > wanted && periods < MAX_CELLS {
            let shorter = tail;
            periods += 1;
            tail = self.tail(periods);
            // What is left are the tails of the filters.
            if periods > 8 && tail > 0.999 * shorter {
                break;
            }
        }
        let late = &self.grids[0].period.delay_periods;
        let (references, channels) = late.split_at(self.bank.ratio);
        let most = |list: &[usize]| list.iter().copied().max().unwrap_or(0);
        let last = (most(references)).max(most(channels) + self.lags.last);
        let first = late.iter().copied().min().unwrap_or(0);
        ((last - first + periods) as f64, tail)
    }

    /// Bounds ||K - K_J|| for all errors in the box, J = `periods`.
    fn tail(&self, periods: usize) -> f64 {
        let reference = (self.bank.ratio as f64).sqrt() * self.reference.tail(periods);
        let tail =
            |(i, channel): (usize, &Channel)| channel.tail(periods, self.lags.sizes[i], self.lags.tails[i]);
        let channels = self.channels.iter().enumerate().map(tail);
        outward(reference + channels.sum::<f64>())
    }

    /// Judges one frequency on coarse grids first.
    fn judge(&mut self, centre: f64, threshold: f64) -> Result<Verdict, VerifyError> {
        let near = Frequency::near(centre);
        if let Some(above) = self.gain_of_best(centre, &near, threshold)? {
            return Ok(Verdict::Above(above));
        }
        let rows = self.remainders(&near)?;
        let mut verdict = Verdict::Below;
        for level in 0..=MAX_LEVEL {
            if !self.make_grid(level)? {
                break;
            }
            let grid = &self.grids[level as usize];
            let (judged, work, best) = self.judge_on(grid, &near, &rows, threshold);
            self.operations += self.cost_of_gram(grid) + work.operations;
            self.gains_computed += work.gains;
            if let Some(best) = best {
                self.offer(Best { frequency: centre.min(PI), ..best });
            }
            verdict = judged;
            if !matches!(verdict, Verdict::Open(_)) {
                break;
            }
        }
        Ok(verdict)
    }

    /// The gain of the worst point so far at another frequency, if it is above the threshold. With many
    /// vertices a search would take long to meet one that is.
    fn gain_of_best(
        &mut self,
        centre: f64,
        near: &Frequency,
        threshold: f64,
    ) -> Result<Option<Attained>, VerifyError> {
        if self.taps == Taps::Following || self.channels.len() < MANY_CHANNELS {
            return Ok(None);
        }
        let Some(point) = self.best.as_ref().map(|best| best.point.clone()) else { return Ok(None) };
        let grid = match self.at_best.take() {
            Some((known, grid)) if known == point => grid,
            _ => Grid::at(self.bank, &point)?,
        };
        let at = self.plain(&grid, near);
        let mixes: Vec<Mix> = (0..self.channels.len())
            .map(|i| vec![(grid.channels[i].rows[0][0], 1.0 + point.gains[i])])
            .collect();
        let lower = lower_gain(&at.square(&mixes));
        self.operations += self.cost_of_gain() + self.cost_of_gram(&grid);
        self.gains_computed += 1;
        self.at_best = Some((point.clone(), grid));
        self.offer(Best { lower, point, frequency: centre.min(PI) });
        let attained = Attained { lower, upper: f64::INFINITY, vertices: Vec::new() };
        Ok((lower > threshold).then_some(attained))
    }

    /// Bounds of the remainders of each channel, by halvings.
    fn remainders(&self, near: &Frequency) -> Result<Vec<Vec<f64>>, VerifyError> {
        // Equal front ends have one response.
        let mut responses: Vec<Option<Response>> = Vec::with_capacity(self.channels.len());
        for (i, channel) in self.channels.iter().enumerate() {
            let own = channel.like == Some(i);
            responses.push(own.then(|| channel.response(near, self.bank.ratio)).transpose()?);
        }
        let of = |channel: &Channel| match channel.like.and_then(|like| responses[like].as_ref()) {
            Some(response) => channel.remainders(response, MAX_LEVEL, self.taps),
            None => vec![0.0; MAX_LEVEL as usize + 1],
        };
        Ok(self.channels.iter().map(of).collect())
    }

    /// The verdict on one grid, the work that it took and the largest gain seen.
    fn judge_on(
        &self,
        grid: &Grid,
        near: &Frequency,
        remainders: &[Vec<f64>],
        threshold: f64,
    ) -> (Verdict, Work, Option<Best>) {
        let at = AtFrequency { remainders: remainders.to_vec(), ..self.plain(grid, near) };
        let limit = (MAX_OPERATIONS - self.operations).max(0.0);
        let mut work = Work { gains: 0, operations: 0.0, limit, per_gain: self.cost_of_gain() };
        let verdict = match self.taps {
            Taps::Fixed => at.compare(threshold, &mut work),
            Taps::Following => {
                Following::new(at, self.slopes_at(near), &self.halves).compare(threshold, &mut work)
            }
        };
        let best = match &verdict {
            Verdict::Below => None,
            Verdict::Above(attained) | Verdict::Open(attained) => best_of(grid, attained),
        };
        (verdict, work, best)
    }

    /// Operations for one gain, and for the Gram matrix of a grid.
    fn cost_of_gain(&self) -> f64 {
        let (m, n) = (self.bank.ratio as f64, self.channels.len() as f64);
        let rows = match self.taps {
            Taps::Fixed => 1.5 * n,
            Taps::Following => 2.5 * n,
        };
        4.0 * m * (m + rows) * (2.0 * m + rows)
    }

    fn cost_of_gram(&self, grid: &Grid) -> f64 {
        let (states, rows) = (grid.period.order() as f64, grid.period.samples() as f64);
        4.0 * rows * rows * (states + rows) + 2.0 * rows * states * (states + rows)
    }

    /// Makes the grid of `level` if it is missing; false if it would be too large.
    fn make_grid(&mut self, level: u32) -> Result<bool, VerifyError> {
        let known = self.grids.len() > level as usize;
        let sides = (0..self.channels.len()).filter(|&i| self.errors.delays[i].0 > 0.0);
        let level_of_grid = level_of_grid(level, self.taps);
        let points = |i: usize| ((1usize << level_of_grid) + 1) * self.errors.speeds(i).len();
        let rows = self.bank.ratio + self.channels.len() + sides.map(points).sum::<usize>();
        if known || rows > MAX_ROWS {
            return Ok(known);
        }
        // A grid that is too large is as good as none.
        let Ok(grid) = Grid::new(self.bank, self.errors, level_of_grid) else { return Ok(false) };
        self.grids.push(grid);
        Ok(true)
    }

    fn fast_period(&self) -> f64 {
        self.bank.spec.as_ref().map_or(self.bank.fast_period, |spec| spec.fast_period).0
    }

    /// S_j at a frequency.
    fn slopes_at(&self, near: &Frequency) -> Vec<Option<ComplexMatrix>> {
        let at = |slope: &SynthesisFilters| spectrum::filter_response(slope, self.bank.ratio, &near.z);
        self.slopes.iter().map(|slope| slope.as_ref().map(at)).collect()
    }

    /// The Gram matrix and the filters at a frequency, without remainders.
    fn plain<'b>(&'b self, grid: &'b Grid, near: &Frequency) -> AtFrequency<'b> {
        let filters = spectrum::filter_response(&self.bank.filters, self.bank.ratio, &near.z);
        AtFrequency {
            gram: spectrum::gram(&grid.period, &near.z),
            columns: (0..self.channels.len()).map(|i| column_norm(&filters, i)).collect(),
            filters,
            channels: &grid.channels,
            gains: &self.errors.gains,
            remainders: vec![vec![0.0; MAX_LEVEL as usize + 1]; self.channels.len()],
        }
    }
}

/// A part of the grid has its ends, and its middle where the taps follow the delays.
fn level_of_grid(level: u32, taps: Taps) -> u32 {
    match taps {
        Taps::Fixed => level,
        Taps::Following => level + 1,
    }
}

/// The slopes of the taps by channel; `None` where they do not follow its delay.
fn slopes(bank: &Bank, taps: Taps) -> Vec<Option<SynthesisFilters>> {
    let of = |j: usize| {
        let slopes = bank.tap_slopes.as_ref().filter(|slopes| slopes.follows(j))?;
        (taps == Taps::Following).then(|| SynthesisFilters::Fir(slopes.by_delay[j].clone()))
    };
    (0..bank.channel_count()).map(of).collect()
}

fn fast_periods(seconds: f64, fast_period: f64) -> Ball {
    Ball::from(seconds) / Ball::from(fast_period)
}

/// The errors at a vertex of `grid`; `None` without a vertex.
fn best_of(grid: &Grid, attained: &Attained) -> Option<Best> {
    if attained.vertices.is_empty() {
        return None;
    }
    let vertices = attained.vertices.iter().zip(&grid.channels);
    let point = ErrorPoint {
        delays: vertices.clone().map(|(vertex, channel)| channel.errors[vertex.error]).collect(),
        gains: vertices.clone().map(|(vertex, _)| vertex.gain - 1.0).collect(),
        cutoffs: vertices.map(|(vertex, channel)| channel.speeds[vertex.speed] - 1.0).collect(),
    };
    Some(Best { lower: attained.lower, point, frequency: 0.0 })
}
