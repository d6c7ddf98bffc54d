//! Delays next to whole fast periods, against the closed form.

use hybank::design::{Options, design};
use hybank::spec::Spec;

/// A low-pass of first order, much faster than the fast rate: samples a whole fast period apart have nothing
/// in common. Of the sample at t the best multiple of the one at t - d leaves sqrt(a / 2 (1 - e^(-2 a d))).
#[test]
fn a_delay_next_to_a_whole_one_is_not_taken_for_it() {
    let pole = 1e6;
    for (delay, latency) in [
        (60_000.000000005, 60_000),
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
        let gamma = design(&spec, &Options::default()).unwrap().bank.gamma;
        let late = delay - f64::from(latency);
        // A later sample can be used as it is; nothing older than the target's can.
        let expected = (-0.5 * pole * f64::exp_m1(-2.0 * pole * late.abs())).sqrt();
        let found = gamma.norm.unwrap();
        assert!((found - expected).abs() <= 1e-6 * expected, "{delay}: {found} {expected}");
    }
}
