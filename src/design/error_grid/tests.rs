use super::*;
use crate::design::problem::Problem;
use crate::lti::StateSpace;
use crate::lti::gramian::h2_norm;
use crate::spec::Spec;

fn plant(ratio: usize) -> LiftedPlant {
    let text = format!(
        "fast_period = 1.0\nratio = {ratio}\nlatency = 6\n\
         target = {{ filter = {{ num = [0.25], den = [1.0, 1.0, 0.25] }} }}\n\
         channel = [{{ delay = 1.2 }}, {{ delay = 0.6 }}]\ndesign = {{ method = \"iir\" }}"
    );
    LiftedPlant::new(&Problem::new(&Spec::from_toml(&text, "spec.toml").unwrap(), 6).unwrap())
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
        let lags = filters::polyphase(&taps(count), ratio);
        let estimate = ErrorGrid::new(&plant, lags.len()).unwrap().peaks(&lags, 0.0).unwrap().estimate;
        let norm = plant.fir_norm(&taps(count)).unwrap().gain;
        assert!(estimate <= norm * (1.0 + 1e-9) && estimate > norm * (1.0 - 1e-5), "{estimate} {norm}");
    }
}

#[test]
fn mean_squares_are_squared_h2_norms() {
    for (ratio, count) in [(1, 1), (2, 9), (3, 14)] {
        let plant = plant(ratio);
        let lags = filters::polyphase(&taps(count), ratio);
        let square = ErrorGrid::new(&plant, lags.len()).unwrap().mean_square(&lags);
        let error = plant.error_system(&StateSpace::fir(&lags));
        let want = h2_norm(&error).unwrap().powi(2);
        assert!((square / want - 1.0).abs() < 1e-9, "{square} {want}");
    }
}

/// Pruned grids against those that compute all points: the highest peak has the same bits wherever it is
/// above the level, and nothing above the level is missed.
#[test]
fn the_highest_peak_is_that_of_the_whole_grid() {
    let spec = Spec::from_toml(include_str!("../../../filters/thesis-fir.toml"), "spec.toml").unwrap();
    let plant = LiftedPlant::new(&Problem::new(&spec, 10).unwrap());
    let mut random = crate::random::Random(5);
    for lags in [1, 3, 11] {
        let grid = ErrorGrid::new(&plant, lags).unwrap();
        for _ in 0..8 {
            let taps: Taps = (0..lags).map(|_| Mat::from_fn(2, 2, |_, _| random.sample())).collect();
            let highest = |peaks: &Peaks<()>| {
                peaks.peaks.iter().cloned().max_by(|a, b| a.gain.total_cmp(&b.gain)).unwrap()
            };
            let all = grid.peaks(&taps, 0.0).unwrap();
            for level in [0.5, 0.9, 0.999].map(|share| share * all.estimate) {
                let some = grid.peaks(&taps, level).unwrap();
                assert_eq!((highest(&some), some.estimate), (highest(&all), all.estimate), "{lags} {level}");
            }
            let above = 1.01 * all.estimate;
            assert!(grid.peaks(&taps, above).unwrap().estimate <= above);
        }
    }
}
