//! Recordings of sums of cosines, which are exact at any instant.

use super::{MergeError, MergeSettings, MergeWarning, Merged, Recorder, merge};
use crate::calibrate::Record;
use crate::random::Random;
use crate::units::{Hertz, Seconds};
use std::f64::consts::TAU;

const SETTINGS: MergeSettings = MergeSettings { rate: None, band: None, learn: true, within: None };

/// Lines up to 3.2 kHz, too many to repeat in a recording.
fn sound(t: f64) -> f64 {
    let line = |q: u32| {
        let frequency = 60.0 + 3140.0 * (43_758.545_3 * (12.989_8 * f64::from(q)).sin()).rem_euclid(1.0);
        (TAU * frequency * t + 2.3 * f64::from(q * q)).cos()
    };
    0.02 * (0..120).map(line).sum::<f64>()
}

fn source(name: &str, gain: f64, instants: impl Iterator<Item = f64>, seed: u64) -> Recorder {
    let mut random = Random(seed);
    let samples = instants.map(|t| gain * sound(t) + 2e-5 * random.sample()).collect();
    Recorder {
        name: name.to_owned(),
        record: Record::new(samples),
        rate: Hertz(4000.0),
        step: 0.0,
        stamps: None,
    }
}

fn snr(merged: &Merged, begin: f64) -> f64 {
    let inner = 400..merged.samples.len() - 400;
    let (mut signal, mut error) = (0.0, 0.0);
    for n in inner {
        let truth = sound(begin + merged.begin.0 + n as f64 / merged.rate.0);
        signal += truth * truth;
        error += (merged.samples[n] - truth).powi(2);
    }
    10.0 * (signal / error).log10()
}

/// Two recorders of 4 kHz, begun apart, one of them inverted and 35 ppm fast, resolve 3.2 kHz together.
#[test]
fn two_recorders_resolve_what_none_of_them_does() {
    let first = source("a", 1.0, (0..24_000).map(|k| 0.3 + f64::from(k) / 4000.0), 1);
    let second = source("b", -0.6, (0..24_000).map(|k| 0.1 + f64::from(k) / 4000.0 / (1.0 + 35e-6)), 2);
    let merged = merge(&[first, second], SETTINGS).unwrap();
    assert_eq!(merged.rate, Hertz(8000.0));
    let found = &merged.sources[1];
    assert!((found.start.0 + 0.2).abs() < 1e-6, "{found:?}");
    let (drift, gain) = (found.drift.unwrap().value, found.gain.unwrap().value);
    assert!((drift - 35e-6).abs() < 1e-7 && (gain + 0.6).abs() < 1e-3, "{found:?}");
    let measured = snr(&merged, 0.3);
    assert!(
        measured > 25.0 && merged.quality.alone.iter().all(|alone| alone.0 < 15.0),
        "{measured} {:?}",
        merged.quality
    );
    assert!(merged.quality.sufficient().is_none());
}

/// The mean of all recordings is in the result once, whatever their rates.
#[test]
fn a_constant_is_in_the_result_once() {
    let at = |rate: f64, name, seed| {
        let count = (6.0 * rate) as u32;
        let mut source = source(name, 1.0, (0..count).map(|k| f64::from(k) / rate), seed);
        source.record.samples.iter_mut().for_each(|x| *x += 0.3);
        Recorder { rate: Hertz(rate), ..source }
    };
    let merged = merge(&[at(7000.0, "a", 1), at(8000.0, "b", 2)], SETTINGS).unwrap();
    let inner = &merged.samples[400..merged.samples.len() - 400];
    let mean = inner.iter().sum::<f64>() / inner.len() as f64;
    assert!((mean - 0.3).abs() < 1e-3, "{mean}");
}

/// Two loggers of one signal, one of them with a bias: it is named, and what is left of it is as small as
/// without.
#[test]
fn a_bias_is_subtracted() {
    let logger = |name, begin: f64, bias: f64, seed| {
        let stamps: Vec<f64> = (0..8000).map(|k| begin + f64::from(k) / 4000.0).collect();
        let mut logger = source(name, 1.0, stamps.iter().copied(), seed);
        logger.record.samples.iter_mut().for_each(|x| *x += 9.81 + bias);
        Recorder { stamps: Some(stamps.into_iter().map(Seconds).collect()), ..logger }
    };
    let merged = |bias| merge(&[logger("a", 0.0, 0.0, 1), logger("b", 0.5001, bias, 2)], SETTINGS).unwrap();
    let (without, with) = (merged(0.0), merged(0.05));
    assert_eq!(without.warnings, []);
    let [MergeWarning::Bias { name, first, bias }] = &with.warnings[..] else {
        panic!("{:?}", with.warnings)
    };
    assert!(name == "b" && first == "a" && (bias - 0.05).abs() < 0.01, "{bias}");
    let apart = |(one, other): (&f64, &f64)| (one - other).powi(2);
    let square =
        without.samples.iter().zip(&with.samples).map(apart).sum::<f64>() / with.samples.len() as f64;
    assert!(square.sqrt() < 2e-3, "{}", square.sqrt());
}

/// One recording has a second of zeros: elsewhere the result is what it is without them.
#[test]
fn zeros_in_a_row_are_lost_samples() {
    let first = source("a", 1.0, (0..24_000).map(|k| 0.3 + f64::from(k) / 4000.0), 1);
    let second = source("b", -0.6, (0..24_000).map(|k| 0.1 + f64::from(k) / 4000.0 / (1.0 + 35e-6)), 2);
    let mut broken = second.clone();
    broken.record.samples[11_000..15_000].fill(0.0);
    let whole = merge(&[first.clone(), second], SETTINGS).unwrap();
    let merged = merge(&[first.clone(), broken.clone()], SETTINGS).unwrap();
    assert!(merged.warnings.contains(&MergeWarning::Zeros { name: "b".into(), zeros: 4000 }));
    // Away from the zeros, which begin 2.55 seconds after the first output.
    let error = |merged: &Merged| {
        let error = |n: usize| (merged.samples[n] - sound(0.3 + merged.begin.0 + n as f64 / 8000.0)).powi(2);
        (4000..20_000).map(error).sum::<f64>()
    };
    assert!(error(&merged) < 1.3 * error(&whole), "{} {}", error(&merged), error(&whole));
    // Zeros of the other one elsewhere are no sound either: these end 0.3 seconds after the first output.
    let mut other = first.clone();
    other.record.samples[200..1200].fill(0.0);
    let both = merge(&[other, broken], SETTINGS).unwrap();
    assert!(error(&both) < 1.5 * error(&whole), "{} {}", error(&both), error(&whole));
}

/// Stamps off by up to 30 % of their period are fused as they are.
#[test]
fn stamps_say_when_samples_were_taken() {
    let mut random = Random(5);
    let stamps: Vec<f64> = (0..8000).map(|k| (f64::from(k) + 0.3 * random.sample()) / 8000.0).collect();
    let mut logger = source("logger", 1.0, stamps.iter().copied(), 3);
    (logger.rate, logger.stamps) = (Hertz(8000.0), Some(stamps.iter().copied().map(Seconds).collect()));
    let merged = merge(std::slice::from_ref(&logger), SETTINGS).unwrap();
    let measured = snr(&merged, stamps[0]);
    assert!(
        measured > 55.0 && (measured - merged.quality.snr.0).abs() < 3.0,
        "{measured} {:?}",
        merged.quality
    );

    let plain = Recorder { stamps: None, name: "plain".into(), ..logger.clone() };
    let refused = merge(&[logger.clone(), plain], SETTINGS).unwrap_err();
    assert!(matches!(refused, MergeError::SomeStamps { .. }), "{refused}");
    let rate = MergeSettings { rate: Some(Hertz(1e9)), ..SETTINGS };
    assert!(matches!(merge(&[logger], rate).unwrap_err(), MergeError::Rate { .. }));
    assert!(matches!(merge(&[], SETTINGS).unwrap_err(), MergeError::NoSources));
}
