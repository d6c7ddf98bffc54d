//! Numbers of 512 bits, for proofs in which 106 bits are not enough.
//!
//! A number is `sign * m * 2^(exponent - 512)` with an integer m of eight 64-bit words whose top bit is
//! set, so that `2^(exponent - 1) <= |x| < 2^exponent`. Sums and products are computed in integers and drop
//! what does not fit: their relative error is below 2^-510. Quotients and roots take Newton's iteration and
//! a last step with the residual; theirs is below 2^-508 (docs/proof.md derives both). An exponent beyond
//! [`MAX_EXPONENT`] makes a number unknown, so that nothing overflows or underflows unseen.

use super::number::Number;
use std::cmp::Ordering;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// 64-bit words of a mantissa.
const WORDS: usize = 8;
const BITS: i64 = 64 * WORDS as i64;
/// Largest modulus of an exponent: sums of two such exponents stay within 64 bits, and squaring reaches it
/// only after fifty steps.
const MAX_EXPONENT: i64 = 1 << 60;

/// A floating-point number with a mantissa of 512 bits; zero has no mantissa, NaN is an unknown number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct BigFloat {
    /// Least significant word first; the top bit is set unless the number is zero.
    words: [u64; WORDS],
    exponent: i64,
    negative: bool,
    nan: bool,
}

impl Default for BigFloat {
    fn default() -> Self {
        Self::ZERO
    }
}

/// The words `words[..]` as a number below `2^exponent`; what lies more than 512 bits below the first
/// bit set is dropped.
fn normalised(words: &[u64], exponent: i64, negative: bool) -> BigFloat {
    let Some(top) = words.iter().rposition(|&word| word != 0) else { return BigFloat::ZERO };
    let shift = words[top].leading_zeros();
    let mut result = [0; WORDS];
    for (k, word) in result.iter_mut().rev().enumerate() {
        let high = top.checked_sub(k).map_or(0, |i| words[i]);
        let low = top.checked_sub(k + 1).map_or(0, |i| words[i]);
        *word = if shift == 0 { high } else { high << shift | low >> (64 - shift) };
    }
    let dropped = 64 * (words.len() - 1 - top) as i64 + i64::from(shift);
    BigFloat { words: result, exponent: exponent - dropped, negative, nan: false }.within_range()
}

impl BigFloat {
    const NAN: Self = Self { words: [0; WORDS], exponent: 0, negative: false, nan: true };

    #[inline]
    fn is_zero(&self) -> bool {
        self.words[WORDS - 1] == 0 && !self.nan
    }

    /// |self| against |other|, neither NaN.
    pub(crate) fn compare_moduli(&self, other: &Self) -> Ordering {
        if self.is_zero() || other.is_zero() {
            return other.is_zero().cmp(&self.is_zero());
        }
        self.exponent.cmp(&other.exponent).then_with(|| self.words.iter().rev().cmp(other.words.iter().rev()))
    }

    /// e with 2^(e - 1) <= |x| < 2^e; 0 for zero and NaN.
    #[inline]
    pub(crate) fn exponent(&self) -> i64 {
        self.exponent
    }

    /// x 2^power.
    #[inline]
    pub(crate) fn scaled(self, power: i64) -> Self {
        if self.is_zero() { self } else { Self { exponent: self.exponent + power, ..self }.within_range() }
    }

    /// The number, unknown if its exponent is too large.
    #[inline]
    fn within_range(self) -> Self {
        if self.exponent.abs() <= MAX_EXPONENT { self } else { Self::NAN }
    }

    /// |self| + |other| for |self| >= |other| > 0, or the difference, with the sign of `self`.
    fn combined(&self, other: &Self, subtract: bool) -> Self {
        // One word below the mantissa keeps 64 more bits of the smaller number, and one above takes the
        // carry.
        let mut sum = [0; WORDS + 2];
        sum[1..=WORDS].copy_from_slice(&self.words);
        let distance = self.exponent - other.exponent;
        if distance < BITS + 64 {
            let (whole, shift) = ((distance / 64) as usize, (distance % 64) as u32);
            // Bit 0 of `other` lies at word 1 before the shift to the right.
            let word = |i: usize| i.checked_sub(1).and_then(|i| other.words.get(i)).copied().unwrap_or(0);
            let part = |i: usize| {
                let (low, high) = (word(i + whole), word(i + whole + 1));
                if shift == 0 { low } else { low >> shift | high << (64 - shift) }
            };
            let mut carry = false;
            for (i, entry) in sum.iter_mut().enumerate().take(WORDS + 1) {
                let part = part(i);
                let (first, over) =
                    if subtract { entry.overflowing_sub(part) } else { entry.overflowing_add(part) };
                let step = u64::from(carry);
                let (second, again) =
                    if subtract { first.overflowing_sub(step) } else { first.overflowing_add(step) };
                (*entry, carry) = (second, over || again);
            }
            sum[WORDS + 1] = u64::from(carry && !subtract);
        }
        normalised(&sum, self.exponent + 64, self.negative)
    }

    /// |self| 2^-exponent with the precision of a double.
    #[inline]
    fn mantissa(&self) -> f64 {
        self.words[WORDS - 1] as f64 * 2f64.powi(-64)
    }
}

impl Number for BigFloat {
    const ZERO: Self = Self { words: [0; WORDS], exponent: 0, negative: false, nan: false };
    /// 2^-506, four times what is proven of the least accurate operation.
    const ROUNDING: f64 = f64::from_bits((1023 - 506) << 52);
    /// 0.5^k / k! is below 2^-512 from here on.
    const SERIES_TERMS: usize = 90;

    #[inline]
    fn nearest(self) -> f64 {
        if self.nan {
            return f64::NAN;
        }
        let size = match self.exponent {
            -1021..=1023 => self.mantissa() * 2f64.powi(self.exponent as i32),
            // 2^1024 is no double, its half is.
            1024 => (2.0 * self.mantissa()) * 2f64.powi(1023),
            1025.. => f64::INFINITY,
            _ => (self.mantissa() * 2f64.powi(-1021)) * 2f64.powi((self.exponent + 1021).max(-1000) as i32),
        };
        if self.negative { -size } else { size }
    }

    fn sqrt(self) -> Self {
        if self.is_zero() {
            return self;
        }
        if self.negative || self.nan {
            return Self::NAN;
        }
        // x = m 2^(2 k) with 1/2 <= m < 2; y -> y + y (1 - m y^2) / 2 doubles the digits of y = 1 / sqrt(m).
        let half = self.exponent.div_euclid(2);
        let m = Self { exponent: self.exponent - 2 * half, ..self };
        let mut y = Self::from(1.0 / m.nearest().sqrt());
        for _ in 0..4 {
            let rest = Self::from(1.0) - m * (y * y);
            y = y + (y * rest).scaled(-1);
        }
        let root = m * y;
        let rest = m - root * root;
        (root + (rest * y).scaled(-1)).scaled(half)
    }
}

impl From<f64> for BigFloat {
    fn from(value: f64) -> Self {
        if value == 0.0 {
            return Self::ZERO;
        }
        if !value.is_finite() {
            return Self::NAN;
        }
        let bits = value.to_bits();
        let (field, fraction) = ((bits >> 52 & 0x7ff) as i64, bits & ((1 << 52) - 1));
        // value = mantissa 2^power.
        let (mantissa, power) =
            if field == 0 { (fraction, -1074) } else { (fraction | 1 << 52, field - 1075) };
        normalised(&[mantissa], power + 64, value < 0.0)
    }
}

impl Neg for BigFloat {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        if self.is_zero() { self } else { Self { negative: !self.negative, ..self } }
    }
}

impl Add for BigFloat {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        if self.nan || other.nan {
            return Self::NAN;
        }
        if other.is_zero() {
            return self;
        }
        if self.is_zero() {
            return other;
        }
        let subtract = self.negative != other.negative;
        match self.compare_moduli(&other) {
            Ordering::Less => other.combined(&self, subtract),
            _ => self.combined(&other, subtract),
        }
    }
}

impl Sub for BigFloat {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for BigFloat {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        if self.nan || other.nan {
            return Self::NAN;
        }
        if self.is_zero() || other.is_zero() {
            return Self::ZERO;
        }
        let mut product = [0u64; 2 * WORDS];
        for (i, &x) in self.words.iter().enumerate() {
            let mut carry = 0u128;
            for (j, &y) in other.words.iter().enumerate() {
                let sum = u128::from(x) * u128::from(y) + u128::from(product[i + j]) + carry;
                product[i + j] = sum as u64;
                carry = sum >> 64;
            }
            product[i + WORDS] = carry as u64;
        }
        normalised(&product, self.exponent + other.exponent, self.negative != other.negative)
    }
}

impl Div for BigFloat {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        if self.nan || other.nan || other.is_zero() {
            return Self::NAN;
        }
        // y -> y + y (1 - d y) doubles the digits of y = 1 / d, d in [1/2, 1).
        let d = Self { exponent: 0, negative: false, ..other };
        let mut y = Self::from(1.0 / d.nearest());
        for _ in 0..4 {
            y = y + y * (Self::from(1.0) - d * y);
        }
        let quotient = self * y;
        let rest = self - quotient * d;
        let quotient = (quotient + rest * y).scaled(-other.exponent);
        if other.negative { -quotient } else { quotient }
    }
}

#[cfg(test)]
mod tests {
    use super::super::exact::Exact;
    use super::*;
    use num_bigint::{BigInt, Sign};
    use proptest::prelude::*;

    fn error_of(found: BigFloat, exact: BigFloat) -> f64 {
        let (gap, size) = ((found - exact).nearest().abs(), exact.nearest().abs());
        if gap == 0.0 { 0.0 } else { gap / size }
    }

    /// A number with digits all along its mantissa.
    fn number(parts: [i64; 3], power: i32) -> BigFloat {
        let tail = parts[1..].iter().enumerate().fold(BigFloat::ZERO, |sum, (k, &part)| {
            sum + BigFloat::from(part as f64).scaled(-200 * (k as i64 + 1))
        });
        (BigFloat::from(parts[0] as f64) + tail).scaled(i64::from(power))
    }

    fn parts() -> impl Strategy<Value = [i64; 3]> {
        [1i64 << 40..1 << 52, -1i64 << 52..1 << 52, -1i64 << 52..1 << 52]
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 512, failure_persistence: None, ..ProptestConfig::default() })]

        /// Sums and products of integers of up to 120 bits, against the machine's integers.
        #[test]
        fn integers_are_exact(a in -1i128 << 60..1 << 60, b in -1i128 << 60..1 << 60) {
            let big = |x: i128| BigFloat::from((x >> 50) as f64).scaled(50) + BigFloat::from((x & ((1 << 50) - 1)) as f64);
            let (x, y) = (big(a), big(b));
            prop_assert_eq!((x + y) - big(a + b), BigFloat::ZERO);
            prop_assert_eq!((x - y) - big(a - b), BigFloat::ZERO);
            let exact = |v: i128| big(v >> 60).scaled(60) + big(v & ((1 << 60) - 1));
            prop_assert_eq!(x * y - exact(a * b), BigFloat::ZERO);
        }

        #[test]
        fn operations_undo_each_other(a in parts(), b in parts(), p in -300i32..300, q in -300i32..300) {
            let (x, y) = (number(a, p), number(b, q));
            prop_assert!(error_of((x * y) / y, x) <= 3.0 * BigFloat::ROUNDING);
            prop_assert!(error_of((x / y) * y, x) <= 3.0 * BigFloat::ROUNDING);
            let root = x.sqrt();
            prop_assert!(error_of(root * root, x) <= 4.0 * BigFloat::ROUNDING);
            // Whatever is smaller in modulus: (x + y) - x = y up to the digits that y loses.
            let large = if p > q { x } else { y };
            let gap = ((x + y) - x) - y;
            prop_assert!(gap.nearest().abs() <= 3.0 * BigFloat::ROUNDING * large.nearest().abs().max(y.nearest().abs()).max(x.nearest().abs()));
        }

        /// (a + b) (a - b) = a^2 - b^2 where nothing is rounded.
        #[test]
        fn products_distribute(a in parts(), b in parts()) {
            let short = |v: [i64; 3]| BigFloat::from(v[0] as f64) + BigFloat::from(v[1] as f64).scaled(-100);
            let (x, y) = (short(a), short(b));
            prop_assert_eq!((x + y) * (x - y) - (x * x - y * y), BigFloat::ZERO);
        }

        #[test]
        fn doubles_come_back(x in any::<f64>()) {
            let back = BigFloat::from(x).nearest();
            prop_assert!(back == x || (!x.is_finite() && back.is_nan()));
        }
    }

    impl From<BigFloat> for Exact {
        fn from(x: BigFloat) -> Self {
            assert!(!x.nan);
            let bytes: Vec<u8> = x.words.iter().flat_map(|word| word.to_le_bytes()).collect();
            let sign = if x.negative { Sign::Minus } else { Sign::Plus };
            Self { mantissa: BigInt::from_bytes_le(sign, &bytes), power: x.exponent - BITS }
        }
    }

    /// Mantissas whose digits are random, all zero but the ends, or all one but a few.
    fn any_number() -> impl Strategy<Value = BigFloat> {
        let words = prop_oneof![
            any::<[u64; WORDS]>(),
            (0..WORDS, any::<u64>()).prop_map(|(i, word)| {
                let mut words = [0; WORDS];
                words[i] = word;
                words
            }),
            (0..WORDS, 0..64).prop_map(|(i, bit)| {
                let mut words = [u64::MAX; WORDS];
                words[i] ^= 1u64 << bit;
                words
            }),
        ];
        let exponent = prop_oneof![-3i64..4, -1100i64..1100, -1i64 << 40..1 << 40];
        (words, exponent, any::<bool>()).prop_map(|(mut words, exponent, negative)| {
            words[WORDS - 1] |= 1 << 63;
            BigFloat { words, exponent, negative, nan: false }
        })
    }

    /// The bounds that docs/proof.md derives.
    fn proven(power: i64, of: &Exact) -> Exact {
        of.times(&Exact::power_of_two(power))
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 2048, failure_persistence: None, ..ProptestConfig::default() })]

        /// Against exact integers; a sum of numbers that lie close together, too.
        #[test]
        fn errors_are_those_that_are_proven(x in any_number(), y in any_number(), shift in -600i64..600) {
            let y = BigFloat { exponent: if shift % 2 == 0 { x.exponent + shift } else { y.exponent }, ..y };
            let [a, b] = [x, y].map(Exact::from);
            if (x.exponent - y.exponent).abs() < 3000 {
                let sum = a.plus(&b);
                prop_assert!(Exact::from(x + y).minus(&sum).is_within(&proven(-510, &sum)));
            }
            let product = a.times(&b);
            prop_assert!(Exact::from(x * y).minus(&product).is_within(&proven(-510, &product)));
            prop_assert!(Exact::from(x / y).times(&b).minus(&a).is_within(&proven(-508, &a)));
            let positive = BigFloat { negative: false, ..x };
            let root = Exact::from(positive.sqrt());
            prop_assert!(root.times(&root).minus(&a.abs()).is_within(&proven(-507, &a)));
        }
    }

    #[test]
    fn an_exponent_beyond_the_range_makes_a_number_unknown() {
        for start in [2.0, 0.5] {
            let mut x = BigFloat::from(start);
            for _ in 0..70 {
                x = x * x;
            }
            assert!(x.nearest().is_nan());
        }
    }

    #[test]
    fn the_ends_of_the_doubles_come_back() {
        for x in [
            f64::MAX,
            -f64::MAX,
            f64::MAX / 2.0,
            f64::MIN_POSITIVE,
            f64::from_bits(1),
            f64::from_bits(0xfffff),
        ] {
            assert_eq!(BigFloat::from(x).nearest(), x);
        }
        assert_eq!((BigFloat::from(f64::MAX) + BigFloat::from(f64::MAX)).nearest(), f64::INFINITY);
        assert_eq!(BigFloat::from(f64::from_bits(1)).scaled(-2).nearest(), 0.0);
    }

    #[test]
    fn a_seventh_repeats_its_digits() {
        let seventh = BigFloat::from(1.0) / BigFloat::from(7.0);
        // 1/7 = 0.001001..b: 8 / 7 = 1 + 1/7.
        assert!(error_of(seventh.scaled(3) - BigFloat::from(1.0), seventh) <= 16.0 * BigFloat::ROUNDING);
        assert!(BigFloat::from(-1.0).sqrt().nearest().is_nan());
        assert!((BigFloat::from(1.0) / BigFloat::ZERO).nearest().is_nan());
        assert!((BigFloat::from(f64::NAN) + BigFloat::from(1.0)).nearest().is_nan());
    }
}
