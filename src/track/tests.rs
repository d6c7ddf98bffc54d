//! The follower on simulated recordings of clocks that drift, against the true delays.

use super::tracker::FollowSettings;
use super::*;
use crate::bank::{Bank, SynthesisFilters, TapSlopes};
use crate::design::Problem;
use crate::random::Random;
use crate::spec::Spec;
use crate::units::{FastPeriods, Hertz, RadiansPerFastPeriod, Seconds};
use std::f64::consts::TAU;

/// Two recorders of 48 kHz with a common low-pass. The taps do not matter here.
fn bank(half: f64) -> Bank {
    let text = format!(
        "fast_rate = 96000.0\nratio = 2\nlatency = 10\n\
         target = {{ filter = {{ family = \"butterworth\", order = 4, cutoff = 20000.0 }} }}\n\
         channel = [{{ delay_samples = 0.0 }}, {{ delay_samples = 1.0 }}]\n\
         design = {{ method = \"fir\", taps = 4, tracking = \"affine\" }}\n\
         [uncertainty]\ndelay_samples = {half}\n"
    );
    let spec = Spec::from_toml(&text, "spec.toml").unwrap();
    let slopes = vec![vec![], vec![vec![0.0; 4]; 2]];
    Bank {
        fast_period: spec.fast_period,
        latency: 10,
        delays: spec.channels.iter().map(|channel| channel.delay).collect(),
        tap_slopes: Some(TapSlopes { by_delay: slopes }),
        spec: Some(spec),
        ..Bank::bare(SynthesisFilters::Fir(vec![vec![0.0; 4]; 2]), 2)
    }
}

fn settings(wander: f64) -> FollowSettings {
    let rate_walk = wander * wander;
    FollowSettings { block_frames: 4096, rate_walk, rate_deviation: 1e-4, rate_change: wander }
}

/// A normal number by the sum of twelve uniform ones.
fn normal(random: &mut Random) -> f64 {
    (0..12).map(|_| random.part()).sum::<f64>() - 6.0
}

const PERIOD: f64 = 1.0 / 48_000.0;

/// Blocks of a tone in both recorders, in closed form: the second one is late by `delay(t)` seconds.
fn block(
    bank: &Bank,
    number: usize,
    tone: f64,
    noise: f64,
    delay: impl Fn(f64) -> f64,
    random: &mut Random,
) -> Vec<Vec<f64>> {
    let problem = Problem::new(bank.spec.as_ref().unwrap(), 10).unwrap();
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
    let (bank, mut random) = (bank(0.9), Random(4));
    let nominal = bank.delays[1].0;
    let delay = |t: f64| nominal - 4e-6 + 0.5 * 1e-5 * (t - 0.4) * (t - 0.4);
    // The rate moves by 10 ppm in a second, so by that times a block between two measurements.
    let step = 1e-5 * (4096.0 * PERIOD).sqrt();
    let mut follower = Follower::new(&bank, DelaySource::Pilot(Hertz(7000.0)), settings(step)).unwrap();
    let (mut square, mut predicted, mut count) = (0.0, 0.0, 0);
    // 60 dB for a tone of amplitude 1/2, whose mean square is 1/8.
    let noise = (0.125e-6f64).sqrt();
    for number in 0..20 {
        let found = follower.follow(&block(&bank, number, 7000.0, noise, delay, &mut random));
        assert_eq!(found.log.held, None);
        let at = (number as f64 + 0.5) * 4096.0 * PERIOD - 0.5 * PERIOD;
        if number >= 6 {
            square += (found.log.delay[1].0 - delay(at)).powi(2);
            predicted += (found.log.half_width[1].0 / 1.96).powi(2);
            count += 1;
            assert_eq!(found.log.lock[1], Lock::Locked);
        }
        // The taps of the block after the next one are for the delays of then, up to 2.5 blocks or 0.213 s
        // ahead, in which the change of the rate moves the delay by 0.022 fast periods.
        if number >= 6 {
            for change in found.changes.iter().step_by(16) {
                let then = ((number + 2) * 4096 + change.frame) as f64 * PERIOD;
                let error = Seconds(change.errors[1].0 / 96_000.0 + nominal - delay(then));
                assert!(error.0.abs() < 0.03 / 96_000.0, "{number} {change:?} {error:?}");
            }
        }
    }
    let ratio = f64::sqrt(square / predicted);
    assert!(count == 14 && ratio < 1.5, "{ratio}");
}

/// A clock that is fast by 60 ppm passes many slow periods: the frames are shifted, and what is left is the
/// delay within the box.
#[test]
fn a_delay_of_many_periods_is_followed_by_shifts() {
    let (bank, mut random) = (bank(1.05), Random(5));
    let nominal = bank.delays[1].0;
    let delay = |t: f64| nominal + 60e-6 * t;
    let mut follower = Follower::new(&bank, DelaySource::Pilot(Hertz(7000.0)), settings(1e-6)).unwrap();
    let mut shifts = vec![0; 2];
    let mut largest = 0;
    for number in 0..45 {
        // Sample k + s of the second channel, at the frame k.
        let ahead = shifts.remove(0) as f64 * PERIOD;
        let found =
            follower.follow(&block(&bank, number, 7000.0, 1e-4, |t| delay(t + ahead) - ahead, &mut random));
        shifts.push(found.changes[0].shifts[1]);
        assert_eq!(found.log.shift[1] as f64 * PERIOD, ahead);
        let at = (number as f64 + 0.5) * 4096.0 * PERIOD - 0.5 * PERIOD;
        let is_box_left = |w: &TrackWarning| matches!(w, TrackWarning::OutsideTheBox { .. });
        assert!(!found.warnings.iter().any(is_box_left), "{number} {:?}", found.warnings);
        if number < 6 {
            continue;
        }
        // The delay is that of sample k + s: 60 ppm of the shift later than that of sample k.
        assert!((found.log.delay[1].0 - delay(at + ahead)).abs() < 1e-8, "{number} {:?}", found.log);
        for change in &found.changes {
            let then = ((number + 2) * 4096 + change.frame) as f64 * PERIOD;
            let ahead = change.shifts[1] as f64 * PERIOD;
            let error = change.errors[1].0 / 96_000.0 + nominal + ahead - delay(then + ahead);
            assert!(error.abs() < 0.03 / 96_000.0, "{number} {change:?} {error:e}");
            assert!(change.errors[1].0.abs() < 1.05 && change.shifts[0] == 0, "{change:?}");
            assert!(change.shifts[1] >= largest, "shifted back: {change:?}");
            largest = change.shifts[1];
        }
    }
    // 47 blocks of 85 ms, at 60 ppm.
    assert!((10..=12).contains(&largest), "{largest}");
}

/// The pilot's error is that of the Cramér-Rao bound: sqrt(2 / (N SNR)) / w for the difference of two
/// phases.
#[test]
fn a_pilot_is_measured_at_the_bound() {
    let (bank, mut random) = (bank(0.9), Random(7));
    let (tone, noise, blocks) = (9100.0, 1e-3, 60);
    let source = DelaySource::Pilot(Hertz(tone));
    let spec = bank.spec.clone().unwrap();
    let truth = bank.delays[1].0 + 2e-6;
    let (mut square, mut stated) = (0.0, 0.0);
    let problem = Problem::new(&spec, 10).unwrap();
    for number in 0..blocks {
        let samples = block(&bank, number, tone, noise, |_| truth, &mut random);
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
    let (bank, mut random) = (bank(0.9), Random(9));
    let delay = |t: f64| bank.delays[1].0 + 1e-6 + 2e-6 * t;
    let mut follower = Follower::new(&bank, DelaySource::Pilot(Hertz(5000.0)), settings(1e-6)).unwrap();
    let mut logs = Vec::new();
    for number in 0..20 {
        let samples = if (8..12).contains(&number) {
            vec![vec![0.0; 4096]; 2]
        } else {
            block(&bank, number, 5000.0, 1e-4, delay, &mut random)
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
    let (bank, mut random) = (bank(0.9), Random(10));
    let delay = |_| bank.delays[1].0 - 1.5e-6;
    let mut first = Follower::new(&bank, DelaySource::Pilot(Hertz(5000.0)), settings(1e-6)).unwrap();
    let mut lines = String::new();
    for number in 0..5 {
        let found = first.follow(&block(&bank, number, 5000.0, 1e-4, delay, &mut random));
        lines += &(serde_json::to_string(&found.log).unwrap() + "\n");
    }
    let readings = Reading::parse(&lines, "log.jsonl", 2).unwrap();
    let mut second = Follower::new(&bank, DelaySource::Readings(readings), settings(1e-6)).unwrap();
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
    let bank = bank(0.9);
    let nominal = bank.delays[1].0;
    let delay = |t: f64| nominal - 5e-6 + 0.5 * 1e-5 * (t - 0.8) * (t - 0.8);
    let line = |k: u64| {
        let (frame, delay) = (k * 16_384, delay(k as f64 * 16_384.0 * PERIOD));
        format!("{{\"frame\": {frame}, \"delay\": [0, {delay}], \"half_width\": 2e-11}}\n")
    };
    let lines: String = (0..8).map(line).collect();
    let readings = Reading::parse(&lines, "d.jsonl", 2).unwrap();
    let mut follower = Follower::new(&bank, DelaySource::Readings(readings), settings(1e-5)).unwrap();
    let mut worst = 0.0_f64;
    for number in 0..26 {
        let found = follower.follow(&vec![vec![0.0; 4096]; 2]);
        let at = (number as f64 + 0.5) * 4096.0 * PERIOD - 0.5 * PERIOD;
        let error = (found.log.delay[1].0 - delay(at)).abs();
        let bound = found.log.bound.unwrap()[1].unwrap().0;
        assert!(error < bound && bound < 8e-7, "{number}: {error:e} {bound:e}");
        for pair in found.changes.windows(2) {
            // Each change suits the middle of the frames until the next one.
            let then = 0.5 * (pair[0].frame + pair[1].frame) as f64 - 0.5;
            let then = ((number + 2) as f64 * 4096.0 + then) * PERIOD;
            worst = worst.max((pair[0].errors[1].0 / 96_000.0 + nominal - delay(then)).abs());
        }
    }
    assert!(worst < 0.01 / 96_000.0, "{:.4} fast periods", worst * 96_000.0);
}

#[test]
fn delays_that_leave_the_box_or_come_together_are_reported_once() {
    let bank = bank(0.9);
    // The delay of channel 2 falls from 1 fast period to that of channel 1, beyond the box.
    let line = |block: u64| {
        let delay = bank.delays[1].0 - 2e-6 * block as f64;
        format!("{{\"frame\": {}, \"delay\": [0, {delay}], \"half_width\": 1e-9}}\n", block * 4096 + 2048)
    };
    let lines: String = (0..8).map(line).collect();
    let readings = Reading::parse(&lines, "d.jsonl", 2).unwrap();
    let mut follower = Follower::new(&bank, DelaySource::Readings(readings), settings(1e-6)).unwrap();
    let mut warnings = Vec::new();
    for _ in 0..8 {
        let found = follower.follow(&vec![vec![0.0; 4096]; 2]);
        let most = FastPeriods(0.9 + 1e-9);
        assert!(found.changes.iter().all(|change| change.errors[1].0.abs() <= most.0), "{found:?}");
        warnings.extend(found.warnings);
    }
    let is = |warning: &TrackWarning| match warning {
        TrackWarning::OutsideTheBox { channel: 2, .. } => 1,
        TrackWarning::Coincidence { channels: [1, 2], .. } => 2,
        _ => 0,
    };
    let mut kinds: Vec<i32> = warnings.iter().map(is).collect();
    kinds.sort_unstable();
    assert_eq!(kinds, [1, 2], "{warnings:?}");
    assert!(warnings.iter().any(|warning| warning.to_string().contains("one instant")));
}

#[test]
fn what_cannot_be_followed_is_refused() {
    let bank = bank(0.5);
    let refused = |bank: &Bank, source| Follower::new(bank, source, settings(1e-6)).unwrap_err();
    assert_eq!(
        refused(&Bank { tap_slopes: None, ..bank.clone() }, DelaySource::AnySignal),
        TrackError::NoTapSlopes
    );
    assert_eq!(refused(&Bank { spec: None, ..bank.clone() }, DelaySource::AnySignal), TrackError::NoSpec);
    let iir = include_str!("../../filters/thesis-iir.json");
    assert_eq!(
        refused(&Bank::from_json(iir, "b.json").unwrap(), DelaySource::AnySignal),
        TrackError::Recursive
    );
    let pilot = refused(&bank, DelaySource::Pilot(Hertz(24_000.0)));
    assert!(matches!(pilot, TrackError::PilotPosition { frames: 4096, .. }), "{pilot}");
}
