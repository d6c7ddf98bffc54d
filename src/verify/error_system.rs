//! The error system K = W - F H of a bank in state-space form: xi+ = A xi + J u, e = C xi + L u, where u has the Gram
//! matrix of a [`Tick`].
//!
//! The state xi is, in this order: the analog state at the beginning of the tick (the distinct filters in the order
//! target, channels); for each of the wanted samples 0..M-1 and then of the channels 1..N that is counted whole ticks late
//! its delay line, latest first; the state of the bank: for taps the past samples of channel 1, latest first, then of
//! channel 2, ..; for a block filter its own state.

use super::ball::{self, Ball, Matrix};
use super::tick::Tick;
use crate::bank::{BlockFilter, SynthesisFilters};
use std::ops::Range;

/// A filter bank in block form, exactly as the file has it.
#[derive(Debug, Clone)]
pub(super) struct BlockForm {
    pub(super) a: Matrix,
    pub(super) b: Matrix,
    pub(super) c: Matrix,
    pub(super) d: Matrix,
}

impl BlockForm {
    pub(super) fn new(filters: &SynthesisFilters, ratio: usize) -> Self {
        match filters {
            SynthesisFilters::Fir(taps) => Self::from_taps(taps, ratio),
            SynthesisFilters::StateSpace(block) => Self::from_block(block, ratio),
        }
    }

    /// The state remembers the last J - 1 samples of each channel, J lags of M taps being as long as the filters.
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

    fn from_block(block: &BlockFilter, ratio: usize) -> Self {
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

/// `[xi+; e] = system xi + inputs u`, rows of the state first.
#[derive(Debug, Clone)]
pub(super) struct ErrorSystem {
    /// [A; C], (n + M) x n.
    pub(super) system: Matrix,
    /// [J; L], (n + M) x (number of u).
    pub(super) inputs: Matrix,
    /// Gram matrix of u.
    pub(super) gram: Matrix,
    /// M.
    pub(super) outputs: usize,
}

/// Where the parts of the state lie.
struct Layout {
    lines: Vec<Range<usize>>,
    filter: Range<usize>,
}

impl Layout {
    fn new(tick: &Tick, filter_states: usize) -> Self {
        let mut next = tick.order();
        let mut take = |count: usize| {
            next += count;
            next - count..next
        };
        let lines = tick.ticks_late.iter().map(|&ticks| take(ticks)).collect();
        Self { lines, filter: take(filter_states) }
    }
}

/// Number of states of the error system of a bank, before anything of that size is built.
pub(super) fn order(tick: &Tick, filters: &SynthesisFilters, ratio: usize) -> usize {
    let own = match filters {
        SynthesisFilters::Fir(taps) => taps.len() * (taps[0].len().div_ceil(ratio) - 1),
        SynthesisFilters::StateSpace(block) => block.a.len(),
    };
    Layout::new(tick, own).filter.end
}

impl ErrorSystem {
    pub(super) fn new(tick: &Tick, filters: &BlockForm) -> Self {
        let outputs = filters.d.nrows();
        let layout = Layout::new(tick, filters.a.nrows());
        let (n, order) = (tick.order(), layout.filter.end);
        let mut system = ball::zeros(order + outputs, order);
        let mut inputs = ball::zeros(order + outputs, n + tick.samples());
        system.view_mut((0, 0), (n, n)).copy_from(&tick.transition);
        (0..n).for_each(|i| inputs[(i, i)] = Ball::from(1.0));
        // Each sample as rows over xi and u, at the tick in which it counts.
        let (mut state_rows, mut input_rows) =
            (ball::zeros(tick.samples(), order), ball::zeros(tick.samples(), n + tick.samples()));
        for (s, line) in layout.lines.iter().enumerate() {
            let entry = if line.is_empty() {
                (&mut state_rows, &mut input_rows, s)
            } else {
                (&mut system, &mut inputs, line.start)
            };
            entry.0.view_mut((entry.2, 0), (1, n)).copy_from(&tick.readouts.row(s));
            entry.1[(entry.2, n + s)] = Ball::from(1.0);
            (line.start + 1..line.end).for_each(|link| system[(link, link - 1)] = Ball::from(1.0));
            if !line.is_empty() {
                state_rows[(s, line.end - 1)] = Ball::from(1.0);
            }
        }
        let channels = tick.samples() - outputs;
        let measured = |rows: &Matrix| rows.rows(outputs, channels).into_owned();
        let wanted = |rows: &Matrix| rows.rows(0, outputs).into_owned();
        let filter = layout.filter;
        let own = filter.len();
        for (from, to) in [(&state_rows, &mut system), (&input_rows, &mut inputs)] {
            to.rows_mut(filter.start, own).copy_from(&ball::product(&filters.b, &measured(from)));
            let error = ball::subtract(&wanted(from), &ball::product(&filters.d, &measured(from)));
            to.rows_mut(order, outputs).copy_from(&error);
        }
        system.view_mut((filter.start, filter.start), (own, own)).copy_from(&filters.a);
        system.view_mut((order, filter.start), (outputs, own)).copy_from(&filters.c.map(|x| -x));
        Self { system, inputs, gram: tick.gram.clone(), outputs }
    }

    /// n, the number of states.
    pub(super) fn order(&self) -> usize {
        self.system.ncols()
    }
}
