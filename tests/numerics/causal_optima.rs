//! The least gamma of any causal bank against true optima.
//!
//! The numbers are those of an independent computation: a doubling Riccati equation in 900-bit arithmetic
//! and modal coordinates, true to 2e-6. Some of its 174 cases stand here; the whole table is read from the
//! file `causal-optima.json` of the data where `HYBANK_SLOW` is set.

use crate::support::{self, specs::alike};
use hybank::design::{DesignOptions, design};
use hybank::spec::{Family, FilterSpec, Passband, Spec};
use hybank::units::Hertz;
use hybank::verify::verify;

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
        case((Family::Butterworth, 8, 0.1), 4, 2, &[0.0, 1.3, 2.1, 2.95], (0.001872594, 1.881832e-06)),
        case((Family::Chebyshev1, 8, 0.1), 4, 2, &[0.0, 1.3, 2.1, 2.95], (0.0001377693, 4.564077e-08)),
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

/// `iir` attains the optimum.
#[test]
fn every_causal_optimum_is_reached() {
    let mut misses = Vec::new();
    let cases: Vec<Case> = golden().into_iter().chain(table()).collect();
    for Case { name, mut spec, optimum, .. } in cases {
        spec.design.method = hybank::spec::Method::Iir;
        let begin = std::time::Instant::now();
        let excess = match support::design(&spec) {
            Ok(bank) => bank.gamma.norm.unwrap() / optimum - 1.0,
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

/// The proven upper end of `iir` where there is hardly any latency.
#[test]
fn hardly_any_latency_is_proven() {
    // Two that double precision proves, and two after steep filters that take 512 bits.
    let usual = golden().into_iter().step_by(6);
    let cases: Vec<Case> = usual.chain(table()).filter(|case| case.spec.latency.unwrap() <= 2).collect();
    for Case { name, mut spec, optimum, noncausal } in cases {
        spec.design.method = hybank::spec::Method::Iir;
        let design =
            design(&spec, &DesignOptions::default()).unwrap_or_else(|error| panic!("{name}: {error}"));
        let proven = design.proof.unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(verify(&design.bank).unwrap(), proven, "{name}");
        assert!((proven.upper / optimum - 1.0).abs() < 1e-4, "{name}: {proven:?}");
        let gamma = design.bank.gamma;
        let bounds = [(gamma.lower, optimum), (gamma.noncausal, noncausal)];
        for (computed, known) in bounds {
            assert!((computed.unwrap() / known - 1.0).abs() < 1e-4, "{name}: {gamma:?}");
        }
    }
}
