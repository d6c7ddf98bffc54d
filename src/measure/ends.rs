//! Ends of a record where something has not settled.

use crate::units::Decibels;

/// Fewest samples at either end that are looked at.
const FEWEST: usize = 8;
/// The power of a piece relative to the middle from which on it belongs to an end.
const RAISED: f64 = 4.0;

/// Samples at the ends of a record that hold most of what no line explains: a filter that had no input
/// before the first sample, for example.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct UnsettledEnds {
    /// Samples at either end.
    pub samples: usize,
    /// Power of the rest of the whole record over that without these samples. The gain of leaving them out
    /// is larger, because they pull at the fit of the tones too.
    #[serde(rename = "raise_db")]
    pub raise: Decibels,
}

impl UnsettledEnds {
    /// The ends of a rest whose power they at least double. Pieces of 8, 16, 32 .. samples are compared with
    /// the middle half. `None` too if more than an eighth at either end is raised: such a record changes all
    /// along.
    pub(super) fn of(rest: &[f64]) -> Option<Self> {
        let n = rest.len();
        let (whole, middle) = (mean_square(rest), mean_square(&rest[n / 4..n - n / 4]));
        if whole <= 2.0 * middle {
            return None;
        }
        let is_raised = |k: usize| {
            [k..2 * k, n - 2 * k..n - k].into_iter().any(|at| mean_square(&rest[at]) > RAISED * middle)
        };
        let mut samples = FEWEST;
        while 8 * samples <= n && is_raised(samples) {
            samples *= 2;
        }
        let is_an_end = 8 * samples <= n;
        is_an_end.then(|| Self {
            samples,
            raise: Decibels::of_power(whole / mean_square(&rest[samples..n - samples])),
        })
    }
}

fn mean_square(samples: &[f64]) -> f64 {
    samples.iter().map(|x| x * x).sum::<f64>() / samples.len().max(1) as f64
}
