//! Exact numbers m 2^e by a library of integers, against which the tests hold the errors of operations.

use num_bigint::{BigInt, Sign};
use std::cmp::Ordering;

/// `mantissa` 2^`power`.
#[derive(Debug, Clone)]
pub(super) struct Exact {
    pub(super) mantissa: BigInt,
    pub(super) power: i64,
}

impl Exact {
    /// 2^`power`.
    pub(super) fn power_of_two(power: i64) -> Self {
        Self { mantissa: 1.into(), power }
    }

    pub(super) fn abs(&self) -> Self {
        Self { mantissa: self.mantissa.magnitude().clone().into(), power: self.power }
    }

    pub(super) fn times(&self, other: &Self) -> Self {
        Self { mantissa: &self.mantissa * &other.mantissa, power: self.power + other.power }
    }

    pub(super) fn plus(&self, other: &Self) -> Self {
        let [a, b] = self.aligned(other);
        Self { mantissa: a + b, power: self.power.min(other.power) }
    }

    pub(super) fn minus(&self, other: &Self) -> Self {
        self.plus(&other.times(&Exact::from(-1.0)))
    }

    /// Whether |self| <= |other|.
    pub(super) fn is_within(&self, other: &Self) -> bool {
        let [a, b] = self.abs().aligned(&other.abs());
        a.cmp(&b) != Ordering::Greater
    }

    /// Both mantissas at the smaller power.
    fn aligned(&self, other: &Self) -> [BigInt; 2] {
        let least = self.power.min(other.power);
        [self, other].map(|x| match x.mantissa.sign() {
            Sign::NoSign => BigInt::default(),
            _ => &x.mantissa << u64::try_from(x.power - least).expect("not negative"),
        })
    }
}

impl From<f64> for Exact {
    fn from(value: f64) -> Self {
        assert!(value.is_finite(), "{value}");
        let bits = value.to_bits();
        let (field, fraction) = ((bits >> 52 & 0x7ff) as i64, (bits & ((1 << 52) - 1)) as i64);
        let size = if field == 0 { fraction } else { fraction | 1 << 52 };
        let mantissa = if value < 0.0 { -size } else { size };
        Self { mantissa: mantissa.into(), power: field.max(1) - 1075 }
    }
}
