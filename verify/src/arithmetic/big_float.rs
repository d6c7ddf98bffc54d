//! Numbers of 256 and of 512 bits, where 106 bits are not enough.
//!
//! A number of B bits is `sign * m * 2^(exponent - B)` with an integer m of B / 64 words whose top bit is
//! set, so that `2^(exponent - 1) <= |x| < 2^exponent`. Sums and products are computed in integers and drop
//! what does not fit: their relative error is below 2^(2 - B). Quotients and roots take Newton's iteration
//! and a last step with the residual; theirs is below 2^(4 - B). An exponent beyond [`MAX_EXPONENT`] makes a
//! number unknown, so that nothing overflows or underflows unseen.
//!
//! For B = 512, with mu = 2^-510:
//!
//! - *Product.* The integers are multiplied exactly, and the first 512 bits are kept: the relative error is
//!   below 2^-511.
//! - *Sum.* The smaller number is shifted and cut 64 bits below the mantissa of the larger one, where 2^e
//!   bounds the larger one: the cut drops less than 2^(e - 576). It drops something only where the exponents
//!   differ by more than 64, and then the sum or difference is at least 2^(e - 2). With the 512 bits that
//!   are kept at the end the relative error is below 2^-574 + 2^-511 < mu.
//! - *Quotient x / d*, 1/2 <= d < 1. The inverse y of d starts from a double with a relative error below
//!   2^-51. With y = (1 + delta) / d, one step y + y (1 - d y) gives (1 - delta^2) / d without rounding. The
//!   rounding of d y adds at most (1 + delta)^2 mu, the last sum mu, and the other two operations 2 mu
//!   |delta|, since 1 - d y is near -delta. So |delta| becomes at most delta^2 + 3 mu: 2^-102, 2^-203,
//!   2^-405 and then below 4 mu. The quotient q = x y has an error eta below 6 mu. The last step q + (x - q
//!   d) y removes eta up to eta times small factors: the rounding of q d adds mu, the last sum mu, and the
//!   rest is of second order. The quotient is right to 3 mu < 2^-508.
//! - *Root of m*, 1/2 <= m < 2. The inverse root y = (1 + delta) / sqrt(m) starts below 2^-51 too. One step
//!   y + y (1 - m y^2) / 2 gives an error of at most (3/2) delta^2 + |delta|^3 / 2 without rounding. The two
//!   products in m y^2 add 2 mu / 2, the last sum mu, the rest less than mu. So |delta| becomes at most
//!   2 delta^2 + 3 mu: 2^-101, 2^-201, 2^-401 and then below 4 mu. r = m y has an error below 6 mu, and the
//!   last step r + (m - r^2) y / 2 leaves mu / 2 from r^2, mu from the sum and terms of second order: less
//!   than 2 mu < 2^-508.

use super::number::Float;
use std::cmp::Ordering;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// Most 64-bit words of a mantissa.
const MOST_WORDS: usize = 8;
/// Largest modulus of an exponent: sums of two such exponents stay within 64 bits, and squaring reaches it
/// only after fifty steps.
const MAX_EXPONENT: i64 = 1 << 60;

/// 512 bits.
pub type Float512 = BigFloat<8>;

/// A floating-point number with a mantissa of so many words; zero has no mantissa, NaN is an unknown number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BigFloat<const WORDS: usize> {
    /// Least significant word first; the top bit is set unless the number is zero.
    words: [u64; WORDS],
    exponent: i64,
    negative: bool,
    nan: bool,
}

impl<const WORDS: usize> Default for BigFloat<WORDS> {
    fn default() -> Self {
        Self::ZERO
    }
}

/// The words `words[..]` as a number below `2^exponent`; bits are dropped that lie further below the first
/// one set than the number has bits.
fn normalised<const WORDS: usize>(words: &[u64], exponent: i64, negative: bool) -> BigFloat<WORDS> {
    let Some(top) = words.iter().rposition(|&word| word != 0) else { return BigFloat::ZERO };
    let mut leading = [0; MOST_WORDS + 1];
    let kept = (top + 1).min(WORDS + 1);
    leading[WORDS + 1 - kept..=WORDS].copy_from_slice(&words[top + 1 - kept..=top]);
    let shift = words[top].leading_zeros();
    let dropped = 64 * (words.len() - 1 - top) as i64 + i64::from(shift);
    let words = upper(&leading[..=WORDS], shift);
    BigFloat { words, exponent: exponent - dropped, negative, nan: false }.within_range()
}

/// The upper word of two after a shift to the left by less than a word.
#[inline]
fn joined(high: u64, low: u64, shift: u32) -> u64 {
    high << shift | low >> 1 >> (63 - shift)
}

/// All words but the lowest one, after a shift to the left by less than a word.
#[inline]
fn upper<const WORDS: usize>(words: &[u64], shift: u32) -> [u64; WORDS] {
    let mut shifted = [0; WORDS];
    // No `array::from_fn`, which is a call for each entry below the highest level of optimisation.
    for (word, pair) in shifted.iter_mut().zip(words.windows(2)) {
        *word = joined(pair[1], pair[0], shift);
    }
    shifted
}

/// 2^power, a normal double.
#[inline]
fn power_of_two(power: i64) -> f64 {
    f64::from_bits(((power + 1023) as u64) << 52)
}

impl<const WORDS: usize> BigFloat<WORDS> {
    const BITS: i64 = 64 * WORDS as i64;
    const NAN: Self = Self { words: [0; WORDS], exponent: 0, negative: false, nan: true };

    /// With another number of words; what does not fit is dropped.
    pub fn rounded<const OTHER: usize>(self) -> BigFloat<OTHER> {
        BigFloat { nan: self.nan, ..normalised(&self.words, self.exponent, self.negative) }
    }

    #[inline]
    fn is_zero(&self) -> bool {
        self.words[WORDS - 1] == 0 && !self.nan
    }

    /// |self| against |other|, neither NaN.
    pub fn compare_moduli(&self, other: &Self) -> Ordering {
        if self.is_zero() || other.is_zero() {
            return other.is_zero().cmp(&self.is_zero());
        }
        self.exponent.cmp(&other.exponent).then_with(|| self.words.iter().rev().cmp(other.words.iter().rev()))
    }

    /// e with 2^(e - 1) <= |x| < 2^e; 0 for zero and NaN.
    #[inline]
    pub fn exponent(&self) -> i64 {
        self.exponent
    }

    /// x 2^power.
    #[inline]
    pub fn scaled(self, power: i64) -> Self {
        if self.is_zero() { self } else { Self { exponent: self.exponent + power, ..self }.within_range() }
    }

    /// The number, unknown if its exponent is too large.
    #[inline]
    fn within_range(self) -> Self {
        if self.exponent.abs() <= MAX_EXPONENT { self } else { Self::NAN }
    }

    /// |self| + |other| for |self| >= |other| > 0, or the difference, with the sign of `self`.
    #[inline]
    fn combined(&self, other: &Self, subtract: bool) -> Self {
        let distance = self.exponent - other.exponent;
        let (whole, shift) = ((distance / 64) as usize, (distance % 64) as u32);
        match distance {
            // Most pairs. The loop is compiled for it, so that the words stay in registers.
            0..64 => self.combined_after(0, shift, other, subtract),
            _ if distance >= Self::BITS + 64 => *self,
            _ => self.combined_after(whole, shift, other, subtract),
        }
    }

    /// The same, with `other` shifted to the right by `whole` words and by `shift` bits, less than a word.
    /// One word below the mantissas keeps 64 more bits of it.
    #[inline(always)]
    fn combined_after(&self, whole: usize, shift: u32, other: &Self, subtract: bool) -> Self {
        let word =
            |k: usize| (k + whole).checked_sub(1).and_then(|k| other.words.get(k)).copied().unwrap_or(0);
        let mut sum = [0; MOST_WORDS + 1];
        let sum = &mut sum[..=WORDS];
        sum[1..].copy_from_slice(&self.words);
        let mut carry = false;
        for (k, entry) in sum.iter_mut().enumerate() {
            let part = word(k) >> shift | word(k + 1) << 1 << (63 - shift);
            let step = u64::from(carry);
            let (first, over) =
                if subtract { entry.overflowing_sub(part) } else { entry.overflowing_add(part) };
            let (second, again) =
                if subtract { first.overflowing_sub(step) } else { first.overflowing_add(step) };
            (*entry, carry) = (second, over | again);
        }
        let (mut words, mut exponent) = (upper(sum, 0), self.exponent);
        if subtract {
            let shift = sum[WORDS].leading_zeros();
            if shift == 64 {
                return normalised(sum, self.exponent, self.negative);
            }
            words = upper(sum, shift);
            exponent -= i64::from(shift);
        } else if carry {
            words = std::array::from_fn(|k| joined(sum.get(k + 2).copied().unwrap_or(1), sum[k + 1], 63));
            exponent += 1;
        }
        Self { words, exponent, negative: self.negative, nan: false }.within_range()
    }

    /// |self| 2^-exponent with the precision of a double.
    #[inline]
    fn mantissa(&self) -> f64 {
        self.words[WORDS - 1] as f64 * power_of_two(-64)
    }
}

impl<const WORDS: usize> Float for BigFloat<WORDS> {
    const ZERO: Self = Self { words: [0; WORDS], exponent: 0, negative: false, nan: false };
    /// 2^(6 - B), four times what is proven of the least accurate operation.
    const ROUNDING: f64 = f64::from_bits((1023 + 6 - 64 * WORDS as u64) << 52);
    /// 0.5^k / k! is below 2^-512 from here on.
    const SERIES_TERMS: usize = 90;

    #[inline]
    fn nearest(self) -> f64 {
        if self.nan {
            return f64::NAN;
        }
        let size = match self.exponent {
            -1021..=1023 => self.mantissa() * power_of_two(self.exponent),
            // 2^1024 is no double, its half is.
            1024 => (2.0 * self.mantissa()) * power_of_two(1023),
            1025.. => f64::INFINITY,
            _ => (self.mantissa() * power_of_two(-1021)) * power_of_two((self.exponent + 1021).max(-1000)),
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

impl<const WORDS: usize> From<f64> for BigFloat<WORDS> {
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

impl<const WORDS: usize> Neg for BigFloat<WORDS> {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        if self.is_zero() { self } else { Self { negative: !self.negative, ..self } }
    }
}

impl<const WORDS: usize> Add for BigFloat<WORDS> {
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

impl<const WORDS: usize> Sub for BigFloat<WORDS> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl<const WORDS: usize> Mul for BigFloat<WORDS> {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        if self.nan || other.nan {
            return Self::NAN;
        }
        if self.is_zero() || other.is_zero() {
            return Self::ZERO;
        }
        let mut product = [0; 2 * MOST_WORDS];
        let product = &mut product[..2 * WORDS];
        write_product(&self.words, &other.words, product);
        // Both mantissas are at least 1/2, so their product is at least 1/4.
        let shift = product[2 * WORDS - 1].leading_zeros();
        Self {
            words: upper(&product[WORDS - 1..], shift),
            exponent: self.exponent + other.exponent - i64::from(shift),
            negative: self.negative != other.negative,
            nan: false,
        }
        .within_range()
    }
}

/// x y, exact, into zeros.
#[inline]
fn write_product<const WORDS: usize>(x: &[u64; WORDS], y: &[u64; WORDS], product: &mut [u64]) {
    for (i, &x) in x.iter().enumerate() {
        let mut carry = 0;
        for (j, &y) in y.iter().enumerate() {
            // At most (2^64 - 1)^2 + 2 (2^64 - 1) = 2^128 - 1.
            let sum = u128::from(x)
                .wrapping_mul(u128::from(y))
                .wrapping_add(u128::from(product[i + j]))
                .wrapping_add(u128::from(carry));
            (product[i + j], carry) = (sum as u64, (sum >> 64) as u64);
        }
        product[i + WORDS] = carry;
    }
}

impl<const WORDS: usize> Div for BigFloat<WORDS> {
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
mod tests;
