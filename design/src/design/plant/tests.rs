use super::*;
use crate::design::merging::Repeats;
use crate::tests::{after_thesis_filter, dense_grid};
use hybank_linalg::Complex;

/// Channels with feedthrough, at the border of a period and delayed by whole periods.
fn plants() -> Vec<LiftedPlant> {
    let plant = |ratio: usize, latency: usize, delays: &str| {
        crate::tests::plant(&after_thesis_filter(ratio, latency, delays, "method = \"iir\""))
    };
    vec![
        plant(2, 10, "{ delay = 1.2 }, { delay = 0.6 }"),
        plant(3, 0, "{ delay = 0.0 }, { delay = 4.5 }, { delay = 12.0 }"),
        plant(1, 2, "{ delay = 0.25 }"),
    ]
}

fn bank(plant: &LiftedPlant) -> StateSpace {
    let (n, m) = (plant.channels(), plant.ratio());
    let wavy = |rows: usize, cols: usize, t: f64| {
        Mat::from_fn(rows, cols, |i, j| (t + 1.3 * i as f64 + 0.7 * j as f64).sin())
    };
    let a = Mat::from_row_slice(2, 2, &[0.4, 0.5, -0.5, 0.4]);
    StateSpace::new(a, wavy(2, n, 0.1), wavy(m, 2, 0.9), wavy(m, n, 2.0))
}

fn taps(plant: &LiftedPlant) -> Vec<Vec<f64>> {
    let tap = |i: usize, n: usize| ((1 + i * 5 + n * 3) as f64).sin() * 0.4;
    (0..plant.channels()).map(|i| (0..3 * plant.ratio() + 1).map(|n| tap(i, n)).collect()).collect()
}

#[test]
fn the_error_system_is_w_minus_f_h() {
    for plant in plants() {
        let (h, w, f) = (plant.measurement(), plant.reference(), bank(&plant));
        let error = plant.error_system(&f);
        assert_eq!(error.order(), plant.system().order() + f.order());
        for angle in [0.0, 0.4, 1.9, PI] {
            let z = Complex::from_polar(1.0, angle);
            let want = w.response_at(z) - f.response_at(z) * h.response_at(z);
            assert!((error.response_at(z) - &want).norm() < 1e-12 * (1.0 + want.norm()));
        }
    }
}

#[test]
fn the_response_keeps_all_products() {
    for plant in plants() {
        for omega in [0.0, 0.8, 2.2, PI] {
            let FrequencyPoint { h, w, .. } = plant.at(omega);
            assert!(h.ncols() <= plant.channels() + plant.ratio());
            let all = plant.system().response_at(Complex::from_polar(1.0, omega));
            let compressed = hybank_linalg::vstack(&[&h, &w]);
            let gap = &compressed * compressed.adjoint() - &all * all.adjoint();
            assert!(gap.norm() < 1e-12 * all.norm_squared(), "{gap}");
        }
    }
}

#[test]
fn norms_are_those_of_dense_grids() {
    for plant in plants() {
        for (norm, error) in [
            (plant.norm(&bank(&plant)).unwrap(), plant.error_system(&bank(&plant))),
            (
                plant.fir_norm(&taps(&plant)).unwrap(),
                plant.error_system(&FirMatrix::polyphase(&taps(&plant), plant.ratio()).state_space()),
            ),
        ] {
            let grid = dense_grid(&error);
            assert!(grid <= norm.gain * (1.0 + 1e-12) && grid > norm.gain * (1.0 - 1e-5), "{grid} {norm:?}");
            assert!(plant.noncausal_bound().unwrap().gain <= norm.gain * (1.0 + 1e-9));
        }
    }
}

#[test]
fn fir_filters_have_the_norm_of_their_state_space_form() {
    for plant in plants() {
        let fir = SynthesisFilters::Fir(taps(&plant));
        let system = filters::lifted(&fir, plant.ratio());
        let stored = SynthesisFilters::StateSpace(filters::to_block(&system));
        let (one, other) = (plant.bank_norm(&fir).unwrap(), plant.bank_norm(&stored).unwrap());
        assert!((one.gain - other.gain).abs() <= 2e-9 * one.gain, "{one:?} {other:?}");
    }
}

#[test]
#[should_panic]
fn filters_for_another_number_of_channels_are_a_fault_of_the_caller() {
    let _ = plants()[0].norm(&StateSpace::gain(Mat::zeros(2, 3)));
}

/// The response of the undelayed part times the delays is that of the whole system, and delays by whole
/// periods change no bound.
#[test]
fn delays_by_whole_periods_are_factors_of_the_response() {
    for plant in plants() {
        for omega in [0.0, 0.3, 1.7, PI] {
            let whole = plant.system().response_at(Complex::from_polar(1.0, omega));
            let (found, wanted) = (plant.at_frequency(omega), &whole * whole.adjoint());
            assert!((&found * found.adjoint() - &wanted).norm() < 1e-12 * wanted.norm(), "{omega}");
        }
        if !plant.problem().merge_channels(Repeats::AtWholePeriods).are_unchanged() {
            // The bound counts repeated channels once.
            continue;
        }
        let direct = unexplained_peak(plant.system(), plant.channels()).unwrap().gain;
        let found = plant.noncausal_bound().unwrap().gain;
        assert!((found / direct - 1.0).abs() < 1e-8, "{found} {direct}");
    }
}
