//! What the tests of specs share: the thesis example and its variations.

use super::*;
use crate::quantity::FullScale;
use crate::units::Hertz;

mod edit;
mod overrides;
mod reading;
mod refusal;
mod round_trip;
mod sizes;

const THESIS: &str = r#"
name = "thesis example, FIR"
fast_period = 1.0          # h in seconds
ratio = 2                  # M
latency = 10

[target]
filter = { num = [0.25], den = [1.0, 1.0, 0.25] }

[[channel]]
delay = 1.2
[[channel]]
delay = 0.6
filter = { zeros = [], poles = [[-0.5, 0.0], [-0.5, 0.0]], gain = 0.25 }

[design]
method = "fir"
taps = 22
"#;

fn read(text: &str) -> Spec {
    Spec::from_toml(text, "spec.toml").unwrap_or_else(|error| panic!("{error}"))
}

/// The thesis example with one piece of text replaced.
fn thesis_with(from: &str, to: &str) -> String {
    assert!(THESIS.contains(from), "{from:?} is not in the example");
    THESIS.replacen(from, to, 1)
}

fn thesis_with_target(filter: &str) -> String {
    thesis_with("{ num = [0.25], den = [1.0, 1.0, 0.25] }", filter)
}
