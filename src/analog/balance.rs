//! Scaling of states by powers of two, which causes no rounding.

use crate::linalg::{Mat, inverse, power_of_two};

use super::section::Realisation;

/// Doublings of [`input_energy`]: covers pole spreads up to 2^60.
const MAX_DOUBLINGS: usize = 60;

/// Scales every state by a power of two to unit input energy: the diagonal of the controllability
/// Gramian lies between 0.37 and 1.6 afterwards. States that the input does not drive keep their scale.
pub(super) fn with_unit_states(system: &Realisation) -> Realisation {
    let mut scaled = system.clone();
    for (i, energy) in input_energy(system).into_iter().enumerate() {
        let factor = power_of_two(energy.sqrt());
        scaled.a.row_mut(i).scale_mut(1.0 / factor);
        scaled.b.row_mut(i).scale_mut(1.0 / factor);
        scaled.a.column_mut(i).scale_mut(factor);
        scaled.c.column_mut(i).scale_mut(factor);
    }
    scaled
}

/// Diagonal of the controllability Gramian P, a P + P a' + b b' = 0, for a stable `a`.
///
/// The bilinear map e = (alpha + a)(alpha - a)^-1 turns it into P = e P e' + 2 alpha g g' with
/// g = (alpha - a)^-1 b, whose series is summed by doubling. Every term is positive, so the
/// diagonal is accurate enough for scaling even if P is nearly singular.
fn input_energy(system: &Realisation) -> Vec<f64> {
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
    (0..n).map(|i| p[(i, i)]).collect()
}

/// Geometric mean of the diagonal's moduli: between the fast and the slow poles.
fn typical_rate(a: &Mat) -> f64 {
    let n = a.nrows().max(1) as f64;
    let logs: f64 = a.diagonal().iter().filter(|x| **x != 0.0).map(|x| x.abs().ln()).sum();
    (logs / n).exp()
}
