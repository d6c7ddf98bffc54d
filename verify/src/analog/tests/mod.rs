//! What the tests of analog filters share: filters in short, and responses of formula and realisation.

use super::section::Realisation;
use super::*;
use hybank_core::spec::{Family, FilterSpec, Passband};
use hybank_core::units::{Hertz, RadiansPerFastPeriod, Seconds};
use hybank_linalg::Complex;

mod enclosed;
mod realisation;
mod refusal;
mod written_forms;

fn zpk(zeros: &[[f64; 2]], poles: &[[f64; 2]], gain: f64) -> FilterSpec {
    FilterSpec::ZeroPoleGain { zeros: zeros.to_vec(), poles: poles.to_vec(), gain }
}

fn tf(num: &[f64], den: &[f64]) -> FilterSpec {
    FilterSpec::TransferFunction { num: num.to_vec(), den: den.to_vec() }
}

fn family(family: Family, order: usize, cutoff: f64) -> FilterSpec {
    FilterSpec::Family {
        family,
        order: (family != Family::Rc).then_some(order),
        passband: Passband::LowPass { cutoff: Hertz(cutoff) },
        ripple_db: family.has_ripple().then_some(0.5),
        attenuation_db: family.has_attenuation().then_some(60.0),
    }
}

/// The band-pass of the family, after its low-pass where it needs more poles.
fn band_pass(kind: Family, order: usize, [low, high]: [f64; 2]) -> FilterSpec {
    let mut filter = family(kind, order, high);
    if let FilterSpec::Family { passband, .. } = &mut filter {
        *passband = Passband::BandPass { low: Hertz(low), high: Hertz(high) };
    }
    if filter.check().is_ok() {
        return filter;
    }
    FilterSpec::Cascade { cascade: vec![filter, family(Family::Rc, 1, 30.0 * high)] }
}

/// The family member, followed by the pole of a switch where it needs one.
fn sampled_family(kind: Family, order: usize, cutoff: f64) -> FilterSpec {
    let filter = family(kind, order, cutoff);
    if filter.check().is_ok() {
        return filter;
    }
    FilterSpec::Cascade { cascade: vec![filter, family(Family::Rc, 1, 30.0 * cutoff)] }
}

/// The filter with a fast period of `h` seconds.
fn realise(filter: &FilterSpec, h: f64) -> Result<StrictlyProper, AnalogError> {
    StrictlyProper::new(filter, Seconds(h))
}

/// Phi'(j w), w in rad per fast period.
fn response(phi: &StrictlyProper, w: f64) -> Complex<f64> {
    phi.response(RadiansPerFastPeriod(w))
}

/// c (j w - a)^-1 b of the realisation, by linear algebra alone.
fn realised_response(phi: &StrictlyProper, w: f64) -> Complex<f64> {
    let state = Realisation { a: phi.a().clone(), b: phi.b().clone(), c: phi.c().clone(), d: 0.0 };
    super::realise::state_response(&state, Complex::new(0.0, w))
}

/// Frequencies around every pole and far beyond, eleven a decade and exactly on the resonances.
fn probes(phi: &StrictlyProper) -> Vec<f64> {
    let moduli: Vec<f64> = phi.poles().iter().map(|p| p.norm()).collect();
    let low = moduli.iter().copied().fold(f64::INFINITY, f64::min).log10() - 2.0;
    let high = moduli.iter().copied().fold(0.0, f64::max).log10() + 2.0;
    let steps = (11.0 * (high - low)) as usize;
    let sweep = (0..=steps).map(|i| 10f64.powf(low + (high - low) * i as f64 / steps as f64));
    sweep.chain(moduli.clone()).chain(phi.poles().iter().map(|p| p.im.abs())).chain([0.0]).collect()
}

/// Largest difference between realisation and formula, relative to the peak.
fn realisation_error(phi: &StrictlyProper) -> f64 {
    let probes = probes(phi);
    let peak = probes.iter().map(|&w| response(phi, w).norm()).fold(0.0, f64::max);
    probes.iter().map(|&w| (realised_response(phi, w) - response(phi, w)).norm() / peak).fold(0.0, f64::max)
}
