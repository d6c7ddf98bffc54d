use super::*;
use crate::tests::{after_thesis_filter, designed};
use hybank_core::bank::SynthesisFilters;
use hybank_core::spec::{Band, SignalSpec, Spec};
use hybank_core::units::Seconds;
use hybank_linalg::Complex;
use hybank_runtime::{Precision, Stream};
use proptest::prelude::*;
use std::f64::consts::PI;

/// A bank of arbitrary taps on the thesis example; the second channel has noise.
fn bank() -> Bank {
    let text = "fast_period = 0.5\nratio = 2\nlatency = 4\n\
        target = { filter = { num = [1.0], den = [1.0, 2.0, 1.0] } }\n\
        channel = [{ delay = 0.6 }, { delay = 0.3, noise = 0.25 }]\n\
        design = { method = \"fir\", taps = 7 }";
    let spec = Spec::from_toml(text, "spec.toml").unwrap();
    let tap = |i: usize, n: usize| ((1 + i * 5 + n * 3) as f64).sin() * 0.4;
    let taps = (0..2).map(|i| (0..7).map(|n| tap(i, n)).collect()).collect();
    let bare = Bank::bare(SynthesisFilters::Fir(taps), 2);
    Bank {
        fast_period: Seconds(0.5),
        latency: 4,
        delays: vec![Seconds(0.6), Seconds(0.3)],
        spec: Some(spec),
        ..bare
    }
}

fn power(taps: &[f64]) -> f64 {
    taps.iter().map(|tap| tap * tap).sum()
}

#[test]
fn noise_gains_are_sums_of_squared_taps() {
    let bank = bank();
    let SynthesisFilters::Fir(taps) = &bank.filters else { unreachable!() };
    let mean = analyze_mean(&bank).unwrap();
    let want = ((power(&taps[0]) + power(&taps[1])) / 2.0).sqrt();
    assert!((mean.noise_gain - want).abs() < 1e-13, "{} {want}", mean.noise_gain);
    let want = 0.25 * (power(&taps[1]) / 2.0).sqrt();
    assert!((mean.output_noise - want).abs() < 1e-13, "{} {want}", mean.output_noise);
}

/// The noise at the output of the running bank, whatever the rms of the signal that the spec states.
#[test]
fn the_output_noise_is_that_of_the_running_bank() {
    let mut random = trials::random::Random(3);
    // Of unit power.
    let noise: Vec<f64> = (0..40_000).map(|_| 3f64.sqrt() * random.sample()).collect();
    let frames: Vec<f64> = noise.iter().flat_map(|x| [0.0, 0.25 * x]).collect();
    let options = hybank_runtime::Options { precision: Precision::Double, ..Default::default() };
    for rms in [None, Some(0.05), Some(0.5)] {
        let mut bank = bank();
        let spec = bank.spec.as_mut().unwrap();
        spec.signal = rms.map(|rms| SignalSpec { rms, ..SignalSpec::in_band(Band::up_to(Hertz(0.4))) });
        let mut output = vec![0.0; 2 * noise.len()];
        Stream::new(&bank.plan(options).unwrap()).process(&frames, &mut output).unwrap();
        let measured = (power(&output) / output.len() as f64).sqrt();
        let told = analyze_mean(&bank).unwrap().output_noise;
        assert!((told / measured - 1.0).abs() < 0.02, "{rms:?}: {told} {measured}");
    }
}

/// The mean square over time is that over frequencies (Parseval), and the worst case is no smaller than any
/// of them.
#[test]
fn the_error_is_that_of_its_frequency_response() {
    let bank = bank();
    let plant = LiftedPlant::new(&Problem::of_bank(&bank).unwrap());
    let error = plant.error_system(&filters::lifted(&bank.filters, 2));
    let count = 4096;
    let response = |k: usize| error.response_at(Complex::from_polar(1.0, 2.0 * PI * k as f64 / count as f64));
    let (mut square, mut most) = (0.0, 0.0f64);
    for k in 0..count {
        let k = response(k);
        square += k.norm_squared();
        most = most.max(hybank_linalg::singular_values(&k).unwrap()[0]);
    }
    let found = analyze(&bank, &[]).unwrap();
    let rms = (square / count as f64 / 2.0).sqrt();
    assert!((found.mean.rms_error / rms - 1.0).abs() < 1e-9, "{} {rms}", found.mean.rms_error);
    assert!(most <= found.gamma * (1.0 + 1e-12) && most > found.gamma * (1.0 - 1e-5), "{most} {found:?}");
    assert!(found.noncausal.unwrap() <= found.gamma);
}

/// Nothing is stated of what doubles do not resolve.
#[test]
fn the_noncausal_bound_of_nearly_equal_delays_is_unknown() {
    let found = analyze(&bank(), &[Seconds(0.0), Seconds(0.3 + 1e-12)]).unwrap();
    assert_eq!(found.noncausal, None);
}

#[test]
fn delay_errors_move_the_samples() {
    let bank = bank();
    let moved = analyze(&bank, &[Seconds(0.05), Seconds(-0.1)]).unwrap();
    let mut there = bank.clone();
    let spec = there.spec.as_mut().unwrap();
    (spec.channels[0].delay, spec.channels[1].delay) = (Seconds(0.65), Seconds(0.2));
    let same = analyze(&there, &[]).unwrap();
    assert!((moved.gamma / same.gamma - 1.0).abs() < 1e-9, "{moved:?} {same:?}");
    let refused = analyze(&bank, &[Seconds(0.1)]).unwrap_err();
    assert_eq!(refused, DesignError::DelayErrorCount { given: 1, channels: 2 });
    assert_eq!(analyze(&Bank { spec: None, ..bank }, &[]).unwrap_err(), DesignError::NoSpec);
}

fn recursive_bank(channels: &str, latency: usize) -> Bank {
    designed(&after_thesis_filter(2, latency, channels, "method = \"iir\"")).bank
}

/// Converters that sample exactly in turn have the ideal samples: plain interleaving makes no error.
#[test]
fn interleaving_of_perfect_converters_is_exact() {
    for latency in [1, 2, 7] {
        let bank = recursive_bank("{ delay = 1.0 }, { delay = 0.0 }", latency);
        let scale = GammaScale::new(&bank, &[]).unwrap();
        assert!(scale.interleaving < 1e-12, "{latency}: {scale:?}");
    }
}

/// The gain to the lifted reference is largest at frequency 0, where all of its M samples agree: it is
/// the norm of the samples of |Phi|^2 that alias there, sum_k |Phi(2 pi k)|^2.
#[test]
fn the_gamma_of_zero_output_is_that_of_the_aliases_of_the_reference() {
    let scale = GammaScale::new(&recursive_bank("{ delay = 1.2 }, { delay = 0.6 }", 4), &[]).unwrap();
    let phi = |w: f64| 0.25 / (w * w + 0.25);
    let sum: f64 = (-2000..=2000).map(|k| phi(std::f64::consts::TAU * f64::from(k)).powi(2)).sum();
    assert!((scale.zero_output - sum.sqrt()).abs() < 1e-9, "{scale:?} {}", sum.sqrt());
    // int |Phi|^2 dw / 2 pi = wc / 4 for wc^2 / (s + wc)^2.
    assert!((scale.rms_reference - (0.5_f64 / 4.0).sqrt()).abs() < 1e-12, "{scale:?}");
    assert!(scale.interleaving < scale.zero_output && scale.interleaving > 0.04, "{scale:?}");
}

#[test]
fn the_taps_pick_the_nearest_samples() {
    let bank = recursive_bank("{ delay = 1.4 }, { delay = 0.2 }", 3);
    let taps = interleaving(&Problem::of_bank(&bank).unwrap());
    // Instants -3 and -2: the samples at -3.4 and -2.2.
    assert_eq!(taps, [vec![0.0, 0.0, 1.0, 0.0], vec![0.0, 0.0, 0.0, 1.0]]);
}

fn nearest(delays: &[f64], ratio: usize, latency: usize, least_lag: i64) -> Vec<(usize, i64)> {
    let delays: Vec<_> = delays.iter().copied().map(FastPeriods).collect();
    let samples = nearest_samples(&delays, ratio, latency, least_lag);
    samples.into_iter().map(|sample| (sample.channel, sample.lag)).collect()
}

#[test]
fn each_phase_has_the_nearest_sample() {
    // Instants -3 and -2; of the last period the samples at -3.4 and -2.2.
    assert_eq!(nearest(&[1.4, 0.2], 2, 3, 0), [(0, 1), (1, 1)]);
}

#[test]
fn a_causal_bank_has_no_sample_of_the_future() {
    // Instant 1 of frame 0: the nearest sample is taken at 1.5, the next period's.
    assert_eq!(nearest(&[0.5], 2, 0, i64::MIN), [(0, 0), (0, -1)]);
    assert_eq!(nearest(&[0.5], 2, 0, 0), [(0, 0), (0, 0)]);
    assert_eq!(nearest(&[], 2, 0, 0), []);
}

proptest! {
    /// Against a search of all samples within ten periods.
    #[test]
    fn no_sample_is_nearer(
        delays in prop::collection::vec(-9.0..9.0, 1..5),
        ratio in 1usize..6,
        latency in 0usize..9,
    ) {
        for (phase, (channel, lag)) in nearest(&delays, ratio, latency, i64::MIN).into_iter().enumerate() {
            let instant = phase as f64 - latency as f64;
            let distance = |i: usize, lag: i64| (instant + (lag * ratio as i64) as f64 + delays[i]).abs();
            let all = (0..delays.len()).flat_map(|i| (-30..30).map(move |lag| (i, lag)));
            let least = all.map(|(i, lag)| distance(i, lag)).fold(f64::INFINITY, f64::min);
            prop_assert!(distance(channel, lag) <= least + 1e-12);
        }
    }
}
