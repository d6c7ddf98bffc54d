//! The bounds of one sample of a frame: what the cut of its memory leaves out, and its row with the range of
//! its errors.

use super::super::VerifyError;
use super::super::ball::{self, Ball, Matrix};
use super::super::covariance::covariance;
use super::super::front_ends::FrontEnds;
use super::ErrorBox;
use super::aliases::{Aliases, FrontEnd};
use super::angle::outward;
use super::grid::Grid;
use super::memory::{Memory, growth};
use super::remainder::UncertainRow;
use super::transfer::Transfer;
use crate::units::Seconds;
use std::rc::Rc;

/// A sample of a frame with the range of its errors.
pub(super) struct Channel {
    transfer: Transfer,
    /// Of the signal's filter, if the spec has a signal.
    signal: Option<Transfer>,
    memory: Memory,
    /// Largest relative errors.
    cutoff: f64,
    gain: f64,
    /// Largest error of the delay, in fast periods.
    half: f64,
    /// D_i in fast periods, for the rounding of delays.
    delay: f64,
    /// The first channel that has the same front end and range of cut-offs.
    pub(super) like: usize,
}

/// The memories of all rows of a grid.
pub(super) struct Memories<'a> {
    grid: &'a Grid,
    covariance: Matrix,
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
        let covariance = covariance(&grid.period).ok_or(VerifyError::LongMemory)?;
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
        Memory::new(row, &self.grid.period.transition, &self.covariance, self.growth)
    }
}

/// The transfer function of channel `i`, from the filter to the sample.
pub(super) fn transfer(grid: &Grid, i: usize) -> Transfer {
    sampled_transfer(grid, grid.channels[i].rows[0][0])
}

/// The transfer function to the sample with this row of the Gram matrix, for the nominal cut-off.
pub(super) fn sampled_transfer(grid: &Grid, sample: usize) -> Transfer {
    let sample = &grid.samples[sample];
    Transfer::new(grid.front_ends.filter(sample.filter), FrontEnds::gain(sample))
}

/// The transfer function of the signal's filter.
pub(super) fn signal_transfer(grid: &Grid) -> Option<Transfer> {
    grid.front_ends.signal().map(|signal| Transfer::new(signal, Ball::from(1.0)))
}

impl Channel {
    /// Sample `i` of a frame of `grid`, with the largest errors that the delay, the gain and the cut-off of
    /// its `converter` have.
    pub(super) fn new(
        memories: &Memories<'_>,
        i: usize,
        converter: usize,
        errors: &ErrorBox,
        fast_period: Seconds,
    ) -> Self {
        let grid = memories.grid;
        // The row of the slowest variant is the first one.
        let first = grid.channels[i].rows[0][0];
        Self {
            transfer: transfer(grid, i),
            signal: signal_transfer(grid),
            memory: memories.of_sample(first),
            cutoff: errors.cutoffs[converter],
            gain: errors.gains[converter],
            half: errors.delays[converter].in_fast_periods(fast_period).0,
            like: i,
            delay: grid.samples[first].time.in_fast_periods().0.abs(),
        }
    }

    /// Bounds what the cut of the memory after `periods` leaves out of F_i H_i, for all errors; `filter`
    /// bounds |F_i|.
    pub(super) fn tail(&self, periods: usize, filter: f64) -> f64 {
        self.for_all_errors(filter * self.memory.tail(periods))
    }

    /// Bounds F_i H_i, for all errors; `filter` bounds |F_i|.
    pub(super) fn whole(&self, filter: f64) -> f64 {
        self.for_all_errors(filter * self.memory.whole())
    }

    /// A kernel that is x times faster is x phi(x t): its energy beyond T is at most that of the slowest
    /// one, times the ratio of the factors.
    fn for_all_errors(&self, of_slowest: f64) -> f64 {
        let speeds = outward((1.0 + self.cutoff) / (1.0 - self.cutoff));
        outward((1.0 + self.gain) * speeds.sqrt() * of_slowest)
    }

    /// The front end.
    pub(super) fn front_end(&self) -> FrontEnd<'_> {
        FrontEnd { transfer: &self.transfer, signal: self.signal.as_ref(), cutoff: self.cutoff }
    }

    /// The row at a frequency; `response` is that of a channel like this one.
    pub(super) fn row(&self, response: Rc<Aliases>) -> UncertainRow {
        // The grid points are rounded.
        let rounding = 8.0 * f64::EPSILON * (1.0 + self.delay + self.half);
        UncertainRow { response, gain: 1.0 + self.gain, cutoff: self.cutoff, half: self.half, rounding }
    }
}

/// A bound of |F_i| from the column of the response.
pub(super) fn column_norm(filters: &super::complex_matrix::ComplexMatrix, i: usize) -> f64 {
    let add = |sum: Ball, &x: &Ball| sum + x * x;
    let square = filters.re.column(i).iter().chain(filters.im.column(i).iter()).fold(Ball::ZERO, add);
    square.upper().max(0.0).sqrt() * (1.0 + 1e-15)
}
