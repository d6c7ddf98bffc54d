//! Blind fits of band-limited noise: coverage, efficiency, and what is refused.

use crate::calibrate::testbench::{assert_covers, assert_holds, gaussian, trials};
use crate::calibrate::{
    Acquisition, CalibrateError, Calibration, CalibrationSettings, CalibrationSignal, FittedValues, Record,
    calibrate, calibrate_pooled,
};
use crate::random::Random;
use crate::simulate::{Instants, Periodic};
use crate::spec::Spec;
use crate::units::FastPeriods;
use std::f64::consts::PI;

const BLIND: CalibrationSettings = CalibrationSettings {
    fit: FittedValues { delay: true, gain: true, offset: true, cutoff: None, nonlinearity: None },
    reference: 0,
};

fn spec(ratio: usize, delays: &[f64]) -> Spec {
    let channels: String = delays.iter().map(|d| format!("[[channel]]\ndelay = {d:?}\n")).collect();
    let head = format!(
        "fast_period = 1.0\nratio = {ratio}\nlatency = 8\n[target]\n\
         filter = {{ family = \"rc\", cutoff = 0.3 }}\n"
    );
    Spec::from_toml(&(head + &channels), "spec.toml").unwrap()
}

/// The same with a `[signal]` in a band of cycles per fast period.
fn in_band(ratio: usize, delays: &[f64], band: [f64; 2]) -> Spec {
    let text = spec(ratio, delays).to_toml().unwrap() + &format!("\n[signal]\nband = {band:?}\n");
    Spec::from_toml(&text, "spec.toml").unwrap()
}

/// Gaussian noise of `samples` fast samples in a band (rad per fast period): a sum over neighbours with a
/// windowed sinc less another. It is periodic.
fn noise_in_band(samples: usize, [low, high]: [f64; 2], dice: &mut Random) -> Vec<f64> {
    let reach = 128i64;
    let sinc = |band: f64, n: i64| if n == 0 { band / PI } else { (band * n as f64).sin() / (PI * n as f64) };
    let window = |n: i64| 0.5 + 0.5 * (PI * n as f64 / (reach as f64 + 1.0)).cos();
    let taps: Vec<f64> = (-reach..=reach).map(|n| (sinc(high, n) - sinc(low, n)) * window(n)).collect();
    let white: Vec<f64> = (0..samples).map(|_| gaussian(dice)).collect();
    let around = |n: usize| white[n..].iter().chain(&white).zip(&taps);
    (0..samples).map(|n| around(n).map(|(white, tap)| white * tap).sum()).collect()
}

/// The same below `band`.
fn band_limited(samples: usize, band: f64, dice: &mut Random) -> Vec<f64> {
    noise_in_band(samples, [0.0, band], dice)
}

/// The captures of `truth`, with noise relative to the signal.
fn captures(truth: &Spec, signal: &[f64], frames: usize, noise: f64, dice: &mut Random) -> Vec<Record> {
    let recording = Periodic::new(signal, FastPeriods(1.0));
    let one = |channel: &crate::spec::ChannelSpec| {
        let filter = crate::analog::StrictlyProper::new(&channel.filter, truth.fast_period).unwrap();
        // From the middle of the periodic signal, so that the record itself is not periodic.
        let first = FastPeriods(100.0 - channel.delay.0);
        let step = FastPeriods(truth.ratio as f64);
        recording.sample(&filter, Instants { first, step, count: frames })
    };
    let clean: Vec<Vec<f64>> = truth.channels.iter().map(one).collect();
    let power = clean[0].iter().map(|x| x * x).sum::<f64>() / frames as f64;
    let noisy = |(samples, channel): (Vec<f64>, &crate::spec::ChannelSpec)| {
        let noisy = |x: f64| channel.gain * x + channel.offset + noise * power.sqrt() * gaussian(dice);
        Record::new(samples.into_iter().map(noisy).collect())
    };
    clean.into_iter().zip(&truth.channels).map(noisy).collect()
}

fn with_errors(spec: &Spec, dice: &mut Random) -> Spec {
    let mut truth = spec.clone();
    for channel in &mut truth.channels {
        channel.delay.0 += 0.02 * dice.part();
        channel.gain = 1.0 + 0.01 * dice.sample();
    }
    truth
}

/// Errors over standard deviations.
fn scaled(truth: &Spec, nominal: &Spec, found: &Calibration) -> Vec<f64> {
    let mut scaled = Vec::new();
    let (own, first) = (&truth.channels, &nominal.channels[0]);
    for (estimate, channel) in found.channels.iter().zip(own).skip(1) {
        let (delay, gain) = (estimate.delay.unwrap(), estimate.gain.unwrap());
        let expected = channel.delay.0 - own[0].delay.0 + first.delay.0;
        scaled.push((delay.value.0 - expected) / delay.sigma.0);
        scaled.push((gain.value - channel.gain / own[0].gain) / gain.sigma);
    }
    scaled
}

#[test]
fn intervals_cover_with_one_alias_and_with_three() {
    for (ratio, delays, band, noise) in [
        (2, vec![1.0, 0.0], 0.45 * PI, 1e-3),
        (2, vec![1.0, 0.0], 0.45 * PI, 0.1),
        (4, vec![3.0, 2.0, 1.0, 0.0], 0.7 * PI, 1e-3),
    ] {
        let spec = spec(ratio, &delays);
        let (mut dice, mut all, trials) = (Random(ratio as u64), Vec::new(), trials(60));
        for _ in 0..trials {
            let truth = with_errors(&spec, &mut dice);
            let frames = 2048;
            let signal = band_limited(2 * frames * ratio, band, &mut dice);
            let records = captures(&truth, &signal, frames, noise, &mut dice);
            let found = calibrate(&spec, &records, &CalibrationSignal::Any, BLIND).unwrap();
            all.extend(scaled(&truth, &spec, &found));
        }
        assert_covers(&all, trials);
        let rms = (all.iter().map(|x| x * x).sum::<f64>() / all.len() as f64).sqrt();
        assert!((0.8..1.15).contains(&rms), "{ratio}: rms error over sigma {rms}");
    }
}

#[test]
fn a_signal_that_fills_all_aliases_is_refused() {
    let (spec, mut dice) = (spec(2, &[1.0, 0.0]), Random(1));
    let signal: Vec<f64> = (0..8192).map(|_| gaussian(&mut dice)).collect();
    let records = captures(&spec, &signal, 2048, 1e-4, &mut dice);
    let refused = calibrate(&spec, &records, &CalibrationSignal::Any, BLIND).unwrap_err();
    assert_eq!(refused, CalibrateError::AllAliasesOccupied { channels: 2 });
    let few =
        calibrate(&spec, &captures(&spec, &signal, 100, 0.0, &mut dice), &CalibrationSignal::Any, BLIND);
    assert_eq!(few.unwrap_err(), CalibrateError::TooShort { frames: 100, needed: 256 });
}

#[test]
fn swapped_captures_are_recognised() {
    let (spec, mut dice) = (spec(2, &[1.2, 0.6]), Random(2));
    let signal = band_limited(8192, 0.4 * PI, &mut dice);
    let mut records = captures(&spec, &signal, 2048, 1e-3, &mut dice);
    records.swap(0, 1);
    let refused = calibrate(&spec, &records, &CalibrationSignal::Any, BLIND).unwrap_err();
    assert_eq!(refused, CalibrateError::WrongOrder { order: vec![2, 1] });
}

#[test]
fn offsets_are_relative_to_the_reference() {
    let (spec, mut dice) = (spec(2, &[1.2, 0.6]), Random(4));
    let mut truth = spec.clone();
    truth.channels[1].offset = 0.02;
    let signal = band_limited(8192, 0.4 * PI, &mut dice);
    let records = captures(&truth, &signal, 2048, 1e-3, &mut dice);
    let found = calibrate(&spec, &records, &CalibrationSignal::Any, BLIND).unwrap();
    let offset = found.channels[1].offset.unwrap();
    assert!((offset.value - 0.02).abs() < 5.0 * offset.sigma && offset.sigma < 1e-4, "{offset:?}");
    assert_eq!(found.channels[0].offset.unwrap().sigma, 0.0);
}

/// Speech, captured elsewhere in the frequency domain: 1.2 and 0.6 fast periods.
#[test]
fn speech_gives_its_delay_to_1e_5_fast_periods() {
    let Some(folder) = trials::data("captures/speech-2x") else { return };
    let text = std::fs::read_to_string(folder.join("spec.toml")).unwrap();
    let records = ["ch1.wav", "ch2.wav"].map(|name| {
        let mut wav = hound::WavReader::open(folder.join(name)).unwrap();
        Record::new(wav.samples::<f32>().map(|x| f64::from(x.unwrap())).collect())
    });
    for off in [0.0, 0.05, -0.3] {
        let mut spec = Spec::from_toml(&text, "spec.toml").unwrap();
        spec.channels[1].delay.0 += off / 48_000.0;
        let found = calibrate(&spec, &records, &CalibrationSignal::Any, BLIND).unwrap();
        let delay = found.channels[1].delay.unwrap();
        println!("speech: error {:.1e}, sigma {:.1e} fast periods", delay.value.0 - 0.6, delay.sigma.0);
        assert!((delay.value.0 - 0.6).abs() < 1e-5, "{delay:?}");
        assert!(delay.sigma.0 < 1e-5 && (delay.value.0 - 0.6).abs() < 4.0 * delay.sigma.0, "{delay:?}");
    }
}

/// A signal that is elsewhere than the spec says, so that other aliases are taken for its own.
#[test]
fn a_band_that_the_signal_does_not_keep_is_a_misfit() {
    let (spec, mut dice) = (in_band(4, &[3.0, 2.0, 1.0, 0.0], [0.265, 0.36]), Random(22));
    let signal = noise_in_band(2 * 2048 * 4, [0.1 * PI, 0.4 * PI], &mut dice);
    let records = captures(&spec, &signal, 2048, 1e-3, &mut dice);
    match calibrate(&spec, &records, &CalibrationSignal::Any, BLIND) {
        Ok(found) => assert!(found.misfit.is_some_and(|misfit| misfit > 2.0), "{:?}", found.misfit),
        Err(refused) => assert!(!matches!(refused, CalibrateError::AllAliasesOccupied { .. }), "{refused}"),
    }
}

/// The offsets of noise whose band covers none, one and three multiples of the slow rate.
#[test]
fn intervals_of_offsets_cover_where_the_signal_folds_onto_0_hertz() {
    let draws = if trials::is_slow("offsets of 100 draws") { 100 } else { 12 };
    for (ratio, band) in [(4, [0.02, 0.42]), (4, [0.02, 0.74]), (8, [0.02, 0.85])] {
        let delays: Vec<f64> = (0..ratio).rev().map(|i| i as f64).collect();
        let (spec, mut dice, mut scaled) = (spec(ratio, &delays), Random(17), Vec::new());
        for _ in 0..draws {
            let mut truth = with_errors(&spec, &mut dice);
            truth.channels.iter_mut().skip(1).for_each(|channel| channel.offset = 0.01 * dice.sample());
            let frames = 2048;
            let signal = noise_in_band(2 * frames * ratio, band.map(|edge| edge * PI), &mut dice);
            let records = captures(&truth, &signal, frames, 1e-3, &mut dice);
            let found = calibrate(&spec, &records, &CalibrationSignal::Any, BLIND).unwrap();
            let pairs = found.channels.iter().zip(&truth.channels).skip(1);
            scaled.extend(pairs.map(|(found, truth)| {
                let offset = found.offset.unwrap();
                (offset.value - truth.offset) / offset.sigma
            }));
        }
        assert_holds(&scaled, draws, &format!("offsets, band {band:?}"));
    }
}

/// Noise in a band far above 0 Hz, each frequency of which folds.
#[test]
fn intervals_cover_in_a_band_of_an_intermediate_frequency() {
    let draws = if trials::is_slow("an intermediate frequency of 100 draws") { 100 } else { 12 };
    let spec = in_band(4, &[3.0, 2.0, 1.0, 0.0], [0.265, 0.36]);
    let (mut dice, mut all) = (Random(18), Vec::new());
    for _ in 0..draws {
        let truth = with_errors(&spec, &mut dice);
        let signal = noise_in_band(2 * 2048 * 4, [0.53 * PI, 0.72 * PI], &mut dice);
        let records = captures(&truth, &signal, 2048, 1e-3, &mut dice);
        let found = calibrate(&spec, &records, &CalibrationSignal::Any, BLIND).unwrap();
        assert!(found.misfit.is_some_and(|misfit| misfit < 1.2), "{:?}", found.misfit);
        all.extend(scaled(&truth, &spec, &found));
    }
    assert_holds(&all, draws, "an intermediate frequency");
}

/// Two acquisitions tell more than each, and their intervals say so.
#[test]
fn acquisitions_of_any_signal_are_pooled() {
    let draws = if trials::is_slow("pooled acquisitions of 100 draws") { 100 } else { 12 };
    let (spec, mut dice, mut all) = (spec(4, &[3.0, 2.0, 1.0, 0.0]), Random(23), Vec::new());
    for _ in 0..draws {
        let mut truth = with_errors(&spec, &mut dice);
        truth.channels[2].offset = 0.01;
        let records = [0.3, 0.6].map(|high| {
            let signal = noise_in_band(2 * 1024 * 4, [0.0, high * PI], &mut dice);
            captures(&truth, &signal, 1024, 1e-3, &mut dice)
        });
        let both = [0, 1].map(|k| Acquisition { name: ["a", "b"][k], records: &records[k] });
        let fit =
            |all: &[Acquisition<'_>]| calibrate_pooled(&spec, all, &CalibrationSignal::Any, BLIND).unwrap();
        let found = fit(&both);
        let sigma = |found: &Calibration| found.channels[1].delay.unwrap().sigma.0;
        assert!(both.iter().all(|one| sigma(&fit(&[*one])) > sigma(&found)));
        all.extend(scaled(&truth, &spec, &found));
        let offset = found.channels[2].offset.unwrap();
        all.push((offset.value - 0.01) / offset.sigma);
    }
    assert_holds(&all, draws, "pooled acquisitions");
}
