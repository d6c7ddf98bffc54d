//! The follower on simulated recordings of clocks that drift, against the true delays.

use super::*;
use crate::design::Problem;
use crate::random::Random;
use crate::spec::Spec;
use crate::units::{Hertz, RadiansPerFastPeriod};
use std::f64::consts::TAU;

/// Two recorders of 48 kHz with a common low-pass.
fn spec(half: f64) -> Spec {
    let text = format!(
        "fast_rate = 96000.0\nratio = 2\nlatency = 10\n\
         target = {{ filter = {{ family = \"butterworth\", order = 4, cutoff = 20000.0 }} }}\n\
         channel = [{{ delay_samples = 0.0 }}, {{ delay_samples = 1.0 }}]\n\
         [uncertainty]\ndelay_samples = {half}\n"
    );
    Spec::from_toml(&text, "spec.toml").unwrap()
}

/// Clocks whose rates wander by so many ppm in a second.
fn settings(wander: f64) -> Tracking {
    Tracking { frames: 4096, wander }
}

/// A normal number by the sum of twelve uniform ones.
fn normal(random: &mut Random) -> f64 {
    (0..12).map(|_| random.part()).sum::<f64>() - 6.0
}

const PERIOD: f64 = 1.0 / 48_000.0;

/// Blocks of a tone in both recorders, in closed form: the second one is late by `delay(t)` seconds.
fn block(
    spec: &Spec,
    number: usize,
    tone: f64,
    noise: f64,
    delay: impl Fn(f64) -> f64,
    random: &mut Random,
) -> Vec<Vec<f64>> {
    let problem = Problem::new(spec, 10).unwrap();
    let w = RadiansPerFastPeriod(TAU * tone / 96_000.0);
    let response = problem.front_ends[0].response(w);
    let amplitude = 0.5 * response.norm();
    let sample = |k: usize, late: f64, random: &mut Random| {
        let phase = TAU * tone * (k as f64 * PERIOD - late) + response.arg();
        amplitude * phase.cos() + noise * normal(random)
    };
    let frames = number * 4096..(number + 1) * 4096;
    let first = frames.clone().map(|k| sample(k, 0.0, random)).collect();
    let second = frames.map(|k| sample(k, delay(k as f64 * PERIOD), random)).collect();
    vec![first, second]
}

/// A clock whose rate changes by 10 ppm in each second, at 60 dB: followed within 1.5 times what the filter
/// says of itself.
#[test]
fn ten_ppm_per_second_are_followed_within_the_prediction() {
    let (spec, mut random) = (spec(0.9), Random(4));
    let nominal = spec.channels[1].delay.0;
    let delay = |t: f64| nominal - 4e-6 + 0.5 * 1e-5 * (t - 0.4) * (t - 0.4);
    // The rate moves by 10 ppm in a second, so by that times a block between two measurements.
    let step = 1e-5 * (4096.0 * PERIOD).sqrt();
    let mut follower = Follower::new(&spec, DelaySource::Pilot(Hertz(7000.0)), settings(1e6 * step)).unwrap();
    let (mut square, mut predicted, mut count) = (0.0, 0.0, 0);
    // 60 dB for a tone of amplitude 1/2, whose mean square is 1/8.
    let noise = (0.125e-6f64).sqrt();
    for number in 0..20 {
        let found = follower.follow(&block(&spec, number, 7000.0, noise, delay, &mut random));
        assert_eq!(found.log.held, None);
        let at = (number as f64 + 0.5) * 4096.0 * PERIOD - 0.5 * PERIOD;
        if number >= 6 {
            square += (found.log.delay[1].0 - delay(at)).powi(2);
            predicted += (found.log.half_width[1].0 / 1.96).powi(2);
            count += 1;
            assert_eq!(found.log.lock[1], Lock::Locked);
        }
    }
    let ratio = f64::sqrt(square / predicted);
    assert!(count == 14 && ratio < 1.5, "{ratio}");
}

/// The pilot's error is that of the Cramér-Rao bound: sqrt(2 / (N SNR)) / w for the difference of two
/// phases.
#[test]
fn a_pilot_is_measured_at_the_bound() {
    let (spec, mut random) = (spec(0.9), Random(7));
    let (tone, noise, blocks) = (9100.0, 1e-3, 60);
    let source = DelaySource::Pilot(Hertz(tone));
    let truth = spec.channels[1].delay.0 + 2e-6;
    let (mut square, mut stated) = (0.0, 0.0);
    let problem = Problem::new(&spec, 10).unwrap();
    for number in 0..blocks {
        let samples = block(&spec, number, tone, noise, |_| truth, &mut random);
        let found = source.measure(&spec, 0, &samples).unwrap();
        let measured = found[1].unwrap();
        square += (measured.delay.0 - truth).powi(2);
        stated += measured.variance;
        assert!(found[0].is_none());
    }
    let amplitude = 0.5 * problem.front_ends[0].response(RadiansPerFastPeriod(TAU * tone / 96e3)).norm();
    let bound = (2.0 / (4096.0 * amplitude * amplitude / (2.0 * noise * noise))).sqrt() / (TAU * tone);
    assert!((stated / blocks as f64).sqrt() / bound < 1.02, "{stated} {bound}");
    // 60 squares have a standard deviation of 18 %.
    let rms = (square / blocks as f64).sqrt();
    assert!(rms / bound < 1.3 && rms / bound > 0.7, "{rms:e} {bound:e}");
}

#[test]
fn silence_holds_the_delays_and_a_tone_takes_them_up_again() {
    let (spec, mut random) = (spec(0.9), Random(9));
    let delay = |t: f64| spec.channels[1].delay.0 + 1e-6 + 2e-6 * t;
    let mut follower = Follower::new(&spec, DelaySource::Pilot(Hertz(5000.0)), settings(1.0)).unwrap();
    let mut logs = Vec::new();
    for number in 0..20 {
        let samples = if (8..12).contains(&number) {
            vec![vec![0.0; 4096]; 2]
        } else {
            block(&spec, number, 5000.0, 1e-4, delay, &mut random)
        };
        logs.push(follower.follow(&samples).log);
    }
    for (number, log) in logs.iter().enumerate() {
        let is_silent = (8..12).contains(&number);
        assert_eq!(log.held.as_deref(), is_silent.then_some("silence"), "{number}");
        let at = (number as f64 + 0.5) * 4096.0 * PERIOD - 0.5 * PERIOD;
        if number > 4 {
            let error = (log.delay[1].0 - delay(at)).abs();
            assert!(error < 3.0 * log.half_width[1].0, "{number} {error:e} {log:?}");
            assert!((log.rate_ppm[1] - 2.0).abs() < 0.5, "{log:?}");
        }
    }
    assert!(
        logs[11].half_width[1] > logs[8].half_width[1] * 1.5
            && logs[13].half_width[1] < logs[11].half_width[1]
    );
}

/// Readings give what was measured elsewhere; a log is a file of readings.
#[test]
fn a_log_is_read_again() {
    let (spec, mut random) = (spec(0.9), Random(10));
    let delay = |_| spec.channels[1].delay.0 - 1.5e-6;
    let mut first = Follower::new(&spec, DelaySource::Pilot(Hertz(5000.0)), settings(1.0)).unwrap();
    let mut lines = String::new();
    for number in 0..5 {
        let found = first.follow(&block(&spec, number, 5000.0, 1e-4, delay, &mut random));
        lines += &(serde_json::to_string(&found.log).unwrap() + "\n");
    }
    let readings = Reading::parse(&lines, "log.jsonl", 2).unwrap();
    let mut second = Follower::new(&spec, DelaySource::Readings(readings), settings(1.0)).unwrap();
    for number in 0..6 {
        let log = second.follow(&vec![vec![0.0; 4096]; 2]).log;
        assert_eq!(log.held.is_some(), number == 5, "{log:?}");
        assert!((log.delay[1].0 - delay(0.0)).abs() < 1e-8, "{log:?}");
    }
}

/// A table of the drift of a clock whose rate changes by 10 ppm in each second, a line in four blocks. A
/// filter of the lines goes on straight for up to six blocks after one, which is 0.1 fast periods off.
#[test]
fn a_known_drift_is_followed_between_its_readings() {
    let spec = spec(0.9);
    let nominal = spec.channels[1].delay.0;
    let delay = |t: f64| nominal - 5e-6 + 0.5 * 1e-5 * (t - 0.8) * (t - 0.8);
    let line = |k: u64| {
        let (frame, delay) = (k * 16_384, delay(k as f64 * 16_384.0 * PERIOD));
        format!("{{\"frame\": {frame}, \"delay\": [0, {delay}], \"half_width\": 2e-11}}\n")
    };
    let lines: String = (0..8).map(line).collect();
    let readings = Reading::parse(&lines, "d.jsonl", 2).unwrap();
    let mut follower = Follower::new(&spec, DelaySource::Readings(readings), settings(10.0)).unwrap();
    for number in 0..26 {
        let found = follower.follow(&vec![vec![0.0; 4096]; 2]);
        let at = (number as f64 + 0.5) * 4096.0 * PERIOD - 0.5 * PERIOD;
        let error = (found.log.delay[1].0 - delay(at)).abs();
        let bound = found.log.bound.unwrap()[1].unwrap().0;
        assert!(error < bound && bound < 8e-7, "{number}: {error:e} {bound:e}");
    }
}

#[test]
fn delays_that_come_together_are_reported_once() {
    let spec = spec(0.9);
    // The delay of channel 2 falls from 1 fast period to that of channel 1.
    let line = |block: u64| {
        let delay = spec.channels[1].delay.0 - 2e-6 * block as f64;
        format!("{{\"frame\": {}, \"delay\": [0, {delay}], \"half_width\": 1e-9}}\n", block * 4096 + 2048)
    };
    let lines: String = (0..8).map(line).collect();
    let readings = Reading::parse(&lines, "d.jsonl", 2).unwrap();
    let mut follower = Follower::new(&spec, DelaySource::Readings(readings), settings(1.0)).unwrap();
    let warnings: Vec<TrackWarning> =
        (0..8).flat_map(|_| follower.follow(&vec![vec![0.0; 4096]; 2]).warnings).collect();
    assert!(matches!(warnings[..], [TrackWarning::Coincidence { channels: [1, 2], .. }]), "{warnings:?}");
    assert!(warnings[0].to_string().contains("one instant"));
}

#[test]
fn what_cannot_be_followed_is_refused() {
    let spec = spec(0.5);
    let refused = |spec: &Spec, source| Follower::new(spec, source, settings(1.0)).unwrap_err();
    let certain = Spec { uncertainty: None, ..spec.clone() };
    assert_eq!(refused(&certain, DelaySource::AnySignal), TrackError::NoUncertainDelay);
    let pilot = refused(&spec, DelaySource::Pilot(Hertz(24_000.0)));
    assert!(matches!(pilot, TrackError::PilotPosition { frames: 4096, .. }), "{pilot}");
    let short = Tracking { frames: 100, ..settings(1.0) };
    let few = Follower::new(&spec, DelaySource::AnySignal, short).unwrap_err();
    assert_eq!(few, TrackError::Frames { given: 100, least: 256 });
    let still = Follower::new(&spec, DelaySource::AnySignal, settings(0.0)).unwrap_err();
    assert_eq!(still, TrackError::Wander { given: 0.0 });
}
