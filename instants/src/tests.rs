//! Digits of an independent computation with Gauss-Legendre sums of 80 to 1,600 nodes and dense solves.

use super::*;
use crate::estimator::MeanSquare;
use hybank_core::units::{CyclesPerFastPeriod, FastPeriods};
use hybank_linalg::{Complex, Mat};
use std::f64::consts::PI;
use std::slice::from_ref;
use trials::random::Random;

/// A Butterworth filter of this order, `f` over its cut-off.
fn butterworth(order: u32, f: f64) -> Complex<f64> {
    (0..order).fold(Complex::from(1.0), |response, k| {
        let angle = PI * f64::from(2 * k + order + 1) / f64::from(2 * order);
        let pole = Complex::from_polar(1.0, angle);
        response * -pole / (Complex::new(0.0, f) - pole)
    })
}

fn decibels(error: f64) -> f64 {
    -10.0 * error.log10()
}

/// Two converters of 24 kHz; the unit of time is their period.
fn two_recorders() -> Estimator {
    let (cutoff, edge) = (14.0 / 24.0, 18.0 / 24.0);
    let spectrum = Spectrum::flat(CyclesPerFastPeriod(0.0)..CyclesPerFastPeriod(edge), FastPeriods(50.0));
    let converters = vec![Converter::exact(0, 1.0, 1e-8), Converter::exact(0, 1.0, 1e-8 / 0.36)];
    let filter = |f: CyclesPerFastPeriod| butterworth(4, f.0 / cutoff);
    Estimator::new(Signals::new(&spectrum, &[&filter], 0, converters))
}

/// Samples -23 to 24 of both, the second ones `delay` later and without the `lost` ones.
fn of_recorders(delay: f64, lost: std::ops::Range<i32>) -> Vec<TimedSample> {
    let of = |converter: usize, delay: f64| {
        (-23..=24).map(move |n| TimedSample { converter, instant: FastPeriods(f64::from(n) + delay) })
    };
    let second =
        (-23..=24).zip(of(1, delay)).filter(move |(n, _)| !lost.contains(n)).map(|(_, sample)| sample);
    of(0, 0.0).chain(second).collect()
}

/// The errors of any taps at 0 and 1/2.
fn errors_of(estimator: &Estimator, samples: &[TimedSample], weights: &Mat) -> Vec<MeanSquare> {
    let set = estimator.set(samples);
    set.errors(weights, &set.with_target(&[FastPeriods(0.0), FastPeriods(0.5)]))
}

#[test]
fn two_recorders_have_the_golden_errors() {
    let estimator = two_recorders();
    for (delay, at_samples, between) in [
        (0.0, 80.257, 3.511),
        (0.02, 79.477, 51.743),
        (0.05, 79.467, 59.605),
        (0.1, 79.459, 65.508),
        (0.25, 79.449, 72.861),
        (0.5, 79.445, 76.128),
    ] {
        let samples = of_recorders(delay, 0..0);
        let taps = estimator.taps(&samples, &[FastPeriods(0.0), FastPeriods(0.5)]).unwrap();
        let snr: Vec<f64> = taps.errors.iter().map(|error| decibels(error.total())).collect();
        assert!((snr[0] - at_samples).abs() < 6e-4 && (snr[1] - between).abs() < 6e-4, "{delay}: {snr:?}");
        // The formula for any taps agrees for these.
        let again = errors_of(&estimator, &samples, &taps.weights);
        for (one, two) in taps.errors.iter().zip(&again) {
            assert!((one.total() - two.total()).abs() < 1e-12, "{one:?} {two:?}");
        }
    }
}

#[test]
fn lost_samples_have_the_golden_errors() {
    let estimator = two_recorders();
    let instants = [0.0, 0.25, 0.5].map(FastPeriods);
    for (lost, golden) in [(-5..5, [78.922, 9.161, 6.447]), (0..0, [79.446, 77.707, 75.640])] {
        let taps = estimator.taps(&of_recorders(0.4, lost), &instants).unwrap();
        for (error, golden) in taps.errors.iter().zip(golden) {
            assert!((decibels(error.total()) - golden).abs() < 6e-4, "{error:?} {golden}");
        }
    }
}

/// Two passes of the delay over a period: the coincidences decide the mean.
#[test]
fn a_whole_drift_has_the_golden_mean() {
    let estimator = two_recorders();
    let error = |k: u32| {
        let taps = estimator.taps(&of_recorders(f64::from(k) / 200.0, 0..0), &[0.0, 0.5].map(FastPeriods));
        taps.unwrap().errors.iter().map(|error| error.total()).sum::<f64>() / 2.0
    };
    let mean = |range: std::ops::RangeInclusive<u32>| {
        let count = range.clone().count() as f64;
        decibels(range.map(error).sum::<f64>() / count)
    };
    assert!((mean(4..=196) - 67.862).abs() < 6e-4, "{}", mean(4..=196));
}

/// One converter of 1 kS/s without front end, stamps off by up to 30 % of the period, band 0 to 400 Hz.
#[test]
fn stamps_with_jitter_have_the_golden_error() {
    let band = CyclesPerFastPeriod(0.0)..CyclesPerFastPeriod(0.4);
    let spectrum = Spectrum::flat(band, FastPeriods(40.0));
    let converters = vec![Converter::exact(0, 1.0, 1e-8)];
    let estimator = Estimator::new(Signals::new(&spectrum, &[&|_| Complex::from(1.0)], 0, converters));
    let mut random = Random(3);
    let stamps: Vec<f64> = (0..2040).map(|n| f64::from(n) + 0.3 * random.sample()).collect();
    let set = |first: usize, instants: &[f64]| -> Vec<TimedSample> {
        let sample = |k: usize| TimedSample { converter: 0, instant: FastPeriods(instants[k]) };
        (first..first + 32).map(sample).collect()
    };
    let even: Vec<f64> = (0..2040).map(f64::from).collect();
    let (mut known, mut taken_as_even) = (0.0, 0.0);
    for k in 20..2020 {
        let at = [FastPeriods(k as f64)];
        let samples = set(k - 16, &stamps);
        known += estimator.taps(&samples, &at).unwrap().errors[0].total() / 2000.0;
        let blind = estimator.taps(&set(k - 16, &even), &at).unwrap();
        let set = estimator.set(&samples);
        taken_as_even += set.errors(&blind.weights, &set.with_target(&at))[0].total() / 2000.0;
    }
    // Other draws than that of the golden values.
    assert!((decibels(known) - 79.2).abs() < 0.5, "{}", decibels(known));
    assert!((decibels(taken_as_even) - 12.1).abs() < 0.5, "{}", decibels(taken_as_even));
}

/// Sensors of 100, 125 and 80 Hz with clocks of +25, -40 and +10 ppm, into 400 Hz.
#[test]
fn sensors_with_clocks_of_their_own_have_the_golden_errors() {
    let fast = 400.0;
    let spectrum =
        Spectrum::flat(CyclesPerFastPeriod(0.0)..CyclesPerFastPeriod(90.0 / fast), FastPeriods(220.0));
    let filter = |cutoff: f64| move |f: CyclesPerFastPeriod| butterworth(2, f.0 * fast / cutoff);
    let filters = [30.0, 40.0, 25.0, 60.0].map(filter);
    let responses: Vec<&dyn Fn(CyclesPerFastPeriod) -> Complex<f64>> =
        filters.iter().map(|f| f as _).collect();
    let noise = [1e-3, 2e-3, 5e-4];
    let converters = (0..3).map(|i| Converter::exact(i, 1.0, f64::powi(noise[i], 2))).collect();
    let estimator = Estimator::new(Signals::new(&spectrum, &responses, 3, converters));
    let rates = [(100.0, 25e-6), (125.0, -40e-6), (80.0, 10e-6)].map(|(rate, fast)| rate * (1.0 + fast));
    for (from, golden) in [(0.0, 47.127), (60.0, 48.984), (120.0, 47.850)] {
        let error = |n: u32| {
            let t = from + f64::from(n) / fast;
            let nearest = |i: usize| {
                let first = (t * rates[i]).round() - 12.0;
                (0..24).map(move |k| TimedSample {
                    converter: i,
                    instant: FastPeriods(((first + f64::from(k)) / rates[i] - t) * fast),
                })
            };
            let samples: Vec<TimedSample> = (0..3).flat_map(nearest).collect();
            estimator.taps(&samples, &[FastPeriods(0.0)]).unwrap().errors[0].total() / 40.0
        };
        let found = decibels((0..40).map(error).sum());
        assert!((found - golden).abs() < 0.3, "from {from} s: {found}, golden {golden}");
    }
}

/// Samples of cosines, exact at any instant.
fn cosines(recording: &Clock, count: usize, lost: std::ops::Range<usize>, noise: f64, seed: u64) -> Vec<f64> {
    let mut random = Random(seed);
    let sample = |k: usize| {
        let noise = noise * 3.0_f64.sqrt() * random.sample();
        if lost.contains(&k) { f64::NAN } else { cosine(recording.at(k as f64).0) + noise }
    };
    (0..count).map(sample).collect()
}

/// Cosines of equal powers up to 0.375 cycles per fast period, with the power 1 together.
fn cosine(t: f64) -> f64 {
    let one = |q: u32| (2.0 * PI * 0.375 * (f64::from(q) + 0.37) / 40.0 * t + 1.9 * f64::from(q * q)).cos();
    (0..40).map(one).sum::<f64>() / 20.0_f64.sqrt()
}

fn of_band(converters: Vec<Converter>, longest: f64) -> Estimator {
    let band = CyclesPerFastPeriod(0.0)..CyclesPerFastPeriod(0.375);
    let spectrum = Spectrum::flat(band, FastPeriods(longest));
    Estimator::new(Signals::new(&spectrum, &[&|_| Complex::from(1.0)], 0, converters))
}

/// Two recorders of half the rate, the second inverted and fast, with a gap; over the whole run.
fn drifting(seed: u64) -> (Estimator, Vec<Recording>) {
    let clocks = [
        Clock::even(FastPeriods(0.0), FastPeriods(2.0)),
        Clock::even(FastPeriods(-3.2), FastPeriods(2.0003)),
    ];
    let noise = 1e-4;
    let [first, second] = clocks;
    let of = |clock: &Clock, lost, seed| cosines(clock, 3000, lost, noise, seed);
    let one = of(&first, 0..0, seed);
    let two = of(&second, 1000..1004, seed + 1).iter().map(|x| -0.5 * x).collect();
    let converters = vec![Converter::exact(0, 1.0, 1e-8), Converter::exact(0, -0.5, 0.25e-8)];
    (of_band(converters, 260.0), vec![Recording::new(one, first, 0), Recording::new(two, second, 1)])
}

fn error_of(fused: &Fused, first: f64, range: std::ops::Range<usize>) -> f64 {
    let miss = |n: usize| (fused.samples[n] - cosine(first + n as f64)).powi(2);
    range.clone().map(miss).sum::<f64>() / range.len() as f64
}

/// Away from coincidences and the gap the error is the predicted one, and knots lose little beside taps made
/// for each output.
#[test]
fn a_drift_is_followed_as_predicted() {
    let (estimator, recordings) = drifting(5);
    let settings = FusionSettings { first: FastPeriods(100.0), count: 5600, reach: 24 };
    let fused = fuse(&estimator, &recordings, settings).unwrap();
    assert_eq!(fused.block, 128);
    for blocks in [0..12, 20..43] {
        let predicted =
            fused.errors[blocks.clone()].iter().map(|error| error.total()).sum::<f64>() / blocks.len() as f64;
        let found = error_of(&fused, 100.0, blocks.start * 128..blocks.end * 128);
        let apart = decibels(found) - decibels(predicted);
        assert!(apart.abs() < 0.5, "{blocks:?}: {} {}", decibels(found), decibels(predicted));
    }
    // The gap of the second recorder: one recorder alone has half of the band.
    let gap = (1940 - 100)..(1960 - 100);
    assert!(decibels(error_of(&fused, 100.0, gap)) > 3.0);
    let exact = |n: usize| {
        let at = FastPeriods(100.0 + n as f64);
        let samples: Vec<(TimedSample, f64)> = recordings
            .iter()
            .flat_map(|recording| {
                let nearest = recording.nearest(at);
                (nearest - 23..=nearest + 24).map(move |k| (recording.sample(k), recording.value(k as usize)))
            })
            .collect();
        let (samples, values): (Vec<TimedSample>, Vec<f64>) = samples.into_iter().unzip();
        let taps = estimator.taps(&samples, &[at]).unwrap();
        hybank_linalg::dot(taps.weights.as_slice(), &values)
    };
    for n in (2600..5400).step_by(173) {
        assert!((fused.samples[n] - exact(n)).abs() < 5e-4, "{n}: {} {}", fused.samples[n], exact(n));
    }
}

/// The bits do not depend on threads, nor on where the outputs end.
#[test]
fn cuts_and_threads_change_no_bit() {
    let (estimator, recordings) = drifting(7);
    let settings = FusionSettings { first: FastPeriods(100.0), count: 3000, reach: 16 };
    let whole = fuse(&estimator, &recordings, settings).unwrap();
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let again =
        one.install(|| fuse(&estimator, &recordings, FusionSettings { count: 2990, ..settings })).unwrap();
    assert_eq!(whole.samples[..2560], again.samples[..2560]);
}

/// However samples arrive, also with lost ones, over several stretches.
#[test]
fn live_outputs_do_not_depend_on_cuts() {
    let (estimator, whole) = drifting(13);
    let live = |lengths: &mut dyn Iterator<Item = usize>| {
        let none = whole.iter().map(|one| Recording::new(Vec::new(), one.clock().clone(), one.converter()));
        let mut live = LiveFusion::new(estimator.clone(), none.collect(), FastPeriods(100.0), 16);
        let (mut samples, mut errors, mut late, mut start) = (Vec::new(), Vec::new(), 0, 0);
        while start < 3000 {
            let end = (start + lengths.next().unwrap()).min(3000);
            let fused = live.push(whole.iter().map(|one| one.samples()[start..end].iter().copied())).unwrap();
            samples.extend(fused.samples);
            errors.extend(fused.errors);
            late = late.max(end.saturating_sub(samples.len() / 2));
            start = end;
        }
        let fused = live.finish(5850).unwrap();
        samples.extend(fused.samples);
        errors.extend(fused.errors);
        (samples, errors, late)
    };
    let (samples, errors, _) = live(&mut std::iter::repeat(3000));
    assert_eq!((samples.len(), errors.len()), (5850, 46));
    for length in [1, 64, 777] {
        let (again, as_well, late) = live(&mut std::iter::repeat(length));
        assert!(samples == again && errors == as_well, "{length}");
        // 50 frames before the first output, 64 of a block, and those of the longest time.
        assert!(late <= 50 + 64 + 50 + length, "{length}: {late}");
    }
    let settings = FusionSettings { first: FastPeriods(100.0), count: 5850, reach: 16 };
    assert_eq!(fuse(&estimator, &whole, settings).unwrap().samples[..4096], samples[..4096]);
}

/// Two rates that share nothing, and stamps with jitter.
#[test]
fn unequal_rates_are_fused_as_predicted() {
    let mut random = Random(11);
    let stamps: Vec<FastPeriods> =
        (0..900).map(|k| FastPeriods(2.177 * f64::from(k) - 4.0 + 0.3 * random.sample())).collect();
    let clocks = [Clock::even(FastPeriods(0.4), FastPeriods(2.0)), Clock::stamps(&stamps).unwrap()];
    let recording = |i: usize| {
        let samples = cosines(&clocks[i], 900, 0..0, 1e-4, 17 + i as u64);
        Recording::new(samples, clocks[i].clone(), i)
    };
    let converters = vec![Converter::exact(0, 1.0, 1e-8); 2];
    let (estimator, recordings) = (of_band(converters, 400.0), [recording(0), recording(1)]);
    let settings = FusionSettings { first: FastPeriods(100.0), count: 1500, reach: 24 };
    let fused = fuse(&estimator, &recordings, settings).unwrap();
    let predicted = fused.errors.iter().map(|error| error.total()).sum::<f64>() / fused.errors.len() as f64;
    let found = error_of(&fused, 100.0, 0..1500);
    let worst = fused.errors.iter().map(|error| error.total()).fold(0.0, f64::max);
    assert!(found < 3.0 * worst && found > 0.2 * predicted, "{} {}", decibels(found), decibels(predicted));
    assert!(decibels(found) > 30.0, "{}", decibels(found));
}

/// Of even clocks and of stamps, in any order of the converters: each entry by itself.
#[test]
fn the_covariances_of_a_set_are_those_of_pairs() {
    let mut random = Random(19);
    let of = |converter: usize, count: u32, period: f64, jitter: f64, random: &mut Random| {
        (0..count)
            .map(|n| FastPeriods(period * f64::from(n) + jitter * random.sample()))
            .map(|instant| TimedSample { converter, instant })
            .collect::<Vec<_>>()
    };
    let parts = [(1, 5, 2.0, 0.0), (0, 24, 2.00004, 0.0), (2, 9, 2.1, 0.4), (1, 7, 2.0, 0.0)];
    let samples = parts.map(|(i, count, period, jitter)| of(i, count, period, jitter, &mut random)).concat();
    let estimator = of_band(
        vec![Converter::exact(0, 1.0, 1e-8), Converter::exact(0, -0.5, 1e-8), Converter::exact(0, 2.0, 1e-8)],
        60.0,
    );
    let covariances = estimator.signal_covariances(&samples);
    for (k, first) in samples.iter().enumerate() {
        for (l, second) in samples[..=k].iter().enumerate() {
            let gains = [first, second].map(|one| [1.0, -0.5, 2.0][one.converter]);
            let x = 2.0 * PI * 0.375 * (first.instant - second.instant).0;
            let flat = if x == 0.0 { 1.0 } else { x.sin() / x };
            let wrong = covariances[(k, l)] - gains[0] * gains[1] * flat;
            assert!(wrong.abs() < 1e-13, "{k} {l}: {wrong:e}");
        }
    }
}

/// The residuals of samples that are left out have the variances of the model.
#[test]
fn residuals_have_the_variance_of_the_model() {
    let (estimator, recordings) = drifting(23);
    let instants: Vec<FastPeriods> = (0..300).map(|k| FastPeriods(150.0 + 18.1 * f64::from(k))).collect();
    let noise: Vec<f64> = estimator.signals().converters().iter().map(|converter| converter.noise).collect();
    let trials = Trials::new(&estimator, &recordings, 24, 1.0, &instants);
    let found = trials.held_out(&noise).unwrap();
    for converter in 0..2 {
        let of = found.iter().filter(|one| one.converter == converter);
        let ratios: Vec<f64> = of.map(|one| one.residual.powi(2) / one.variance).collect();
        let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
        assert!(ratios.len() > 290 && (mean - 1.0).abs() < 0.3, "{converter}: {mean} of {}", ratios.len());
    }
}

/// The spectrum of two bands, with the power of the signal.
#[test]
fn the_spectrum_is_that_of_the_signal() {
    let mut random = Random(2);
    // A recursive filter of white noise: |H|^2 = 1 / |1 - 0.9 z^-1|^2.
    let mut state = 0.0;
    let signal: Vec<f64> = (0..60_000)
        .map(|_| {
            state = 0.9 * state + random.sample();
            state
        })
        .collect();
    let (spectrum, power) =
        learned(&signal, from_ref(&(0..60_000)), 0.0, &|_| 1.0, FastPeriods(50.0)).unwrap();
    let variance = 1.0 / 3.0 / (1.0 - 0.81);
    assert!((power / variance - 1.0).abs() < 0.03, "{power} {variance}");
    let share = |f: f64| 1.0 / (Complex::from(1.0) - Complex::from_polar(0.9, -2.0 * PI * f)).norm_sqr();
    let below = |f: f64| -> f64 {
        let nodes = spectrum.nodes().iter();
        nodes.filter(|node| node.frequency.0 < f).map(|node| node.power).sum()
    };
    let total: f64 = (0..5000).map(|k| share((f64::from(k) + 0.5) / 10_000.0)).sum();
    for (f, count) in [(0.05, 500), (0.1, 1000), (0.3, 3000)] {
        let exact: f64 = (0..count).map(|k| share((f64::from(k) + 0.5) / 10_000.0)).sum::<f64>() / total;
        assert!((below(f) - exact).abs() < 0.02, "{f}: {} {exact}", below(f));
    }
    assert!(learned(&signal, from_ref(&(0..300)), 0.0, &|_| 1.0, FastPeriods(50.0)).is_none());
    assert!(learned(&[0.0; 2000], from_ref(&(0..2000)), 0.0, &|_| 1.0, FastPeriods(50.0)).is_none());
}

/// White noise that passed `1 + z^-1`, whose gain falls over the band, is white again.
#[test]
fn what_an_estimate_takes_away_is_restored() {
    let mut random = Random(3);
    let white: Vec<f64> = (0..120_000).map(|_| random.sample()).collect();
    let estimate: Vec<f64> = white.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect();
    let gain =
        |band: std::ops::Range<CyclesPerFastPeriod>| (0.5 * PI * (band.start.0 + band.end.0)).cos().max(0.1);
    // A quarter of the variance 1/3 is noise.
    let all = 0..estimate.len();
    let (spectrum, _) = learned(&estimate, from_ref(&all), 1.0 / 12.0, &gain, FastPeriods(50.0)).unwrap();
    let power = |low: f64| -> f64 {
        let nodes = spectrum.nodes().iter().filter(|node| (low..low + 0.1).contains(&node.frequency.0));
        nodes.map(|node| node.power).sum()
    };
    assert!((power(0.3) / power(0.05) - 1.0).abs() < 0.05, "{} {}", power(0.3), power(0.05));
}

/// Band, spectrum and noise of recordings that say nothing of them.
#[test]
fn recordings_tell_their_noise_and_the_error_is_as_predicted() {
    let (_, recordings) = drifting(31);
    let prior = Prior {
        band: None,
        front_ends: &[],
        passes: 2,
        gains: vec![1.0, -0.5],
        gain_deviations: vec![0.0; 2],
        delay_deviations: vec![FastPeriods(0.0); 2],
        least_noise: vec![0.0; 2],
    };
    let settings = FusionSettings { first: FastPeriods(100.0), count: 5600, reach: 24 };
    let model = Model::learn(&recordings, &prior, settings).unwrap();
    for (noise, exact) in model.noise.iter().zip([1e-8, 0.25e-8]) {
        assert!((0.5..2.0).contains(&(noise / exact)), "{:?}", model.noise);
    }
    let fused = fuse(&model.estimator, &recordings, settings).unwrap();
    // Without the coincidence and the gap.
    let predicted = fused.errors[20..43].iter().map(|error| error.total()).sum::<f64>() / 23.0;
    let found = error_of(&fused, 100.0, 20 * 128..43 * 128);
    let apart = decibels(found) - decibels(predicted);
    assert!(apart.abs() < 1.0, "{} {}", decibels(found), decibels(predicted));
}

/// Where two recorders come to sample at one instant the stated errors are those of exact taps.
#[test]
fn errors_over_a_coincidence_are_those_of_exact_taps() {
    let clocks = [
        Clock::even(FastPeriods(0.0), FastPeriods(2.0)),
        Clock::even(FastPeriods(-0.1), FastPeriods(2.00004)),
    ];
    let recording =
        |i: usize| Recording::new(cosines(&clocks[i], 3500, 0..0, 2e-4, 3 + i as u64), clocks[i].clone(), i);
    let recordings = [0, 1].map(recording);
    let estimator = of_band(vec![Converter::exact(0, 1.0, 4e-8); 2], 260.0);
    let settings = FusionSettings { first: FastPeriods(4000.0), count: 2048, reach: 24 };
    let fused = fuse(&estimator, &recordings, settings).unwrap();
    let stated = fused.errors.iter().map(|error| error.total()).sum::<f64>() / 16.0;
    let best = |n: usize| {
        let at = FastPeriods(4000.0 + n as f64);
        let around = |one: &Recording| {
            let nearest = one.nearest(at);
            (nearest - 23..=nearest + 24).map(|k| one.sample(k)).collect::<Vec<_>>()
        };
        let samples: Vec<TimedSample> = recordings.iter().flat_map(around).collect();
        estimator.taps(&samples, &[at]).unwrap().errors[0].total()
    };
    let exact = (0..2048).map(best).sum::<f64>() / 2048.0;
    let measured = error_of(&fused, 4000.0, 0..2048);
    assert!(exact > 1e-3 && (stated / exact - 1.0).abs() < 0.02, "{stated} {exact}");
    // One coincidence is a small sample.
    assert!((0.3..3.0).contains(&(measured / exact)), "{measured} {exact}");
}
