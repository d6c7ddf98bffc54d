//! The unit of a signal does not matter: K = W - F H is linear in the target's gain, and a channel's gain is
//! undone by its filter. Designed, proven and read back over 18 decades.

use crate::support::proven;
use crate::support::specs::{alike, amplified, amplify, butterworth, tf, thesis, with_taps};
use hybank::bank::{Bank, SynthesisFilters};
use hybank::design::{DesignOptions, analyze, design};
use hybank::spec::{DesignSpec, FilterSpec, Method, Spec};
use hybank::verify::verify;

/// gamma of the thesis example, and of its optimal bank of 22 taps.
const GAMMA: f64 = 0.03993204;
const GAINS: [f64; 8] = [1e-9, 1e-6, 1e-3, 0.7, 1e3, 1e6, 1e8, 1e9];

fn example(method: Method) -> Spec {
    match method {
        Method::Fir => with_taps(thesis(10, &[1.2, 0.6]), 22),
        _ => Spec { design: DesignSpec::new(method, None), ..thesis(10, &[1.2, 0.6]) },
    }
}

/// Designs and proves; gamma is `wanted` up to what the design leaves open, computed, proven and read back.
fn check(what: &str, spec: &Spec, wanted: f64) -> Bank {
    let found = design(spec, &DesignOptions::default()).unwrap_or_else(|error| panic!("{what}: {error}"));
    let gamma = &found.bank.gamma;
    let norm = gamma.norm.unwrap();
    assert!((norm / wanted - 1.0).abs() < 1e-6, "{what}: {gamma:?}, wanted {wanted:e}");
    let (lower, noncausal) = (gamma.lower.unwrap(), gamma.noncausal.unwrap());
    assert!(lower > wanted * (1.0 - 2e-6) && noncausal > wanted * (1.0 - 2e-6), "{what}: {gamma:?}");
    let again = analyze(&found.bank, &[]).unwrap().gamma;
    assert!((again / norm - 1.0).abs() < 1e-8, "{what}: {again:e}, {norm:e}");
    let bank = found.bank;
    found.proof.unwrap_or_else(|error| panic!("{what}: {error}"));
    let read = Bank::from_json(&bank.to_json().unwrap(), "bank.json").unwrap();
    let proven = verify(&read).unwrap_or_else(|error| panic!("{what}: {error}"));
    assert!(proven.upper <= wanted * (1.0 + 2e-6) && proven.upper >= norm, "{what}: {proven:?}");
    assert!(proven.attained > wanted * (1.0 - 3e-6), "{what}: {proven:?}");
    bank
}

/// A gain of all front ends or of the target is one of gamma; one of a channel is undone by its filter, and
/// so is that of a converter, which is a gain of the filter in front of it.
#[test]
fn gains_are_those_of_gamma_or_undone_by_the_filters() {
    for method in [Method::Fir, Method::Iir, Method::H2] {
        for gain in GAINS {
            check(&format!("{method:?}, all {gain:e}"), &amplified(example(method), gain), GAMMA * gain);
            let mut spec = example(method);
            amplify(&mut spec.target, gain);
            check(&format!("{method:?}, target {gain:e}"), &spec, GAMMA * gain);
            let mut spec = example(method);
            amplify(&mut spec.channels[0].filter, gain);
            check(&format!("{method:?}, channel 1 {gain:e}"), &spec, GAMMA);
        }
        for gain in [1e-6, 0.97, -1.0, 1.03, 1e6] {
            let mut spec = example(method);
            spec.channels[0].gain = gain;
            check(&format!("{method:?}, converter 1 {gain:e}"), &spec, GAMMA);
        }
    }
}

#[test]
fn the_methods_for_comparison_know_the_gains_of_converters() {
    for method in [Method::Sinc, Method::Separation] {
        let mut spec = Spec { design: DesignSpec::new(method, Some(22)), ..example(Method::Fir) };
        let plain = proven(&spec).bank;
        (spec.channels[0].gain, spec.channels[1].gain) = (0.5, -2.0);
        let bank = proven(&spec).bank;
        let [plain_gamma, gamma] = [&plain, &bank].map(|bank| bank.gamma.norm.unwrap());
        assert!((gamma / plain_gamma - 1.0).abs() < 1e-6, "{method:?}: {gamma} {plain_gamma}");
        assert_eq!(bank.gains, [0.5, -2.0]);
    }
}

/// The gain is a part of what is proven: a file with another one has another norm.
#[test]
fn a_proof_holds_for_its_gains_only() {
    let mut spec = example(Method::Fir);
    spec.channels[1].gain = 1.02;
    let bank = check("converter 2", &spec, GAMMA);
    let mut other = bank.clone();
    other.gains[1] = 1.021;
    other.spec.as_mut().unwrap().channels[1].gain = 1.021;
    other.check().unwrap();
    assert!(verify(&bank).is_ok() && verify(&other).is_err());
    // The offset does not enter the norm.
    let mut shifted = bank;
    shifted.offsets[0] = 0.125;
    shifted.spec.as_mut().unwrap().channels[0].offset = 0.125;
    assert!(verify(&shifted).is_ok());
}

#[test]
fn taps_follow_the_gains() {
    let taps = |bank: Bank| match bank.filters {
        SynthesisFilters::Fir(taps) => taps,
        SynthesisFilters::StateSpace(_) => panic!("states"),
    };
    let plain = taps(check("plain", &example(Method::Fir), GAMMA));
    // Powers of two change no digit of the problem.
    for exponent in [-30, 30] {
        let gain = f64::from(exponent).exp2();
        let all = taps(check("all", &amplified(example(Method::Fir), gain), GAMMA * gain));
        let size = plain.iter().flatten().fold(0.0f64, |most, tap| most.max(tap.abs()));
        for (a, b) in all.iter().flatten().zip(plain.iter().flatten()) {
            assert!((a - b).abs() < 1e-6 * size, "2^{exponent}: {a} {b}");
        }
    }
}

#[test]
fn steep_front_ends_of_much_gain_are_designed() {
    for gain in [1e-9, 1e9] {
        // An amplifier without feedback to speak of, before a Butterworth filter.
        let amplifier = tf(&[gain], &[0.1, 1.0]);
        let filter = FilterSpec::Cascade { cascade: vec![butterworth(4, 1.2), amplifier.clone()] };
        let unity = FilterSpec::Cascade { cascade: vec![butterworth(4, 1.2), tf(&[1.0], &[0.1, 1.0])] };
        let gamma = |filter| {
            let spec = alike(filter, 4, 12, &[0.0, 1.3, 2.1, 2.95]);
            proven(&spec).bank.gamma.norm.unwrap()
        };
        let (amplified, plain) = (gamma(&filter), gamma(&unity));
        assert!((amplified / (gain * plain) - 1.0).abs() < 1e-6, "{amplified:e} {plain}");
    }
}

/// Channels whose gains lie 12 decades apart: neither gamma nor its bounds depend on the gains, and each
/// filter undoes its own.
#[test]
fn gains_twelve_decades_apart_change_no_gamma() {
    let channels = [0.2, 1.1, 2.4];
    for method in [Method::Fir, Method::Iir, Method::H2, Method::Sinc, Method::Separation] {
        let ratio = if method == Method::Sinc { 3 } else { 2 };
        let base = alike(&butterworth(3, 0.2), ratio, 4, &channels);
        let spec = if method.has_taps() { with_taps(base, 12) } else { base };
        let spec = Spec { design: DesignSpec::new(method, spec.design.taps), ..spec };
        let mut unequal = spec.clone();
        let gains = [1e-6, 1.0, 1e6];
        unequal.channels.iter_mut().zip(gains).for_each(|(channel, gain)| channel.gain = gain);
        let [plain, unequal] = [spec, unequal].map(|spec| proven(&spec));
        let [before, after] = [&plain, &unequal].map(|found| found.bank.gamma.norm.unwrap());
        assert!((after / before - 1.0).abs() < 1e-9, "{method:?}: {before} {after}");
        let noncausal = |found: &hybank::design::Design| found.bank.gamma.noncausal.unwrap();
        assert!(
            (noncausal(&unequal) / noncausal(&plain) - 1.0).abs() < 1e-6,
            "{method:?}: {:?}",
            unequal.bank.gamma
        );
        let again = analyze(&unequal.bank, &[]).unwrap();
        assert!((again.gamma / before - 1.0).abs() < 1e-8, "{method:?}: {again:?}");
        assert!((again.noncausal.unwrap() / noncausal(&plain) - 1.0).abs() < 1e-6, "{method:?}: {again:?}");
        let proven = unequal.proof.unwrap_or_else(|error| panic!("{method:?}: {error}"));
        assert!(proven.upper < before * (1.0 + 1e-5), "{method:?}: {proven:?}");
        let (SynthesisFilters::Fir(plain), SynthesisFilters::Fir(taps)) =
            (&plain.bank.filters, &unequal.bank.filters)
        else {
            continue;
        };
        for ((plain, taps), gain) in plain.iter().zip(taps).zip(gains) {
            let size = plain.iter().fold(0.0f64, |most, tap| most.max(tap.abs()));
            let is_undone = |(a, b): (&f64, &f64)| (a - b * gain).abs() < 1e-6 * size;
            assert!(plain.iter().zip(taps).all(is_undone), "{gain}: {taps:?}");
        }
    }
}
