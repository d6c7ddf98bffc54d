//! Banks with arbitrary coefficients and all kinds of front ends: what the checker and the designer say of
//! one error system is compared on them.
// Each program uses a part of it.
#![allow(dead_code)]

use hybank_core::bank::{Bank, SynthesisFilters};
use hybank_core::spec::{Family, FilterSpec};
use hybank_core::units::Seconds;
pub(crate) use specs::{low_pass as family, thesis_filter};

#[path = "specs.rs"]
pub(crate) mod specs;

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
    let mut spec = specs::with_taps(specs::alike(&target, ratio, latency, delays), taps);
    spec.channels.iter_mut().zip(filters).for_each(|(channel, filter)| channel.filter = filter);
    let filters = SynthesisFilters::Fir((0..delays.len()).map(made_up).collect());
    let delays = delays.iter().copied().map(Seconds).collect();
    Bank { spec: Some(spec), latency, delays, ..Bank::bare(filters, ratio) }
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
