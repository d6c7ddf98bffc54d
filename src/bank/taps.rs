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

    /// Digits other than 0 of all integers in canonical signed digits: -1, 0 and 1, of which no two
    /// neighbours are other than 0, as few as any such digits (G. W. Reitwiesner, *Binary Arithmetic*,
    /// 1960).
    pub fn signed_digits(&self) -> u32 {
        self.integers.iter().flatten().map(|&integer| signed_digits(integer)).sum()
    }

    /// The taps as floating-point numbers; the conversion is exact.
    pub fn taps(&self) -> Vec<Vec<f64>> {
        let tap = |&integer: &i64| integer as f64 * self.step();
        self.integers.iter().map(|list| list.iter().map(tap).collect()).collect()
    }
}

/// Canonical signed digits of an integer that are other than 0: where it differs from its triple.
pub(crate) fn signed_digits(integer: i64) -> u32 {
    let size = u128::from(integer.unsigned_abs());
    (size ^ (3 * size)).count_ones()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signed_digits_are_the_fewest() {
        // By trying all sums of up to three signed powers of two.
        let powers: Vec<i64> = (0..8).flat_map(|k| [1 << k, -(1 << k)]).collect();
        let plus = |sums: &Vec<i64>| sums.iter().flat_map(|x| powers.iter().map(move |p| x + p)).collect();
        let one = powers.clone();
        let two: Vec<i64> = plus(&one);
        let three: Vec<i64> = plus(&two);
        for integer in -64..65 {
            let fewest = match integer {
                0 => 0,
                x if one.contains(&x) => 1,
                x if two.contains(&x) => 2,
                x if three.contains(&x) => 3,
                _ => 4,
            };
            assert_eq!(signed_digits(integer), fewest, "{integer}");
        }
    }
}
