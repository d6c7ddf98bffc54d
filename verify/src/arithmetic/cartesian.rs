//! Complex numbers of any of the real ones.

use super::real::Field;
use super::{Ball, Float, Float512};
use std::ops::{Add, Div, Mul, Neg, Sub};

/// A complex number by its parts.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Cartesian<T> {
    /// Real part.
    pub re: T,
    /// Imaginary part.
    pub im: T,
}

/// All complex numbers whose parts lie in two balls.
pub type ComplexBall<F = Float512> = Cartesian<Ball<F>>;

impl<T: Field> Cartesian<T> {
    /// re + j im.
    #[inline]
    pub fn new(re: T, im: T) -> Self {
        Self { re, im }
    }

    /// The conjugate.
    #[inline]
    pub fn conj(self) -> Self {
        Self { re: self.re, im: -self.im }
    }

    /// The square of the modulus.
    #[inline]
    pub fn norm_sqr(self) -> T {
        self.re * self.re + self.im * self.im
    }

    /// Times a real number.
    #[inline]
    pub fn scaled(self, by: T) -> Self {
        Self { re: self.re * by, im: self.im * by }
    }
}

impl<F: Float> ComplexBall<F> {
    /// One of the two square roots.
    pub fn sqrt(self) -> Self {
        let half = Ball::from(0.5);
        // The part that is a sum; the other one follows from 2 re im.
        let large = ((self.norm_sqr().sqrt() + if self.re.nearest() < 0.0 { -self.re } else { self.re })
            * half)
            .sqrt();
        let small = self.im * half / large;
        if self.re.nearest() < 0.0 { Self::new(small, large) } else { Self::new(large, small) }
    }
}

impl<F: Float> From<Ball<F>> for ComplexBall<F> {
    #[inline]
    fn from(re: Ball<F>) -> Self {
        Self { re, im: Ball::ZERO }
    }
}

impl<F: Float> From<f64> for ComplexBall<F> {
    #[inline]
    fn from(re: f64) -> Self {
        Ball::from(re).into()
    }
}

impl<T: Field> Neg for Cartesian<T> {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self { re: -self.re, im: -self.im }
    }
}

impl<T: Field> Add for Cartesian<T> {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        Self { re: self.re + other.re, im: self.im + other.im }
    }
}

impl<T: Field> Sub for Cartesian<T> {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        Self { re: self.re - other.re, im: self.im - other.im }
    }
}

impl<T: Field> Mul for Cartesian<T> {
    type Output = Self;
    #[inline]
    fn mul(self, other: Self) -> Self {
        Self { re: self.re * other.re - self.im * other.im, im: self.re * other.im + self.im * other.re }
    }
}

impl<T: Field> Div for Cartesian<T> {
    type Output = Self;
    /// NaN if the divisor is, or may be, zero.
    #[inline]
    fn div(self, other: Self) -> Self {
        let (product, size) = (self * other.conj(), other.norm_sqr());
        Self { re: product.re / size, im: product.im / size }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ball(re: f64, im: f64) -> ComplexBall {
        ComplexBall::new(Ball::from(re), Ball::from(im))
    }

    /// (3 + 4 i) (1 - 2 i) = 11 - 2 i, all exact in binary.
    #[test]
    fn products_and_quotients_are_those_of_complex_numbers() {
        let (x, y, xy) = (ball(3.0, 4.0), ball(1.0, -2.0), ball(11.0, -2.0));
        for rest in [x * y - xy, xy / y - x, x + y - ball(4.0, 2.0), x.scaled(Ball::from(2.0)) - x - x] {
            assert!(rest.norm_sqr().magnitude() < 1e-280, "{rest:?}");
            assert!(rest.re.lower() <= 0.0 && rest.re.upper() >= 0.0, "{rest:?}");
            assert!(rest.im.lower() <= 0.0 && rest.im.upper() >= 0.0, "{rest:?}");
        }
        for z in [x, -x, y, -y, x * y, x.conj(), ball(0.0, -2.0)] {
            let rest = z.sqrt() * z.sqrt() - z;
            assert!(rest.norm_sqr().magnitude() < 1e-280, "{z:?}");
            assert!(rest.re.lower() <= 0.0 && rest.re.upper() >= 0.0, "{rest:?}");
        }
        assert!((x / (y - y)).re.radius().is_nan());
    }
}
