//! Elementary functions of numbers of 512 bits, enclosed: series with a bound for what they leave out, after
//! an argument reduction in balls.
//!
//! The terms left out of a series of arctangents sum to less than twice the next power. An n-th root is
//! found by Newton's iteration and then enclosed: for x = y^n (1 + e) it is y up to a factor within
//! |e| / (n (1 - |e|)) of 1.

use super::{Ball, ComplexBall, LongBall};
use std::sync::OnceLock;

/// A term below this, 2^-540, lies below the rounding of every sum of about one.
const NEGLIGIBLE_TERM: f64 = f64::from_bits((1023 - 540) << 52);
/// Arguments of the exponential series are halved until they are below this.
const LARGEST_SERIES_ARGUMENT: f64 = 1.0 / 256.0;
/// Degree of the exponential series. The remainder is below 2 |r|^46 / 46! < 2^-550 |r| for |r| <= 1/256.
const SERIES_DEGREE: usize = 45;
const SERIES_REMAINDER: f64 = f64::from_bits((1023 - 550) << 52);
/// Largest argument of an exponential.
const MAX_ARGUMENT: f64 = 700.0;
/// Newton's steps for a root, from a double on: each doubles the digits, up to a loss of four bits.
const ROOT_STEPS: usize = 4;

/// pi = 16 atan(1/5) - 4 atan(1/239) (Machin).
pub fn pi() -> LongBall {
    static PI: OnceLock<LongBall> = OnceLock::new();
    *PI.get_or_init(|| {
        Ball::from(16.0) * inverse_tangent(5.0, -1.0) - Ball::from(4.0) * inverse_tangent(239.0, -1.0)
    })
}

/// ln 10 = 46 atanh(1/31) + 34 atanh(1/49) + 20 atanh(1/161).
pub fn ln_10() -> LongBall {
    static LN_10: OnceLock<LongBall> = OnceLock::new();
    *LN_10.get_or_init(|| {
        let terms = [(46.0, 31.0), (34.0, 49.0), (20.0, 161.0)];
        terms.iter().fold(Ball::ZERO, |sum, &(factor, n)| sum + Ball::from(factor) * inverse_tangent(n, 1.0))
    })
}

/// The sum of `sign`^k x^(2k+1) / (2k+1) for x = 1/`n`, `n` a whole number above 1: the inverse tangent of x
/// for the sign -1, the hyperbolic one for 1. The terms left out are below the last power times 1/(1 - x^2).
fn inverse_tangent(n: f64, sign: f64) -> LongBall {
    let step = Ball::from(sign) / Ball::from(n * n);
    let (mut power, mut sum, mut odd) = (Ball::from(1.0) / Ball::from(n), Ball::ZERO, 1.0);
    while power.magnitude() > NEGLIGIBLE_TERM {
        sum += power / Ball::from(odd);
        power = power * step;
        odd += 2.0;
    }
    sum.widened(2.0 * power.magnitude())
}

/// e^x - 1, relatively accurate for small x too.
pub fn exp_m1(x: LongBall) -> LongBall {
    let Some(ExponentialSeries { terms, remainder, halvings }) = ExponentialSeries::new(x) else {
        return Ball::unknown();
    };
    let series = terms[1..].iter().rev().fold(Ball::ZERO, |sum, &term| sum + term);
    // e^2r - 1 = (e^r - 1) (e^r - 1 + 2).
    (0..halvings).fold(series.widened(remainder), |y, _| y * (y + Ball::from(2.0)))
}

/// cos x + i sin x.
pub fn phasor(x: LongBall) -> ComplexBall {
    let Some(ExponentialSeries { terms, remainder, halvings }) = ExponentialSeries::new(x) else {
        return ComplexBall::new(Ball::unknown(), Ball::unknown());
    };
    let sum = |first: usize| {
        let alternating = terms.iter().skip(first).step_by(2).enumerate();
        let sum =
            alternating.fold(Ball::ZERO, |sum, (k, &term)| if k % 2 == 0 { sum + term } else { sum - term });
        sum.widened(remainder)
    };
    (0..halvings).fold(ComplexBall::new(sum(0), sum(1)), |z, _| z * z)
}

/// The terms r^k / k! of the exponential series for x = r 2^`halvings`, and a bound of what they leave out.
struct ExponentialSeries {
    terms: Vec<LongBall>,
    remainder: f64,
    halvings: usize,
}

impl ExponentialSeries {
    /// `None` for an argument that is unknown or too large.
    fn new(x: LongBall) -> Option<Self> {
        let mut size = x.magnitude();
        let is_supported = size <= MAX_ARGUMENT;
        let (mut halvings, mut unit) = (0, 1.0);
        while is_supported && size > LARGEST_SERIES_ARGUMENT {
            (size, unit, halvings) = (0.5 * size, 0.5 * unit, halvings + 1);
        }
        let r = x * Ball::from(unit);
        let powers = std::iter::successors(Some((0.0, Ball::from(1.0))), |&(k, term)| {
            Some((k + 1.0, term * r / Ball::from(k + 1.0)))
        });
        let terms = powers.take(SERIES_DEGREE + 1).map(|(_, term)| term).collect();
        is_supported.then_some(Self {
            terms,
            remainder: size * SERIES_REMAINDER + f64::MIN_POSITIVE,
            halvings,
        })
    }
}

/// The positive `n`-th root of a positive number. With x = y^n (1 + e) it is y (1 + e)^(1/n), and
/// |(1 + e)^(1/n) - 1| <= |e| / (n (1 - |e|)).
pub fn root(x: LongBall, n: usize) -> LongBall {
    let order = n as f64;
    let excess = |y: LongBall| x / power(y, n) - Ball::from(1.0);
    let start = Ball::from(x.nearest().powf(1.0 / order));
    let y = (0..ROOT_STEPS).fold(start, |y, _| {
        let next = y + y * excess(y) / Ball::from(order);
        Ball::exactly(next.mid())
    });
    let error = excess(y).magnitude();
    // NaN is not small either.
    if error < 0.5 { y * Ball::from(1.0).widened(2.0 * error / order) } else { Ball::unknown() }
}

/// x^n by squaring.
fn power(x: LongBall, n: usize) -> LongBall {
    match n {
        0 => Ball::from(1.0),
        _ => {
            let half = power(x, n / 2);
            if n.is_multiple_of(2) { half * half } else { half * half * x }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Digits "d.ddd..", exactly up to the last one.
    fn digits(text: &str) -> LongBall {
        let fraction = text.split_once('.').unwrap().1;
        let (all, scale) = (text.replace('.', ""), Ball::from(10.0));
        let whole = all.bytes().fold(Ball::ZERO, |sum, c| sum * scale + Ball::from(f64::from(c - b'0')));
        let unit = power(scale, fraction.len());
        (whole / unit).widened(1.0 / unit.nearest())
    }

    /// Both enclose one number, and the first is narrow.
    fn agree(found: LongBall, other: LongBall) -> bool {
        found.radius() <= 1e-140 * found.nearest().abs()
            && (found - other).lower() <= 0.0
            && (found - other).upper() >= 0.0
    }

    #[test]
    fn known_digits() {
        let pi_digits = "3.14159265358979323846264338327950288419716939937510582097494459230781640628620899862803482534211706798";
        let ln_10_digits = "2.30258509299404568401799145468436420760110148862877297603332790096757260967735248023599720508959829834";
        // e - 1.
        let e_digits = "1.71828182845904523536028747135266249775724709369995957496696762772407663035354759457138217852516642743";
        assert!(agree(pi(), digits(pi_digits)));
        assert!(agree(ln_10(), digits(ln_10_digits)));
        assert!(agree(exp_m1(Ball::from(1.0)), digits(e_digits)));
        assert!(agree(exp_m1(ln_10()), Ball::from(9.0)));
    }

    #[test]
    fn the_phasor_of_a_third_of_a_half_turn() {
        let z = phasor(pi() / Ball::from(3.0));
        assert!(agree(z.re, Ball::from(0.5)));
        assert!(agree(z.im * z.im, Ball::from(0.75)));
        assert!(
            phasor(Ball::from(1e9)).re.radius().is_nan() && exp_m1(Ball::from(f64::NAN)).radius().is_nan()
        );
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn identities_hold(x in -5.0..300.0f64, y in -9.0..2.0f64, n in 1usize..40) {
            let (a, b) = (Ball::from(x), Ball::from(10f64.powf(y)));
            let one = Ball::from(1.0);
            let grown = |x: LongBall| exp_m1(x) + one;
            let product = grown(a) * grown(b);
            prop_assert!(agree(product, grown(a + b)));
            prop_assert!((exp_m1(b).nearest() / 10f64.powf(y).exp_m1() - 1.0).abs() < 1e-14);
            let (u, v) = (phasor(a), phasor(b));
            prop_assert!(agree(u.norm_sqr(), one));
            prop_assert!((u.re.nearest() - x.cos()).abs() < 1e-15 && (v.im.nearest() / 10f64.powf(y).sin() - 1.0).abs() < 1e-12);
            prop_assert!(agree((u * v).re, phasor(a + b).re) || (u * v).re.nearest().abs() < 1e-10);
            prop_assert!(agree(power(root(grown(a), n), n), grown(a)));
        }
    }
}
