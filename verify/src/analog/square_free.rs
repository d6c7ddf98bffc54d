//! The square-free factors of a polynomial: its multiple roots, found exactly.
//!
//! Coefficients in doubles are whole numbers times a power of two, so greatest common divisors of
//! polynomials are computed with integers.

use num_bigint::{BigInt, BigUint, Sign};

use crate::arithmetic::Float512;

/// Bits of each piece in which an integer is handed to 512-bit arithmetic: every piece is exact in a double.
const PIECE_BITS: u64 = 48;
/// Pieces that are handed over: the 512 bits end within the last one.
const PIECES: u64 = 12;

/// A factor without multiple roots, and how often it divides.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct SquareFreeFactor {
    /// In descending powers, each rounded to 512 bits; the first and the last one are not zero.
    pub(super) coefficients: Vec<Float512>,
    pub(super) multiplicity: usize,
}

/// The factors of the polynomial with these coefficients in descending powers, of which the first and the
/// last one are not zero. Their product is the polynomial up to a constant.
pub(super) fn square_free_factors(coefficients: &[f64]) -> Vec<SquareFreeFactor> {
    // Entry k - 1: the product of all roots that occur k times and more, each once.
    let mut layers = Vec::new();
    let mut rest = primitive(whole(coefficients));
    while rest.len() > 1 {
        let repeated = common_divisor(&rest, &derivative(&rest));
        layers.push(quotient(&rest, &repeated));
        rest = repeated;
    }
    layers.push(vec![BigInt::from(1)]);
    let exactly = |(k, pair): (usize, &[Vec<BigInt>])| SquareFreeFactor {
        coefficients: quotient(&pair[0], &pair[1]).iter().map(to_long).collect(),
        multiplicity: k + 1,
    };
    layers.windows(2).enumerate().map(exactly).filter(|factor| factor.coefficients.len() > 1).collect()
}

/// `value` as an odd or zero mantissa of at most 53 bits and a power of two.
fn dyadic(value: f64) -> (i64, i64) {
    let bits = value.abs().to_bits();
    let (field, fraction) = ((bits >> 52) as i64, (bits & ((1 << 52) - 1)) as i64);
    let size = if field == 0 { fraction } else { fraction | 1 << 52 };
    let zeros = if size == 0 { 0 } else { size.trailing_zeros() };
    let mantissa = size >> zeros;
    (if value < 0.0 { -mantissa } else { mantissa }, field.max(1) - 1075 + i64::from(zeros))
}

/// The coefficients times a power of two that makes them whole.
fn whole(coefficients: &[f64]) -> Vec<BigInt> {
    let parts: Vec<(i64, i64)> = coefficients.iter().map(|&x| dyadic(x)).collect();
    let least = parts.iter().filter(|part| part.0 != 0).map(|part| part.1).min().unwrap_or(0);
    parts.iter().map(|&(mantissa, power)| BigInt::from(mantissa) << (power - least).max(0) as u64).collect()
}

fn is_zero(x: &BigInt) -> bool {
    x.sign() == Sign::NoSign
}

/// Without leading zeros and common factor.
fn primitive(p: Vec<BigInt>) -> Vec<BigInt> {
    let content = p.iter().fold(BigInt::ZERO, |mut a, x| {
        let mut b = x.clone();
        while !is_zero(&b) {
            (a, b) = (b.clone(), a % b);
        }
        a
    });
    p.into_iter().skip_while(is_zero).map(|x| x / &content).collect()
}

fn derivative(p: &[BigInt]) -> Vec<BigInt> {
    let n = p.len() - 1;
    p[..n].iter().enumerate().map(|(i, x)| x * BigInt::from(n - i)).collect()
}

/// The greatest common divisor, by Euclid's algorithm with primitive remainders.
fn common_divisor(p: &[BigInt], q: &[BigInt]) -> Vec<BigInt> {
    let (mut a, mut b) = (p.to_vec(), primitive(q.to_vec()));
    while b.len() > 1 {
        while a.len() >= b.len() {
            let lead = a[0].clone();
            a.iter_mut().for_each(|x| *x *= &b[0]);
            a.iter_mut().zip(&b).for_each(|(x, y)| *x -= &lead * y);
            a.remove(0);
        }
        (a, b) = (b, primitive(a));
    }
    if b.is_empty() { a } else { b }
}

/// p / q for a primitive q that divides p.
fn quotient(p: &[BigInt], q: &[BigInt]) -> Vec<BigInt> {
    let mut rest = p.to_vec();
    let mut quotient = Vec::new();
    for i in 0..=p.len() - q.len() {
        let factor = &rest[i] / &q[0];
        rest[i..].iter_mut().zip(q).for_each(|(x, y)| *x -= &factor * y);
        quotient.push(factor);
    }
    quotient
}

/// Rounded to 512 bits, with a relative error of at most twice their rounding.
fn to_long(x: &BigInt) -> Float512 {
    let piece = |i: u64| {
        let low = x.magnitude() >> (PIECE_BITS * i);
        let high: BigUint = &low >> PIECE_BITS;
        (low - (high << PIECE_BITS)).iter_u64_digits().next().unwrap_or(0)
    };
    let count = x.bits().div_ceil(PIECE_BITS);
    let left_out = count.saturating_sub(PIECES);
    let value = (left_out..count)
        .rev()
        .fold(Float512::from(0.0), |sum, i| sum.scaled(PIECE_BITS as i64) + Float512::from(piece(i) as f64));
    let value = value.scaled((PIECE_BITS * left_out) as i64);
    if x.sign() == Sign::Minus { -value } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arithmetic::Float;
    use proptest::prelude::*;

    fn times(p: &[f64], q: &[f64]) -> Vec<f64> {
        let mut product = vec![0.0; p.len() + q.len() - 1];
        for (i, x) in p.iter().enumerate() {
            for (j, y) in q.iter().enumerate() {
                product[i + j] += x * y;
            }
        }
        product
    }

    /// The factors by multiplicity, each divided by its leading coefficient.
    fn factors(p: &[f64]) -> Vec<(usize, Vec<f64>)> {
        let monic = |c: &[Float512]| c.iter().map(|&x| (x / c[0]).nearest()).collect();
        square_free_factors(p).iter().map(|f| (f.multiplicity, monic(&f.coefficients))).collect()
    }

    #[test]
    fn multiplicities_are_told_exactly() {
        let cube = times(&times(&[1.0, 0.5], &[1.0, 0.5]), &[1.0, 0.5]);
        let pair = times(&[1.0, 1.0, 4.0], &[1.0, 1.0, 4.0]);
        let whole = times(&times(&cube, &pair), &[-3.0, 1.0]);
        let third: f64 = -1.0 / 3.0;
        assert_eq!(factors(&whole), [(1, vec![1.0, third]), (2, vec![1.0, 1.0, 4.0]), (3, vec![1.0, 0.5])]);
        // One bit beside a double root there is none.
        assert_eq!(factors(&[1.0, 1.0, 0.25]), [(2, vec![1.0, 0.5])]);
        assert_eq!(factors(&[1.0, 1.0, 0.25 + 2f64.powi(-54)]).len(), 1);
        assert_eq!(factors(&[1.0, 1.0, 0.25 + 2f64.powi(-54)])[0].0, 1);
        assert_eq!(factors(&[7.0]), []);
    }

    #[test]
    fn coefficients_of_any_size_are_divided() {
        // All of them exact: the roots are powers of two.
        for scale in [2f64.powi(-24), 2f64.powi(24)] {
            let p = (0..20).fold(vec![2f64.powi(-100)], |p, _| times(&p, &[1.0, scale]));
            assert_eq!(factors(&p), [(20, vec![1.0, scale])]);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

        /// (s^2 + b s + c)^2 (s + d) with small whole numbers.
        #[test]
        fn products_of_squares_are_factored(b in 1i32..40, c in 1i32..40, d in 41i32..90) {
            let (pair, single) = ([1.0, f64::from(b), f64::from(c)], [1.0, f64::from(d)]);
            prop_assume!(b * b != 4 * c && d * d - b * d + c != 0);
            let found = factors(&times(&times(&pair, &pair), &single));
            prop_assert_eq!(found, vec![(1, single.to_vec()), (2, pair.to_vec())]);
        }
    }
}
