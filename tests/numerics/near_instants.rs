//! Delays next to whole fast periods and next to one another, against closed forms.

use crate::support::specs::{alike, low_pass, with_taps};
use crate::support::{designed, proven};
use hybank::design::{ProofSearch, judge_taps};
use hybank::spec::{Family, FilterSpec, Passband, Spec};
use hybank::units::Hertz;
use std::f64::consts::PI;

/// A low-pass of first order, much faster than the fast rate: samples a whole fast period apart have nothing
/// in common. Of the sample at t the best multiple of the one at t - d leaves sqrt(a / 2 (1 - e^(-2 a d))).
#[test]
fn a_delay_next_to_a_whole_one_is_not_taken_for_it() {
    let pole = 1e6;
    for (delay, latency) in [
        (600.000_000_000_05, 600),
        (1.000_000_000_000_09, 1),
        (1.0 + f64::EPSILON, 1),
        (1.0 - f64::EPSILON / 2.0, 1),
        (1.0, 1),
    ] {
        let text = format!(
            "fast_period = 1.0\nratio = 1\nlatency = {latency}\n[target]\nfilter = {{ num = [1e6], den = [1.0, 1e6] }}\n\
             [[channel]]\ndelay = {delay:?}\n[design]\nmethod = \"fir\"\ntaps = 1\n"
        );
        let spec = Spec::from_toml(&text, "spec.toml").unwrap();
        let gamma = proven(&spec).bank.gamma;
        let late = delay - f64::from(latency);
        // A later sample can be used as it is; nothing older than the target's can.
        let expected = (-0.5 * pole * f64::exp_m1(-2.0 * pole * late.abs())).sqrt();
        let found = gamma.norm.unwrap();
        assert!((found - expected).abs() <= 1e-6 * expected, "{delay}: {found} {expected}");
    }
}

/// A bank with taps of 2e9 that almost cancel, because two channels sample 1.2e-10 apart. Of the error 1e-15
/// of the terms is left. Its norm is the root of the spectrum of the error at pi, a sum over residues of the
/// filter times e^(p t), by mpmath with 80 digits from these decimals.
#[test]
fn the_norm_holds_where_almost_all_of_the_taps_cancels() {
    let filter = FilterSpec::Family {
        family: Family::Butterworth,
        order: Some(3),
        passband: Passband::LowPass { cutoff: Hertz(0.03459136453147298) },
        ripple_db: None,
        attenuation_db: None,
    };
    let spec = alike(&filter, 1, 1, &[1.1752889842310483, 1.1752889843510483, 0.11537585537790718]);
    let taps = vec![
        vec![
            -2271359837.2716517,
            3975313.470634414,
            668920.0865414382,
            935630.3960756825,
            -111156.20618397712,
        ],
        vec![
            2271359830.895682,
            -3975313.4545146227,
            -668920.0824595601,
            -935630.3920620059,
            111156.20611350537,
        ],
        vec![
            0.004689077885306092,
            7.372948496285509,
            -0.017609002542583498,
            -0.0041090795811230645,
            -0.0040926105528903585,
        ],
    ];
    let judged = judge_taps(&spec, taps, ProofSearch::Run).unwrap();
    let norm = judged.bank.gamma.norm.unwrap();
    assert!((norm / 1.4594204969838147e-5 - 1.0).abs() < 1e-9, "{norm:e}");
}

/// What is computed lies in what is proven, also where double precision takes a wrong peak for the highest.
#[test]
fn the_norm_lies_in_the_proven_interval() {
    let filter = low_pass(Family::Butterworth, 2, 0.2 * PI);
    for ratio in [1, 2] {
        let spec = with_taps(alike(&filter, ratio, 6, &[1.2, 1.20000000012]), 12);
        let designed = proven(&spec);
        let (norm, proven) = (designed.bank.gamma.norm.unwrap(), designed.proof.unwrap());
        let inside = proven.attained * (1.0 - 1e-9) <= norm && norm <= proven.upper;
        assert!(inside, "{ratio}: {norm:e} {proven:?}");
        assert!(norm - proven.attained <= 1e-9 * norm, "{ratio}: {norm:e} {proven:?}");
    }
}

/// The bounds of ordinary plants are stated.
#[test]
fn delays_a_millionth_apart_are_resolved() {
    for apart in [1e-3, 1e-6] {
        let spec = with_taps(alike(&low_pass(Family::Butterworth, 2, 0.5), 2, 4, &[0.6, 0.6 + apart]), 8);
        let found = designed(&spec).gamma;
        let (lower, norm) = (found.lower.unwrap(), found.norm.unwrap());
        assert!(lower <= norm && lower > 0.99 * norm, "{apart:e}: {found:?}");
    }
}
