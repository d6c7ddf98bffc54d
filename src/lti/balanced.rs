//! Square-root balanced truncation (Laub, Heath, Paige, Ward 1987; Tombs, Postlethwaite 1987).

use super::gramian::{controllability_root, observability_root};
use super::{LtiError, StateSpace};
use crate::linalg::{self, Mat};

/// The system in coordinates in which both Gramians are diag(sigma), the Hankel singular values in
/// descending order, truncated: the last states are left out if together they change the transfer function
/// by at most `floor` (twice the sum of their sigma bounds the H-infinity norm of the truncation error:
/// Glover 1984).
///
/// The algorithm works on square roots of the Gramians, so that small sigma keep their digits. States that
/// are exactly uncontrollable or unobservable are always left out, even with `floor` = 0.
///
/// # Errors
/// [`LtiError`] if the system is not stable.
pub fn balanced(system: &StateSpace, floor: f64) -> Result<StateSpace, LtiError> {
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
pub fn balanced_when_driven(
    system: &StateSpace,
    controllability_root: &Mat,
    floor: f64,
) -> Result<StateSpace, LtiError> {
    let observability_root = observability_root(system.a(), system.c())?;
    let svd = linalg::svd(&(observability_root.transpose() * controllability_root))?;
    let kept = kept(&svd.s, floor);
    let root = |k: usize| svd.s[k].sqrt();
    let right = Mat::from_fn(svd.v.nrows(), kept, |i, k| svd.v[(i, k)] / root(k));
    let left = Mat::from_fn(kept, svd.u.nrows(), |k, i| svd.u[(i, k)] / root(k));
    let (forward, back) = (controllability_root * right, left * observability_root.transpose());
    let a = &back * system.a() * &forward;
    Ok(StateSpace::new(a, back * system.b(), system.c() * forward, system.d().clone())?)
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
    use crate::linalg::Complex;

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
        StateSpace::new(a, b, c, Mat::from_element(1, 2, 0.5)).unwrap()
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
        let a = Mat::from_diagonal(&nalgebra::dvector![0.5, 0.9, -0.3]);
        let b = Mat::from_column_slice(3, 1, &[1.0, 0.0, 1.0]);
        let c = Mat::from_row_slice(1, 3, &[1.0, 1.0, 1e-9]);
        let system = StateSpace::new(a, b, c, Mat::zeros(1, 1)).unwrap();
        assert_eq!(balanced(&system, 1e-15).unwrap().order(), 2);
        let small = balanced(&system, 1e-6).unwrap();
        assert_eq!(small.order(), 1);
        assert!(response_gap(&small, &system) < 1e-8);
        let undriven =
            StateSpace::new(system.a().clone(), Mat::zeros(3, 1), system.c().clone(), Mat::zeros(1, 1))
                .unwrap();
        assert_eq!(balanced(&undriven, 0.0).unwrap().order(), 0);
    }

    #[test]
    fn an_empty_system_stays_empty() {
        let empty =
            StateSpace::new(Mat::zeros(0, 0), Mat::zeros(0, 2), Mat::zeros(3, 0), Mat::zeros(3, 2)).unwrap();
        assert_eq!(balanced(&empty, 1.0).unwrap(), empty);
    }
}
