//! Cutoffs so far below the fast rate that gamma vanishes in the rounding errors of doubles.

use crate::support::specs::{alike, butterworth};
use hybank::design::{LiftedPlant, Problem, ProofSearch, judge_taps};
use hybank::spec::Spec;
use std::f64::consts::TAU;

/// gamma below which a computed norm has few digits.
const TINY: f64 = 1e-9;

/// The noncausal bound of two channels after Butterworth filters, M = 2, for a cutoff in multiples of the
/// fast rate.
fn noncausal(order: usize, cutoff: f64) -> f64 {
    let spec = alike(&butterworth(order, TAU * cutoff), 2, 10, &[1.2, 0.6]);
    LiftedPlant::new(&Problem::new(&spec, 10).unwrap()).noncausal_bound().unwrap().gain
}

/// The cutoffs of the design guide.
#[test]
fn gamma_is_tiny_below_the_cutoffs_of_the_design_guide() {
    for (order, stated) in [(2, 1.2e-5), (4, 2.5e-3), (6, 0.015), (8, 0.035)] {
        let (mut low, mut high) = (1e-7f64, 0.4f64);
        for _ in 0..50 {
            let middle = (low * high).sqrt();
            if noncausal(order, middle) < TINY { low = middle } else { high = middle }
        }
        assert!((low / stated - 1.0).abs() < 0.05, "order {order}: {low} of the fast rate, not {stated}");
    }
}

/// Three channels at latency 1 of which the first two sample 2e-8 and 7e-9 fast periods before the target.
const NEARLY_THE_TARGET: &str = "
fast_rate = 44100
ratio = 1
latency = 1
target = { filter = { family = \"butterworth\", order = 4, cutoff = 5962.9869503033715 } }
[[channel]]
delay_samples = 0.9999999793459191
[[channel]]
delay_samples = 0.9999999933855491
filter = { family = \"butterworth\", order = 2, cutoff = 4149.794117256607 }
[[channel]]
delay_samples = 9.62969849238924e-05
[design]
method = \"fir\"
taps = 12
";

const TAPS: [[f64; 12]; 3] = [
    [
        0.9997855767934506,
        -1.7403801644451132e-11,
        -1.0628990196789415e-11,
        -2.676671118741704e-12,
        -2.0023070363257918e-11,
        -5.624759491514598e-11,
        -8.98657990983799e-11,
        -7.793875050301011e-11,
        2.352889556130151e-12,
        3.3135881911513755e-10,
        1.7084895535161755e-10,
        3.54519070603327e-15,
    ],
    [
        -1.4776308454077601e-12,
        9.530613372643607e-15,
        4.955333374185744e-15,
        1.973599114074123e-15,
        -5.1608956616605095e-16,
        -2.721493966442597e-15,
        -5.501892842209123e-15,
        -9.43904878116841e-15,
        -1.3355792959154248e-14,
        -1.9166193058006942e-14,
        1.9913407349121197e-15,
        2.8985614021715125e-15,
    ],
    [
        1.0182227062248751e-16,
        0.00021442320764072378,
        1.762821937085797e-11,
        1.0756239655010468e-11,
        2.7385643688287876e-12,
        2.0044478902761297e-11,
        5.6249945017449996e-11,
        8.986140606251403e-11,
        7.793137078383968e-11,
        -2.3610364699180578e-12,
        -3.314035255311064e-10,
        -1.7080965911567572e-10,
    ],
];

/// Gamma as small as the rounding of the instants: the proof holds for the delays of the file, in seconds.
/// The number is that of mpmath with 500 bits, from sums of residues over all aliases. For delays of exactly
/// these numbers of fast periods it would be 7.630003677e-16.
#[test]
fn a_gamma_at_the_rounding_of_the_delays_is_that_of_the_delays_in_seconds() {
    let spec = Spec::from_toml(NEARLY_THE_TARGET, "spec.toml").unwrap();
    let judged = judge_taps(&spec, TAPS.map(|taps| taps.to_vec()).to_vec(), ProofSearch::Run).unwrap();
    let proven = judged.proof.unwrap();
    assert!((proven.attained / 7.629584922e-16 - 1.0).abs() < 1e-9, "{proven:?}");
    assert!(proven.attained <= proven.upper && proven.upper < 7.63e-16, "{proven:?}");
}
