//! Real and complex numbers of 640 bits, on the crate dashu-float: nothing here comes from the product.

use dashu_float::FBig;
use dashu_float::ops::SquareRoot;
use dashu_float::round::mode::HalfEven;
use std::ops::{Add, Mul, Neg, Sub};

/// A real number with a mantissa of [`BITS`].
pub(crate) type Real = FBig<HalfEven, 2>;

/// 192 digits. The residues of six pole pairs of Q = 10,000 cancel over 50 digits, and a triple pole that is
/// split by [`SPLIT`](super::fronts::SPLIT) over 90.
pub(crate) const BITS: usize = 640;

/// The double as it is.
pub(crate) fn real(x: f64) -> Real {
    Real::try_from(x).expect("a finite number").with_precision(BITS).value()
}

/// Rounded to a double.
pub(crate) fn double(x: &Real) -> f64 {
    x.to_f64().value()
}

pub(crate) fn sqrt(x: &Real) -> Real {
    if *x <= real(0.0) { real(0.0) } else { x.sqrt() }
}

/// pi by the arithmetic-geometric mean (Salamin and Brent, 1976).
pub(crate) fn pi() -> Real {
    let (mut a, mut b, mut t, mut p) = (real(1.0), sqrt(&real(0.5)), real(0.25), real(1.0));
    // The digits double: 2^10 digits after ten steps.
    for _ in 0..10 {
        let mean = (&a + &b) * real(0.5);
        b = sqrt(&(&a * &b));
        t -= &p * (&a - &mean) * (&a - &mean);
        (a, p) = (mean, p * real(2.0));
    }
    (&a + &b) * (&a + &b) / (real(4.0) * t)
}

/// 10^(db / 10).
pub(crate) fn power_of_decibels(db: f64) -> Real {
    (real(10.0).ln() * real(db) / real(10.0)).exp()
}

/// A complex number.
#[derive(Debug, Clone)]
pub(crate) struct Complex {
    pub(crate) re: Real,
    pub(crate) im: Real,
}

impl Complex {
    pub(crate) fn new(re: Real, im: Real) -> Self {
        Self { re, im }
    }

    pub(crate) fn zero() -> Self {
        Self::new(real(0.0), real(0.0))
    }

    pub(crate) fn one() -> Self {
        Self::real(real(1.0))
    }

    pub(crate) fn real(re: Real) -> Self {
        Self::new(re, real(0.0))
    }

    pub(crate) fn imaginary(im: Real) -> Self {
        Self::new(real(0.0), im)
    }

    pub(crate) fn conj(&self) -> Self {
        Self::new(self.re.clone(), -&self.im)
    }

    pub(crate) fn square_size(&self) -> Real {
        &self.re * &self.re + &self.im * &self.im
    }

    /// |z| as a double, for decisions.
    pub(crate) fn size(&self) -> f64 {
        double(&sqrt(&self.square_size()))
    }

    pub(crate) fn is_zero(&self) -> bool {
        self.re == real(0.0) && self.im == real(0.0)
    }

    pub(crate) fn times(&self, factor: &Real) -> Self {
        Self::new(&self.re * factor, &self.im * factor)
    }

    pub(crate) fn inverse(&self) -> Self {
        let scale = real(1.0) / self.square_size();
        Self::new(&self.re * &scale, -(&self.im * &scale))
    }

    pub(crate) fn over(&self, other: &Self) -> Self {
        self * &other.inverse()
    }

    /// z^n, n of either sign.
    pub(crate) fn power(&self, n: i64) -> Self {
        let (mut square, mut left) = (if n < 0 { self.inverse() } else { self.clone() }, n.unsigned_abs());
        let mut product = Self::one();
        while left > 0 {
            if left & 1 == 1 {
                product = &product * &square;
            }
            (square, left) = (&square * &square, left / 2);
        }
        product
    }

    /// e^z: Taylor's series of z / 2^k, squared k times. The squarings lose k of [`BITS`] bits.
    pub(crate) fn exp(&self) -> Self {
        let doublings = (self.size() * 1024.0).max(1.0).log2().ceil() as i32;
        let small = self.times(&real(0.5f64.powi(doublings)));
        let (mut sum, mut term) = (Self::one(), Self::one());
        // |small| <= 2^-10: sixty terms reach 2^-870.
        for k in 1..=60 {
            term = (&term * &small).times(&(real(1.0) / real(f64::from(k))));
            sum = &sum + &term;
        }
        for _ in 0..doublings {
            sum = &sum * &sum;
        }
        sum
    }

    /// The root in the right half-plane, or on the positive imaginary axis.
    pub(crate) fn sqrt(&self) -> Self {
        let size = sqrt(&self.square_size());
        // The larger part first: the difference of size and |re| would cancel.
        let large =
            sqrt(&((size + if self.re < real(0.0) { -&self.re } else { self.re.clone() }) * real(0.5)));
        if large == real(0.0) {
            return Self::zero();
        }
        let small = &self.im / (real(2.0) * &large);
        match (self.re < real(0.0), small < real(0.0)) {
            (false, _) => Self::new(large, small),
            (true, false) => Self::new(small, large),
            (true, true) => Self::new(-small, -large),
        }
    }

    pub(crate) fn rounded(&self) -> nalgebra::Complex<f64> {
        nalgebra::Complex::new(double(&self.re), double(&self.im))
    }
}

impl Add for &Complex {
    type Output = Complex;
    fn add(self, other: Self) -> Complex {
        Complex::new(&self.re + &other.re, &self.im + &other.im)
    }
}

impl Sub for &Complex {
    type Output = Complex;
    fn sub(self, other: Self) -> Complex {
        Complex::new(&self.re - &other.re, &self.im - &other.im)
    }
}

impl Mul for &Complex {
    type Output = Complex;
    fn mul(self, other: Self) -> Complex {
        let re = &self.re * &other.re - &self.im * &other.im;
        Complex::new(re, &self.re * &other.im + &self.im * &other.re)
    }
}

impl Neg for &Complex {
    type Output = Complex;
    fn neg(self) -> Complex {
        Complex::new(-&self.re, -&self.im)
    }
}
