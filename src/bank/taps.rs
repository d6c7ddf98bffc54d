//! What banks say of their taps: fixed-point integers, and slopes by which delay-scheduled taps follow the
//! delays.

use super::{Bank, SynthesisFilters};
use crate::spec::WordLengths;
use crate::units::FastPeriods;
use serde::Serialize;

/// Taps that are integers times 2^-`fraction_bits`, `f_i[n] = integers[i][n] * 2^-fraction_bits`, in two's
/// complement with the given word lengths.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FixedPoint {
    /// Bits of each tap.
    pub bits: WordLengths,
    /// Bits after the point.
    pub fraction_bits: i32,
    /// One list per channel.
    pub integers: Vec<Vec<i64>>,
}

impl FixedPoint {
    /// 2^-`fraction_bits`.
    pub fn step(&self) -> f64 {
        (-f64::from(self.fraction_bits)).exp2()
    }

    /// Whether all integers are zero.
    pub fn is_zero(&self) -> bool {
        self.integers.iter().flatten().all(|&integer| integer == 0)
    }

    /// The taps as floating-point numbers; the conversion is exact.
    pub fn taps(&self) -> Vec<Vec<f64>> {
        let tap = |&integer: &i64| integer as f64 * self.step();
        self.integers.iter().map(|list| list.iter().map(tap).collect()).collect()
    }
}

/// How the taps change with the delays: with channel j delayed by delta_j fast periods more than the bank
/// says, tap n of channel i is
///
/// ```text
/// f_i[n] + sum over j of  delta_j by_delay[j][i][n].
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct TapSlopes {
    /// `by_delay[j][i][n]`, per fast period; an empty list for a channel j whose delay is exact.
    pub by_delay: Vec<Vec<Vec<f64>>>,
}

impl TapSlopes {
    /// The `taps` of the bank's delays moved to delays that differ by `errors`, one per channel. The sum
    /// goes from the first channel to the last one.
    pub fn moved(&self, taps: &[Vec<f64>], errors: &[FastPeriods]) -> Vec<Vec<f64>> {
        let mut moved = taps.to_vec();
        for (slopes, error) in self.by_delay.iter().zip(errors) {
            for (tap, slope) in moved.iter_mut().flatten().zip(slopes.iter().flatten()) {
                *tap += error.0 * slope;
            }
        }
        moved
    }

    /// Whether the taps follow the delay of channel `j`, from 0.
    pub fn follows(&self, j: usize) -> bool {
        self.by_delay.get(j).is_some_and(|slopes| !slopes.is_empty())
    }
}

impl Bank {
    /// The filters for delays that differ from those of the bank by `errors`, one per channel. Without
    /// [`Bank::tap_slopes`] they are the filters of the bank.
    pub fn filters_at(&self, errors: &[FastPeriods]) -> SynthesisFilters {
        match (&self.filters, &self.tap_slopes) {
            (SynthesisFilters::Fir(taps), Some(slopes)) => SynthesisFilters::Fir(slopes.moved(taps, errors)),
            _ => self.filters.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn taps_move_with_all_delays_at_once() {
        let by_delay = vec![vec![], vec![vec![1.0, -2.0], vec![0.5, 0.0]]];
        let slopes = TapSlopes { by_delay };
        let taps = [vec![1.0, 1.0], vec![2.0, 3.0]];
        let moved = slopes.moved(&taps, &[FastPeriods(7.0), FastPeriods(0.25)]);
        assert_eq!(moved, [vec![1.25, 0.5], vec![2.125, 3.0]]);
        assert!(slopes.follows(1) && !slopes.follows(0) && !slopes.follows(2));
    }
}
