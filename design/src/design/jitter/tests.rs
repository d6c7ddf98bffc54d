use super::*;
use hybank_core::spec::Spec;
use std::f64::consts::TAU;

fn problem(filters: &str) -> Problem {
    let text = format!(
        "fast_period = 1.0\nratio = 2\ntarget = {{ filter = {{ family = \"rc\", cutoff = 0.1 }} }}\nchannel = [{filters}]\n"
    );
    Problem::new(&Spec::from_toml(&text, "spec.toml").unwrap(), 0).unwrap()
}

#[test]
fn jitter_is_the_slope_times_the_deviation_where_there_is_a_slope() {
    let problem = problem("{ delay = 0, filter = { family = \"butterworth\", order = 2, cutoff = 0.1 } }");
    // Var(y') / Var(y) of a Butterworth filter of order 2 is its natural frequency squared.
    let natural = (TAU * 0.1).powi(2);
    for deviation in [1e-3, 1e-4, 1e-6, 1e-9] {
        let found = problem.change(1, FastPeriods(deviation)) / problem.output_power(1);
        let expected = natural * deviation * deviation;
        let off = (found / expected - 1.0).abs();
        assert!(off < 3.0 * deviation.sqrt() + 1e-5, "{deviation}: {found} {expected}");
    }
    // One pole p has no slope: the change is that of a random walk, 2 (1 - e^{-p |d|}) on average.
    let p = TAU * 0.1;
    for deviation in [1e-2, 1e-5] {
        let found = problem.change(0, FastPeriods(deviation)) / problem.output_power(0);
        let expected = 2.0 * p * deviation * (2.0 / std::f64::consts::PI).sqrt();
        assert!((found / expected - 1.0).abs() < p * deviation + 1e-6, "{deviation}: {found} {expected}");
    }
    assert_eq!(problem.change(0, FastPeriods(0.0)), 0.0);
}
