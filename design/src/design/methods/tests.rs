//! Tests of all methods: shapes, bounds, and the norm computed independently.

use super::*;
use crate::design::filters::lifted;
use crate::design::merging::Repeats;
use crate::lti::FirMatrix;
use crate::tests::{after_thesis_filter, largest_on_grid};
use hybank_core::spec::Spec;
use hybank_core::units::Seconds;
use hybank_linalg::{CMat, Complex};

struct Case {
    name: &'static str,
    ratio: usize,
    latency: usize,
    channels: &'static str,
}

const fn case(name: &'static str, ratio: usize, latency: usize, channels: &'static str) -> Case {
    Case { name, ratio, latency, channels }
}

const NOISY: &str = "{ delay = 0.2, noise = 1e-3 }, { delay = 0.9 }, { delay = 1.6, noise = 1e-2 }";
const TWICE: &str = "{ delay = 0.5 }, { delay = 1.1 }, { delay = 0.5, noise = 1e-2 }";
const CASES: [Case; 7] = [
    case("thesis", 2, 10, "{ delay = 1.2 }, { delay = 0.6 }"),
    case("no latency", 2, 0, "{ delay = 1.2 }, { delay = 0.6 }"),
    case("one channel", 1, 3, "{ delay = 0.4 }"),
    case("one channel, undersampled", 2, 4, "{ delay = 0.4 }"),
    case("oversampled, with noise", 2, 6, NOISY),
    case("whole periods of delay", 2, 0, "{ delay = 0.5 }, { delay = 5.0 }"),
    case("twice the same channel", 2, 5, TWICE),
];

fn spec(case: &Case, method: Method) -> Spec {
    let taps = if method.has_taps() { ", taps = 13" } else { "" };
    let design = format!("method = \"{}\"{taps}", method.name());
    after_thesis_filter(case.ratio, case.latency, case.channels, &design)
}

/// A plant without identical channels, as the designer passes it to a method.
fn plant(case: &Case) -> LiftedPlant {
    let problem = Problem::new(&spec(case, Method::Iir), case.latency).unwrap();
    LiftedPlant::new(&problem.merge_channels(Repeats::AtOneInstant).problem)
}

fn settings(case: &Case, method: Method) -> MethodSettings {
    let spec = spec(case, method);
    let slow = Spec { fast_period: Seconds(case.ratio as f64), ..spec };
    let at_slow_rate = Some(Problem::new(&slow, 0).unwrap().merge_channels(Repeats::AtOneInstant).problem);
    let taps = if method.has_taps() { 13 } else { 0 };
    MethodSettings { taps, at_slow_rate, ..MethodSettings::default() }
}

/// F(z) by its definition.
fn filter_response(filters: &SynthesisFilters, ratio: usize, z: Complex<f64>) -> CMat {
    match filters {
        SynthesisFilters::StateSpace(_) => lifted(filters, ratio).response_at(z),
        SynthesisFilters::Fir(taps) => {
            let term =
                |j: usize, lag: &hybank_linalg::Mat| hybank_linalg::to_complex(lag) * z.powi(-(j as i32));
            FirMatrix::polyphase(taps, ratio).lags().iter().enumerate().map(|(j, lag)| term(j, lag)).sum()
        }
    }
}

/// The largest gain of W - F H on a dense grid, from the responses of the three.
fn dense_grid(plant: &LiftedPlant, filters: &SynthesisFilters) -> f64 {
    let (h, w) = (plant.measurement(), plant.reference());
    let f = |z| filter_response(filters, plant.ratio(), z);
    largest_on_grid(1500, |z| w.response_at(z) - f(z) * h.response_at(z))
}

fn check(case: &Case, method: Method, synthesis: &Synthesis, plant: &LiftedPlant) {
    let what = format!("{}, {}", case.name, method.name());
    let Synthesis { filters, peak, lower, noncausal, .. } = synthesis;
    match filters {
        SynthesisFilters::Fir(taps) => {
            assert!(method.reads("taps"), "{what}");
            assert_eq!(taps.len(), plant.channels(), "{what}");
            assert!(taps.iter().all(|filter| filter.len() == 13), "{what}");
        }
        SynthesisFilters::StateSpace(_) => {
            let system = lifted(filters, plant.ratio());
            assert!(!method.has_taps(), "{what}");
            assert_eq!((system.outputs(), system.inputs()), (plant.ratio(), plant.channels()), "{what}");
            assert!(system.spectral_radius().unwrap() < 1.0, "{what}");
        }
    }
    let bounds = [0.0, *noncausal, *lower, peak.gain];
    assert!(bounds.is_sorted(), "{what}: {bounds:?}");
    let grid = dense_grid(plant, filters);
    assert!(grid <= peak.gain * (1.0 + 1e-8), "{what}: {grid} above {peak:?}");
    assert!(grid >= peak.gain * (1.0 - 1e-3), "{what}: {grid} far below {peak:?}");
}

#[test]
fn every_method_keeps_the_contract() {
    for case in &CASES {
        let plant = plant(case);
        for method in Method::ALL {
            match synthesise(method, &plant, &settings(case, method)) {
                Ok(synthesis) => check(case, method, &synthesis, &plant),
                Err(DesignError::SincNeedsNyquist { channels, ratio }) => {
                    assert!(method == Method::Sinc && channels != ratio, "{}", case.name);
                }
                Err(error) => panic!("{}, {}: {error}", case.name, method.name()),
            }
        }
        let taps = MethodSettings { taps: 13, ..MethodSettings::default() };
        check(case, Method::H2, &synthesise(Method::H2, &plant, &taps).unwrap(), &plant);
    }
}

#[test]
fn no_method_beats_those_that_minimise_gamma() {
    for case in &CASES {
        let plant = plant(case);
        let norm = |method: Method| synthesise(method, &plant, &settings(case, method)).map(|s| s.peak.gain);
        let (iir, fir) = (norm(Method::Iir).unwrap(), norm(Method::Fir).unwrap());
        let tolerance = 1.0 + 2.0 * GAMMA_ACCURACY;
        assert!(iir <= fir * tolerance, "{}: {iir} {fir}", case.name);
        for other in [Method::H2, Method::Sinc, Method::Separation] {
            let Ok(other_norm) = norm(other) else { continue };
            assert!(iir <= other_norm * tolerance, "{}, {}: {iir} {other_norm}", case.name, other.name());
            let is_fir = other.has_taps();
            // fir spends 1e-3 of gamma where there is noise.
            assert!(!is_fir || fir <= other_norm * (1.0 + 2e-3), "{}: {fir} {other_norm}", case.name);
        }
    }
}

#[test]
fn a_margin_is_spent_on_the_mean_square() {
    let plant = plant(&CASES[0]);
    let h2 = |filters: &SynthesisFilters| {
        crate::lti::gramian::h2_norm(&plant.error_system(&lifted(filters, plant.ratio()))).unwrap()
    };
    for method in [Method::Fir, Method::Iir] {
        let tight = settings(&CASES[0], method);
        let wide = MethodSettings { gamma_margin: Some(0.05), ..tight.clone() };
        let (tight, wide) =
            (synthesise(method, &plant, &tight).unwrap(), synthesise(method, &plant, &wide).unwrap());
        assert!(wide.peak.gain <= tight.peak.gain * 1.05 * (1.0 + 1e-9), "{}", method.name());
        // The least gamma of this plant is that of the Kalman filter, so `iir` has nothing left to gain.
        assert!(method == Method::Iir || h2(&wide.filters) < h2(&tight.filters), "{}", method.name());
    }
}

/// Of filters: the mean square of the error, that of the noise at the output, and the noise gain.
fn squares(plant: &LiftedPlant, filters: &SynthesisFilters) -> [f64; 3] {
    let system = lifted(filters, plant.ratio());
    let square = |system: &crate::lti::StateSpace| crate::lti::gramian::h2_norm(system).unwrap().powi(2);
    let rms: Vec<f64> = plant.problem().noise.iter().map(|power| power.sqrt()).collect();
    let noise = square(&system.clone().scale_inputs(&rms));
    [square(&plant.error_system(&system)), noise, square(&system).sqrt()]
}

/// The recursive optimum is at least as good as that of many taps, whatever the noise; and noise that is
/// stated is not amplified beyond what zero output has.
#[test]
fn the_recursive_mean_square_optimum_counts_noise() {
    let channels = [
        ("smooth and nearly equal", "{ delay = 1.2 }, { delay = 1.2001 }", 2),
        ("one exact", "{ delay = 0.6, noise = 0 }, { delay = 1.3 }", 2),
        ("whole periods apart", "{ delay = 0.5 }, { delay = 6.5 }, { delay = 1.5 }", 2),
        ("delayed and exact", "{ delay = 0.5 }, { delay = 7.0, noise = 0 }", 2),
        ("many", "{ delay = 0 }, { delay = 1.01 }, { delay = 2.3 }, { delay = 2.31 }", 3),
    ];
    for (what, list, ratio) in channels {
        for noise in [1e-9, 1e-6, 1e-3, 0.1, 1.0] {
            let text = format!(
                "fast_period = 1.0\nratio = {ratio}\nlatency = 6\nchannel = [{list}]\n\
                 target = {{ filter = {{ family = \"butterworth\", order = 6, cutoff = 0.05 }} }}\n\
                 design = {{ method = \"h2\", noise = {noise:e} }}"
            );
            let spec = Spec::from_toml(&text, "spec.toml").unwrap();
            let problem = Problem::new(&spec, 6).unwrap().merge_channels(Repeats::of(&spec));
            let plant = LiftedPlant::new(&problem.of_unit_size().unwrap().problem);
            let of = |taps: usize| {
                let settings = MethodSettings { taps, ..MethodSettings::default() };
                squares(&plant, &synthesise(Method::H2, &plant, &settings).unwrap().filters)
            };
            let (recursive, fir) = (of(0), of(60));
            let zero = crate::lti::gramian::h2_norm(&plant.reference()).unwrap().powi(2);
            let total = |squares: [f64; 3]| squares[0] + squares[1];
            assert!(
                total(recursive) <= total(fir) * (1.0 + 1e-4) + 1e-20 * zero,
                "{what}, {noise:e}: {recursive:?} {fir:?}"
            );
            assert!(total(recursive) <= zero, "{what}, {noise:e}: {recursive:?} {zero}");
        }
    }
}

/// With a margin `iir` spends gamma on error and noise together.
#[test]
fn iir_trades_gamma_for_less_noise() {
    let case = case("noise", 2, 6, "{ delay = 1.2, noise = 0.02 }, { delay = 1.1, noise = 0.02 }");
    let plant = plant(&case);
    let of = |margin: Option<f64>| {
        let settings = MethodSettings { gamma_margin: margin, ..settings(&case, Method::Iir) };
        let found = synthesise(Method::Iir, &plant, &settings).unwrap();
        let [error, noise, _] = squares(&plant, &found.filters);
        (found.peak.gain, error + noise)
    };
    let (least, all) = of(None);
    let mut before = all;
    for margin in [0.05, 0.5, 3.0] {
        let (gamma, total) = of(Some(margin));
        assert!(gamma <= least * (1.0 + margin) * (1.0 + 1e-9), "{margin}: {gamma} {least}");
        assert!(total < before, "{margin}: {total} {before}");
        before = total;
    }
    let best =
        squares(&plant, &synthesise(Method::H2, &plant, &settings(&case, Method::H2)).unwrap().filters);
    assert!(best[0] + best[1] <= before * (1.0 + 1e-9), "{best:?} {before}");
}

#[test]
fn sinc_names_both_numbers_it_needs_equal() {
    let error = synthesise(Method::Sinc, &plant(&CASES[3]), &settings(&CASES[3], Method::Sinc)).unwrap_err();
    assert_eq!(error, DesignError::SincNeedsNyquist { channels: 1, ratio: 2 });
}
