//! Elliptic (Cauer) filters in closed form.
//!
//! With the nome q of the modulus k, the theta series T(y), the sum of (-1)^m q^(m^2) y^m over all whole m,
//! and x = e^(i z), z = pi u / (2 K), the Jacobi function is
//!
//! ```text
//! sn(u, k) = -i c x T(q x^2) / T(x^2),  c = T(-1) / T(-q),  k = q^(1/2) / c^2
//! ```
//!
//! so that poles and zeros are quotients of theta series. The nome of the filter is the n-th root of that of
//! the modulus k1 = sqrt(ripple / attenuation) as powers (the degree equation), and the poles lie at u = j K
//! / n + i v K with sc(n v K1, k1') = 1 / sqrt(ripple). Both follow from Landen's transformation k -> (k /
//! (1 + k'))^2, which squares the nome. It ends below k = 2^-256, where the root of the nome is k / 4 up to
//! a factor within k^2 of 1, and where the integral of 1 / sqrt((1 + y^2) (1 + k^2 y^2)) from 0 to S is
//! asinh S up to a factor within k^2 (1 + S^2) of 1. From the term of a theta series on where each is at
//! most half of the one before, all others are at most as large as the last.
//!
//! Sources: Abramowitz and Stegun, chapters 16 and 17; Orfanidis, "Lecture notes on elliptic filter design"
//! (2006); the degree equation by nomes as in Lutovac, Tosic and Evans, "Filter design for signal
//! processing" (2001).
//!
//! Order and attenuation of elliptic filters by the degree equation, in doubles: they choose the filter of a
//! signal, and the chosen numbers stand for themselves.

use super::{LongBall, dc_gain, excess_power, exp_asinh, product_of_negatives, upper_roots};
use crate::analog::roots::{Factors, RootSet};
use crate::arithmetic::{Ball, ComplexBall, elementary};
use std::f64::consts::{LN_10, PI};

/// Modulus below which Landen's transformation ends, 2^-256: what is left is of the order of its square.
const LAST_MODULUS: f64 = f64::from_bits((1023 - 256) << 52);
/// Most of Landen's transformations. Each squares the modulus, and before that the complementary modulus
/// grows as its root: 20 are enough from 1e-300 on.
const MAX_TRANSFORMATIONS: usize = 32;
/// Most terms of a theta series on each side. Nomes for which they are not enough belong to transition bands
/// that are narrower than 1e-9 of the cutoff.
const MAX_TERMS: usize = 200;
/// Size of a term of a theta series, 2^-540, that lies below the rounding of the others.
const NEGLIGIBLE_TERM: f64 = f64::from_bits((1023 - 540) << 52);

/// Elliptic: ripple of `ripple_db` up to the cutoff, attenuation of at least `attenuation_db` (>
/// `ripple_db` > 0) beyond the stop-band edge, which follows from order and ripples. An even order has as
/// many zeros as poles.
pub(super) fn elliptic(order: usize, ripple_db: f64, attenuation_db: f64) -> Factors<LongBall> {
    let (one, ripple) = (Ball::from(1.0), excess_power(ripple_db));
    let slope = one / ripple.sqrt();
    if order == 1 {
        let poles = RootSet { real: vec![-slope], upper: Vec::new() };
        return Factors { zeros: RootSet::default(), poles, gain: slope };
    }
    let Landen { nome_root, stretch } = Landen::new(ripple, excess_power(attenuation_db));
    let nome_root = elementary::root(nome_root, order);
    let shrink = one / elementary::root(stretch, order);
    let sine = Sine::new(nome_root * nome_root);

    let poles = upper_roots(order, |angle| sine.times_i(angle.scaled(shrink)));
    let mut zeros = upper_roots(order, |angle| {
        // 1 / (k sn u), from i sn u.
        let modulus = nome_root / (sine.factor * sine.factor);
        ComplexBall::new(Ball::ZERO, one / (modulus * sine.times_i(angle).im))
    });
    // An odd order has one at infinity.
    zeros.real.clear();
    let gain = dc_gain(order, ripple) * product_of_negatives(&poles) / product_of_negatives(&zeros);
    Factors { zeros, poles, gain }
}

/// What Landen's descending transformation gives for the modulus k with k^2 = `ripple` / `attenuation`.
struct Landen {
    /// q^(1/2).
    nome_root: LongBall,
    /// e^(pi v / 2) with sc(v K, k') = `ripple`^(-1/2).
    stretch: LongBall,
}

impl Landen {
    /// Each transformation squares the nome and keeps v, while the modulus k falls and S = sc(v K, k') comes
    /// to sinh(pi v / 2):
    ///
    /// ```text
    /// k -> (k / (1 + k'))^2,  k' -> 2 sqrt(k') / (1 + k')
    /// S -> 2 S / ((1 + new k) (1 + sqrt(1 + k^2 S^2)))
    /// ```
    ///
    /// In the end v K is the integral of ((1 + y^2) (1 + k^2 y^2))^(-1/2) from 0 to S, and K lies between
    /// pi/2 and pi/(2 k'). So pi v / 2 = (1 - d) asinh S with
    /// 0 <= d <= 1 - k' (1 + k^2 S^2)^(-1/2) <= k^2 (1 + S^2). And k = 4 q^(1/2) times the product of
    /// ((1 + q^2m) / (1 + q^(2m-1)))^4, which lies between 1 - 5 q and 1 for q < 0.1, so that q^(1/2) = k/4
    /// up to a factor within k^2 of 1.
    fn new(ripple: LongBall, attenuation: LongBall) -> Self {
        let (one, two) = (Ball::from(1.0), Ball::from(2.0));
        let (mut k, mut complement) =
            ((ripple / attenuation).sqrt(), ((attenuation - ripple) / attenuation).sqrt());
        let mut sc = one / ripple.sqrt();
        let mut transformations = 0;
        while k.upper() > LAST_MODULUS && transformations < MAX_TRANSFORMATIONS {
            let ratio = k / (one + complement);
            let next = ratio * ratio;
            sc = two * sc / ((one + next) * (one + (one + k * k * sc * sc).sqrt()));
            (k, complement) = (next, two * complement.sqrt() / (one + complement));
            transformations += 1;
        }
        let (square, size) = ((k * k).magnitude(), sc.magnitude());
        let is_last = k.magnitude() <= LAST_MODULUS;
        if !is_last {
            return Self { nome_root: Ball::unknown(), stretch: Ball::unknown() };
        }
        let nome_root = k * Ball::from(0.25) * one.widened(square);
        // 1 - e^(-d asinh S) <= d S.
        let stretch = exp_asinh(sc) * one.widened(2.0 * square * (1.0 + size * size) * size);
        Self { nome_root: (0..transformations).fold(nome_root, |q, _| q.sqrt()), stretch }
    }
}

/// The function i sn of x = e^(i z) for one nome.
struct Sine {
    nome: LongBall,
    /// c.
    factor: LongBall,
}

impl Sine {
    fn new(nome: LongBall) -> Self {
        let minus = ComplexBall::from(Ball::from(-1.0));
        Self { nome, factor: theta(nome, minus).re / theta(nome, minus.scaled(nome)).re }
    }

    /// i sn(u).
    fn times_i(&self, x: ComplexBall) -> ComplexBall {
        let square = x * x;
        (x * theta(self.nome, square.scaled(self.nome)) / theta(self.nome, square)).scaled(self.factor)
    }
}

/// T(y). From some term on each is at most half of the one before it, so that all others together are at
/// most as large as the last.
fn theta(nome: LongBall, y: ComplexBall) -> ComplexBall {
    let one = ComplexBall::from(Ball::from(1.0));
    let (inverse, square) = (one / y, nome * nome);
    let size = |z: ComplexBall| z.re.magnitude() + z.im.magnitude();
    let (mut rising, mut falling, mut sum, mut step) = (one, one, one, nome);
    for _ in 0..MAX_TERMS {
        rising = -(rising * y).scaled(step);
        falling = -(falling * inverse).scaled(step);
        sum = sum + rising + falling;
        step = step * square;
        let last = size(rising) + size(falling);
        if last <= NEGLIGIBLE_TERM && step.magnitude() * size(y).max(size(inverse)) <= 0.5 {
            // The series of a real number is real.
            let im = if y.im.is_zero() { sum.im } else { sum.im.widened(last) };
            return ComplexBall::new(sum.re.widened(last), im);
        }
    }
    ComplexBall::new(Ball::unknown(), Ball::unknown())
}

/// Most steps of the arithmetic-geometric mean, which converges quadratically.
const MAX_STEPS: usize = 64;

/// The shape of elliptic filters: the ripple up to the cutoff, and the stop-band edge over the cutoff.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::analog) struct Selectivity {
    /// Ripple in the pass band, decibels.
    pub(in crate::analog) ripple_db: f64,
    /// Stop-band edge over the cutoff, above 1.
    pub(in crate::analog) transition: f64,
}

impl Selectivity {
    /// The least order with an attenuation of at least `attenuation_db` from the stop-band edge on: the
    /// degree equation n = K'(k1) K(k) / (K(k1) K'(k)), k = 1 / `transition`,
    /// k1^2 = (10^(ripple/10) - 1) / (10^(attenuation/10) - 1).
    pub(in crate::analog) fn order_for(self, attenuation_db: f64) -> usize {
        let selectivity =
            (rounded_excess_power(self.ripple_db) / rounded_excess_power(attenuation_db)).sqrt();
        let degree = ln_nome(selectivity) / ln_nome(1.0 / self.transition);
        // The attenuation of a whole order has that order, whatever the rounding.
        (degree - 1e-9).ceil().max(1.0) as usize
    }

    /// The attenuation in decibels from the stop-band edge on of the filter of this `order`.
    pub(in crate::analog) fn attenuation_of(self, order: usize) -> f64 {
        let selectivity = modulus_of_nome(ln_nome(1.0 / self.transition) * order as f64);
        10.0 * (rounded_excess_power(self.ripple_db) / (selectivity * selectivity)).ln_1p() / LN_10
    }
}

/// 10^(db/10) - 1 without cancellation for small `db`.
fn rounded_excess_power(db: f64) -> f64 {
    (db * LN_10 / 10.0).exp_m1()
}

/// ln q = -pi K'(k) / K(k), by the arithmetic-geometric means of 1 with k and with k'.
fn ln_nome(k: f64) -> f64 {
    -PI * geometric_mean(((1.0 - k) * (1.0 + k)).sqrt()) / geometric_mean(k)
}

/// The arithmetic-geometric mean of 1 and `b`.
fn geometric_mean(mut b: f64) -> f64 {
    let mut a = 1.0;
    for _ in 0..MAX_STEPS {
        if (a - b).abs() <= f64::EPSILON * a {
            break;
        }
        (a, b) = (0.5 * (a + b), (a * b).sqrt());
    }
    a
}

/// k for the nome e^`ln_q`. The complementary nome has ln q ln q' = pi^2.
fn modulus_of_nome(ln_q: f64) -> f64 {
    if ln_q < -PI { theta_quotient(ln_q, false) } else { theta_quotient(PI * PI / ln_q, true) }
}

/// (theta_2 / theta_3)^2, or (theta_4 / theta_3)^2 for the `complement`, for the nome e^`ln_q` <= e^-pi,
/// where five terms are beyond double precision.
fn theta_quotient(ln_q: f64, complement: bool) -> f64 {
    let term = |power: f64| (power * ln_q).exp();
    let (mut theta2, mut theta3, mut theta4) = (0.0, 0.5, 0.5);
    for j in 0..5 {
        let j = f64::from(j);
        theta2 += term((j + 0.5) * (j + 0.5));
        let next = term((j + 1.0) * (j + 1.0));
        theta3 += next;
        theta4 += if j % 2.0 == 0.0 { -next } else { next };
    }
    let quotient = if complement { theta4 } else { theta2 } / theta3;
    quotient * quotient
}
