//! The error system K = W - F H of a bank as an [`EnclosedSystem`], whose input has the Gram matrix of a
//! [`SlowPeriod`].
//!
//! The state xi is, in this order: the analog state at the beginning of the period (the distinct filters in
//! the order target, channels); the delay line, latest first, of each sample that is counted whole periods
//! late, in the order reference samples 0..M-1, channels 1..N; the state of the bank. For taps, the state
//! of the bank holds the past samples of channel 1, latest first, then those of channel 2, and so on. For a
//! block filter it is the filter's own state.

use super::ball::{self, Ball, Matrix};
use super::slow_period::SlowPeriod;
use super::system::EnclosedSystem;
use crate::arithmetic::{DoubleDouble, Float};
use hybank_core::bank::{StateMatrices, SynthesisFilters};
use std::ops::Range;

/// A filter bank in block form, exactly as the file has it.
#[derive(Debug, Clone)]
pub(super) struct BlockForm<F = DoubleDouble> {
    pub(super) a: Matrix<F>,
    pub(super) b: Matrix<F>,
    pub(super) c: Matrix<F>,
    pub(super) d: Matrix<F>,
}

impl<F: Float> BlockForm<F> {
    pub(super) fn new(filters: &SynthesisFilters, ratio: usize) -> Self {
        match filters {
            SynthesisFilters::Fir(taps) => Self::from_taps(taps, ratio),
            SynthesisFilters::StateSpace(block) => Self::from_block(block, ratio),
        }
    }

    /// The same filters with states that are scaled by powers of two, so that the powers of `a` grow little
    /// and responses lose few digits.
    pub(super) fn balanced(&self) -> Self {
        let [a, b, c] = [&self.a, &self.b, &self.c].map(ball::nearest);
        let scales = hybank_linalg::state_scales(&a, &b, &c);
        let scaled = |m: &Matrix<F>, factor: &dyn Fn(usize, usize) -> f64| {
            m.map_with_location(|i, j, x| x * Ball::from(factor(i, j)))
        };
        Self {
            a: scaled(&self.a, &|i, j| scales[j] / scales[i]),
            b: scaled(&self.b, &|i, _| 1.0 / scales[i]),
            c: scaled(&self.c, &|_, j| scales[j]),
            d: self.d.clone(),
        }
    }

    /// The state holds the last J - 1 samples of each channel; the filters have J lags of M taps.
    fn from_taps(taps: &[Vec<f64>], ratio: usize) -> Self {
        let (channels, lags) = (taps.len(), taps[0].len().div_ceil(ratio));
        let depth = lags - 1;
        let mut form = Self {
            a: ball::zeros(channels * depth, channels * depth),
            b: ball::zeros(channels * depth, channels),
            c: ball::zeros(ratio, channels * depth),
            d: ball::zeros(ratio, channels),
        };
        for (i, filter) in taps.iter().enumerate() {
            for lag in 0..depth {
                match lag {
                    0 => form.b[(i * depth, i)] = Ball::from(1.0),
                    _ => form.a[(i * depth + lag, i * depth + lag - 1)] = Ball::from(1.0),
                }
            }
            for (n, &tap) in filter.iter().enumerate() {
                let (lag, phase) = (n / ratio, n % ratio);
                match lag {
                    0 => form.d[(phase, i)] = Ball::from(tap),
                    _ => form.c[(phase, i * depth + lag - 1)] = Ball::from(tap),
                }
            }
        }
        form
    }

    fn from_block(block: &StateMatrices, ratio: usize) -> Self {
        let (states, channels) = (block.a.len(), block.d[0].len());
        let matrix = |rows: &[Vec<f64>], r, c| Matrix::from_fn(r, c, |i, j| Ball::from(rows[i][j]));
        Self {
            a: matrix(&block.a, states, states),
            b: matrix(&block.b, states, channels),
            c: matrix(&block.c, ratio, states),
            d: matrix(&block.d, ratio, channels),
        }
    }
}

/// The index ranges of the parts of the state.
struct StateRanges {
    lines: Vec<Range<usize>>,
    filter: Range<usize>,
}

impl StateRanges {
    fn new<F: Float>(period: &SlowPeriod<F>, filter_states: usize) -> Self {
        let mut next = period.order();
        let mut take = |count: usize| {
            next += count;
            next - count..next
        };
        let lines = period.delay_periods.iter().map(|&late| take(late)).collect();
        Self { lines, filter: take(filter_states) }
    }

    /// Number of states.
    fn order(&self) -> usize {
        self.filter.end
    }
}

/// Number of states of the error system of a bank, computed before any matrix of that size is allocated.
pub(super) fn order(
    analog: usize,
    delay_periods: &[usize],
    filters: &SynthesisFilters,
    ratio: usize,
) -> usize {
    let own = match filters {
        SynthesisFilters::Fir(taps) => taps.len() * (taps[0].len().div_ceil(ratio) - 1),
        SynthesisFilters::StateSpace(block) => block.a.len(),
    };
    delay_periods.iter().fold(analog + own, |sum, &late| sum.saturating_add(late))
}

/// Linear maps from the state xi and the inputs u, row by row.
struct LinearMap<F> {
    state: Matrix<F>,
    input: Matrix<F>,
}

impl<F: Float> LinearMap<F> {
    fn zeros(count: usize, states: usize, inputs: usize) -> Self {
        Self { state: ball::zeros(count, states), input: ball::zeros(count, inputs) }
    }

    /// Makes `row` the sample `s` of the period, as it is taken.
    fn take_sample(&mut self, row: usize, period: &SlowPeriod<F>, s: usize) {
        self.state.view_mut((row, 0), (1, period.order())).copy_from(&period.outputs.row(s));
        self.input[(row, period.order() + s)] = Ball::from(1.0);
    }

    /// Subtracts `by` times the rows `range` of `other` from the rows that begin at `start`.
    fn subtract(&mut self, start: usize, by: &Matrix<F>, other: &Self, range: Range<usize>) {
        for (to, from) in [(&mut self.state, &other.state), (&mut self.input, &other.input)] {
            let part = ball::product(by, &from.rows(range.start, range.len()).into_owned());
            let mut rows = to.rows_mut(start, by.nrows());
            let difference = &rows - part;
            rows.copy_from(&difference);
        }
    }
}

/// The analog side with its delay lines: xi+ (with `more` rows of zeros below), and the samples that are
/// counted in this period.
fn sampled<F: Float>(
    period: &SlowPeriod<F>,
    layout: &StateRanges,
    more: usize,
) -> (LinearMap<F>, LinearMap<F>) {
    let (n, order, inputs) = (period.order(), layout.order(), period.order() + period.samples());
    let mut next = LinearMap::zeros(order + more, order, inputs);
    next.state.view_mut((0, 0), (n, n)).copy_from(&period.transition);
    (0..n).for_each(|i| next.input[(i, i)] = Ball::from(1.0));
    let mut delivered = LinearMap::zeros(period.samples(), order, inputs);
    for (s, line) in layout.lines.iter().enumerate() {
        if line.is_empty() {
            delivered.take_sample(s, period, s);
            continue;
        }
        next.take_sample(line.start, period, s);
        (line.start + 1..line.end).for_each(|link| next.state[(link, link - 1)] = Ball::from(1.0));
        delivered.state[(s, line.end - 1)] = Ball::from(1.0);
    }
    (next, delivered)
}

/// The error system of a bank with these filters.
pub(super) fn error_system<F: Float>(period: &SlowPeriod<F>, filters: &BlockForm<F>) -> EnclosedSystem<F> {
    let outputs = filters.d.nrows();
    let layout = StateRanges::new(period, filters.a.nrows());
    let order = layout.order();
    let (mut whole, delivered) = sampled(period, &layout, outputs);
    let (reference, measured) = (0..outputs, outputs..period.samples());
    let own = layout.filter;
    whole.state.view_mut((own.start, own.start), (own.len(), own.len())).copy_from(&filters.a);
    whole.subtract(own.start, &filters.b.map(|x| -x), &delivered, measured.clone());
    // e = reference - c eta - d measured.
    whole.state.view_mut((order, own.start), (outputs, own.len())).copy_from(&filters.c.map(|x| -x));
    whole.subtract(order, &ball::identity(outputs).map(|x: Ball<F>| -x), &delivered, reference);
    whole.subtract(order, &filters.d, &delivered, measured);
    EnclosedSystem { system: whole.state, inputs: whole.input, gram: period.gram.clone(), outputs }
}
