use super::*;
use crate::design::error_grid::LocatedPeak;
use hybank_linalg::{CMat, Complex};
use std::f64::consts::PI;

/// `W = gain / (1 - a e^{-i omega})` repeated down the diagonal, and channels that measure the white input
/// with the given gains: J lags of F approximate a geometric impulse response.
///
/// With J lags of one channel the distance is the Hankel norm of the rest of the response (Nehari),
/// `gain a^J / (1 - a^2)`.
struct Geometric {
    a: f64,
    gain: f64,
    channels: Vec<f64>,
    /// Frequencies on which peaks are looked for.
    grid: usize,
}

impl AffineError for Geometric {
    type Scenario = ();

    fn at(&self, location: &GridFrequency<()>) -> FrequencyPoint {
        self.point(location.frequency)
    }

    fn peaks(&self, taps: &FirMatrix, _level: f64) -> Result<Vec<LocatedPeak<()>>, DesignError> {
        let gain = |k: usize| {
            let location = GridFrequency { frequency: PI * k as f64 / self.grid as f64, scenario: () };
            LocatedPeak { gain: gain(&self.point(location.frequency), taps), location }
        };
        Ok((0..=self.grid).map(gain).max_by(|a, b| a.gain.total_cmp(&b.gain)).into_iter().collect())
    }
}

impl Geometric {
    fn point(&self, omega: f64) -> FrequencyPoint {
        let z = Complex::from_polar(1.0, -omega);
        let w = CMat::from_element(1, 1, self.gain / (1.0 - z * self.a));
        let h = CMat::from_fn(self.channels.len(), 1, |i, _| Complex::new(self.channels[i], 0.0));
        FrequencyPoint { omega, w, h }
    }
}

fn gain(point: &FrequencyPoint, taps: &FirMatrix) -> f64 {
    let mut k = point.w.clone();
    for (j, f) in taps.lags().iter().enumerate() {
        k -= hybank_linalg::to_complex(f) * &point.h * Complex::from_polar(1.0, -point.omega * j as f64);
    }
    hybank_linalg::singular_values(&k).unwrap()[0]
}

/// The exchange on five points to begin with, `lags` lags.
fn exchange(error: Geometric, lags: usize, gamma_margin: f64) -> Exchange<Geometric> {
    let points: Vec<FrequencyPoint> = (0..5).map(|k| error.point(PI * f64::from(k) / 4.0)).collect();
    let problem = SampledProblem::new(points, vec![lags]);
    let objective =
        MeanSquareObjective::noiseless(vec![0.125, 0.25, 0.25, 0.25, 0.125], error.channels.len());
    Exchange::new(error, problem, std::iter::repeat(()), objective, gamma_margin)
}

fn geometric(a: f64, gain: f64, channels: &[f64]) -> Geometric {
    Geometric { a, gain, channels: channels.to_vec(), grid: 3000 }
}

#[test]
fn the_optimum_is_nehari_s() {
    for a in [0.3, -0.5, 0.8] {
        for lags in [1, 2, 5] {
            let mut exchange = exchange(geometric(a, 1.0, &[1.0]), lags, 0.0);
            let best = exchange.optimise().unwrap();
            let nehari = f64::powi(a, lags as i32).abs() / (1.0 - a * a);
            let gamma = best.estimate;
            assert!((gamma / nehari - 1.0).abs() < 2e-6, "{a} {lags}: {gamma} {nehari}");
            assert!(exchange.lower <= nehari * (1.0 + 1e-9) && exchange.lower > nehari * (1.0 - 2e-6));
        }
    }
}

/// Equal channels, zero channels and gains far from one change neither gamma nor the bound.
#[test]
fn gains_and_copies_of_channels_do_not_matter() {
    let nehari = 0.125 / 0.75;
    for (gain, channels) in [
        (1.0, vec![1.0, 1.0]),
        (1.0, vec![1e-9]),
        (1.0, vec![1e9, 0.0]),
        (1e-9, vec![1.0]),
        (1e9, vec![1e-9, 1.0]),
    ] {
        let mut exchange = exchange(geometric(0.5, gain, &channels), 3, 0.0);
        let gamma = exchange.optimise().unwrap().estimate;
        assert!((gamma / (gain * nehari) - 1.0).abs() < 2e-6, "{gain} {channels:?}: {gamma}");
        assert!((exchange.lower / (gain * nehari) - 1.0).abs() < 2e-6, "{gain} {channels:?}");
    }
}

#[test]
fn a_zero_measurement_leaves_the_reference_and_a_zero_reference_has_no_error() {
    let mut zero_measurement = exchange(geometric(0.5, 1.0, &[0.0]), 2, 0.0);
    let gamma = zero_measurement.optimise().unwrap().estimate;
    assert!((gamma - 2.0).abs() < 1e-9 && (zero_measurement.lower - 2.0).abs() < 1e-6, "{gamma}");
    let mut zero_reference = exchange(geometric(0.5, 0.0, &[1.0]), 2, 0.0);
    let best = zero_reference.optimise().unwrap();
    assert!(best.estimate == 0.0 && best.taps.lags().iter().all(|f| f.norm() == 0.0));
}

/// The optimum of all frequencies is that of a dense grid, solved at once.
#[test]
fn the_exchange_ends_where_a_dense_grid_does() {
    for a in [0.4, -0.7] {
        let dense: Vec<FrequencyPoint> =
            (0..=600).map(|k| geometric(a, 1.0, &[1.0, 2.0]).point(PI * f64::from(k) / 600.0)).collect();
        let dense = sampled::minimise(&SampledProblem::new(dense, vec![3]), FINEST_GAP, &|| false).unwrap();
        let mut exchange = exchange(geometric(a, 1.0, &[1.0, 2.0]), 3, 0.0);
        let best = exchange.optimise().unwrap();
        assert!((best.estimate / dense.gamma - 1.0).abs() < 1e-5, "{} {}", best.estimate, dense.gamma);
        assert!(exchange.locations.len() < 60, "{}", exchange.locations.len());
    }
}

#[test]
fn a_wider_margin_lowers_the_mean_square_within_the_cap() {
    let mean_square = |margin: f64| {
        let mut exchange = exchange(geometric(0.8, 1.0, &[1.0]), 2, margin);
        let best = exchange.optimise().unwrap();
        let error = &exchange.error;
        let square = |k: i32| gain(&error.point(PI * f64::from(k) / 4.0), &best.taps).powi(2);
        assert!(best.estimate <= exchange.lower * (1.0 + margin) * (1.0 + 2e-6));
        0.125 * (square(0) + square(4)) + 0.25 * (1..4).map(square).sum::<f64>()
    };
    let all: Vec<f64> = [0.0, 0.01, 0.1].into_iter().map(mean_square).collect();
    assert!(all[1] < all[0] * (1.0 - 1e-3) && all[2] < all[1] * (1.0 - 1e-3), "{all:?}");
}

#[test]
fn known_frequencies_are_not_added_twice() {
    let mut exchange = exchange(geometric(0.5, 1.0, &[1.0]), 1, 0.0);
    let at = |frequency: f64| GridFrequency { frequency, scenario: () };
    assert!(!exchange.add(&[at(0.0), at(PI + 1e-9)]));
    assert!(exchange.add(&[at(1.0), at(1.0)]));
    assert_eq!(exchange.locations.len(), 6);
}

/// The peaks of taps cost as much as the problem itself, so none is looked for after the end: on a grid
/// without an interval the search would fail.
#[test]
fn a_stopped_exchange_ends_with_the_taps_of_its_points() {
    let unsearchable = Geometric { grid: 0, ..geometric(0.8, 1.0, &[1.0]) };
    let mut exchange = exchange(unsearchable, 2, 0.0);
    exchange.stop.now();
    let found = exchange.optimise().unwrap();
    assert_eq!(found.estimate, exchange.problem.worst(&found.taps).unwrap());
}
