//! Banks with arbitrary coefficients and all kinds of front ends: what the checker and the designer say of
//! one error system is compared on them.

use hybank_core::bank::{Bank, Gamma, SynthesisFilters};
use hybank_core::spec::{ChannelSpec, DesignSpec, Family, FilterSpec, Method, Passband, Spec};
use hybank_core::units::{Hertz, Seconds};
use std::f64::consts::TAU;

pub(crate) fn family(family: Family, order: usize, omega: f64) -> FilterSpec {
    FilterSpec::Family {
        family,
        order: Some(order),
        passband: Passband::LowPass { cutoff: Hertz(omega / TAU) },
        ripple_db: family.has_ripple().then_some(0.5),
        attenuation_db: family.has_attenuation().then_some(55.0),
    }
}

pub(crate) fn thesis_filter() -> FilterSpec {
    FilterSpec::TransferFunction { num: vec![0.25], den: vec![1.0, 1.0, 0.25] }
}

/// A bank with arbitrary coefficients; the comparisons hold for good and bad banks.
pub(crate) fn bank(
    target: FilterSpec,
    filters: Vec<FilterSpec>,
    delays: &[f64],
    ratio: usize,
    latency: usize,
    taps: usize,
) -> Bank {
    let made_up = |i: usize| (0..taps).map(|n| ((7 * n + 3 * i) % 11) as f64 / 11.0 - 0.4).collect();
    let channel = |(filter, &delay)| ChannelSpec::new(Seconds(delay), filter);
    let spec = Spec {
        name: String::new(),
        fast_period: Seconds(1.0),
        ratio,
        latency: Some(latency),
        full_scale: None,
        fit: Vec::new(),
        target,
        channels: filters.into_iter().zip(delays).map(channel).collect(),
        signal: None,
        uncertainty: None,
        design: DesignSpec::new(Method::Fir, Some(taps)),
    };
    Bank {
        spec: Some(spec),
        fast_period: Seconds(1.0),
        ratio,
        latency,
        method: Method::Fir,
        samples: vec![1; delays.len()],
        delays: delays.iter().copied().map(Seconds).collect(),
        gains: vec![1.0; delays.len()],
        offsets: vec![0.0; delays.len()],
        nonlinearity: vec![hybank_core::runtime::Nonlinearity::default(); delays.len()],
        filters: SynthesisFilters::Fir((0..delays.len()).map(made_up).collect()),
        gamma: Gamma::default(),
        proof: None,
        fixed_point: None,
    }
}

pub(crate) fn alike(filter: &FilterSpec, delays: &[f64], ratio: usize, latency: usize, taps: usize) -> Bank {
    bank(filter.clone(), vec![filter.clone(); delays.len()], delays, ratio, latency, taps)
}

pub(crate) fn cases() -> Vec<(&'static str, Bank)> {
    let thesis = thesis_filter();
    let eight = [0.0, 1.224, 1.703, 3.193, 4.178, 4.981, 5.882, 6.867];
    let rc = |omega| family(Family::Rc, 1, omega);
    let stiff = FilterSpec::Cascade { cascade: vec![rc(1e6), rc(0.5)] };
    let mixed = vec![thesis.clone(), rc(1.0), family(Family::Elliptic, 5, 2.0)];
    vec![
        ("thesis", alike(&thesis, &[1.2, 0.6], 2, 10, 22)),
        ("whole periods late", alike(&thesis, &[0.2, 9.1], 2, 3, 7)),
        ("exactly whole periods", alike(&thesis, &[0.0, 4.0, 8.0], 4, 9, 9)),
        ("samples as wanted", alike(&thesis, &[0.0, 1.0], 2, 10, 22)),
        ("equal delays", alike(&thesis, &[0.6, 0.6], 2, 4, 8)),
        ("delays almost equal", alike(&thesis, &[0.6, 0.6 + 1e-9], 2, 4, 8)),
        ("a delay a hair from a period", alike(&thesis, &[2.0 - 1e-7, 1.0], 2, 5, 8)),
        ("one channel, no ratio", alike(&rc(2.0), &[0.25], 1, 1, 5)),
        ("stiff", alike(&stiff, &[0.3, 1.7], 2, 6, 9)),
        ("stiffer", alike(&rc(1e8), &[0.3, 1.7], 2, 6, 9)),
        ("slow", alike(&rc(1e-4), &[0.3, 1.7], 2, 6, 9)),
        ("mixed", bank(rc(0.7), mixed, &[0.25, 1.1, 2.6], 3, 6, 11)),
        ("Butterworth 6, eight channels", alike(&family(Family::Butterworth, 6, 1.8), &eight, 8, 32, 48)),
        ("low Butterworth 6", alike(&family(Family::Butterworth, 6, 0.4), &eight, 8, 20, 24)),
        ("elliptic 7", alike(&family(Family::Elliptic, 7, 2.4), &[0.31, 1.22, 2.45, 2.9], 4, 10, 32)),
        ("Bessel 8", alike(&family(Family::Bessel, 8, 0.9), &[0.1, 1.9], 3, 2, 6)),
        ("few channels", alike(&thesis, &[0.2, 1.9], 3, 6, 18)),
    ]
}
