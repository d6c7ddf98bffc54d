//! Forged banks: stated numbers are changed, the digest is computed again, and what `verify` then proves
//! must be true.

use crate::norm::norm;
use crate::support::forgery::{forged, numbers, parts, sealed};
use crate::support::random::Random;
use crate::support::specs::{alike, tf, thesis, with_taps};
use hybank::bank::Bank;
use hybank::design::{Options, design};
use hybank::spec::Spec;
use hybank::verify::{Verified, verify};
use serde_json::Value;
use std::f64::consts::SQRT_2;
use trials::rounds;

/// Relative error of the oracle: its sum over aliases ends, and it may miss the top of a peak by a little.
const ORACLE: f64 = 1e-6;

/// The bank whose proof needs more than doubles.
const CORRECTED: &str = "recursive after a steep filter, latency 1";

/// A proven bank as a document.
struct Example {
    name: &'static str,
    document: Value,
}

fn examples() -> Vec<Example> {
    let butterworth = tf(&[0.36], &[1.0, 0.6 * SQRT_2, 0.36]);
    // Of order 8 at 0.1: `scipy.signal.butter(8, 0.2 * pi, analog=True)`. Its certificate has a correction.
    let steep = tf(
        &[0.024290639401140676],
        &[
            1.0,
            3.220654536958605,
            5.186307823216022,
            5.418942410806815,
            4.003647042306509,
            2.1393127146779487,
            0.8083096494112137,
            0.19816335795656187,
            0.024290639401140676,
        ],
    );
    let list: [(&str, Spec); 6] = [
        ("FIR, latency 10", with_taps(thesis(10, &[1.2, 0.6]), 12)),
        ("FIR, latency 1", with_taps(thesis(1, &[1.2, 0.6]), 8)),
        ("FIR, three channels", with_taps(alike(&butterworth, 3, 6, &[0.0, 1.1, 2.3]), 12)),
        ("FIR, one channel", with_taps(alike(&butterworth, 1, 2, &[0.4]), 6)),
        ("recursive, latency 3", thesis(3, &[1.2, 0.6])),
        (CORRECTED, alike(&steep, 2, 1, &[0.6])),
    ];
    let example = |(name, spec): (&'static str, Spec)| {
        let bank = design(&spec, &Options::default()).unwrap().bank;
        verify(&bank).unwrap_or_else(|error| panic!("{name}: {error}"));
        let proof = &bank.proof.as_ref().unwrap().upper;
        assert_eq!(name == CORRECTED, !proof.correction.is_empty(), "{name}");
        let document = serde_json::from_str(&bank.to_json().unwrap()).unwrap();
        Example { name, document }
    };
    list.into_iter().map(example).collect()
}

/// The forged document as a file whose digest is right, read as any other.
fn read(document: &Value) -> Option<Bank> {
    Bank::from_json(&sealed(document)?, "forged").ok()
}

/// What was proven, and norm and upper end as stated, is true of the forged bank.
fn check(forged: &Bank, proven: &Verified, what: &str) {
    let true_norm = norm(forged);
    let what = format!("{what}: norm {true_norm:e}, {proven:?}, {:?}", forged.gamma);
    let (above, below) = (true_norm * (1.0 + ORACLE) + 1e-9, true_norm * (1.0 - ORACLE) - 1e-9);
    assert!(proven.attained <= above && below <= proven.upper, "{what}");
    let stated = forged.gamma;
    assert!(stated.norm.is_none_or(|norm| below <= norm && norm <= above), "{what}");
    assert!(stated.upper.is_none_or(|upper| below <= upper && proven.upper <= upper), "{what}");
}

#[test]
fn what_verify_proves_of_forged_banks_is_true() {
    let mut dice = Random(2008);
    for example in examples() {
        let trials = rounds(60);
        let (mut unreadable, mut refused, mut true_ones) = (0, 0, 0);
        for trial in 0..trials {
            let mut document = example.document.clone();
            for _ in 0..=dice.below(3) {
                let mut parts = parts(&mut document);
                let count = parts.len();
                let mut numbers = numbers(parts[dice.below(count)]);
                let count = numbers.len();
                let number = &mut *numbers[dice.below(count)];
                *number = forged(&mut dice, number);
            }
            let Some(bank) = read(&document) else {
                unreadable += 1;
                continue;
            };
            match verify(&bank) {
                Err(_) => refused += 1,
                Ok(proven) => {
                    true_ones += 1;
                    check(&bank, &proven, &format!("{}, trial {trial}", example.name));
                }
            }
        }
        println!(
            "{}: {trials} forgeries, {unreadable} not read, {refused} refused, {true_ones} proven and true",
            example.name
        );
        assert!(refused > 0 && true_ones > 0, "{}", example.name);
    }
}
