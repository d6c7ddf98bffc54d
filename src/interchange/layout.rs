//! The coefficients in the order in which every format has them.

use crate::bank::StateMatrices;

/// FIR taps by channel, phase and lag.
#[derive(Debug, Clone, PartialEq)]
pub struct PolyphaseTaps<T> {
    /// N.
    pub channels: usize,
    /// M.
    pub ratio: usize,
    /// Slow periods that the filters span; shorter phases end in zeros.
    pub lags: usize,
    /// Entry (i, p, j) at `(i M + p) lags + j`.
    pub values: Vec<T>,
}

impl<T: Copy + Default + PartialEq> PolyphaseTaps<T> {
    /// Of `taps[i][n]`, n counting fast samples.
    pub fn new(taps: &[Vec<T>], ratio: usize) -> Self {
        let lags = taps.iter().map(Vec::len).max().unwrap_or(0).div_ceil(ratio).max(1);
        let tap = |i: usize, p: usize, j: usize| taps[i].get(p + j * ratio).copied().unwrap_or_default();
        let index = |i: usize| (0..ratio).flat_map(move |p| (0..lags).map(move |j| (i, p, j)));
        let values = (0..taps.len()).flat_map(index).map(|(i, p, j)| tap(i, p, j)).collect();
        Self { channels: taps.len(), ratio, lags, values }
    }

    /// Entry (i, p, j).
    pub fn get(&self, channel: usize, phase: usize, lag: usize) -> T {
        self.values[(channel * self.ratio + phase) * self.lags + lag]
    }

    /// The taps of a phase, each with its channel, in the order of the file.
    pub(super) fn of_phase(&self, phase: usize) -> impl Iterator<Item = (usize, T)> {
        let of_channel = move |i: usize| (0..self.lags).map(move |j| (i, self.get(i, phase, j)));
        (0..self.channels).flat_map(of_channel)
    }

    /// Taps that are not zero: the multiplications of a slow period.
    pub fn nonzero(&self) -> usize {
        self.values.iter().filter(|value| **value != T::default()).count()
    }
}

/// The rows of `[a b; c d]` without their zeros: for each, states first, the columns of `[x; u]` with their
/// coefficients.
pub fn sparse_rows(block: &StateMatrices) -> Vec<Vec<(usize, f64)>> {
    let row = |(left, right): (&Vec<f64>, &Vec<f64>)| {
        left.iter().chain(right).copied().enumerate().filter(|&(_, value)| value != 0.0).collect()
    };
    block.a.iter().zip(&block.b).chain(block.c.iter().zip(&block.d)).map(row).collect()
}
