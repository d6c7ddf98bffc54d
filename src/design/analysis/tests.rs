use super::*;
use crate::bank::SynthesisFilters;
use crate::linalg::{self, Complex};
use crate::spec::Spec;
use crate::units::Seconds;
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

/// The mean square over time is that over frequencies (Parseval), and the worst case is no smaller than any
/// of them.
#[test]
fn the_error_is_that_of_its_frequency_response() {
    let bank = bank();
    let plant = LiftedPlant::new(&bank_problem(&bank).unwrap()).unwrap();
    let error = plant.error_system(&filters::lifted(&bank.filters, 2).unwrap()).unwrap();
    let count = 4096;
    let response = |k: usize| error.response_at(Complex::from_polar(1.0, 2.0 * PI * k as f64 / count as f64));
    let (mut square, mut most) = (0.0, 0.0f64);
    for k in 0..count {
        let k = response(k);
        square += k.norm_squared();
        most = most.max(linalg::singular_values(&k).unwrap()[0]);
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
