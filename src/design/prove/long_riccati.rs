//! The bounded-real Riccati equation in 512 bits.
//!
//! With xi+ = A xi + J u, e = C xi + L u and the Gram matrix S of u, the least P at the level gamma is the
//! limit from P = 0 of
//!
//! ```text
//! P+ = A P A' + J S J' + N - T' Re^-1 T,   T = C P A' + L S J',   Re = C P C' + L S L' - gamma^2 I.
//! ```
//!
//! N is white noise on the states. It makes the inequality of the certificate strict. The limit is that of
//! P+ = F P (I + G P)^-1 F' + H with F = A - T' Re^-1 C, G = C' Re^-1 C and H = P+, all at P = 0.

use super::units::Units;
use crate::arithmetic::{BigFloat, Matrix, Number};
use crate::design::doubling::riccati_limit;
use crate::lti::gramian::observability_root;
use crate::verify::Midpoint;
use crate::verify::precise::PreciseErrorSystem;

/// Rows of a lower triangular R with P = R R' at the level `gamma`, in `units`, and of what rounding to
/// doubles takes from it. `middle` is the same system in doubles. The noise on the states adds about `noise`
/// to the norm. `None` if there is no such P.
pub(super) fn root(
    units: &Units,
    error: &PreciseErrorSystem,
    middle: &Midpoint,
    gamma: f64,
    noise: f64,
) -> Option<[Vec<Vec<f64>>; 2]> {
    // Noise of unit density on all states has this energy in e.
    let energy = observability_root(&middle.a, &middle.c).ok()?.norm_squared();
    let equation = Riccati::new(&in_units(units, error), 2.0 * gamma * noise / energy);
    let root = equation.limit(gamma)?.cholesky()?;
    let rows = |entry: &dyn Fn(BigFloat) -> f64| -> Vec<Vec<f64>> {
        (0..root.nrows()).map(|i| (0..=i).map(|j| entry(root[(i, j)])).collect()).collect()
    };
    Some([rows(&|x| x.nearest()), rows(&|x| (x - BigFloat::from(x.nearest())).nearest())])
}

/// The system with its states and references in `units`.
fn in_units(units: &Units, error: &PreciseErrorSystem) -> PreciseErrorSystem {
    let unit = |i: usize| BigFloat::from(*units.states.get(i).unwrap_or(&units.reference));
    let PreciseErrorSystem { system, input_gram } = error;
    PreciseErrorSystem {
        system: Matrix::from_fn(system.nrows(), system.ncols(), |i, j| system[(i, j)] * unit(j) / unit(i)),
        input_gram: Matrix::from_fn(input_gram.nrows(), input_gram.ncols(), |i, j| {
            input_gram[(i, j)] / unit(i) / unit(j)
        }),
    }
}

struct Riccati {
    a: Matrix<BigFloat>,
    c: Matrix<BigFloat>,
    /// J S J' + N.
    input_gram: Matrix<BigFloat>,
    /// L S J'.
    cross: Matrix<BigFloat>,
    /// L S L'.
    direct: Matrix<BigFloat>,
}

impl Riccati {
    /// With white noise of the variance `noise` on each state.
    fn new(error: &PreciseErrorSystem, noise: f64) -> Self {
        let n = error.system.ncols();
        let (states, outputs): (Vec<usize>, Vec<usize>) =
            ((0..n).collect(), (n..error.system.nrows()).collect());
        let noise = Matrix::from_fn(n, n, |i, j| BigFloat::from(if i == j { noise } else { 0.0 }));
        Self {
            a: error.system.select_rows(&states),
            c: error.system.select_rows(&outputs),
            input_gram: &error.input_gram.select(&states, &states) + &noise,
            cross: error.input_gram.select(&outputs, &states),
            direct: error.input_gram.select(&outputs, &outputs),
        }
    }

    /// P at the level `gamma`; `None` if the recursion has no limit.
    fn limit(&self, gamma: f64) -> Option<Matrix<BigFloat>> {
        let Self { a, c, input_gram, cross, direct } = self;
        let mut re = direct.clone();
        (0..re.nrows()).for_each(|i| re[(i, i)] = re[(i, i)] - BigFloat::from(gamma) * BigFloat::from(gamma));
        let (weighted_c, weighted_t) = (re.solve(c)?, re.solve(cross)?);
        let f = a - &(&cross.transpose() * &weighted_c);
        let g = (&c.transpose() * &weighted_c).symmetric();
        let h = (input_gram - &(&cross.transpose() * &weighted_t)).symmetric();
        riccati_limit(&f, &g, &h)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// x+ = a x + u, e = x: with N = 0 the equation is P = a^2 P + 1 + a^2 P^2 / (g^2 - P), or
    /// P^2 - (1 + g^2 (1 - a^2)) P + g^2 = 0 with the norm 1 / (1 - a).
    fn one_pole(gamma: f64) -> Option<f64> {
        let number = |rows: usize, columns: usize, entries: &[f64]| {
            Matrix::from_fn(rows, columns, |i, j| BigFloat::from(entries[i * columns + j]))
        };
        let error = PreciseErrorSystem {
            system: number(2, 1, &[0.5, 1.0]),
            input_gram: number(2, 2, &[1.0, 0.0, 0.0, 0.0]),
        };
        Some(Riccati::new(&error, 0.0).limit(gamma)?[(0, 0)].nearest())
    }

    #[test]
    fn one_pole_has_its_quadratic_root() {
        for gamma in [2.0 * (1.0 + 1e-12), 2.1, 10.0_f64] {
            let b = 1.0 + 0.75 * gamma * gamma;
            let exact = 2.0 * gamma * gamma / (b + (b * b - 4.0 * gamma * gamma).sqrt());
            let p = one_pole(gamma).unwrap();
            assert!((p / exact - 1.0).abs() < 1e-5, "{gamma}: {p} {exact}");
        }
        assert!(one_pole(1.9).is_none_or(|p| !(0.0..=1.9 * 1.9).contains(&p)), "{:?}", one_pole(1.9));
    }
}
