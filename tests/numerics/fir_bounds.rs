//! The proven interval of FIR banks: how wide it is, what class of banks its lower end bounds, and the time
//! of search and proof. `HYBANK_TRIALS=81` goes through all, `HYBANK_TRIALS=17..18` through that one.

use crate::support::specs::{alike, butterworth, low_pass, with_taps};
use hybank::design::{Options, design};
use hybank::spec::{Family, Spec};
use hybank::verify::{BoundedBanks, verify};
use std::f64::consts::TAU;
use std::time::Instant;

const DELAYS: [&[f64]; 3] = [&[1.2, 0.6], &[2.1, 1.3, 0.4], &[3.1, 1.9, 1.05, 0.0]];
const TAPS: [usize; 3] = [24, 48, 96];
const LATENCIES: [usize; 3] = [1, 8, 30];

/// Three front ends, two to four channels, three lengths and three latencies.
fn bank(number: usize) -> (String, Spec) {
    let [front_end, channels, taps, latency] = [number % 3, number / 3 % 3, number / 9 % 3, number / 27 % 3];
    let filter = match front_end {
        0 => butterworth(4, 0.1 * TAU),
        1 => butterworth(2, 0.1 * TAU),
        _ => low_pass(Family::Bessel, 6, 0.05 * TAU),
    };
    let name = ["Butterworth 4", "Butterworth 2", "Bessel 6"][front_end];
    let (delays, taps, latency) = (DELAYS[channels], TAPS[taps], LATENCIES[latency]);
    let spec = with_taps(alike(&filter, delays.len(), latency, delays), taps);
    (format!("{name}, {} channels, {taps} taps, latency {latency}", delays.len()), spec)
}

#[test]
fn the_taps_of_long_fir_banks_are_bound() {
    let (mut counts, mut classes) = ([0; 5], [0; 3]);
    for number in trials::asked_trials().unwrap_or(9..10) {
        let (name, spec) = bank(number as usize);
        let begin = Instant::now();
        let design = design(&spec, &Options::default()).unwrap_or_else(|error| panic!("{name}: {error}"));
        let designed = begin.elapsed().as_secs_f64();
        let gamma = design.bank.gamma;
        let proven = design.proof.unwrap_or_else(|error| panic!("{name}: {error}"));
        let begin = Instant::now();
        assert_eq!(verify(&design.bank).unwrap(), proven, "{name}");
        let verified = begin.elapsed().as_secs_f64();
        let width = (proven.upper - proven.lower) / proven.upper;
        let above = gamma.norm.unwrap() / proven.lower - 1.0;
        println!(
            "{number} {name}: {:?}, width {width:.1e}, norm above lower {above:.1e}, {} witnesses, \
             {designed:.1} s, verify {verified:.1} s, {proven:?}",
            proven.lower_banks,
            match &design.bank.proof.as_ref().unwrap().lower {
                Some(hybank::bank::LowerProof::Fir(witnesses)) => witnesses.len(),
                _ => 0,
            },
        );
        let limits = [1e-6, 1e-5, 1e-4, 1e-3, f64::INFINITY];
        counts[limits.iter().position(|limit| width <= *limit).unwrap()] += 1;
        let class = [BoundedBanks::FirOfThisLength, BoundedBanks::Causal, BoundedBanks::Any]
            .iter()
            .position(|banks| *banks == proven.lower_banks);
        classes[class.unwrap()] += 1;
        assert!((-1e-9..1e-4).contains(&above), "{name}: {proven:?}");
    }
    println!(
        "widths up to 1e-6, 1e-5, 1e-4, 1e-3, more: {counts:?}; FIR of this length, causal, any bank: {classes:?}"
    );
}
