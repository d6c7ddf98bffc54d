//! Which form a FIR bank runs in.

use super::{BuildError, Precision};

/// K: ticks that the filters `taps` reach over, at least one.
pub(crate) fn lags(taps: &[Vec<f64>], ratio: usize) -> usize {
    taps.iter().map(|f| f.len().div_ceil(ratio)).max().unwrap_or(0).max(1)
}

/// The form of a FIR bank.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Form {
    /// Every product is made: nothing is later than the bank's latency.
    #[default]
    Direct,
    /// By Fourier transforms of the given length, or of the best one: for long filters a fraction of the work,
    /// but late by a batch of blocks.
    OverlapSave(Option<usize>),
    /// Whichever takes least time.
    Fastest,
}

impl Form {
    /// F, if the bank is to run by transforms.
    pub(crate) fn transform_len(
        self,
        taps: &[Vec<f64>],
        ratio: usize,
        _precision: Precision,
    ) -> Result<Option<usize>, BuildError> {
        let lags = lags(taps, ratio);
        Ok(match self {
            Self::Direct => None,
            Self::OverlapSave(len) => Some(len.unwrap_or((4 * lags).next_power_of_two().max(16))),
            Self::Fastest => None,
        })
    }
}
