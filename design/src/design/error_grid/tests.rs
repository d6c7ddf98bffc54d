use super::*;
use crate::lti::FirMatrix;
use crate::lti::gramian::h2_norm;
use crate::tests::{self, after_thesis_filter};

fn plant(ratio: usize) -> LiftedPlant {
    tests::plant(&after_thesis_filter(ratio, 6, "{ delay = 1.2 }, { delay = 0.6 }", "method = \"iir\""))
}

fn taps(count: usize) -> Vec<Vec<f64>> {
    let tap = |i: usize, n: usize| ((1 + i * 5 + n * 3) as f64).sin() * 0.4;
    (0..2).map(|i| (0..count).map(|n| tap(i, n)).collect()).collect()
}

/// The estimate is attained, so it is never above the norm, and fine enough to come close to it.
#[test]
fn estimates_come_close_to_the_norm_from_below() {
    for (ratio, count) in [(1, 1), (2, 9), (2, 30), (3, 14)] {
        let plant = plant(ratio);
        let fir = FirMatrix::polyphase(&taps(count), ratio);
        let estimate = ErrorGrid::new(&plant, fir.lags().len()).unwrap().gamma(&fir).unwrap();
        let norm = plant.fir_norm(&taps(count)).unwrap().gain;
        assert!(estimate <= norm * (1.0 + 1e-9) && estimate > norm * (1.0 - 1e-5), "{estimate} {norm}");
    }
}

#[test]
fn mean_squares_are_squared_h2_norms() {
    for (ratio, count) in [(1, 1), (2, 9), (3, 14)] {
        let plant = plant(ratio);
        let fir = FirMatrix::polyphase(&taps(count), ratio);
        let square = ErrorGrid::new(&plant, fir.lags().len()).unwrap().mean_square(&fir);
        let error = plant.error_system(&fir.state_space());
        let want = h2_norm(&error).unwrap().powi(2);
        assert!((square / want - 1.0).abs() < 1e-9, "{square} {want}");
    }
}
