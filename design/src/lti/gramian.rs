//! Square roots of Gramians, by doubling, and what they give: the H2 norm and the coordinates in which a
//! Gramian is one or both are balanced.

use super::{LtiError, StateSpace};
use hybank_linalg::Mat;

/// 2^60 steps of any stable system are a steady state.
const DOUBLING_LIMIT: usize = 60;

/// Square root `S` of the controllability Gramian, `S S' = sum_k a^k b b' a'^k`, n x min(n, ...), by
/// the squared Smith iteration on the factor: S <- [S, a S], a <- a^2.
///
/// Fails with [`LtiError::IterationLimit`] when `a` is not stable.
pub(crate) fn controllability_root(a: &Mat, b: &Mat) -> Result<Mat, LtiError> {
    let mut root = hybank_linalg::lq_factor(b);
    let mut power = a.clone();
    let mut change = f64::INFINITY;
    for _ in 0..DOUBLING_LIMIT {
        let more = &power * &root;
        change = more.norm() / root.norm().max(f64::MIN_POSITIVE);
        if change < f64::EPSILON * 1e-2 || root.norm() == 0.0 {
            return Ok(root);
        }
        if !change.is_finite() {
            break;
        }
        root = hybank_linalg::lq_factor(&hybank_linalg::hstack(&[&root, &more]));
        power = &power * &power;
    }
    Err(LtiError::IterationLimit { what: "the Gramian", limit: DOUBLING_LIMIT, change })
}

/// Square root of the observability Gramian, `S S' = sum_k a'^k c' c a^k`: see [`controllability_root`].
///
/// # Errors
/// [`LtiError::IterationLimit`] when `a` is not stable.
pub(crate) fn observability_root(a: &Mat, c: &Mat) -> Result<Mat, LtiError> {
    controllability_root(&a.transpose(), &c.transpose())
}

/// The H2 norm: square root of `trace(c P c' + d d')`, P the controllability Gramian.
pub(crate) fn h2_norm(system: &StateSpace) -> Result<f64, LtiError> {
    let root = controllability_root(system.a(), system.b())?;
    Ok(((system.c() * root).norm_squared() + system.d().norm_squared()).sqrt())
}

/// Coordinates xi of the controllable states x (n of them) with the identity as controllability Gramian,
/// `A A' + B B' = I`: `x = basis xi` and `xi = inverse x`.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct GramianCoordinates {
    /// n x r.
    pub(crate) basis: Mat,
    /// r x n, `inverse basis = I`.
    pub(crate) inverse: Mat,
    /// A in these coordinates, `inverse A basis`.
    pub(crate) a: Mat,
    /// B in these coordinates, `inverse B`.
    pub(crate) b: Mat,
}

impl GramianCoordinates {
    /// Scales every state to unit variance, so that the units of the states do not matter, and drops the
    /// directions with a standard deviation below `tol_rank` times the largest.
    ///
    /// # Errors
    /// [`LtiError::IterationLimit`] if A is not stable, [`LtiError::Linalg`] if the decomposition does not
    /// converge.
    pub(crate) fn new(a: &Mat, b: &Mat, tol_rank: f64) -> Result<Self, LtiError> {
        let root = controllability_root(a, b)?;
        let n = a.nrows();
        let deviation: Vec<f64> = (0..n).map(|i| root.row(i).norm()).collect();
        let unit = |i: usize| if deviation[i] > 0.0 { 1.0 / deviation[i] } else { 0.0 };
        let svd = hybank_linalg::svd(&Mat::from_fn(n, root.ncols(), |i, j| unit(i) * root[(i, j)]))?;
        let rank = svd.rank(tol_rank);
        let basis = Mat::from_fn(n, rank, |i, r| deviation[i] * svd.u[(i, r)] * svd.s[r]);
        let inverse = Mat::from_fn(rank, n, |r, i| svd.u[(i, r)] / svd.s[r] * unit(i));
        let (small_a, small_b) = (&inverse * a * &basis, &inverse * b);
        Ok(Self { basis, inverse, a: small_a, b: small_b })
    }
}

/// The system in coordinates in which both Gramians are diag(sigma), the Hankel singular values in
/// descending order, truncated: the last states are left out if together they change the transfer function
/// by at most `floor` (twice the sum of their sigma bounds the H-infinity norm of the truncation error:
/// Glover 1984). Sources of the method: Laub, Heath, Paige and Ward 1987; Tombs and Postlethwaite 1987.
///
/// The algorithm works on square roots of the Gramians, so that small sigma keep their digits. States that
/// are exactly uncontrollable or unobservable are always left out, even with `floor` = 0.
///
/// # Errors
/// [`LtiError`] if the system is not stable.
pub(crate) fn balanced(system: &StateSpace, floor: f64) -> Result<StateSpace, LtiError> {
    balanced_when_driven(system, &controllability_root(system.a(), system.b())?, floor)
}

/// As [`balanced`] for a system that is driven by another signal than white noise, for example by the
/// output of another system (Enns 1984). `controllability_root` is a square root of the covariance of the
/// states under that signal. The leading states then have the largest effect for that signal.
///
/// The output is not weighted, so every truncation is stable. The truncation error has no bound as simple
/// as that of [`balanced`]; compute it.
///
/// # Errors
/// [`LtiError`] if the system is not stable.
pub(crate) fn balanced_when_driven(
    system: &StateSpace,
    controllability_root: &Mat,
    floor: f64,
) -> Result<StateSpace, LtiError> {
    let observability_root = observability_root(system.a(), system.c())?;
    let svd = hybank_linalg::svd(&(observability_root.transpose() * controllability_root))?;
    let kept = kept(&svd.s, floor);
    let root = |k: usize| svd.s[k].sqrt();
    let right = Mat::from_fn(svd.v.nrows(), kept, |i, k| svd.v[(i, k)] / root(k));
    let left = Mat::from_fn(kept, svd.u.nrows(), |k, i| svd.u[(i, k)] / root(k));
    let (forward, back) = (controllability_root * right, left * observability_root.transpose());
    let a = &back * system.a() * &forward;
    Ok(StateSpace::new(a, back * system.b(), system.c() * forward, system.d().clone()))
}

/// How many of the descending `sigma` must stay.
fn kept(sigma: &[f64], floor: f64) -> usize {
    let mut rest = 0.0;
    let droppable = sigma.iter().rev().take_while(|&&value| {
        rest += 2.0 * value;
        rest <= floor
    });
    sigma.len() - droppable.count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use hybank_linalg::Complex;
    use nalgebra::DVector;

    #[test]
    fn solves_the_lyapunov_equation() {
        let a = Mat::from_row_slice(3, 3, &[0.5, 0.9, 0.0, -0.3, 0.7, 0.1, 0.0, 0.0, 0.999]);
        let b = Mat::from_row_slice(3, 2, &[1.0, 0.0, 0.0, 1e-3, 1e3, 0.0]);
        let root = controllability_root(&a, &b).unwrap();
        let p = &root * root.transpose();
        let residual = &a * &p * a.transpose() + &b * b.transpose() - &p;
        assert!(residual.norm() < 1e-13 * p.norm(), "{}", residual.norm());
    }

    #[test]
    fn a_delay_line_counts_its_samples() {
        let n = 9;
        let a = Mat::from_fn(n, n, |i, j| f64::from(u8::from(i == j + 1)));
        let mut b = Mat::zeros(n, 1);
        b[0] = 2.0;
        let system = StateSpace::new(a, b, Mat::from_element(1, n, 1.0), Mat::zeros(1, 1));
        assert!((h2_norm(&system).unwrap() - 6.0).abs() < 1e-13);
    }

    #[test]
    fn an_unstable_system_is_an_error() {
        let one = Mat::from_element(1, 1, 1.0);
        assert!(controllability_root(&(&one * 1.01), &one).is_err());
        assert!(controllability_root(&one, &one).is_err());
    }

    #[test]
    fn the_gramian_is_one_and_uncontrollable_states_are_gone_whatever_the_units() {
        let a =
            Mat::from_row_slice(4, 4, &[0.9, 0.2, 0., 0., 0., 0.5, 0., 0., 0., 0., 0.3, 0., 0., 0., 1.0, 0.]);
        let b = Mat::from_row_slice(4, 1, &[0.0, 1.0, 0.0, 0.0]);
        for scale in [1e-9, 1.0, 1e9] {
            let units = Mat::from_diagonal(&DVector::from_vec(vec![1.0, scale, 1.0, 1.0]));
            let back = Mat::from_diagonal(&DVector::from_vec(vec![1.0, 1.0 / scale, 1.0, 1.0]));
            let c = GramianCoordinates::new(&(&units * &a * &back), &(&units * &b), 1e-12).unwrap();
            assert_eq!(c.a.nrows(), 2);
            let unity = &c.a * c.a.transpose() + &c.b * c.b.transpose();
            assert!((unity - Mat::identity(2, 2)).norm() < 1e-12);
        }
    }

    #[test]
    fn an_unstable_system_is_refused() {
        let one = Mat::from_element(1, 1, 1.5);
        assert!(matches!(GramianCoordinates::new(&one, &one, 1e-12), Err(LtiError::IterationLimit { .. })));
    }

    fn response_gap(a: &StateSpace, b: &StateSpace) -> f64 {
        let at = |w: f64| Complex::from_polar(1.0, w);
        [0.0, 0.4, 1.3, 2.9]
            .map(|w| (a.response_at(at(w)) - b.response_at(at(w))).norm())
            .into_iter()
            .fold(0.0, f64::max)
    }

    fn badly_scaled() -> StateSpace {
        let a = Mat::from_row_slice(3, 3, &[0.9, 1e6, 0.0, 0.0, 0.5, 0.0, 1e-6, 0.0, -0.8]);
        let b = Mat::from_row_slice(3, 2, &[1.0, 2.0, 1e-6, 0.0, 0.0, 1e-5]);
        let c = Mat::from_row_slice(1, 3, &[1.0, 0.0, 1e4]);
        StateSpace::new(a, b, c, Mat::from_element(1, 2, 0.5))
    }

    #[test]
    fn both_gramians_become_the_same_diagonal() {
        let system = balanced(&badly_scaled(), 0.0).unwrap();
        let gramian = |a: &Mat, b: &Mat| {
            let root = controllability_root(a, b).unwrap();
            &root * root.transpose()
        };
        let p = gramian(system.a(), system.b());
        let q = gramian(&system.a().transpose(), &system.c().transpose());
        assert!((&p - &q).norm() < 1e-12 * p.norm(), "{p} {q}");
        assert!((&p - Mat::from_diagonal(&p.diagonal())).norm() < 1e-12 * p.norm(), "{p}");
        assert!(response_gap(&system, &badly_scaled()) < 1e-10);
    }

    #[test]
    fn uncontrollable_and_negligible_states_are_left_out() {
        // Observable and controllable; not controllable; hardly observable.
        let a = Mat::from_diagonal(&DVector::from_vec(vec![0.5, 0.9, -0.3]));
        let b = Mat::from_column_slice(3, 1, &[1.0, 0.0, 1.0]);
        let c = Mat::from_row_slice(1, 3, &[1.0, 1.0, 1e-9]);
        let system = StateSpace::new(a, b, c, Mat::zeros(1, 1));
        assert_eq!(balanced(&system, 1e-15).unwrap().order(), 2);
        let small = balanced(&system, 1e-6).unwrap();
        assert_eq!(small.order(), 1);
        assert!(response_gap(&small, &system) < 1e-8);
        let undriven =
            StateSpace::new(system.a().clone(), Mat::zeros(3, 1), system.c().clone(), Mat::zeros(1, 1));
        assert_eq!(balanced(&undriven, 0.0).unwrap().order(), 0);
    }

    #[test]
    fn an_empty_system_stays_empty() {
        let empty = StateSpace::new(Mat::zeros(0, 0), Mat::zeros(0, 2), Mat::zeros(3, 0), Mat::zeros(3, 2));
        assert_eq!(balanced(&empty, 1.0).unwrap(), empty);
    }
}
