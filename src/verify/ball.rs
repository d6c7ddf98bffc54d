//! Interval arithmetic with midpoint and radius. The midpoint has 106 bits (or 512), and every operation
//! adds a bound of its rounding error to the radius. A result encloses the exact result for all values in
//! the operands.

use crate::arithmetic::{DoubleDouble, Number};
use nalgebra::DMatrix;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// Compensates for the rounding of the radius itself: at most a dozen operations in double precision.
const OUTWARD: f64 = 1.0 + 32.0 * f64::EPSILON;
/// Covers results that underflow.
const TINY: f64 = 1e-290;

/// All numbers x with `|x - mid| <= radius`. With an infinite or NaN radius the number is unknown.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Ball<F = DoubleDouble> {
    mid: F,
    radius: f64,
}

/// Matrix of enclosed numbers.
pub(super) type Matrix<F = DoubleDouble> = DMatrix<Ball<F>>;

impl<F: Number> Ball<F> {
    pub(super) const ZERO: Self = Self { mid: F::ZERO, radius: 0.0 };

    pub(super) fn mid(self) -> F {
        self.mid
    }

    /// The nearest double to the midpoint.
    pub(super) fn nearest(self) -> f64 {
        self.mid.nearest()
    }

    /// The radius.
    pub(super) fn radius(self) -> f64 {
        self.radius
    }

    /// Exactly the midpoint given.
    pub(super) fn exactly(mid: F) -> Self {
        Self { mid, radius: 0.0 }
    }

    /// The same midpoint, `by` further in both directions.
    pub(super) fn widened(self, by: f64) -> Self {
        Self { mid: self.mid, radius: (self.radius + by) * OUTWARD }
    }

    /// A bound on the modulus.
    pub(super) fn magnitude(self) -> f64 {
        (self.mid.nearest().abs() + self.radius) * OUTWARD
    }

    /// No value of the ball is less.
    pub(super) fn lower(self) -> f64 {
        let value = self.mid.nearest();
        value - (self.radius + value.abs() * f64::EPSILON) * OUTWARD
    }

    /// No value of the ball is larger.
    pub(super) fn upper(self) -> f64 {
        -(-self).lower()
    }

    fn is_zero(self) -> bool {
        self == Self::ZERO
    }

    fn rounded(mid: F, inherited: f64) -> Self {
        Self { mid, radius: (inherited + F::ROUNDING * mid.nearest().abs()) * OUTWARD + TINY }
    }

    /// Enclosure of the root; NaN if the ball contains negative numbers.
    pub(super) fn sqrt(self) -> Self {
        let least = self.lower();
        if least.is_nan() || least < 0.0 {
            return Self { mid: F::from(f64::NAN), radius: f64::NAN };
        }
        let root = self.mid.sqrt();
        // |sqrt(x) - sqrt(m)| = |x - m| / (sqrt(x) + sqrt(m)).
        let spread = if self.radius == 0.0 { 0.0 } else { self.radius / root.nearest() };
        Self::rounded(root, spread)
    }
}

impl<F: Number> From<f64> for Ball<F> {
    fn from(value: f64) -> Self {
        Self { mid: value.into(), radius: 0.0 }
    }
}

impl<F: Number> Neg for Ball<F> {
    type Output = Self;
    fn neg(self) -> Self {
        Self { mid: -self.mid, radius: self.radius }
    }
}

impl<F: Number> Add for Ball<F> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        match (self.is_zero(), other.is_zero()) {
            (true, _) => other,
            (_, true) => self,
            _ => Self::rounded(self.mid + other.mid, self.radius + other.radius),
        }
    }
}

impl<F: Number> Sub for Ball<F> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl<F: Number> Mul for Ball<F> {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        if self.is_zero() || other.is_zero() {
            return Self::ZERO;
        }
        let (x, y) = (self.mid.nearest().abs(), other.mid.nearest().abs());
        let spread = x * other.radius + y * self.radius + self.radius * other.radius;
        Self::rounded(self.mid * other.mid, spread)
    }
}

impl<F: Number> Div for Ball<F> {
    type Output = Self;
    /// NaN if the divisor's ball contains zero.
    fn div(self, other: Self) -> Self {
        let least = other.mid.nearest().abs() * (1.0 - f64::EPSILON) - other.radius * OUTWARD;
        if least.is_nan() || least <= 0.0 {
            return Self { mid: F::from(f64::NAN), radius: f64::NAN };
        }
        let quotient = self.mid / other.mid;
        // |x/y - m/n| <= (|x - m| + |m/n| |y - n|) / |y|.
        let spread = (self.radius + quotient.nearest().abs() * OUTWARD * other.radius) / least;
        Self::rounded(quotient, spread * OUTWARD)
    }
}

/// The matrix of exactly these doubles.
pub(super) fn exact<F: Number>(m: &DMatrix<f64>) -> Matrix<F> {
    m.map(Ball::from)
}

pub(super) fn zeros<F: Number>(rows: usize, columns: usize) -> Matrix<F> {
    Matrix::from_element(rows, columns, Ball::ZERO)
}

pub(super) fn identity<F: Number>(order: usize) -> Matrix<F> {
    Matrix::from_fn(order, order, |i, j| Ball::from(f64::from(u8::from(i == j))))
}

pub(super) fn add<F: Number>(a: &Matrix<F>, b: &Matrix<F>) -> Matrix<F> {
    a.zip_map(b, |x, y| x + y)
}

pub(super) fn subtract<F: Number>(a: &Matrix<F>, b: &Matrix<F>) -> Matrix<F> {
    a.zip_map(b, |x, y| x - y)
}

pub(super) fn scaled<F: Number>(a: &Matrix<F>, by: Ball<F>) -> Matrix<F> {
    a.map(|x| x * by)
}

/// a b. Entries of `a` that are exactly zero are skipped, because most matrices here are sparse.
pub(super) fn product<F: Number>(a: &Matrix<F>, b: &Matrix<F>) -> Matrix<F> {
    assert_eq!(a.ncols(), b.nrows(), "the matrices of a product fit each other");
    let mut result = zeros(a.nrows(), b.ncols());
    for i in 0..a.nrows() {
        let row: Vec<(usize, Ball<F>)> =
            (0..a.ncols()).map(|k| (k, a[(i, k)])).filter(|(_, x)| !x.is_zero()).collect();
        for j in 0..b.ncols() {
            result[(i, j)] = row.iter().fold(Ball::ZERO, |sum, &(k, x)| sum + x * b[(k, j)]);
        }
    }
    result
}

/// a b'.
pub(super) fn product_transposed<F: Number>(a: &Matrix<F>, b: &Matrix<F>) -> Matrix<F> {
    product(a, &b.transpose())
}

/// a s a' for a symmetric s.
pub(super) fn congruence<F: Number>(a: &Matrix<F>, s: &Matrix<F>) -> Matrix<F> {
    // The second product in the form (a (a s)')', so that the sparse factor stands on the left.
    symmetric(&product(a, &product(a, s).transpose()))
}

/// Copies one triangle into the other, so that the matrix is exactly symmetric. Both triangles must enclose
/// the same numbers.
pub(super) fn symmetric<F: Number>(m: &Matrix<F>) -> Matrix<F> {
    Matrix::from_fn(m.nrows(), m.ncols(), |i, j| m[(i.max(j), i.min(j))])
}

/// A bound on the largest sum of moduli in a row.
pub(super) fn row_sum<F: Number>(m: &Matrix<F>) -> f64 {
    let sum = |i: usize| m.row(i).iter().fold(0.0, |sum, x| (sum + x.magnitude()) * OUTWARD);
    (0..m.nrows()).map(sum).fold(0.0, nan_max)
}

/// A bound on the sum of the radii in each row.
pub(super) fn row_radii<F: Number>(m: &Matrix<F>) -> Vec<f64> {
    m.row_iter().map(|row| row.iter().fold(0.0, |sum, x| (sum + x.radius) * OUTWARD)).collect()
}

/// The same for radii only: a bound on the spectral norm of a symmetric matrix within the radii.
pub(super) fn radius_sum<F: Number>(m: &Matrix<F>) -> f64 {
    row_radii(m).into_iter().fold(0.0, nan_max)
}

/// The larger one; NaN if either is NaN, so that an unknown bound stays unknown.
pub(super) fn nan_max(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) }
}

/// The nearest doubles to the midpoints.
pub(super) fn nearest<F: Number>(m: &Matrix<F>) -> DMatrix<f64> {
    m.map(Ball::nearest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig { cases: 256, failure_persistence: None, ..ProptestConfig::default() })]

        /// The result encloses the results for all values in the operands; tested at the end points,
        /// against 106-bit arithmetic.
        #[test]
        fn results_hold_all_values(a in -1e3..1e3f64, b in -1e3..1e3f64, ra in 0.0..1.0f64, rb in 0.0..1.0f64, s in -1.0..1.0f64, t in -1.0..1.0f64) {
            let (x, y) = (Ball::<DoubleDouble>::from(a).widened(ra), Ball::from(b).widened(rb));
            let (u, v) = (DoubleDouble::from(a) + DoubleDouble::from(s * ra), DoubleDouble::from(b) + DoubleDouble::from(t * rb));
            let holds = |ball: Ball, value: DoubleDouble| ball.radius.is_nan() || (value - ball.mid).nearest().abs() <= ball.radius;
            prop_assert!(holds(x + y, u + v) && holds(x - y, u - v) && holds(x * y, u * v));
            prop_assert!(holds(x / y, u / v));
            prop_assert!(holds(x.sqrt(), u.sqrt()));
            prop_assert!(x.lower() <= u.nearest() && u.nearest() <= x.upper());
        }
    }

    #[test]
    fn what_is_unknown_stays_unknown() {
        let zero = Ball::<DoubleDouble>::from(1e-9).widened(1e-8);
        let unknown = Ball::from(1.0) / zero;
        assert!(unknown.radius().is_nan() && (unknown + Ball::from(1.0)).radius().is_nan());
        assert!(row_sum(&Matrix::from_element(1, 1, unknown)).is_nan());
        assert!(Ball::<DoubleDouble>::from(-1.0).sqrt().radius().is_nan());
    }
}
