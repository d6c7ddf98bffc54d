//! Scaling of states by powers of two, which causes no rounding.

use crate::arithmetic::Real;
use crate::linalg::{Mat, inverse, power_of_two};

use super::section::Realisation;

/// Doublings of [`gramian`]: covers pole spreads up to 2^60.
const MAX_DOUBLINGS: usize = 60;

/// Scales every state by a power of two to unit input energy: the diagonal of the controllability Gramian
/// lies between 0.37 and 1.6 afterwards. States that the input does not drive keep their scale. The input is
/// white, or white noise through `signal`.
pub(super) fn with_unit_states<T: Real>(
    signal: Option<&Realisation<f64>>,
    system: &Realisation<T>,
) -> Realisation<T> {
    let mut scaled = system.clone();
    for (i, energy) in own_energy(signal, &system.rounded()).into_iter().enumerate() {
        let factor = power_of_two(energy.sqrt());
        let times = |by: f64| move |x: &mut T| *x = *x * T::from(by);
        scaled.a.row_mut(i).apply(times(1.0 / factor));
        scaled.b.row_mut(i).apply(times(1.0 / factor));
        scaled.a.column_mut(i).apply(times(factor));
        scaled.c.column_mut(i).apply(times(factor));
    }
    scaled
}

/// The energy of each state of `system`.
fn own_energy(signal: Option<&Realisation<f64>>, system: &Realisation<f64>) -> Vec<f64> {
    let (whole, first) = match signal {
        Some(signal) => (signal.then(system), signal.a.nrows()),
        None => (system.clone(), 0),
    };
    let gramian = gramian(&whole);
    (first..whole.a.nrows()).map(|i| gramian[(i, i)]).collect()
}

/// ||c (s - a)^-1 b||_2^2.
pub(super) fn output_energy(system: &Realisation<f64>) -> f64 {
    (&system.c * gramian(system) * system.c.transpose())[(0, 0)]
}

/// Controllability Gramian P, a P + P a' + b b' = 0, for a stable `a`.
///
/// The bilinear map e = (alpha + a)(alpha - a)^-1 turns it into P = e P e' + 2 alpha g g' with
/// g = (alpha - a)^-1 b, whose series is summed by doubling. Every term is positive, so the
/// diagonal is accurate enough for scaling even if P is nearly singular.
fn gramian(system: &Realisation<f64>) -> Mat {
    let n = system.a.nrows();
    let alpha = typical_rate(&system.a);
    let resolvent = inverse(&(Mat::identity(n, n) * alpha - &system.a));
    let g = &resolvent * &system.b;
    let mut e = &resolvent * (&system.a + Mat::identity(n, n) * alpha);
    let mut p = &g * g.transpose() * (2.0 * alpha);
    for _ in 0..MAX_DOUBLINGS {
        p += &e * &p * e.transpose();
        e = &e * &e;
        if e.amax() <= f64::EPSILON {
            break;
        }
    }
    p
}

/// Geometric mean of the diagonal's moduli: between the fast and the slow poles.
fn typical_rate(a: &Mat) -> f64 {
    let n = a.nrows().max(1) as f64;
    let logs: f64 = a.diagonal().iter().filter(|x| **x != 0.0).map(|x| x.abs().ln()).sum();
    (logs / n).exp()
}
