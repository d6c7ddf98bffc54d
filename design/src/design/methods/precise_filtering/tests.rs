//! Against double precision where that suffices, and against its own equation.

use super::super::filtering::{Innovations, tests::plant};
use super::*;
use hybank_verify::arithmetic::{DoubleDouble, Float512};

/// All channels with feedthrough, and one delayed by whole periods.
fn plants() -> [LiftedPlant; 3] {
    [
        plant(4, "{ delay = 0.3 }, { delay = 1.7 }"),
        plant(0, "{ delay = 0.5 }"),
        plant(2, "{ delay = 0.5 }, { delay = 6.3 }"),
    ]
}

fn norm(plant: &LiftedPlant, filter: &StateSpace) -> f64 {
    plant.norm(filter).unwrap().gain
}

#[test]
fn covariances_do_not_change_in_a_step() {
    for plant in plants() {
        let filtering = PreciseFiltering::<Float512>::new(&plant).unwrap();
        let silence = norm(&plant, &StateSpace::gain(Mat::zeros(plant.ratio(), plant.channels())));
        for gamma in [None, Some(1.2 * silence)] {
            let p = filtering.covariance(gamma).unwrap();
            let next = filtering.step(&p, gamma).unwrap().next;
            for i in 0..p.nrows() {
                for j in 0..p.nrows() {
                    let size = (p[(i, i)] * p[(j, j)]).sqrt().nearest();
                    assert!((next[(i, j)] - p[(i, j)]).nearest().abs() <= 1e-24 * size, "{gamma:?} {i} {j}");
                }
            }
        }
    }
}

#[test]
fn filters_are_those_of_double_precision() {
    for plant in plants() {
        let precise = PreciseFiltering::<DoubleDouble>::new(&plant).unwrap();
        let double = Innovations::new(&plant).unwrap();
        let (a, b) = (norm(&plant, &precise.h2().unwrap()), norm(&plant, &double.h2().unwrap()));
        assert!((a / b - 1.0).abs() < 1e-9, "{a} {b}");
        let gamma = 1.1 * b;
        let (Trial::Achieved(ours), Trial::Achieved(theirs)) =
            (precise.h_infinity(gamma), double.h_infinity(gamma))
        else {
            panic!("{gamma} is achieved")
        };
        assert!(norm(&plant, &ours) <= gamma);
        assert!((norm(&plant, &ours) / norm(&plant, &theirs) - 1.0).abs() < 1e-7);
    }
}

/// At latency 0 the optimum lies above the noncausal bound.
#[test]
fn gammas_below_the_causal_optimum_are_impossible() {
    let plant = plant(0, "{ delay = 0.5 }");
    let filtering = PreciseFiltering::<Float512>::new(&plant).unwrap();
    let (mut below, mut above) = (plant.noncausal_bound().unwrap().gain, 2.0);
    assert!(matches!(filtering.h_infinity(below * 1.001), Trial::Impossible));
    while above > below * (1.0 + 1e-9) {
        let gamma = (below * above).sqrt();
        match filtering.h_infinity(gamma) {
            Trial::Achieved(filter) => {
                assert!(norm(&plant, &filter) <= gamma * (1.0 + 1e-9));
                above = gamma;
            }
            Trial::Impossible => below = gamma,
            Trial::Unresolved => panic!("unresolved at {gamma}"),
        }
    }
}
