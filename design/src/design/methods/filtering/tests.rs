//! The Riccati equation of the thesis, in the plant's own matrices: the code never forms it, since D2 D2'
//! may be nearly singular. On mild plants it can be formed, and the covariances found must solve it.

use super::*;
use crate::design::problem::Problem;
use hybank_core::spec::Spec;

/// Channels that all have feedthrough: no other plant has a regular weight.
pub(in crate::design::methods) fn plant(latency: usize, delays: &str) -> LiftedPlant {
    let text = format!(
        "fast_period = 1.0\nratio = 2\nlatency = {latency}\n\
         target = {{ filter = {{ num = [2.0], den = [1.0, 2.0] }} }}\n\
         channel = [{delays}]\ndesign = {{ method = \"iir\" }}"
    );
    LiftedPlant::new(&Problem::new(&Spec::from_toml(&text, "spec.toml").unwrap(), latency).unwrap())
}

fn plants() -> [LiftedPlant; 3] {
    [
        plant(4, "{ delay = 0.3 }, { delay = 1.7 }"),
        plant(1, "{ delay = 0.3 }, { delay = 0.9 }, { delay = 1.7 }"),
        plant(0, "{ delay = 0.5 }"),
    ]
}

/// P - (A P A' + B B' - M Re^-1 M') with M = A P C' + B D' and Re = D D' + C P C' - gamma^2 diag(0, I),
/// over the norm of P. Without gamma the references are left out, which is the equation of the Kalman
/// filter.
fn residual(plant: &LiftedPlant, p: &Mat, gamma: Option<f64>) -> f64 {
    let system = match gamma {
        Some(_) => plant.system().clone(),
        None => plant.measurement(),
    };
    let (a, b, c, d) = (system.a(), system.b(), system.c(), system.d());
    let m = a * p * c.transpose() + b * d.transpose();
    let mut re = d * d.transpose() + c * p * c.transpose();
    for i in plant.channels()..re.nrows() {
        re[(i, i)] -= gamma.map_or(0.0, |gamma| gamma * gamma);
    }
    let gap = a * p * a.transpose() + b * b.transpose() - &m * hybank_linalg::solve(&re, &m.transpose()) - p;
    gap.norm() / p.norm()
}

#[test]
fn the_mean_square_covariance_solves_the_kalman_equation() {
    for plant in plants() {
        let p = Innovations::new(&plant).unwrap().mean_square_covariance().unwrap();
        assert!(residual(&plant, &p, None) < 1e-10, "{:e}", residual(&plant, &p, None));
        assert!(hybank_linalg::hermitian_eigenvalues(&p).unwrap()[0] > -1e-12 * p.norm());
    }
}

#[test]
fn the_worst_case_covariance_solves_the_equation_of_the_thesis() {
    for plant in plants() {
        let gamma =
            1.2 * plant.norm(&StateSpace::gain(Mat::zeros(plant.ratio(), plant.channels()))).unwrap().gain;
        let innovations = Innovations::new(&plant).unwrap();
        let (f, g, h) = innovations.weights(&innovations.margin(gamma)).unwrap();
        let Some(solution) = solve_doubling(&f.transpose(), &g, &h) else { panic!("not solved at {gamma}") };
        let p = solution.x + &innovations.p0;
        assert!(residual(&plant, &p, Some(gamma)) < 1e-10, "{:e}", residual(&plant, &p, Some(gamma)));
    }
}

/// With whole-period delays the weight is singular: the definition of the filter decides instead.
#[test]
fn a_filter_that_is_said_to_achieve_gamma_does() {
    let delayed = plant(2, "{ delay = 0.5 }, { delay = 6.0 }");
    assert!(!delayed.chain(1).is_empty());
    for plant in plants().into_iter().chain([delayed]) {
        let bound = plant.noncausal_bound().unwrap().gain;
        for innovations in Innovations::in_all_coordinates(&plant).unwrap() {
            for factor in [1.5, 4.0] {
                if let Trial::Achieved(filter) = innovations.h_infinity(factor * bound) {
                    let norm = plant.norm(&filter).unwrap().gain;
                    assert!(norm <= factor * bound * (1.0 + 1e-9), "{norm} above {}", factor * bound);
                }
            }
            // Below the noncausal bound nothing can be achieved, by whatever filter.
            let below = innovations.h_infinity(0.9 * bound);
            assert!(!matches!(below, Trial::Achieved(ref f) if plant.norm(f).unwrap().gain < 0.95 * bound));
            assert!(matches!(innovations.h_infinity(1e3), Trial::Achieved(_)));
        }
    }
}

/// The square of such a gamma is not a number of double precision, so nothing is known of it; it counted as
/// one that no filter achieves, and as a lower bound.
#[test]
fn an_overflow_does_not_exclude_a_gamma() {
    for plant in plants() {
        for innovations in Innovations::in_all_coordinates(&plant).unwrap() {
            assert!(!matches!(innovations.h_infinity(1e200), Trial::Impossible));
        }
    }
}
