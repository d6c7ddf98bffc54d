//! Taps that are fixed-point numbers.

use crate::spec::WordLengths;
use serde::{Deserialize, Serialize};

/// Taps that are integers times 2^-`fraction_bits`, `f_i[n] = integers[i][n] * 2^-fraction_bits`, in two's
/// complement with the given word lengths.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
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
