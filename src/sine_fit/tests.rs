mod exponential;

use super::*;
use crate::linalg::{Mat, svd};
use crate::random::Random;
use crate::units::{Decibels, Hertz, Radians};
use std::f64::consts::{PI, TAU};

const RATE: Hertz = Hertz(48_000.0);

/// A cosine as the test knows it: amplitude, cycles per sample, phase at the instant 0.
#[derive(Clone, Copy)]
struct Wave(f64, f64, f64);

/// Samples at n + offset, by the definition.
fn record(count: usize, offset: f64, constant: f64, waves: &[Wave]) -> Vec<f64> {
    let at = |n: usize, w: &Wave| w.0 * (TAU * (w.1 * (n as f64 + offset)) + w.2).cos();
    (0..count).map(|n| constant + waves.iter().map(|w| at(n, w)).sum::<f64>()).collect()
}

fn noisy(samples: &[f64], sigma: f64, random: &mut Random) -> Vec<f64> {
    samples.iter().map(|x| x + sigma * random.gaussian()).collect()
}

fn channel(samples: &[f64], offset: f64) -> Channel<'_> {
    Channel { samples, offset: Seconds(offset / RATE.0), keep: None }
}

fn angle(a: f64, b: f64) -> f64 {
    ((a - b + PI).rem_euclid(TAU) - PI).abs()
}

#[test]
fn a_sine_without_noise_is_found_in_records_of_every_length() {
    for count in (5..40).chain([64, 100, 511, 512, 513, 1025, 5000]) {
        for cycles in [0.13, 0.21, 0.25, 0.3127, 0.41] {
            if distance_to_edge(cycles) * (count as f64) < 1.0 {
                continue;
            }
            let samples = record(count, 0.0, 0.3, &[Wave(0.7, cycles, 1.1)]);
            // A start a tenth of a cycle per record away.
            let start = RATE * (cycles + 0.1 / count as f64);
            let fit = fit(&[Channel::new(&samples)], RATE, &[start]).unwrap();
            let tone = fit.channels[0].tones[0];
            let off = (fit.frequencies[0].value / RATE - cycles).abs();
            assert!(off < 1e-11 / count as f64, "{count} {cycles}");
            assert!((tone.amplitude.value - 0.7).abs() < 1e-11, "{count} {cycles}: {}", tone.amplitude.value);
            assert!(angle(tone.phase.value.0, 1.1) < 1e-10, "{count} {cycles}: {}", tone.phase.value);
            assert!((fit.channels[0].constant.value - 0.3).abs() < 1e-11);
            assert!(fit.channels[0].residual_rms < 1e-12);
        }
    }
}

#[test]
fn found_tones_are_those_that_are_there() {
    let waves = [Wave(1.0, 0.081_34, 0.2), Wave(2e-4, 0.0829, 2.0), Wave(0.05, 0.4021, -1.0)];
    let mut random = Random(3);
    let samples = noisy(&record(20_000, 0.0, 5.0, &waves), 1e-4, &mut random);
    let tones = find_tones(&[Channel::new(&samples)], RATE, 5, Decibels(90.0)).unwrap();
    let near = |tone: &Hertz, cycles: f64| assert!((*tone / RATE - cycles).abs() < 1e-6, "{tone} {cycles}");
    assert_eq!(tones.len(), 3);
    near(&tones[0], waves[0].1);
    near(&tones[1], waves[2].1);
    near(&tones[2], waves[1].1);
    assert_eq!(find_tones(&[Channel::new(&samples)], RATE, 5, Decibels(60.0)).unwrap().len(), 2);
}

#[test]
fn noise_and_constants_hold_no_tone() {
    for seed in 0..20 {
        let samples = noisy(&vec![1.0; 3000], 1.0, &mut Random(seed));
        let found = find_tones(&[Channel::new(&samples)], RATE, 3, Decibels(60.0));
        assert!(matches!(found, Err(SineFitError::NoTone { near: None, .. })), "{seed}: {found:?}");
    }
    for constant in [0.0, 1.0, 0.1, -1e9] {
        let found = find_tones(&[Channel::new(&[constant; 777])], RATE, 1, Decibels(60.0));
        assert!(matches!(found, Err(SineFitError::NoTone { .. })), "{constant}: {found:?}");
    }
}

#[test]
fn a_known_tone_is_located_in_its_own_zone() {
    for zone in [0.0, 1.0, 2.0, 7.0] {
        for sign in [1.0, -1.0] {
            let cycles: f64 = zone + sign * 0.2037;
            if cycles < 0.0 {
                continue;
            }
            // Whole cycles per sample are left out, or the test's own phase would lose digits.
            let samples = record(4000, 0.0, 0.0, &[Wave(1.0, cycles - zone, 0.4), Wave(3.0, 0.35, 0.0)]);
            let channels = [Channel::new(&samples)];
            let start = locate(&channels, RATE, RATE * (cycles + 0.002), RATE * 0.01).unwrap();
            let fit = fit(&channels, RATE, &[start, RATE * 0.35]).unwrap();
            assert!((fit.frequencies[0].value / RATE - cycles).abs() < 1e-13, "{cycles}");
            assert!(angle(fit.channels[0].tones[0].phase.value.0, 0.4) < 1e-8);
            assert!(fit.channels[0].residual_rms < 1e-10);
        }
    }
}

/// The same estimates from the dense least-squares problem, solved by a singular value decomposition.
#[test]
fn known_tones_are_the_dense_least_squares_solution() {
    let cycles = [0.0713, 0.0741, 0.31];
    for (count, has_gaps) in [(200, true), (200, false), (513, true), (513, false), (1500, false)] {
        let samples = noisy(&vec![0.2; count], 1.0, &mut Random(count as u64));
        let keep: Vec<bool> = (0..count).map(|n| !has_gaps || n % 7 != 3).collect();
        let rows: Vec<usize> = (0..count).filter(|&n| keep[n]).collect();
        let centre = 0.5 * (count as f64 - 1.0);
        let entry = |row: usize, column: usize| {
            let angle = TAU * cycles[column.saturating_sub(1) / 2] * (rows[row] as f64 - centre);
            if column == 0 {
                1.0
            } else if column % 2 == 1 {
                angle.cos()
            } else {
                angle.sin()
            }
        };
        let dense = svd(&Mat::from_fn(rows.len(), 7, entry)).unwrap();
        let rhs = Mat::from_fn(rows.len(), 1, |i, _| samples[rows[i]]);
        let scaled = Mat::from_diagonal(&dense.s.iter().map(|s| s.recip()).collect::<Vec<_>>().into());
        let want = dense.v * scaled * (dense.u.transpose() * rhs);
        let channel = Channel { samples: &samples, offset: Seconds(0.0), keep: Some(&keep) };
        let fit = fit_known(&[channel], RATE, &cycles.map(|f| RATE * f)).unwrap();
        assert!((fit.channels[0].constant.value - want[0]).abs() < 1e-12);
        for (k, tone) in fit.channels[0].tones.iter().enumerate() {
            let amplitude = want[1 + 2 * k].hypot(want[2 + 2 * k]);
            assert!((tone.amplitude.value - amplitude).abs() < 1e-12, "{count} {k}");
        }
        assert_eq!((fit.channels[0].used, fit.channels[0].left_out), (rows.len(), count - rows.len()));
    }
}

#[test]
fn samples_that_are_left_out_do_not_matter() {
    let clean = noisy(&record(3000, 0.0, 0.1, &[Wave(1.0, 0.1234, 0.5)]), 1e-3, &mut Random(1));
    let keep: Vec<bool> = (0..clean.len()).map(|n| n % 11 != 4).collect();
    let spoilt = |value: f64| -> Vec<f64> {
        clean.iter().zip(&keep).map(|(&x, &keep)| if keep { x } else { value }).collect()
    };
    let start = [RATE * 0.123_45];
    let of = |samples: &[f64], keep| {
        let fit = fit(&[Channel { samples, offset: Seconds(0.0), keep }], RATE, &start).unwrap();
        (fit.frequencies[0], fit.channels[0].clone())
    };
    let want = of(&clean, Some(&keep));
    assert_eq!(of(&spoilt(1e9), Some(&keep)), want);
    assert_eq!(of(&spoilt(f64::NAN), None), want);
    assert_eq!(of(&spoilt(f64::INFINITY), Some(&keep)), want);
}

/// A clipped sine with its clipped samples left out is the sine; with them the amplitude is wrong.
#[test]
fn clipped_samples_can_be_left_out() {
    let whole = record(4001, 0.0, 0.0, &[Wave(1.3, 0.031_7, 0.9)]);
    let clipped: Vec<f64> = whole.iter().map(|x| x.clamp(-1.0, 1.0)).collect();
    let keep: Vec<bool> = clipped.iter().map(|x| x.abs() < 1.0).collect();
    let channels = [Channel { samples: &clipped, offset: Seconds(0.0), keep: Some(&keep) }];
    let tones = find_tones(&channels, RATE, 1, Decibels(60.0)).unwrap();
    let fit_without = fit(&channels, RATE, &tones).unwrap();
    assert!((fit_without.channels[0].tones[0].amplitude.value - 1.3).abs() < 1e-11);
    let with = fit(&[Channel::new(&clipped)], RATE, &tones).unwrap();
    assert!(with.channels[0].tones[0].amplitude.value < 1.2);
}

#[test]
fn standard_deviations_are_the_cramer_rao_bounds_of_the_closed_forms() {
    let (amplitude, sigma) = (0.8, 1e-3);
    for joint in [1, 3] {
        let count = 20_000;
        let mut random = Random(9);
        let records: Vec<Vec<f64>> = (0..joint)
            .map(|i| {
                noisy(&record(count, 0.0, 0.0, &[Wave(amplitude, 0.1377, i as f64)]), sigma, &mut random)
            })
            .collect();
        let channels: Vec<Channel<'_>> = records.iter().map(|r| Channel::new(r)).collect();
        let fit = fit(&channels, RATE, &[RATE * 0.1377]).unwrap();
        let n = count as f64;
        let snr = amplitude * amplitude / (2.0 * sigma * sigma);
        let close =
            |got: f64, want: f64| assert!((got / want - 1.0).abs() < 0.02, "{joint}: {got:e} {want:e}");
        let omega = (12.0 / (joint as f64 * snr * n * (n * n - 1.0))).sqrt();
        close(fit.frequencies[0].sigma / RATE * TAU, omega);
        close(fit.channels[0].constant.sigma, sigma / n.sqrt());
        close(fit.channels[0].tones[0].amplitude.sigma, amplitude / (n * snr).sqrt());
        if joint == 1 {
            // At the start of the record the error of the frequency quadruples the variance of the phase.
            close(fit.channels[0].tones[0].phase.sigma.0, (4.0 / (n * snr)).sqrt());
        } else {
            let lag = fit.lag_between(2, 0, 0);
            close(lag.sigma.0, (2.0 / (n * snr)).sqrt() / (TAU * 0.1377 * RATE.0));
            close(fit.ratio(Component::Real(1), Component::Real(0), 0).gain.sigma, (2.0 / (n * snr)).sqrt());
        }
    }
}

/// The scatter over many records is what each record says of itself; short records, two tones, unequal
/// channels.
#[test]
fn standard_deviations_are_the_scatter_of_repeated_records() {
    const TRIALS: usize = 1000;
    let mut random = Random(77);
    let waves = [Wave(1.0, 0.113, 0.3), Wave(0.2, 0.29, 1.0)];
    let clean = [record(60, 0.0, 0.0, &waves), record(90, 0.4, 0.1, &waves)];
    let mut scores = [0.0; 6];
    for _ in 0..TRIALS {
        let records = [noisy(&clean[0], 0.02, &mut random), noisy(&clean[1], 0.05, &mut random)];
        let channels = [channel(&records[0], 0.0), channel(&records[1], 0.4)];
        let fit = fit(&channels, RATE, &waves.map(|w| RATE * w.1)).unwrap();
        let (lag, gain) =
            (fit.lag_between(1, 0, 1), fit.ratio(Component::Real(1), Component::Real(0), 0).gain);
        let (second, phase) = (fit.frequencies[1], fit.channels[1].tones[0].phase);
        let amplitude = fit.channels[0].tones[1].amplitude;
        let errors = [
            lag.value / lag.sigma,
            (gain.value - 1.0) / gain.sigma,
            (second.value - RATE * 0.29) / second.sigma,
            (phase.value - Radians(0.3)) / phase.sigma,
            (amplitude.value - 0.2) / amplitude.sigma,
            (fit.channels[1].constant.value - 0.1) / fit.channels[1].constant.sigma,
        ];
        scores.iter_mut().zip(errors).for_each(|(score, error)| *score += error * error / TRIALS as f64);
    }
    // A mean of 1000 squares has a standard deviation of 4.5 %; the estimated noise adds a few per cent.
    for (i, score) in scores.iter().enumerate() {
        assert!((0.85..1.2).contains(score), "{i}: {score}");
    }
}

#[test]
fn lags_and_gains_of_channels_are_found_in_every_zone() {
    for cycles in [0.137, 0.837, 1.137, 2.6, 3.137] {
        let (lag, gain) = (0.0123, 1.013);
        let one = record(2000, 0.0, 0.1, &[Wave(1.0, cycles, 0.3)]);
        // Sampled at n - 0.25 - lag; the offset only says n - 0.25.
        let two: Vec<f64> =
            record(1900, -0.25 - lag, 0.0, &[Wave(gain, cycles, 0.3)]).iter().map(|x| x - 0.05).collect();
        let fit = fit(&[channel(&one, 0.0), channel(&two, -0.25)], RATE, &[RATE * (cycles + 1e-5)]).unwrap();
        let found = fit.lag_between(1, 0, 0).value.0 * RATE.0;
        assert!((found - lag).abs() < 1e-10, "{cycles}: {found}");
        assert!((fit.ratio(Component::Real(1), Component::Real(0), 0).gain.value - gain).abs() < 1e-10);
        assert_eq!(fit.lag_between(1, 1, 0).value, Seconds(0.0));
        assert!((fit.channels[1].constant.value + 0.05).abs() < 1e-10);
    }
}

#[test]
fn a_residual_is_what_the_tones_do_not_explain() {
    let noise = noisy(&vec![0.0; 1300], 0.01, &mut Random(5));
    let tones = record(1300, 0.0, 0.4, &[Wave(1.0, 0.1, 0.0), Wave(0.5, 0.23, 1.0)]);
    let samples: Vec<f64> = tones.iter().zip(&noise).map(|(x, e)| x + e).collect();
    let fit = fit_known(&[Channel::new(&samples)], RATE, &[RATE * 0.1, RATE * 0.23]).unwrap();
    let residual = fit.residual(0, &samples);
    let power = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>();
    assert!((power(&residual) / 1300.0 - fit.channels[0].residual_rms.powi(2)).abs() < 1e-16);
    let second = fit.without(0, &samples, 1..2);
    for (n, (x, e)) in second.iter().zip(&residual).enumerate() {
        let first = 0.4 + (TAU * 0.1 * n as f64).cos();
        assert!((x - e - first).abs() < 2e-3, "{n}: {x}");
    }
    // The fit takes 5 of 1300 degrees of freedom.
    let ratio = power(&residual) / power(&noise);
    assert!((0.985..1.0).contains(&ratio), "{ratio}");
}

/// Four bits of mantissa are lost in the phase of sample 1e6 if it is computed as a plain product.
#[test]
fn long_records_keep_their_digits() {
    let count = 1_000_000;
    // An exact binary fraction, so that the phase of each sample is exact in the test.
    let cycles = 1234567.0 / 8388608.0;
    let samples: Vec<f64> =
        (0..count).map(|n: u64| (TAU * ((n * 1234567) % 8388608) as f64 / 8388608.0 + 0.5).cos()).collect();
    let fit = fit(&[Channel::new(&samples)], RATE, &[RATE * (cycles + 2e-7)]).unwrap();
    assert!((fit.frequencies[0].value / RATE - cycles).abs() < 1e-16);
    assert!(fit.channels[0].residual_rms < 1e-14, "{:e}", fit.channels[0].residual_rms);
}

#[test]
fn what_cannot_be_fitted_is_refused() {
    let samples = record(100, 0.0, 0.0, &[Wave(1.0, 0.2, 0.0)]);
    let one = [Channel::new(&samples)];
    let tone = [RATE * 0.2];
    assert!(matches!(fit(&[], RATE, &tone), Err(SineFitError::Nothing { channels: 0, .. })));
    assert!(matches!(fit(&one, RATE, &[]), Err(SineFitError::Nothing { tones: 0, .. })));
    for rate in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(fit(&one, Hertz(rate), &tone), Err(SineFitError::Nothing { .. })));
    }
    for half in [0.0, 0.5, 1.0, 3.5, 0.004, 0.497] {
        let refused = fit(&one, RATE, &[RATE * half]);
        assert!(matches!(refused, Err(SineFitError::AtEdge { .. })), "{half}: {refused:?}");
        assert!(matches!(fit_known(&one, RATE, &[RATE * half]), Err(SineFitError::AtEdge { .. })));
    }
    assert!(matches!(fit(&one, RATE, &[Hertz(f64::NAN)]), Err(SineFitError::AtEdge { .. })));
    for other in [0.2, 0.204, 0.8, 1.2] {
        let refused = fit(&one, RATE, &[RATE * 0.2, RATE * other]);
        assert!(matches!(refused, Err(SineFitError::TonesCoincide { .. })), "{other}: {refused:?}");
    }
    let short = [Channel::new(&samples[..4])];
    let refused = fit(&short, RATE, &tone).unwrap_err();
    let want = SineFitError::TooFewSamples { channel: 1, used: 4, samples: 4, tones: 1, needed: 5 };
    assert_eq!(refused, want);
    let masked = [Channel { keep: Some(&[true; 99]), ..one[0] }];
    assert!(matches!(fit(&masked, RATE, &tone), Err(SineFitError::Mask { mask: 99, samples: 100, .. })));
    let nothing = [Channel { keep: Some(&[false; 100]), ..one[0] }];
    assert!(matches!(fit(&nothing, RATE, &tone), Err(SineFitError::TooFewSamples { used: 0, .. })));
    // Far from any tone the iteration has nowhere to go.
    let refused = fit(&one, RATE, &[RATE * 0.4]);
    assert!(refused.is_err(), "{refused:?}");
    let zero = [Channel::new(&[0.0; 100])];
    assert!(matches!(fit(&zero, RATE, &tone), Err(SineFitError::NoTone { near: Some(_), .. })));
    let refused = locate(&one, RATE, RATE * 0.4, RATE * 0.01);
    assert!(matches!(refused, Err(SineFitError::NoTone { near: Some(_), .. })), "{refused:?}");
}
