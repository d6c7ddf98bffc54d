//! The least gamma of any causal bank, proven from below by `verify`'s recursion, against true optima.
//!
//! The numbers are those of an independent computation: a doubling Riccati equation in 900-bit arithmetic
//! and modal coordinates, true to 2e-6. Some of its 174 cases stand here; the whole table is read from the
//! file `causal-optima.json` of the data where `HYBANK_SLOW` is set.

use crate::support::specs::{alike, with_taps};
use hybank::bank::{Bank, SynthesisFilters};
use hybank::design::{Options, design};
use hybank::spec::{Family, FilterSpec, Passband, Spec};
use hybank::units::Hertz;
use hybank::verify::{EnclosedErrorSystem, Precision, Recursion, verify};

/// Error of the table.
const TABLE: f64 = 3e-6;
/// Slow periods at most.
const PERIODS: usize = 512;

struct Case {
    name: String,
    spec: Spec,
    optimum: f64,
    noncausal: f64,
}

fn case(
    (family, order, cutoff): (Family, usize, f64),
    ratio: usize,
    latency: usize,
    delays: &[f64],
    (optimum, noncausal): (f64, f64),
) -> Case {
    let name = format!("{family:?} {order} at {cutoff}, M = {ratio}, latency {latency}, {delays:?}");
    let filter = FilterSpec::Family {
        family,
        order: Some(order),
        passband: Passband::LowPass { cutoff: Hertz(cutoff) },
        ripple_db: family.has_ripple().then_some(0.5),
        attenuation_db: family.has_attenuation().then_some(60.0),
    };
    let spec = alike(&filter, ratio, latency, delays);
    Case { name, spec, optimum, noncausal }
}

/// Steep and gentle filters, one channel and four, hardly any latency and some.
fn golden() -> Vec<Case> {
    vec![
        case((Family::Butterworth, 2, 0.1), 2, 0, &[0.6], (0.3421665, 0.1591749)),
        case((Family::Butterworth, 2, 0.1), 4, 2, &[2.3], (0.6543281, 0.5392855)),
        case((Family::Butterworth, 2, 0.1), 4, 1, &[2.3], (0.7519916, 0.5392855)),
        case((Family::Butterworth, 4, 0.1), 2, 1, &[0.6], (0.0482543, 0.0255936)),
        case((Family::Butterworth, 4, 0.1), 2, 2, &[0.6], (0.02770561, 0.0255936)),
        case((Family::Butterworth, 4, 0.1), 4, 2, &[2.3], (0.5768853, 0.3790364)),
        case((Family::Butterworth, 4, 0.25), 2, 0, &[0.6], (0.8151188, 0.7072165)),
        case((Family::Butterworth, 4, 0.25), 4, 0, &[2.3], (0.9986254, 0.9980779)),
        case((Family::Butterworth, 4, 0.25), 4, 2, &[0.0, 1.3, 2.1, 2.95], (0.4801483, 0.0483771)),
        case((Family::Butterworth, 8, 0.1), 2, 1, &[0.6], (0.007744863, 0.0006553599)),
        case((Family::Butterworth, 8, 0.1), 4, 4, &[2.3], (0.2049205, 0.1654597)),
        case((Family::Butterworth, 8, 0.1), 4, 2, &[2.3], (0.4741524, 0.1654597)),
        case((Family::Chebyshev1, 8, 0.1), 2, 0, &[0.6], (0.006750596, 2.061575e-05)),
        case((Family::Chebyshev1, 8, 0.1), 2, 1, &[0.6], (0.001119147, 2.061575e-05)),
        case((Family::Chebyshev1, 8, 0.1), 4, 4, &[2.3], (0.1002612, 0.0223595)),
        case((Family::Elliptic, 5, 0.1), 2, 1, &[0.6], (0.007013631, 0.002903868)),
        case((Family::Elliptic, 5, 0.1), 2, 2, &[0.6], (0.003489372, 0.002903868)),
        case((Family::Elliptic, 5, 0.1), 4, 8, &[2.3], (0.1101964, 0.1044714)),
        case((Family::Bessel, 6, 0.05), 2, 0, &[0.6], (0.003010487, 6.273528e-05)),
        case((Family::Bessel, 6, 0.05), 4, 8, &[2.3], (0.004267246, 0.003743923)),
        case((Family::Bessel, 6, 0.05), 4, 4, &[2.3], (0.01160882, 0.003743923)),
    ]
}

/// The whole table, where it is given.
fn table() -> Vec<Case> {
    if !trials::is_slow("the whole table of causal optima") {
        return Vec::new();
    }
    let Some(path) = trials::data("causal-optima.json") else { return Vec::new() };
    let text = std::fs::read_to_string(path).unwrap();
    let document: serde_json::Value = serde_json::from_str(&text).unwrap();
    let family = |name: &str| match name {
        "butterworth" => Family::Butterworth,
        "bessel" => Family::Bessel,
        "chebyshev1" => Family::Chebyshev1,
        "elliptic" => Family::Elliptic,
        _ => panic!("{name}"),
    };
    let read = |case_: &serde_json::Value| {
        let number = |key: &str| case_[key].as_f64().unwrap();
        let filter = &case_["filter"];
        let delays: Vec<f64> =
            case_["delay_samples"].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect();
        case(
            (
                family(filter["family"].as_str().unwrap()),
                filter["order"].as_u64().unwrap() as usize,
                filter["cutoff"].as_f64().unwrap(),
            ),
            number("ratio") as usize,
            number("latency") as usize,
            &delays,
            (number("optimum"), number("noncausal")),
        )
    };
    document["cases"].as_array().unwrap().iter().map(read).collect()
}

/// A bank of zeros on the case's front ends: the recursion does not ask for the filters.
fn zero_output(spec: &Spec) -> Bank {
    let filters = SynthesisFilters::Fir(vec![vec![0.0]; spec.channels.len()]);
    Bank {
        spec: Some(spec.clone()),
        latency: spec.latency.unwrap(),
        delays: spec.channels.iter().map(|channel| channel.delay).collect(),
        ..Bank::bare(filters, spec.ratio)
    }
}

/// What the table leaves open is not refuted, and what lies `width` below the optimum is, unless the
/// noncausal bound says so.
#[test]
fn the_recursion_refutes_what_no_causal_bank_reaches_and_nothing_else() {
    let widths = [1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0];
    let mut reached = [0usize; 7];
    let cases: Vec<Case> = golden().into_iter().chain(table()).collect();
    for Case { name, spec, optimum, noncausal } in &cases {
        let bank = zero_output(spec);
        let error = EnclosedErrorSystem::new(&bank).unwrap();
        let begin = std::time::Instant::now();
        for precision in [Precision::Short, Precision::Long] {
            let above = error.causal_recursion(optimum * (1.0 + TABLE), PERIODS, precision);
            let refuted = matches!(above, Recursion::Refuted { .. });
            assert!(!refuted, "{name}: {above:?} above the optimum {optimum}, {precision:?}");
        }
        let below = |width: f64| {
            let gamma = optimum * (1.0 - TABLE) * (1.0 - width);
            match error.causal_recursion(gamma, PERIODS, Precision::Short) {
                Recursion::Refuted { periods } => Recursion::Refuted { periods },
                _ => error.causal_recursion(gamma, PERIODS, Precision::Long),
            }
        };
        let proven = |width: f64| {
            optimum * (1.0 - width) <= *noncausal || matches!(below(width), Recursion::Refuted { .. })
        };
        let best = widths.iter().position(|&width| proven(width)).unwrap();
        reached[best] += 1;
        println!(
            "{name}: {:e}, below {:?}, {:.0} ms",
            widths[best],
            below(widths[best]),
            begin.elapsed().as_secs_f64() * 1e3
        );
    }
    println!("widths {widths:?}: {reached:?} of {}", cases.len());
    let narrow: usize = reached[..2].iter().sum();
    assert_eq!(narrow, cases.len(), "cases within 1e-5");
}

/// `iir` attains the optimum.
#[test]
fn every_causal_optimum_is_reached() {
    let mut misses = Vec::new();
    let cases: Vec<Case> = golden().into_iter().chain(table()).collect();
    for Case { name, mut spec, optimum, .. } in cases {
        spec.design.method = hybank::spec::Method::Iir;
        let begin = std::time::Instant::now();
        let excess = match design(&spec, &Options::without_proof()) {
            Ok(design) => design.bank.gamma.norm.unwrap() / optimum - 1.0,
            Err(error) => {
                println!("{error}");
                f64::INFINITY
            }
        };
        println!("{name}: {excess:.2e}, {:.0} ms", begin.elapsed().as_secs_f64() * 1e3);
        if excess > 1e-5 {
            misses.push((name, excess));
        }
    }
    assert!(misses.is_empty(), "{} cases: {misses:?}", misses.len());
}

/// The proven interval of `iir` where there is hardly any latency.
#[test]
fn hardly_any_latency_is_proven_from_both_sides() {
    // Two that double precision proves, and two after steep filters that take 512 bits.
    let usual = golden().into_iter().step_by(6);
    let cases: Vec<Case> = usual.chain(table()).filter(|case| case.spec.latency.unwrap() <= 2).collect();
    let mut widths = Vec::new();
    for Case { name, mut spec, optimum, .. } in cases {
        spec.design.method = hybank::spec::Method::Iir;
        let design = design(&spec, &Options::default()).unwrap_or_else(|error| panic!("{name}: {error}"));
        let width = match &design.proof {
            Ok(proven) => {
                assert_eq!(verify(&design.bank).unwrap(), *proven, "{name}");
                assert!(proven.lower <= optimum * (1.0 + TABLE), "{name}: {proven:?}");
                (proven.upper - proven.lower) / proven.upper
            }
            Err(_) => f64::INFINITY,
        };
        if width > 1e-5 {
            println!("{name}: {width:.1e}");
        }
        widths.push(width);
    }
    let within = |limit: f64| widths.iter().filter(|width| **width <= limit).count();
    let counts = [1e-6, 1e-5, 1e-4, 1e-3].map(within);
    println!("widths up to 1e-6, 1e-5, 1e-4, 1e-3: {counts:?} of {}", widths.len());
    assert_eq!(within(1e-4), widths.len(), "{counts:?}");
}

/// Covariances of so many samples have eigenvalues below 106 bits, so that no dual witness binds the taps:
/// the causal bound, which long filters all but reach, holds for them too.
#[test]
fn long_fir_banks_are_proven_by_the_causal_bound() {
    for taps in [48, 64] {
        let Case { spec, optimum, noncausal, .. } =
            case((Family::Butterworth, 4, 0.1), 2, 1, &[1.2, 0.6], (0.01289579, 0.002532753));
        let design = design(&with_taps(spec, taps), &Options::default()).unwrap();
        let proven = design.proof.unwrap();
        println!("{taps} taps: {proven:?}");
        assert!(proven.lower <= proven.upper && proven.lower > optimum * (1.0 - 1e-4), "{taps}: {proven:?}");
        assert!((proven.noncausal / noncausal - 1.0).abs() < 1e-6, "{taps}: {proven:?}");
        assert_eq!(verify(&design.bank).unwrap(), proven);
    }
}
