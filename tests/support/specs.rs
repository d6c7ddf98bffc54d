//! Specs in memory for tests and benchmarks, h = 1.
// Each program uses a part of it.
#![allow(dead_code)]

use hybank_core::spec::{ChannelSpec, DesignSpec, Family, FilterSpec, Method, Passband, Spec};
use hybank_core::units::{Hertz, Seconds};
use std::f64::consts::TAU;

/// Numerator over denominator, descending powers of s.
pub(crate) fn tf(num: &[f64], den: &[f64]) -> FilterSpec {
    FilterSpec::TransferFunction { num: num.to_vec(), den: den.to_vec() }
}

/// The thesis's wc^2 / (s + wc)^2, wc = 1/2.
pub(crate) fn thesis_filter() -> FilterSpec {
    tf(&[0.25], &[1.0, 1.0, 0.25])
}

/// A low-pass with its cutoff in rad/s; 0.5 dB of ripple and 55 dB of attenuation where the family has
/// these.
pub(crate) fn low_pass(family: Family, order: usize, omega: f64) -> FilterSpec {
    FilterSpec::Family {
        family,
        order: Some(order),
        passband: Passband::LowPass { cutoff: Hertz(omega / TAU) },
        ripple_db: family.has_ripple().then_some(0.5),
        attenuation_db: family.has_attenuation().then_some(55.0),
    }
}

/// The same with its cutoff in cycles per fast sample.
pub(crate) fn low_pass_at(family: Family, order: usize, cutoff: f64) -> FilterSpec {
    low_pass(family, order, TAU * cutoff)
}

/// Butterworth low-pass with its cutoff in rad/s.
pub(crate) fn butterworth(order: usize, omega: f64) -> FilterSpec {
    low_pass(Family::Butterworth, order, omega)
}

/// Every channel has the filter of the target; method `iir`.
pub(crate) fn alike(filter: &FilterSpec, ratio: usize, latency: usize, delays: &[f64]) -> Spec {
    let channel = |&delay: &f64| ChannelSpec::new(Seconds(delay), filter.clone());
    Spec {
        full_scale: None,
        fit: Vec::new(),
        name: String::new(),
        fast_period: Seconds(1.0),
        ratio,
        latency: Some(latency),
        target: filter.clone(),
        channels: delays.iter().map(channel).collect(),
        signal: None,
        uncertainty: None,
        design: DesignSpec::new(Method::Iir, None),
    }
}

/// Two fast samples for each slow one, all after [`thesis_filter`].
pub(crate) fn thesis(latency: usize, delays: &[f64]) -> Spec {
    alike(&thesis_filter(), 2, latency, delays)
}

/// The same front ends by the method `fir`.
pub(crate) fn with_taps(spec: Spec, taps: usize) -> Spec {
    Spec { design: DesignSpec::new(Method::Fir, Some(taps)), ..spec }
}

/// A transfer function times `gain`.
pub(crate) fn amplify(filter: &mut FilterSpec, gain: f64) {
    let FilterSpec::TransferFunction { num, .. } = filter else { panic!("no transfer function") };
    num.iter_mut().for_each(|x| *x *= gain);
}

/// Every front end and the target times `gain`.
pub(crate) fn amplified(mut spec: Spec, gain: f64) -> Spec {
    spec.channels.iter_mut().for_each(|channel| amplify(&mut channel.filter, gain));
    amplify(&mut spec.target, gain);
    spec
}
