//! Classical low-pass families as enclosed zeros, poles and gain.
//!
//! Every function returns the prototype with its cutoff at |s| = 1. "Cutoff" means what scipy.signal
//! means by it (`buttap`, `cheb1ap`, `cheb2ap`, `ellipap`, `besselap` with `norm="phase"`); [`passband`]
//! moves it. The DC gain also follows scipy: 1, except `-ripple_db` for Chebyshev 1 and elliptic filters
//! of even order.
//!
//! All are formulas in balls of 512 bits. Doubles are these numbers, rounded. Angles are powers of one cos +
//! i sin, and e^mu is the n-th root of S + sqrt(1 + S^2) for mu = asinh(S) / n. The polynomials of Bessel
//! filters have integer coefficients; their roots are enclosed as those of a denominator. The roots of a
//! band-pass are u ± sqrt(u^2 - w^2).

mod elliptic;
mod passband;

pub(super) use elliptic::Selectivity;

use super::polynomial::isolated;
use super::roots::{Factors, RootSet};
use super::{AnalogError, MIN_DAMPING_RATIO};
use crate::arithmetic::{Ball, ComplexBall, Float, Float512, LongBall, elementary};
use hybank_core::spec::{Family, MAX_ORDER, Passband, refused};
use hybank_core::units::Seconds;
use std::sync::OnceLock;

/// Radius over midpoint up to which a number counts as resolved: its double is right then, and the
/// proofs need a few digits more.
const RESOLVED_RADIUS: f64 = 1e-40;

/// A family member with its cutoff at |s| = 1.
#[derive(Debug, Clone, Copy)]
pub(super) struct Member {
    pub(super) family: Family,
    /// From 1 to [`MAX_ORDER`](hybank_core::spec::MAX_ORDER).
    pub(super) order: usize,
    /// Ripple in the pass band of Chebyshev 1 and elliptic filters, decibels.
    pub(super) ripple_db: f64,
    /// Attenuation in the stop band of Chebyshev 2 and elliptic filters, decibels.
    pub(super) attenuation_db: f64,
}

/// Zeros, poles and gain of `member` moved to `passband`, in normalised time t / `h`.
///
/// # Errors
/// [`AnalogError::Filter`] where the transition band or the band is too narrow for the poles;
/// [`AnalogError::RootsNotIsolated`].
pub(super) fn placed(
    member: &Member,
    passband: Passband,
    h: Seconds,
) -> Result<Factors<LongBall>, AnalogError> {
    let prototype = prototype(member)?;
    if !is_damped(&prototype) {
        let rule = format!(
            "order = {}: with these ripples the transition band is narrower than 1e-9 of the cutoff, beyond double \
             precision; lower the order or set the ripples further apart",
            member.order
        );
        return Err(refused("order", rule).into());
    }
    let filter = passband::moved(&prototype, passband, h);
    match passband {
        Passband::BandPass { low, high } if !is_damped(&filter) => {
            let rule = format!(
                "band = {} Hz wide: a band this narrow puts poles within 1e-9 of the imaginary axis, beyond double \
                 precision; widen the band or lower the order",
                (high - low).0
            );
            Err(refused("band", rule).into())
        }
        _ => Ok(filter),
    }
}

/// Whether all numbers are resolved and all poles have the least damping.
fn is_damped(filter: &Factors<LongBall>) -> bool {
    let is_resolved = |x: LongBall| x.radius() <= RESOLVED_RADIUS * x.nearest().abs();
    let real = |&p: &LongBall| is_resolved(p) && p.nearest() < 0.0;
    let pair = |&(re, im): &(LongBall, LongBall)| {
        let (re, im, resolved) = (re.nearest(), im.nearest(), is_resolved(re) && is_resolved(im));
        resolved && -re >= MIN_DAMPING_RATIO * re.hypot(im)
    };
    let poles = &filter.poles;
    is_resolved(filter.gain) && poles.real.iter().all(real) && poles.upper.iter().all(pair)
}

/// Zeros, poles and gain of `member`. Numbers that 512 bits do not resolve are unknown.
///
/// # Errors
/// [`AnalogError::RootsNotIsolated`] for a Bessel polynomial.
pub(super) fn prototype(member: &Member) -> Result<Factors<LongBall>, AnalogError> {
    let Member { order, ripple_db, attenuation_db, .. } = *member;
    Ok(match member.family {
        Family::Butterworth => butterworth(order),
        Family::Chebyshev1 => chebyshev1(order, ripple_db),
        Family::Chebyshev2 => chebyshev2(order, attenuation_db),
        Family::Elliptic => elliptic::elliptic(order, ripple_db, attenuation_db),
        Family::Bessel => bessel(order)?,
        Family::Rc => butterworth(1),
    })
}

/// Poles evenly on the unit circle, -3.01 dB at the cutoff.
fn butterworth(order: usize) -> Factors<LongBall> {
    let pole = |angle: ComplexBall| ComplexBall::new(-angle.re, angle.im);
    Factors { zeros: RootSet::default(), poles: upper_roots(order, pole), gain: Ball::from(1.0) }
}

/// `root` for each angle of the Butterworth poles, counted from the negative real axis: j / n times 90
/// degrees, j = n - 1, n - 3, .. down to 1 or 0. It takes cos + i sin of the angle and gives an upper
/// root, for the angle 0 a real one.
fn upper_roots(order: usize, root: impl Fn(ComplexBall) -> ComplexBall) -> RootSet<LongBall> {
    let mut roots = RootSet::default();
    for z in angles(order) {
        let root = root(z);
        if z.im.is_zero() {
            roots.real.push(root.re);
        } else {
            roots.upper.push((root.re, root.im));
        }
    }
    roots.sorted()
}

/// cos + i sin of the angles of [`upper_roots`], ascending; exactly 1 for the angle 0.
fn angles(order: usize) -> impl Iterator<Item = ComplexBall> {
    let step = elementary::phasor(elementary::pi() / Ball::from(2.0 * order as f64));
    let first = if order.is_multiple_of(2) { step } else { ComplexBall::from(Ball::from(1.0)) };
    std::iter::successors(Some(first), move |&z| Some(z * step * step)).take(order.div_ceil(2))
}

/// The point at this angle on the ellipse with half axes sinh(mu), cosh(mu), counted from the negative real
/// axis, for `stretch` = e^mu.
fn on_ellipse(stretch: LongBall, angle: ComplexBall) -> ComplexBall {
    let (half, inverse) = (Ball::from(0.5), Ball::from(1.0) / stretch);
    ComplexBall::new(angle.re * (inverse - stretch) * half, angle.im * (inverse + stretch) * half)
}

/// prod(-roots), real by conjugate symmetry.
fn product_of_negatives(roots: &RootSet<LongBall>) -> LongBall {
    let real = roots.real.iter().fold(Ball::from(1.0), |product, &r| product * -r);
    roots.upper.iter().fold(real, |product, &(re, im)| product * (re * re + im * im))
}

/// The gain at 0 of a filter with this power of ripple: the ripple for an even order.
fn dc_gain(order: usize, ripple: LongBall) -> LongBall {
    let one = Ball::from(1.0);
    if order.is_multiple_of(2) { one / (one + ripple).sqrt() } else { one }
}

/// 10^(db/10) - 1.
fn excess_power(db: f64) -> LongBall {
    elementary::exp_m1(Ball::from(db) * elementary::ln_10() / Ball::from(10.0))
}

/// e^asinh(x).
fn exp_asinh(x: LongBall) -> LongBall {
    x + (Ball::from(1.0) + x * x).sqrt()
}

/// Chebyshev 1: poles on an ellipse. The gain ripples by `ripple_db` (> 0 dB) below the cutoff and falls
/// above it.
fn chebyshev1(order: usize, ripple_db: f64) -> Factors<LongBall> {
    let ripple = excess_power(ripple_db);
    let stretch = elementary::root(exp_asinh(Ball::from(1.0) / ripple.sqrt()), order);
    let poles = upper_roots(order, |angle| on_ellipse(stretch, angle));
    let gain = dc_gain(order, ripple) * product_of_negatives(&poles);
    Factors { zeros: RootSet::default(), poles, gain }
}

/// Chebyshev 2 (inverse Chebyshev): the attenuation is at least `attenuation_db` (> 0 dB) from the cutoff
/// on. An even order has as many zeros as poles.
fn chebyshev2(order: usize, attenuation_db: f64) -> Factors<LongBall> {
    let stretch = elementary::root(exp_asinh(excess_power(attenuation_db).sqrt()), order);
    let poles = upper_roots(order, |angle| {
        let z = on_ellipse(stretch, angle);
        z.scaled(Ball::from(1.0) / z.norm_sqr())
    });
    // The zeros are the inverse Chebyshev nodes; the middle one of an odd order is at infinity.
    let mut zeros = upper_roots(order, |angle| ComplexBall::new(Ball::ZERO, Ball::from(1.0) / angle.im));
    zeros.real.clear();
    let gain = product_of_negatives(&poles) / product_of_negatives(&zeros);
    Factors { zeros, poles, gain }
}

/// Bessel with `norm="phase"`: the poles are the zeros of the reverse Bessel polynomials (Grosswald, *Bessel
/// polynomials*, 1978). The magnitude falls asymptotically as a Butterworth filter of the same order
/// and cutoff; the phase at the cutoff is half of its total change. DC gain and leading coefficient are 1.
///
/// # Errors
/// [`AnalogError::RootsNotIsolated`]. The tests cover all orders up to [`MAX_ORDER`].
fn bessel(order: usize) -> Result<Factors<LongBall>, AnalogError> {
    // The roots of an order are always the same, and those of a high order take milliseconds.
    static POLES: [OnceLock<Option<RootSet<LongBall>>>; MAX_ORDER + 1] =
        [const { OnceLock::new() }; MAX_ORDER + 1];
    let poles = POLES.get(order).and_then(|poles| poles.get_or_init(|| scaled_roots(order)).clone());
    let poles = poles.ok_or(AnalogError::RootsNotIsolated { what: "family" })?;
    Ok(Factors { zeros: RootSet::default(), poles, gain: Ball::from(1.0) })
}

/// The zeros of theta_n in units of their geometric mean, theta_n(0)^(1/n).
fn scaled_roots(n: usize) -> Option<RootSet<LongBall>> {
    let coefficients = reverse_bessel(n);
    let mean = elementary::root(Ball::exactly(*coefficients.last()?), n);
    Some(isolated(&coefficients)?.scaled(Ball::from(1.0) / mean))
}

/// theta_n in descending powers, from theta_0 = 1, theta_1 = s + 1 and
/// theta_n = (2n - 1) theta_(n-1) + s^2 theta_(n-2). Its integers are exact: the largest for n = 32 have 150
/// bits.
fn reverse_bessel(n: usize) -> Vec<Float512> {
    let one = Float512::from(1.0);
    let (mut previous, mut current) = (vec![one], vec![one, one]);
    for k in 2..=n {
        let factor = Float512::from(2.0 * k as f64 - 1.0);
        let mut next: Vec<Float512> =
            std::iter::once(Float512::ZERO).chain(current.iter().map(|&x| factor * x)).collect();
        previous.iter().enumerate().for_each(|(i, &x)| next[i] += x);
        (previous, current) = (current, next);
    }
    current
}

#[cfg(test)]
mod tests;
