//! What the tests of several modules share.

use crate::design::{Design, DesignOptions, LiftedPlant, Problem, design};
use hybank_core::spec::Spec;

#[path = "../../tests/support/front_ends.rs"]
pub(crate) mod front_ends;

/// A design without the search for its proof.
pub(crate) fn designed(spec: &Spec) -> Design {
    design(spec, &DesignOptions::without_proof()).unwrap()
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
