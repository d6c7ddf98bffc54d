use super::*;
use crate::spec::Spec;

fn problem(filters: &str) -> Problem {
    let text = format!(
        "fast_period = 1.0\nratio = 2\ntarget = {{ filter = {{ family = \"rc\", cutoff = 0.1 }} }}\nchannel = [{filters}]\n"
    );
    Problem::new(&Spec::from_toml(&text, "spec.toml").unwrap(), 0).unwrap()
}

/// One pole p: c(t) = (p / 2) e^{-p |t|}, whose Gaussian average is a sum of two error functions. Here by
/// the frequency: (1 / pi) int_0^inf |Phi|^2 chi cos(w t) dw with the trapezoidal rule, which is exact for
/// such a decaying smooth function up to its aliases.
#[test]
fn averages_multiply_the_spectrum_by_the_characteristic_function() {
    let text = "{ delay = 0, filter = { family = \"butterworth\", order = 3, cutoff = 0.2 } }, \
                { delay = 0, filter = { zeros = [[0, 0]], poles = [[-0.3, 5], [-0.3, -5]], gain = 0.7 } }, \
                { delay = 0, filter = { num = [40], den = [1, 40] } }";
    let problem = problem(text);
    let covariances = Covariances::new(&problem).unwrap();
    let response = |i: usize, w: f64| problem.response(i, crate::units::RadiansPerFastPeriod(w));
    for deviation in [0.05, 0.7, 3.0] {
        let averaged = covariances.averaged(FastPeriods(deviation));
        let (step, most) = (1e-3, 9.0 / deviation);
        for (a, b) in [(0, 0), (1, 2), (2, 1), (2, 2), (3, 3), (3, 0), (0, 3)] {
            for t in [-40.0, -3.3, -0.4, 0.0, 0.1, 2.7, 30.0] {
                let term = |k: usize| {
                    let w = step * k as f64;
                    let cross = response(a, w) * response(b, w).conj() * Complex::from_polar(1.0, w * t);
                    let half = if k == 0 { 0.5 } else { 1.0 };
                    half * cross.re * (-0.5 * (w * deviation).powi(2)).exp()
                };
                let count = (most / step) as usize;
                let expected = (0..count).map(term).sum::<f64>() * step / std::f64::consts::PI;
                let scale = (covariances.power(a) * covariances.power(b)).sqrt();
                let found = averaged.at(a, b, t);
                assert!(
                    (found - expected).abs() < 1e-10 * scale,
                    "{deviation} {a} {b} {t}: {found} {expected}"
                );
            }
        }
    }
}

#[test]
fn jitter_is_the_slope_times_the_deviation_where_there_is_a_slope() {
    let problem = problem("{ delay = 0, filter = { family = \"butterworth\", order = 2, cutoff = 0.1 } }");
    let covariances = Covariances::new(&problem).unwrap();
    // Var(y') / Var(y) of a Butterworth filter of order 2 is its natural frequency squared.
    let natural = (TAU * 0.1).powi(2);
    for deviation in [1e-3, 1e-4, 1e-6, 1e-9] {
        let found = covariances.change(1, FastPeriods(deviation)) / covariances.power(1);
        let expected = natural * deviation * deviation;
        assert!(
            (found / expected - 1.0).abs() < 3.0 * deviation.sqrt() + 1e-5,
            "{deviation}: {found} {expected}"
        );
    }
    // One pole p has no slope: the change is that of a random walk, 2 (1 - e^{-p |d|}) on average.
    let p = TAU * 0.1;
    for deviation in [1e-2, 1e-5] {
        let found = covariances.change(0, FastPeriods(deviation)) / covariances.power(0);
        let expected = 2.0 * p * deviation * (2.0 / std::f64::consts::PI).sqrt();
        assert!((found / expected - 1.0).abs() < p * deviation + 1e-6, "{deviation}: {found} {expected}");
    }
    assert_eq!(covariances.change(0, FastPeriods(0.0)), 0.0);
}
