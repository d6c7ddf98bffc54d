//! Compares the gains over a box with a threshold, frequency by frequency, on grids that become finer where
//! that decides.

use super::super::VerifyError;
use super::super::spectrum;
use super::aliases::{Aliases, FrontEnd};
use super::angle::Frequency;
use super::at_frequency::{AtFrequency, Attained, Mix, Verdict, Work};
use super::channel::{Channel, Memories, column_norm, sampled_transfer, signal_transfer};
use super::grid::{Grid, Halvings, halved};
use super::memory::Memory;
use super::quick::lower_gain;
use super::remainder::Remainders;
use super::transfer::Transfer;
use super::{ErrorBox, ErrorPoint, Side};
use crate::bank::Bank;
use crate::units::{RadiansPerSlowPeriod, Seconds};
use std::f64::consts::PI;
use std::ops::Range;
use std::rc::Rc;

/// Most grids, each finer than the one before.
const MAX_GRIDS: usize = 10;
/// Sides of the box are halved together if each loses at least this share of what the worst one loses.
const SHARE_OF_WORST: f64 = 0.25;
/// Most rows of a Gram matrix.
const MAX_ROWS: usize = 250;
/// Operations for a grid, over its samples times the cube of its states.
const GRID_OPERATIONS: f64 = 20.0;
/// From this many converters on, the worst point so far is tried at each frequency before all others.
const MANY_CONVERTERS: usize = 5;

/// All that is needed to judge one frequency, and the largest gain seen.
pub(super) struct Judge<'a> {
    bank: &'a Bank,
    errors: &'a ErrorBox,
    /// Made when needed, each finer than the one before.
    grids: Vec<(Vec<Halvings>, Grid)>,
    /// The converter of each sample of a frame.
    owners: Vec<usize>,
    pub(super) channels: Vec<Channel>,
    /// The filters of the target and of the signal.
    target: Transfer,
    signal: Option<Transfer>,
    /// Aliases on each side that are summed one by one.
    aliases: usize,
    /// Size of the reference samples.
    pub(super) scale: f64,
    pub(super) best: Option<Best>,
    /// The grid of the point of `best`, where it was needed.
    at_best: Option<(ErrorPoint, Grid)>,
    /// Gains computed so far.
    pub(super) gains_computed: usize,
    /// Operations on balls so far, and their limit.
    pub(super) operations: f64,
    pub(super) limit: f64,
}

/// The largest gain found.
pub(super) struct Best {
    pub(super) lower: f64,
    pub(super) point: ErrorPoint,
    pub(super) frequency: f64,
}

impl<'a> Judge<'a> {
    /// With the memory of the reference samples.
    ///
    /// # Errors
    /// See [`super::worst_case`].
    pub(super) fn new(bank: &'a Bank, errors: &'a ErrorBox) -> Result<(Self, Memory), VerifyError> {
        let halvings = Halvings::none(bank.channel_count());
        let grid = Grid::new(bank, errors, &halvings)?;
        let memories = Memories::new(&grid, errors)?;
        let fast_period = fast_period(bank);
        let owners = bank.layout().owners();
        let channels = channels(&memories, &owners, errors, fast_period);
        let reference = memories.of_sample(0);
        let (target, signal) = (sampled_transfer(&grid, 0), signal_transfer(&grid));
        let n = grid.period.order();
        let scale = (n..n + bank.ratio).map(|i| grid.period.gram[(i, i)].nearest()).sum::<f64>().sqrt();
        let mut judge = Self {
            bank,
            errors,
            grids: vec![(halvings, grid)],
            owners,
            channels,
            target,
            signal,
            aliases: 0,
            scale,
            best: None,
            at_best: None,
            gains_computed: 0,
            operations: 0.0,
            limit: f64::INFINITY,
        };
        judge.aliases = judge.aliases_needed().ok_or(VerifyError::LongMemory)?;
        Ok((judge, reference))
    }

    /// Aliases on each side that all front ends need.
    fn aliases_needed(&self) -> Option<usize> {
        let front_ends = self.channels.iter().map(Channel::front_end).chain([self.reference()]);
        let counts = front_ends.map(|front_end| front_end.aliases(self.bank.ratio));
        counts.collect::<Option<Vec<_>>>()?.into_iter().max()
    }

    /// The filter of the reference samples.
    fn reference(&self) -> FrontEnd<'_> {
        FrontEnd { transfer: &self.target, signal: self.signal.as_ref(), cutoff: 0.0 }
    }

    /// For each sample, the slow periods by which it is late.
    pub(super) fn delay_periods(&self) -> &[usize] {
        &self.grids[0].1.period.delay_periods
    }

    pub(super) fn is_used_up(&self) -> bool {
        self.operations > self.limit
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
        let lower = lower_gain(&self.plain(&grid, &near).square(&mixes_at(&grid, point)));
        self.offer(Best { lower, point: point.clone(), frequency: frequency.0 });
        Ok(())
    }

    fn offer(&mut self, found: Best) {
        if self.best.as_ref().is_none_or(|best| best.lower < found.lower) {
            self.best = Some(found);
        }
    }

    /// Compares the gains at the frequency `centre` with `threshold`, on coarse grids first.
    ///
    /// # Errors
    /// As [`super::worst_case`].
    pub(super) fn compare(&mut self, centre: f64, threshold: f64) -> Result<Verdict, VerifyError> {
        let near = Frequency::near(centre);
        if let Some(above) = self.gain_of_best(centre, &near, threshold)? {
            return Ok(Verdict::Above(above));
        }
        let remainders = self.remainders(&near)?;
        let mut level = 0;
        loop {
            let grid = &self.grids[level].1;
            let (verdict, work, best) = self.judge_on(grid, &near, &remainders, threshold);
            self.operations += self.cost_of_gram(grid) + work.operations;
            self.gains_computed += work.gains;
            if let Some(best) = best {
                self.offer(Best { frequency: centre.min(PI), ..best });
            }
            level += 1;
            let is_open = matches!(verdict, Verdict::Open(_)) && !self.is_used_up();
            if !is_open || (level == self.grids.len() && !self.refine(&remainders, threshold)) {
                return Ok(verdict);
            }
        }
    }

    /// The gain of the worst point so far at another frequency, if it is above the threshold. With many
    /// vertices a search would take long to meet one that is.
    fn gain_of_best(
        &mut self,
        centre: f64,
        near: &Frequency,
        threshold: f64,
    ) -> Result<Option<Attained>, VerifyError> {
        if self.errors.delays.len() < MANY_CONVERTERS {
            return Ok(None);
        }
        let Some(point) = self.best.as_ref().map(|best| best.point.clone()) else { return Ok(None) };
        let grid = match self.at_best.take() {
            Some((known, grid)) if known == point => grid,
            _ => Grid::at(self.bank, &point)?,
        };
        let lower = lower_gain(&self.plain(&grid, near).square(&mixes_at(&grid, &point)));
        self.operations += self.cost_of_gain() + self.cost_of_gram(&grid);
        self.gains_computed += 1;
        self.at_best = Some((point.clone(), grid));
        self.offer(Best { lower, point, frequency: centre.min(PI) });
        let attained = Attained { lower, upper: f64::INFINITY, vertices: Vec::new() };
        Ok((lower > threshold).then_some(attained))
    }

    /// What lies between the points of the grids at a frequency.
    fn remainders(&self, near: &Frequency) -> Result<Remainders, VerifyError> {
        let response = |front_end: FrontEnd<'_>| {
            let aliases = Aliases::new(&front_end, near.angle, self.bank.ratio, self.aliases);
            aliases.map(Rc::new).ok_or(VerifyError::LongMemory)
        };
        // Equal front ends have one response.
        let mut responses: Vec<Rc<Aliases>> = Vec::with_capacity(self.channels.len());
        for channel in &self.channels {
            let known = responses.get(channel.like).cloned();
            responses.push(known.map_or_else(|| response(channel.front_end()), Ok)?);
        }
        let rows = self.channels.iter().zip(responses).map(|(channel, response)| channel.row(response));
        let filters = spectrum::filter_response(&self.bank.filters, self.bank.ratio, near.z).into();
        let columns = (0..self.channels.len()).map(|i| column_norm(&filters, i)).collect();
        let (reference, owners) = (response(self.reference())?, self.owners.clone());
        Ok(Remainders::new(rows.collect(), &reference, columns, owners, self.bank.ratio))
    }

    /// The verdict on one grid, the work that it took and the largest gain seen.
    fn judge_on(
        &self,
        grid: &Grid,
        near: &Frequency,
        remainders: &Remainders,
        threshold: f64,
    ) -> (Verdict, Work, Option<Best>) {
        let at = self.plain(grid, near);
        let limit = (self.limit - self.operations).max(0.0);
        let mut work = Work { gains: 0, operations: 0.0, limit, per_gain: self.cost_of_gain() };
        let verdict = at.compare(remainders, threshold, &mut work);
        let best = match &verdict {
            Verdict::Below => None,
            Verdict::Above(attained) | Verdict::Open(attained) => best_of(grid, attained),
        };
        (verdict, work, best)
    }

    /// Operations for one gain, and for the Gram matrix of a grid.
    fn cost_of_gain(&self) -> f64 {
        let (m, n) = (self.bank.ratio as f64, self.channels.len() as f64);
        let rows = 1.5 * n;
        4.0 * m * (m + rows) * (2.0 * m + rows)
    }

    /// Two complex sums over the states for each pair of rows, and one for each row and state.
    fn cost_of_gram(&self, grid: &Grid) -> f64 {
        let (states, rows) = (grid.period.order() as f64, grid.period.samples() as f64);
        4.0 * rows * states * (2.0 * rows + states) + 8.0 * states.powi(3)
    }

    /// Adds a grid on which the sides with the largest remainders are halved once more; false if it would be
    /// too large.
    fn refine(&mut self, remainders: &Remainders, threshold: f64) -> bool {
        let Some((halvings, _)) = self.grids.last() else { return false };
        let limit = |halvings: &[Halvings]| remainders.rough_limit(halvings, threshold);
        let so_far = limit(halvings);
        let rated =
            self.errors.sides().into_iter().map(|side| (limit(&halved(side, halvings)) - so_far, side));
        let mut rated: Vec<(f64, Side)> = rated.collect();
        rated.sort_by(|a, b| b.0.total_cmp(&a.0));
        let most = rated.first().map_or(0.0, |(gain, _)| *gain);
        let mut finer = halvings.clone();
        for (gain, side) in rated {
            let next = halved(side, &finer);
            if gain > 0.0 && gain >= SHARE_OF_WORST * most && self.rows(&next) <= MAX_ROWS {
                finer = next;
            }
        }
        if finer == *halvings || self.grids.len() >= MAX_GRIDS {
            return false;
        }
        // A grid that is too large is as good as none.
        let Ok(grid) = Grid::new(self.bank, self.errors, &finer) else { return false };
        self.operations +=
            GRID_OPERATIONS * grid.period.samples() as f64 * (grid.period.order() as f64).powi(3);
        self.grids.push((finer, grid));
        true
    }

    /// Rows of the Gram matrix of a grid.
    fn rows(&self, halvings: &[Halvings]) -> usize {
        let points = |half: f64, halvings: u32| if half > 0.0 { (1usize << halvings) + 1 } else { 1 };
        let of = |(i, at): (usize, &Halvings)| {
            let samples = self.bank.samples[i];
            samples * points(self.errors.delays[i].0, at.delay) * points(self.errors.cutoffs[i], at.cutoff)
        };
        self.bank.ratio + halvings.iter().enumerate().map(of).sum::<usize>()
    }

    /// The Gram matrix and the filters at a frequency.
    fn plain<'b>(&'b self, grid: &'b Grid, near: &Frequency) -> AtFrequency<'b> {
        let filters = spectrum::filter_response(&self.bank.filters, self.bank.ratio, near.z).into();
        AtFrequency {
            gram: spectrum::gram(&grid.period, near.z).into(),
            columns: (0..self.channels.len()).map(|i| column_norm(&filters, i)).collect(),
            filters,
            channels: &grid.channels,
            converters: &grid.converters,
            gains: &self.errors.gains,
        }
    }
}

/// The samples of a frame, each with the first one that is like it.
fn channels(
    memories: &Memories<'_>,
    owners: &[usize],
    errors: &ErrorBox,
    fast_period: Seconds,
) -> Vec<Channel> {
    let grid = memories.grid();
    let channel = |i: usize| {
        let cutoff = |i: usize| errors.cutoffs[owners[i]];
        // Errors of delay and gain do not matter to the response.
        let same = |&j: &usize| grid.has_equal_front_ends(i, j) && cutoff(i) == cutoff(j);
        let mut channel = Channel::new(memories, i, owners[i], errors, fast_period);
        channel.like = (0..i).find(same).unwrap_or(i);
        channel
    };
    (0..grid.channels.len()).map(channel).collect()
}

/// The rows of a grid of one point.
fn mixes_at(grid: &Grid, point: &ErrorPoint) -> Vec<Mix> {
    let mix = |(columns, gain): (&Range<usize>, &f64)| {
        let gain = 1.0 + gain;
        columns.clone().map(move |column| vec![(grid.channels[column].rows[0][0], gain)])
    };
    grid.converters.iter().zip(&point.gains).flat_map(mix).collect()
}

fn fast_period(bank: &Bank) -> Seconds {
    bank.spec.as_ref().map_or(bank.fast_period, |spec| spec.fast_period)
}

/// The errors at a vertex of `grid`; `None` without a vertex.
fn best_of(grid: &Grid, attained: &Attained) -> Option<Best> {
    if attained.vertices.is_empty() {
        return None;
    }
    let channels = grid.converters.iter().map(|columns| &grid.channels[columns.start]);
    let vertices = attained.vertices.iter().zip(channels);
    let point = ErrorPoint {
        delays: vertices.clone().map(|(vertex, channel)| channel.errors[vertex.error]).collect(),
        gains: vertices.clone().map(|(vertex, _)| vertex.gain - 1.0).collect(),
        cutoffs: vertices.map(|(vertex, channel)| channel.speeds[vertex.speed] - 1.0).collect(),
    };
    Some(Best { lower: attained.lower, point, frequency: 0.0 })
}
