//! Channels that repeat what others measure: the same filter, up to a gain, sampled whole slow periods
//! later. `HYBANK_TRIALS=200` tries so many random plants.

use crate::support::proven;
use crate::support::random::Random;
use crate::support::specs::{alike, amplify, low_pass_at, thesis};
use hybank::design::{Design, analyze};
use hybank::spec::{Family, Method, Spec};
use hybank::verify::verify;

fn by(method: Method, mut spec: Spec) -> Spec {
    spec.design.method = method;
    spec
}

fn norm(design: &Design) -> f64 {
    design.bank.gamma.norm.unwrap()
}

/// Two channels that carry the whole information, and two that repeat it a period later.
#[test]
fn a_channel_a_period_later_adds_nothing_and_harms_nothing() {
    let front_end = low_pass_at(Family::Butterworth, 4, 0.2);
    for method in [Method::Iir, Method::H2] {
        let four = proven(&by(method, alike(&front_end, 2, 8, &[0.2, 1.1, 2.2, 3.1])));
        let two = proven(&by(method, alike(&front_end, 2, 8, &[0.2, 1.1])));
        assert!((norm(&four) / norm(&two) - 1.0).abs() < 1e-6, "{} {}", norm(&four), norm(&two));
        let noise_gain = analyze(&four.bank, &[]).unwrap().mean.noise_gain;
        assert!(noise_gain < 10.0, "{noise_gain}");
        let proof = four.proof.as_ref().unwrap();
        assert_eq!(&verify(&four.bank).unwrap(), proof);
        // The optimum, of 64 taps too.
        assert!((four.bank.gamma.noncausal.unwrap() / 0.01743 - 1.0).abs() < 1e-3, "{:?}", four.bank.gamma);
        if method == Method::Iir {
            assert!(proof.upper / 0.01743 < 1.0 + 1e-3, "{proof:?}");
        }
    }
}

#[test]
fn one_converter_twice_is_one_converter() {
    let front_end = low_pass_at(Family::Butterworth, 4, 0.2);
    let two = proven(&alike(&front_end, 2, 1, &[0.2, 2.2]));
    let one = proven(&alike(&front_end, 2, 1, &[0.2]));
    assert!((norm(&two) / norm(&one) - 1.0).abs() < 1e-6, "{} {}", norm(&two), norm(&one));
}

#[test]
fn four_interleaved_converters_at_half_the_ratio_are_designed() {
    let front_end = low_pass_at(Family::Butterworth, 4, 0.2);
    let four = proven(&alike(&front_end, 2, 8, &[0.0, 1.0, 2.0, 3.0]));
    let two = proven(&alike(&front_end, 2, 8, &[0.0, 1.0]));
    assert!(norm(&four) <= norm(&two) * (1.0 + 1e-6) + 1e-12, "{} {}", norm(&four), norm(&two));
}

/// thesis, and its second channel once more.
#[test]
fn the_noncausal_bound_counts_repeated_channels_once() {
    for method in [Method::Iir, Method::Fir] {
        let mut spec = by(method, thesis(10, &[0.6, 1.2, 2.6]));
        spec.design.taps = (method == Method::Fir).then_some(22);
        let three = proven(&spec);
        assert!((three.bank.gamma.noncausal.unwrap() - 0.03993).abs() < 2e-5, "{:?}", three.bank.gamma);
        assert!((norm(&three) / 0.03993 - 1.0).abs() < 1e-3, "{}", norm(&three));
        verify(&three.bank).unwrap();
    }
}

/// A preamplifier in front of one of two converters changes nothing but their taps.
#[test]
fn proportional_filters_are_one_measurement() {
    for method in [Method::Iir, Method::Fir] {
        let mut spec = by(method, thesis(10, &[1.2, 0.6, 0.6]));
        spec.design.taps = (method == Method::Fir).then_some(22);
        amplify(&mut spec.channels[2].filter, 3.7);
        let three = proven(&spec);
        assert!((norm(&three) / 0.03993 - 1.0).abs() < 1e-3, "{}", norm(&three));
        let proven = verify(&three.bank).unwrap();
        assert!((proven.upper / 0.03993 - 1.0).abs() < 1e-3, "{proven:?}");
    }
}

/// A random plant of distinct channels, and the same with some of them again, whole periods later.
fn plants(seed: u64) -> (Spec, Spec) {
    let mut dice = Random(seed);
    let family = dice.of(&[Family::Butterworth, Family::Bessel, Family::Chebyshev1]);
    let front_end = low_pass_at(family, dice.count(1, 4), 0.05 + 0.3 * dice.part());
    let (count, ratio) = (dice.count(1, 3), dice.count(1, 3));
    let latency = dice.count(0, 12);
    let distinct: Vec<f64> =
        (0..count).map(|i| (i as f64 + 0.1 + 0.8 * dice.part()) * ratio as f64 / count as f64).collect();
    let mut delays = distinct.clone();
    for &delay in &distinct {
        if delays.len() == count || dice.part() < 0.5 {
            delays.push(delay + (dice.count(1, 3) * ratio) as f64);
        }
    }
    let plain = alike(&front_end, ratio, latency, &distinct);
    let mut repeated = alike(&front_end, ratio, latency, &delays);
    // A repeated converter may have another gain.
    for channel in &mut repeated.channels[count..] {
        channel.gain = dice.of(&[1.0, 1.0, 3.7, -0.01]);
    }
    (plain, repeated)
}

#[test]
fn repeats_change_no_recursive_bank() {
    let seeds = trials::trials(12);
    let (mut worst, mut noncausal) = (0.0_f64, 0.0_f64);
    for seed in seeds.clone() {
        let (plain, repeated) = plants(seed);
        for method in [Method::Iir, Method::H2] {
            let [plain, repeated] = [&plain, &repeated].map(|spec| proven(&by(method, spec.clone())));
            let excess = norm(&repeated) / norm(&plain) - 1.0;
            worst = worst.max(excess);
            let [least, other] = [&plain, &repeated].map(|found| found.bank.gamma.noncausal.unwrap());
            if least > 1e-6 {
                noncausal = noncausal.max((other / least - 1.0).abs());
                assert!((other / least - 1.0).abs() < 1e-5, "plant {seed}, {method:?}: {other} {least}");
            }
            assert!(excess < 1e-5, "plant {seed}, {method:?}: {} {}", norm(&repeated), norm(&plain));
            let proven =
                repeated.proof.clone().unwrap_or_else(|error| panic!("plant {seed}, {method:?}: {error}"));
            assert!(proven.attained <= norm(&repeated) * (1.0 + 1e-9), "plant {seed}: {proven:?}");
        }
    }
    println!("plants {seeds:?}, largest excess {worst:.1e}, noncausal {noncausal:.1e} apart");
}
