//! The bounds of one channel: what its memory and the chords of its errors leave out.

use super::super::VerifyError;
use super::super::ball::{self, Ball, Matrix};
use super::super::covariance::Covariance;
use super::super::front_ends::FrontEnds;
use super::aliases::{Aliases, FrontEnd, Weight};
use super::angle::{Frequency, outward};
use super::grid::Grid;
use super::memory::{Memory, growth};
use super::transfer::Transfer;
use super::{ErrorBox, Taps};
use crate::units::Seconds;

/// A channel with the range of its errors.
pub(super) struct Channel {
    transfer: Transfer,
    /// Of the signal's filter, if the spec has a signal.
    signal: Option<Transfer>,
    /// Second derivative in the cut-off, if that is uncertain.
    curvature: Option<Transfer>,
    memory: Memory,
    /// Largest relative errors.
    cutoff: f64,
    gain: f64,
    /// Largest error of the delay, in fast periods.
    half: f64,
    /// D_i in fast periods, for the rounding of delays.
    delay: f64,
    /// The first channel with errors that has the same front end and range of cut-offs; none if this one has
    /// no errors.
    pub(super) like: Option<usize>,
}

/// What the front end of a channel does at a frequency, for all its cut-offs.
#[derive(Debug, Clone)]
pub(super) struct Response {
    aliases: Aliases,
    /// Bounds the distance of the rows from their chord over the cut-offs.
    bend: f64,
}

/// The memories of all rows of a grid.
pub(super) struct Memories<'a> {
    grid: &'a Grid,
    covariance: Covariance,
    growth: f64,
}

impl<'a> Memories<'a> {
    /// # Errors
    /// [`VerifyError::LongMemory`]; [`VerifyError::ErrorBox`] for uncertain cut-offs beside a signal: a
    /// kernel of Phi(s / x) W is not that of another x in another time.
    pub(super) fn new(grid: &'a Grid, errors: &ErrorBox) -> Result<Self, VerifyError> {
        if grid.front_ends.signal().is_some() && errors.cutoffs.iter().any(|cutoff| *cutoff > 0.0) {
            let rule = "uncertain cut-offs are not covered for a spec with a [signal]; leave the cut-offs out of the \
                        box, or the table out of the spec";
            return Err(VerifyError::ErrorBox { rule: rule.into() });
        }
        let covariance = Covariance::new(&grid.period).ok_or(VerifyError::LongMemory)?;
        let growth = growth(&grid.period.transition).ok_or(VerifyError::LongMemory)?;
        Ok(Self { grid, covariance, growth })
    }

    /// The grid.
    pub(super) fn grid(&self) -> &Grid {
        self.grid
    }

    /// Of the sample with this row of the Gram matrix.
    pub(super) fn of_sample(&self, sample: usize) -> Memory {
        self.of_row(&self.grid.front_ends.output(&self.grid.samples[sample]))
    }

    /// Of the derivative of that sample with respect to time.
    pub(super) fn of_slope(&self, sample: usize) -> Memory {
        let (a, _) = self.grid.front_ends.dynamics();
        let row: Matrix = self.grid.front_ends.output(&self.grid.samples[sample]);
        self.of_row(&ball::product(&row, &a))
    }

    fn of_row(&self, row: &Matrix) -> Memory {
        Memory::new(row, &self.grid.period.transition, &self.covariance.state, self.growth)
    }
}

/// The transfer function of channel `i`, from the filter to the sample.
pub(super) fn transfer(grid: &Grid, i: usize) -> Transfer {
    let sample = &grid.samples[grid.channels[i].rows[0][0]];
    Transfer::new(grid.front_ends.filter(sample.filter), FrontEnds::gain(sample))
}

/// The transfer function of the signal's filter.
pub(super) fn signal_transfer(grid: &Grid) -> Option<Transfer> {
    grid.front_ends.signal().map(|signal| Transfer::new(signal, Ball::from(1.0)))
}

impl Channel {
    /// Channel `i` of `grid`, with the largest errors of its delay, gain and cut-off.
    pub(super) fn new(
        memories: &Memories<'_>,
        i: usize,
        (half, gain, cutoff): (Seconds, f64, f64),
        fast_period: Seconds,
    ) -> Self {
        let grid = memories.grid;
        // The row of the slowest variant is the first one.
        let first = grid.channels[i].rows[0][0];
        let transfer = transfer(grid, i);
        Self {
            curvature: (cutoff > 0.0).then(|| transfer.curvature()),
            transfer,
            signal: signal_transfer(grid),
            memory: memories.of_sample(first),
            cutoff,
            gain,
            half: half.in_fast_periods(fast_period).0,
            like: None,
            delay: grid.samples[first].time.delay.in_fast_periods(fast_period).0.abs(),
        }
    }

    /// Bounds what the cut of the memory after `periods` and that of the filters by `filter_tail` leave out
    /// of F_i H_i, for all errors; `filter` bounds |F_i|.
    pub(super) fn tail(&self, periods: usize, filter: f64, filter_tail: f64) -> f64 {
        // A kernel that is x times faster is x phi(x t): its energy beyond T is at most that of the slowest
        // one, times the ratio of the factors.
        let speeds = outward((1.0 + self.cutoff) / (1.0 - self.cutoff));
        let rows = filter * self.memory.tail(periods) + filter_tail * self.memory.whole();
        outward((1.0 + self.gain) * speeds.sqrt() * rows)
    }

    /// Whether delay and cut-off are exact.
    pub(super) fn is_certain(&self) -> bool {
        self.half == 0.0 && self.cutoff == 0.0
    }

    /// The moduli at a frequency.
    ///
    /// # Errors
    /// [`VerifyError::LongMemory`].
    pub(super) fn response(&self, near: &Frequency, ratio: usize) -> Result<Response, VerifyError> {
        let range = [1.0 - self.cutoff, 1.0 + self.cutoff];
        let sum = |transfer: &Transfer| {
            let front_end = FrontEnd { transfer, signal: self.signal.as_ref() };
            Aliases::new(&front_end, near.angle, ratio, range).ok_or(VerifyError::LongMemory)
        };
        let aliases = sum(&self.transfer)?;
        // The chord over 2 x of a function with second derivative at most curvature / (1 - x)^2.
        let bend = match &self.curvature {
            Some(curvature) => {
                0.5 * (self.cutoff / (1.0 - self.cutoff)).powi(2) * sum(curvature)?.norm(Weight::One)
            }
            None => 0.0,
        };
        Ok(Response { aliases, bend })
    }

    /// Bounds the remainder of the chords or parabolas, after 0, 1, .. `levels` halvings of the delay;
    /// `response` is that of a channel like this one.
    pub(super) fn remainders(&self, response: &Response, levels: u32, taps: Taps) -> Vec<f64> {
        let Response { aliases, bend } = response;
        // The grid points are rounded.
        let slack = 8.0 * f64::EPSILON * (1.0 + self.delay + self.half);
        let rounding = if self.half > 0.0 { slack } else { 0.0 };
        let level = |level: u32| {
            let half = self.half / f64::from(1u32 << level) + rounding;
            let between = match taps {
                Taps::Fixed => aliases.norm(Weight::Chord(half)),
                // The parabola goes through the rows of the rounded points, so its own weights (5/4 in all)
                // times the distance of these rows from those of the points come in addition.
                Taps::Following => {
                    aliases.norm(Weight::Parabola(half)) + 1.25 * aliases.norm(Weight::Shift(rounding))
                }
            };
            outward((between + bend) * (1.0 + self.gain))
        };
        (0..=levels).map(level).collect()
    }
}

/// A bound of |F_i| from the column of the response.
pub(super) fn column_norm(filters: &super::super::spectrum::ComplexMatrix, i: usize) -> f64 {
    let add = |sum: Ball, &x: &Ball| sum + x * x;
    let square = filters.re.column(i).iter().chain(filters.im.column(i).iter()).fold(Ball::ZERO, add);
    square.upper().max(0.0).sqrt() * (1.0 + 1e-15)
}
