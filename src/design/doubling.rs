//! Limits by doubling in extended precision: each step squares the number of slow periods that it covers.

use crate::arithmetic::{Matrix, Number};

/// Maximum number of steps: 2^40 slow periods.
const STEPS: usize = 40;
/// Relative change of the diagonal at which a limit is reached.
const CONVERGED: f64 = 1e-25;

/// X = A X A' + B B' for a stable A: the sum of A^k B B' A'^k. `None` without convergence.
pub(in crate::design) fn gramian<F: Number>(a: &Matrix<F>, b: &Matrix<F>) -> Option<Matrix<F>> {
    let (mut transition, mut sum) = (a.clone(), (b * &b.transpose()).symmetric());
    for _ in 0..STEPS {
        let more = transition.congruence(&sum);
        let done = is_negligible(&more, &sum);
        sum = &sum + &more;
        if done {
            return Some(sum);
        }
        transition = &transition * &transition;
    }
    None
}

/// The limit of X+ = F X (I + G X)^-1 F' + H from X = 0 by the structure-preserving doubling algorithm
/// (E. K.-W. Chu, H.-Y. Fan, W.-W. Lin, C.-S. Wang, *Structure-preserving algorithms for periodic
/// discrete-time algebraic Riccati equations*, Int. J. Control 77, 2004). `None` without convergence.
pub(in crate::design) fn riccati_limit<F: Number>(
    f: &Matrix<F>,
    g: &Matrix<F>,
    h: &Matrix<F>,
) -> Option<Matrix<F>> {
    let (mut a, mut g, mut h) = (f.transpose(), g.clone(), h.clone());
    let one = Matrix::identity(a.nrows());
    for _ in 0..STEPS {
        let w = &one + &(&g * &h);
        let (wa, wg) = (w.solve(&a)?, w.solve(&g)?);
        let more = (&a.transpose() * &(&h * &wa)).symmetric();
        g = (&g + &(&a * &(&wg * &a.transpose()))).symmetric();
        a = &a * &wa;
        let done = is_negligible(&more, &h);
        h = &h + &more;
        if done {
            return Some(h);
        }
    }
    None
}

/// Whether `more` changes no diagonal entry of `whole` by more than [`CONVERGED`].
fn is_negligible<F: Number>(more: &Matrix<F>, whole: &Matrix<F>) -> bool {
    let size = |m: &Matrix<F>, i: usize| m[(i, i)].nearest().abs();
    (0..more.nrows()).all(|i| size(more, i) <= CONVERGED * size(whole, i))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arithmetic::BigFloat;

    fn wave(rows: usize, columns: usize, step: f64) -> Matrix<BigFloat> {
        Matrix::from_fn(rows, columns, |i, j| BigFloat::from(0.4 * (step * (3 * i + 5 * j + 1) as f64).sin()))
    }

    fn size(m: &Matrix<BigFloat>) -> f64 {
        let entries = (0..m.nrows()).flat_map(|i| (0..m.ncols()).map(move |j| m[(i, j)].nearest().abs()));
        entries.fold(0.0, f64::max)
    }

    #[test]
    fn the_gramian_solves_its_equation() {
        let (a, b) = (wave(5, 5, 1.3), wave(5, 2, 0.7));
        let x = gramian(&a, &b).unwrap();
        let residual = &(&a.congruence(&x) + &(&b * &b.transpose())) - &x;
        assert!(size(&residual) < 1e-40 * size(&x), "{:e}", size(&residual));
        let unstable = Matrix::from_fn(1, 1, |_, _| BigFloat::from(1.0));
        assert!(gramian(&unstable, &unstable).is_none());
    }

    #[test]
    fn the_limit_is_a_fixed_point_of_the_recursion() {
        let (f, c, b) = (wave(4, 4, 1.1), wave(2, 4, 0.3), wave(4, 2, 2.1));
        let (g, h) = ((&c.transpose() * &c).symmetric(), (&b * &b.transpose()).symmetric());
        let x = riccati_limit(&f, &g, &h).unwrap();
        let w = (&Matrix::identity(4) + &(&g * &x)).solve(&f.transpose()).unwrap();
        let residual = &(&(&f * &(&x * &w)) + &h) - &x;
        assert!(size(&residual) < 1e-40 * size(&x), "{:e}", size(&residual));
    }
}
