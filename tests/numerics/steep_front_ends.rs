//! Steep front ends with hardly any latency, where a sample lies shortly after the beginning of the slow
//! period and has almost no feedthrough. `HYBANK_TRIALS=200` tries so many random plants.

use crate::support::random::Random;
use crate::support::specs::{alike, low_pass, with_taps};
use hybank::design::{Design, DesignOptions, analyze, design};
use hybank::spec::{Family, FilterSpec, Method, Spec};
use std::f64::consts::TAU;

/// A low-pass with its cutoff in cycles per fast sample.
fn filter(family: Family, order: usize, cutoff: f64) -> FilterSpec {
    low_pass(family, order, TAU * cutoff)
}

fn norm(design: &Design) -> f64 {
    design.bank.gamma.norm.unwrap()
}

#[test]
fn a_sample_just_inside_the_period_costs_nothing() {
    let front_end = filter(Family::Butterworth, 8, 0.1);
    let spec = alike(&front_end, 2, 0, &[0.2, 0.9, 1.6]);
    let iir = design(&spec, &DesignOptions::without_proof()).unwrap();
    let fir = design(&with_taps(spec.clone(), 32), &DesignOptions::without_proof()).unwrap();
    assert!(norm(&iir) <= norm(&fir) * (1.0 + 1e-5), "{} {}", norm(&iir), norm(&fir));
    let mut mean_square = spec;
    mean_square.design.method = Method::H2;
    let h2 = design(&mean_square, &DesignOptions::default()).unwrap();
    let rms = analyze(&h2.bank, &[]).unwrap().mean.rms_error;
    assert!((rms / 0.000500 - 1.0).abs() < 2e-3, "{rms}");
}

fn plant(seed: u64) -> Spec {
    let mut dice = Random(seed);
    let family = dice.of(&[Family::Butterworth, Family::Bessel, Family::Chebyshev1, Family::Elliptic]);
    let order = if family == Family::Elliptic { dice.of(&[3, 5, 7]) } else { dice.count(2, 8) };
    let front_end = filter(family, order, 0.05 + 0.2 * dice.part());
    let (count, ratio) = (dice.count(1, 4), dice.count(2, 4));
    let delays: Vec<f64> = (0..count).map(|_| ratio as f64 * dice.part()).collect();
    alike(&front_end, ratio, dice.count(0, 4), &delays)
}

#[test]
fn no_taps_do_better_than_iir() {
    let excess = |seed| {
        let design = |spec: Spec| {
            design(&spec, &DesignOptions::without_proof()).unwrap_or_else(|error| panic!("{seed}: {error}"))
        };
        let spec = plant(seed);
        norm(&design(spec.clone())) / norm(&design(with_taps(spec, 32))) - 1.0
    };
    let beyond: Vec<_> =
        trials::trials(10).map(|seed| (seed, excess(seed))).filter(|(_, excess)| *excess > 1e-5).collect();
    assert!(beyond.is_empty(), "{beyond:?}");
}
