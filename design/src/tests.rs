//! What the tests of several modules share.

use crate::design::{Design, DesignOptions, LiftedPlant, Problem, design};
use crate::lti::StateSpace;
use hybank_core::spec::Spec;
use hybank_linalg::{CMat, Complex};

#[path = "../../tests/support/front_ends.rs"]
pub(crate) mod front_ends;

/// A design without the search for its proof.
pub(crate) fn designed(spec: &Spec) -> Design {
    design(spec, &DesignOptions::without_proof()).unwrap()
}

/// Largest gain of a response on a dense grid: a lower bound that knows no level sets.
pub(crate) fn largest_on_grid(points: usize, response: impl Fn(Complex<f64>) -> CMat) -> f64 {
    let gain = |k: usize| {
        let z = Complex::from_polar(1.0, std::f64::consts::PI * k as f64 / points as f64);
        hybank_linalg::singular_values(&response(z)).unwrap()[0]
    };
    (0..=points).map(gain).fold(0.0, f64::max)
}

/// That of a system, by one LU factorisation a frequency.
pub(crate) fn dense_grid(system: &StateSpace) -> f64 {
    largest_on_grid(4000, |z| system.response_at(z))
}

pub(crate) fn plant(spec: &Spec) -> LiftedPlant {
    LiftedPlant::new(&Problem::new(spec, spec.latency.unwrap()).unwrap())
}

/// Channels after the thesis's filter, which is the target too; h = 1.
pub(crate) fn after_thesis_filter(ratio: usize, latency: usize, channels: &str, design: &str) -> Spec {
    let text = format!(
        "fast_period = 1.0\nratio = {ratio}\nlatency = {latency}\n\
         target = {{ filter = {{ num = [0.25], den = [1.0, 1.0, 0.25] }} }}\n\
         channel = [{channels}]\ndesign = {{ {design} }}"
    );
    Spec::from_toml(&text, "spec.toml").unwrap()
}
