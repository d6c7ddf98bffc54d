//! Steep front ends with hardly any latency, where a sample lies shortly after the beginning of the slow
//! period and has almost no feedthrough. `HYBANK_TRIALS=200` tries so many random plants.

use crate::support::random::Random;
use crate::support::specs::{alike, low_pass, with_taps};
use hybank::design::{Design, Options, analyze, design};
use hybank::spec::{Family, FilterSpec, Method, Spec};
use hybank::verify::{EnclosedErrorSystem, Precision, Recursion};
use std::f64::consts::TAU;

/// A low-pass with its cutoff in cycles per fast sample.
fn filter(family: Family, order: usize, cutoff: f64) -> FilterSpec {
    low_pass(family, order, TAU * cutoff)
}

fn norm(design: &Design) -> f64 {
    design.bank.gamma.norm.unwrap()
}

/// Relative distance of the norm from the largest gamma that the recursion of `verify` refutes, in 106 or
/// 512 bits: at most this much is lost.
fn loss(design: &Design) -> f64 {
    let error = EnclosedErrorSystem::new(&design.bank).unwrap();
    let refuted = |gamma: f64| {
        [Precision::Short, Precision::Long].into_iter().any(|precision| {
            matches!(error.causal_recursion(gamma, 512, precision), Recursion::Refuted { .. })
        })
    };
    let noncausal = design.bank.gamma.noncausal.unwrap();
    let losses = [1e-6, 3e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1];
    let bounded = |loss: &f64| {
        let gamma = norm(design) * (1.0 - loss);
        gamma <= noncausal || refuted(gamma)
    };
    losses.into_iter().find(bounded).unwrap_or(1.0)
}

#[test]
fn a_sample_just_inside_the_period_costs_nothing() {
    let front_end = filter(Family::Butterworth, 8, 0.1);
    let spec = alike(&front_end, 2, 0, &[0.2, 0.9, 1.6]);
    let iir = design(&spec, &Options::without_proof()).unwrap();
    let fir = design(&with_taps(spec.clone(), 32), &Options::without_proof()).unwrap();
    assert!(norm(&iir) <= norm(&fir) * (1.0 + 1e-5), "{} {}", norm(&iir), norm(&fir));
    let mut mean_square = spec;
    mean_square.design.method = Method::H2;
    let h2 = design(&mean_square, &Options::default()).unwrap();
    let rms = analyze(&h2.bank, &[]).unwrap().mean.rms_error;
    assert!((rms / 0.000500 - 1.0).abs() < 2e-3, "{rms}");
}

#[test]
fn one_steep_channel_is_optimal_at_every_delay() {
    let front_end = filter(Family::Chebyshev1, 8, 0.1);
    for delay in [2.2, 2.3, 2.5, 2.7, 3.0, 3.5] {
        let bank = design(&alike(&front_end, 4, 2, &[delay]), &Options::without_proof()).unwrap();
        assert!(loss(&bank) <= 1e-5, "delay {delay}: {:e}", loss(&bank));
    }
}

#[test]
fn four_steep_channels_are_optimal() {
    for (family, order) in [(Family::Butterworth, 8), (Family::Bessel, 6), (Family::Chebyshev1, 8)] {
        let spec = alike(&filter(family, order, 0.1), 4, 2, &[0.0, 1.3, 2.1, 2.95]);
        let bank = design(&spec, &Options::without_proof()).unwrap();
        assert!(loss(&bank) <= 1e-5, "{family:?} {order}: {:e}", loss(&bank));
    }
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
fn no_causal_bank_does_better_than_iir() {
    let seeds = trials::trials(10);
    let (mut worst, mut beyond) = (0.0_f64, Vec::new());
    for seed in seeds.clone() {
        let begin = std::time::Instant::now();
        let bank =
            design(&plant(seed), &Options::without_proof()).unwrap_or_else(|error| panic!("{seed}: {error}"));
        let (time, loss) = (begin.elapsed(), loss(&bank));
        println!("plant {seed}: norm {:e}, loss at most {loss:e}, {time:?}", norm(&bank));
        worst = worst.max(loss);
        if loss > 1e-5 {
            beyond.push((seed, loss));
        }
    }
    println!("plants {seeds:?}, worst {worst:e}, beyond 1e-5: {beyond:?}");
    assert!(beyond.is_empty(), "{beyond:?}");
}
