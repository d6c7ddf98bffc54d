//! A latency that the spec leaves open, against designs at every latency: of FIR banks that of the least
//! error, of recursive ones the shortest whose whole error, that of the signal and the rounding to 16 bits,
//! is within 0.1 dB of the best.

use crate::support::specs::{alike, butterworth};
use crate::support::{design, designed};
use hybank::design::{DesignError, Sizing, analyze_mean};
use hybank::spec::{DesignSpec, Method, Spec};
use std::f64::consts::TAU;

/// What "within 0.1 dB" means, and how exactly errors are compared.
const WORTHWHILE: f64 = 0.01158;
const COMPARED: f64 = 2e-4;
/// Rms of the rounding to 16 bits.
const ROUNDING: f64 = 8.809_7e-6;

/// The latency that is chosen for a spec.
fn latency(spec: &Spec) -> Result<usize, DesignError> {
    Sizing::of(spec).map(|sizing| sizing.latency)
}

/// The least whole error of a bank of the same length, for a method that minimises something else too;
/// infinite where there is no bank.
fn error(spec: &Spec, latency: usize) -> f64 {
    let mut spec = Spec { latency: Some(latency), ..spec.clone() };
    if !spec.is_fir() {
        spec.channels.iter_mut().for_each(|channel| channel.noise = ROUNDING);
    }
    if matches!(spec.design.method, Method::Fir | Method::Iir) {
        spec.design =
            DesignSpec { order: spec.design.order, ..DesignSpec::new(Method::H2, spec.design.taps) };
    }
    match design(&spec) {
        Ok(found) => {
            let mean = analyze_mean(&found).unwrap();
            mean.rms_error.hypot(mean.output_noise)
        }
        Err(DesignError::OutOfReach { .. } | DesignError::RiccatiFailed { .. }) => f64::INFINITY,
        Err(other) => panic!("latency {latency}: {other}"),
    }
}

/// The errors of all latencies that can be the choice.
fn errors(spec: &Spec) -> Vec<f64> {
    errors_up_to(spec, 16)
}

/// The errors up to so many slow periods beyond the longest delay, or to the last sample that taps see.
fn errors_up_to(spec: &Spec, periods: usize) -> Vec<f64> {
    let longest = spec.channels.iter().map(|channel| channel.delay.0.ceil() as usize).max().unwrap_or(0);
    let last = spec.design.taps.map_or(longest + periods * spec.ratio, |taps| longest + taps);
    (0..=last).map(|latency| error(spec, latency)).collect()
}

/// What is wrong with the choice.
fn fault(spec: &Spec, errors: &[f64], chosen: usize) -> Option<String> {
    let best = errors.iter().copied().fold(f64::INFINITY, f64::min);
    let worthwhile = if spec.is_fir() { 0.0 } else { WORTHWHILE };
    let enough = best * (1.0 + worthwhile + COMPARED);
    if errors[chosen] > enough {
        let least = errors.iter().position(|error| *error == best).unwrap_or_default();
        let times = errors[chosen] / best;
        return Some(format!("latency {chosen} has {times} times the best, {best:e} at {least}"));
    }
    let surely = best * (1.0 + worthwhile - COMPARED);
    let shorter = errors[..chosen].iter().position(|error| *error <= surely)?;
    Some(format!("latency {shorter} has {:e}, {chosen} has {:e}", errors[shorter], errors[chosen]))
}

/// They minimise nothing: the output instant lies in the middle of the samples that their taps see.
#[test]
fn comparison_methods_take_the_middle_of_their_taps() {
    for method in [Method::Sinc, Method::Separation] {
        let spec = alike(&butterworth(6, TAU * 9.0 / 48.0), 2, 0, &[1.2, 0.3]);
        let spec = Spec { latency: None, design: DesignSpec::new(method, Some(15)), ..spec };
        let (errors, chosen) = (errors(&spec), latency(&spec).unwrap());
        let best = errors.iter().copied().fold(f64::INFINITY, f64::min);
        assert!(errors[chosen] < 1.5 * best, "{}: {chosen} of {errors:?}", method.name());
    }
}

/// 48 kHz from four 12 kHz converters.
fn four_at_48_khz(taps: usize) -> Spec {
    let spec = alike(&butterworth(6, TAU * 9.0 / 48.0), 4, 0, &[3.1, 1.9, 1.05, 0.0]);
    Spec { latency: None, design: DesignSpec::new(Method::Fir, Some(taps)), ..spec }
}

/// Half of the taps was the rule once: gamma 0.111 with 8 taps.
#[test]
fn the_latency_is_not_the_middle_of_the_taps() {
    let short = four_at_48_khz(8);
    assert_eq!(latency(&short), Ok(5));
    let gamma = gamma(&short, 5);
    assert!((gamma - 0.0011).abs() < 5e-5, "{gamma}");
}

#[test]
fn interleaved_converters_need_three_samples_of_latency() {
    let text = include_str!("../../filters/interleaved-4x250M.toml");
    let mut spec = Spec::from_toml(text, "interleaved-4x250M.toml").unwrap();
    (spec.signal, spec.latency) = (None, None);
    spec.design.taps = Some(8);
    assert_eq!(latency(&spec), Ok(3));
    assert_eq!(fault(&spec, &errors(&spec), 3), None);
}

fn gamma(spec: &Spec, latency: usize) -> f64 {
    designed(&Spec { latency: Some(latency), ..spec.clone() }).gamma.norm.unwrap()
}

fn refusal(spec: &Spec, latency: usize) -> DesignError {
    let spec = Spec { latency: Some(latency), ..spec.clone() };
    design(&spec).err().unwrap_or_else(|| panic!("latency {latency} is reached"))
}

/// With 32 taps the samples of latency 1000 are too old for any tap, and so are those before a long delay.
#[test]
fn a_latency_that_the_taps_do_not_reach_is_refused() {
    for method in [Method::Fir, Method::Sinc, Method::Separation] {
        let mut spec = four_at_48_khz(32);
        spec.design.method = method;
        for unreachable in [60, 1000] {
            let refused = refusal(&spec, unreachable);
            let DesignError::OutOfReach { shortest, longest, .. } = refused else { panic!("{refused}") };
            assert!(shortest == 0 && (32..45).contains(&longest), "{shortest} {longest}");
        }
    }
    let mut late = four_at_48_khz(8);
    late.channels.iter_mut().for_each(|channel| channel.delay.0 += 50.0);
    assert_eq!(latency(&late), Ok(55));
    let refused = refusal(&late, 5);
    let DesignError::OutOfReach { shortest, .. } = refused else { panic!("{refused}") };
    // At the edge of what is reached, gamma is nearly that of zero output already.
    let zero_output = gamma(&Spec { design: DesignSpec::new(Method::Iir, None), ..late.clone() }, 0);
    let reached = gamma(&late, shortest);
    assert!(reached > 0.9 * zero_output, "{reached} of {zero_output}");
}

/// A delay that all channels have adds to the latency and changes nothing else, however many slow periods it
/// lasts.
#[test]
fn a_common_delay_adds_to_the_latency() {
    let with_delay = |method: Method, common: f64| {
        let spec = alike(&butterworth(2, 0.6), 2, 0, &[common + 1.25, common + 0.5]);
        Spec { latency: None, design: DesignSpec::new(method, method.has_taps().then_some(14)), ..spec }
    };
    for method in [Method::Fir, Method::Iir, Method::H2, Method::Sinc, Method::Separation] {
        let [near, far] = [0.0, 20_001.0].map(|common| designed(&with_delay(method, common)));
        assert_eq!(far.latency, near.latency + 20_001, "{method:?}");
        let [near, far] = [near, far].map(|bank| bank.gamma.norm.unwrap());
        assert!((far / near - 1.0).abs() < 1e-6, "{method:?}: {near} {far}");
    }
}
