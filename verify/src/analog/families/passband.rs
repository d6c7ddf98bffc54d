//! A prototype at its place: low-pass or band-pass in normalised time.

use super::LongBall;
use crate::analog::roots::{Factors, RootSet};
use crate::arithmetic::{Ball, ComplexBall, Real, elementary};
use hybank_core::spec::Passband;
use hybank_core::units::{Hertz, Seconds};

/// `prototype`, whose cutoff lies at |s| = 1, moved to `passband`, in normalised time.
pub(in crate::analog) fn moved(
    prototype: &Factors<LongBall>,
    passband: Passband,
    fast_period: Seconds,
) -> Factors<LongBall> {
    // 2 pi f h.
    let angular =
        |Hertz(f): Hertz| elementary::pi() * Ball::from(2.0) * Ball::from(f) * Ball::from(fast_period.0);
    match passband {
        Passband::LowPass { cutoff } => prototype.stretched(angular(cutoff)),
        Passband::BandPass { low, high } => {
            let (low, high) = (angular(low), angular(high));
            band_pass(prototype, high - low, low * high)
        }
    }
}

/// H((s^2 + w^2) / (s `width`)) with w^2 = `square`: two roots for every root of the prototype, and a
/// zero at 0 for every pole without a zero.
fn band_pass(prototype: &Factors<LongBall>, width: LongBall, square: LongBall) -> Factors<LongBall> {
    let half = width * Ball::from(0.5);
    let moved = |roots: &RootSet<LongBall>| {
        let mut moved = RootSet::default();
        roots.real.iter().for_each(|&r| push_real(&mut moved, r * half, square));
        roots
            .upper
            .iter()
            .for_each(|&(re, im)| push_pair(&mut moved, ComplexBall::new(re * half, im * half), square));
        moved
    };
    let excess = prototype.poles.count().saturating_sub(prototype.zeros.count());
    let mut zeros = moved(&prototype.zeros);
    zeros.real.resize(zeros.real.len() + excess, Ball::ZERO);
    let gain = prototype.gain.times_power(width, excess as i64);
    Factors { zeros: zeros.sorted(), poles: moved(&prototype.poles).sorted(), gain }
}

/// The roots u +- sqrt(u^2 - w^2) for a real u: both are real, or they are conjugates. A square root
/// that may be of either kind is unknown.
fn push_real(roots: &mut RootSet<LongBall>, u: LongBall, square: LongBall) {
    let discriminant = u * u - square;
    if discriminant.nearest() > 0.0 {
        let root = discriminant.sqrt();
        roots.real.extend([u - root, u + root]);
    } else {
        roots.upper.push((u, (-discriminant).sqrt()));
    }
}

/// The upper ones of the roots u +- sqrt(u^2 - w^2) and their conjugates.
fn push_pair(roots: &mut RootSet<LongBall>, u: ComplexBall, square: LongBall) {
    if u.re.is_zero() {
        // Both roots lie on the imaginary axis.
        let root = (u.im * u.im + square).sqrt();
        roots.upper.extend([(Ball::ZERO, root - u.im), (Ball::ZERO, root + u.im)]);
        return;
    }
    let root = (u * u - square.into()).sqrt();
    for z in [u + root, u - root] {
        roots.upper.push((z.re, if z.im.nearest() < 0.0 { -z.im } else { z.im }));
    }
}
