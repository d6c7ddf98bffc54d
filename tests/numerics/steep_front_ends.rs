//! Steep front ends with hardly any latency, where a sample lies shortly after the beginning of the slow
//! period and has almost no feedthrough. `HYBANK_TRIALS=200` tries so many random plants.

use crate::support::random::Random;
use crate::support::specs::{alike, low_pass_at, with_taps};
use crate::support::{designed, proven};
use hybank::design::analyze;
use hybank::spec::{Family, Method, Spec};

fn norm(spec: Spec) -> f64 {
    designed(&spec).gamma.norm.unwrap()
}

#[test]
fn a_sample_just_inside_the_period_costs_nothing() {
    let front_end = low_pass_at(Family::Butterworth, 8, 0.1);
    let spec = alike(&front_end, 2, 0, &[0.2, 0.9, 1.6]);
    let [iir, fir] = [spec.clone(), with_taps(spec.clone(), 32)].map(norm);
    assert!(iir <= fir * (1.0 + 1e-5), "{iir} {fir}");
    let mut mean_square = spec;
    mean_square.design.method = Method::H2;
    let h2 = proven(&mean_square);
    let rms = analyze(&h2.bank, &[]).unwrap().mean.rms_error;
    assert!((rms / 0.000500 - 1.0).abs() < 2e-3, "{rms}");
}

fn plant(seed: u64) -> Spec {
    let mut dice = Random(seed);
    let family = dice.of(&[Family::Butterworth, Family::Bessel, Family::Chebyshev1, Family::Elliptic]);
    let order = if family == Family::Elliptic { dice.of(&[3, 5, 7]) } else { dice.count(2, 8) };
    let front_end = low_pass_at(family, order, 0.05 + 0.2 * dice.part());
    let (count, ratio) = (dice.count(1, 4), dice.count(2, 4));
    let delays: Vec<f64> = (0..count).map(|_| ratio as f64 * dice.part()).collect();
    alike(&front_end, ratio, dice.count(0, 4), &delays)
}

#[test]
fn no_taps_do_better_than_iir() {
    let excess = |seed| norm(plant(seed)) / norm(with_taps(plant(seed), 32)) - 1.0;
    let beyond: Vec<_> =
        trials::trials(10).map(|seed| (seed, excess(seed))).filter(|(_, excess)| *excess > 1e-5).collect();
    assert!(beyond.is_empty(), "{beyond:?}");
}
