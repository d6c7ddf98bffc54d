use super::*;
use crate::design::history_errors::HistoryErrors;
use crate::lmi::sampled;

/// The problem of a spec in normalised time with the same filter everywhere.
fn problem(filter: &str, ratio: usize, delays: &[f64]) -> Problem {
    let channels: Vec<String> = delays.iter().map(|delay| format!("{{ delay = {delay} }}")).collect();
    let text = format!(
        "fast_period = 1.0\nratio = {ratio}\ntarget = {{ filter = {filter} }}\nchannel = [{}]\n",
        channels.join(", ")
    );
    Problem::new(&Spec::from_toml(&text, "spec.toml").unwrap(), 0).unwrap()
}

const THESIS: &str = "{ num = [0.25], den = [1.0, 1.0, 0.25] }";
const STEEP: &str = r#"{ family = "butterworth", order = 6, cutoff = 0.12 }"#;

/// One pole p: the covariance of the output is (p / 2) e^{-p |t|}, and the nearest sample before and after
/// determine the best estimate.
#[test]
fn one_pole_has_closed_forms() {
    let p = 0.3;
    let problem = problem("{ num = [0.3], den = [1.0, 0.3] }", 4, &[1.5]);
    // Samples at -1.5, -5.5, -9.5.
    let errors = HistoryErrors::new(&problem, 3, -30..=6).unwrap();
    let power = 0.5 * p;
    assert!((errors.power / power - 1.0).abs() < 1e-12);
    let apart = |t: f64| power * (1.0 - (-2.0 * p * t).exp());
    for ahead in 0..=6 {
        let exact = apart(ahead as f64 + 1.5);
        assert!((errors.at(ahead) / exact - 1.0).abs() < 1e-5, "{ahead}");
    }
    for before in 0..20 {
        let exact = apart(before as f64 + 0.5);
        assert!((errors.at(-10 - before) / exact - 1.0).abs() < 1e-5, "{before}");
    }
    // Between two samples, a and b away.
    for (instant, a, b) in [(-2, 3.5, 0.5), (-4, 1.5, 2.5), (-7, 2.5, 1.5)] {
        let (u, v) = ((-p * a).exp(), (-p * b).exp());
        let exact = power * (1.0 - u * u) * (1.0 - v * v) / (1.0 - u * u * v * v);
        assert!((errors.at(instant) / exact - 1.0).abs() < 1e-5, "{instant}: {exact}");
    }
}

/// The least squares over the frequencies of the lifted plant are another route to the same errors.
#[test]
fn the_errors_are_those_of_the_least_squares_taps() {
    let cases = [
        (THESIS, 2, vec![1.2, 0.6], 9),
        (STEEP, 4, vec![3.1, 1.9, 1.05, 0.0], 14),
        (STEEP, 3, vec![4.4, 0.3], 7),
    ];
    for (filter, ratio, delays, taps) in cases {
        let problem = problem(filter, ratio, &delays);
        let reach = Reach::new(&problem, taps, &(0..=taps + 6)).unwrap();
        for latency in 0..=taps + 6 {
            let expected = least_square_errors(&problem, latency, taps);
            let worst = expected.iter().copied().fold(0.0, f64::max).sqrt();
            let found = reach.lower_bound(latency);
            assert!((found - worst).abs() < 1e-5 * worst + 1e-9, "latency {latency}: {found} {worst}");
        }
    }
}

/// By QR on a grid of frequencies that is exact for the periodic part of the error.
fn least_square_errors(problem: &Problem, latency: usize, taps: usize) -> Vec<f64> {
    let plant = plant(problem, latency).unwrap();
    let ratio = problem.ratio;
    let lags: Vec<usize> = (0..ratio).map(|p| taps.saturating_sub(p).div_ceil(ratio)).collect();
    let count = 256;
    let points = (0..=count).map(|k| {
        let omega = std::f64::consts::PI * k as f64 / count as f64;
        let (h, w) = plant.response(omega);
        sampled::Point { omega, h, w }
    });
    let grid = sampled::Problem::new(points.collect(), lags).unwrap();
    let weight = |k: usize| if k == 0 || k == count { 0.5 } else { 1.0 } / count as f64;
    let weights: Vec<f64> = (0..=count).map(weight).collect();
    let square = sampled::MeanSquareObjective::noiseless(weights.clone(), problem.channels.len());
    let taps = sampled::least_squares(&grid, &square, 1e-13).unwrap();
    let errors: Vec<_> = (0..=count).map(|l| grid.error_at(l, &taps)).collect();
    let square =
        |p: usize| errors.iter().zip(&weights).map(|(k, weight)| weight * k.row(p).norm_squared()).sum();
    (0..ratio).map(square).collect()
}

#[test]
fn the_bound_is_below_gamma_and_the_check_agrees_with_the_search() {
    for (filter, ratio, delays, taps) in [(THESIS, 2, vec![1.2, 0.6], 8), (STEEP, 4, vec![3.1, 1.9], 11)] {
        let problem = problem(filter, ratio, &delays);
        let latencies = reach::candidates(&problem, taps);
        let reach = Reach::new(&problem, taps, &latencies).unwrap();
        for latency in latencies {
            let (lower, upper) =
                fir::bracket(&plant(&problem, latency).unwrap(), taps, ACCURACY, f64::INFINITY).unwrap();
            assert!(lower <= upper && upper <= lower * (1.0 + ACCURACY), "{latency}: {lower} {upper}");
            assert!(reach.lower_bound(latency) <= upper, "{latency}");
        }
    }
}

#[test]
fn the_floor_does_not_depend_on_whole_periods() {
    let near = floor(&problem(THESIS, 2, &[1.25, 0.5]), 1.0).unwrap();
    let far = floor(&problem(THESIS, 2, &[801.25, 0.5]), 1.0).unwrap();
    assert!((near / far - 1.0).abs() < 1e-12, "{near} {far}");
    // Channels a whole period apart are one measurement.
    let twice = floor(&problem(THESIS, 2, &[1.25, 3.25]), 1.0).unwrap();
    let once = floor(&problem(THESIS, 2, &[1.25]), 1.0).unwrap();
    assert!((twice / once - 1.0).abs() < 1e-12, "{twice} {once}");
}
