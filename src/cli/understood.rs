//! What a command understood from a spec, in one line of the user's units.

use crate::analog::StrictlyProper;
use crate::quantity::readable;
use crate::spec::Spec;
use crate::units::Hertz;
use std::f64::consts::{PI, TAU};
use std::io::IsTerminal;

/// Delays that a line holds.
const MOST_DELAYS: usize = 8;

/// The rates, the band of the target, the delays and the latency of `spec`.
pub(super) fn understood(spec: &Spec) -> String {
    let parts = [Some(rates(spec)), target(spec), Some(delays(spec)), latency(spec)];
    parts.into_iter().flatten().collect::<Vec<_>>().join("; ")
}

/// The line on standard error, where a person reads it.
pub(super) fn say_understood(spec: Option<&Spec>) {
    if std::io::stderr().is_terminal() {
        spec.iter().for_each(|spec| super::say(&format!("{}\n", understood(spec))));
    }
}

fn rates(spec: &Spec) -> String {
    let converters = spec.channels.len();
    if spec.is_normalised() {
        return format!("normalised time (fast period 1) from {converters} x 1/{} of the rate", spec.ratio);
    }
    let fast = spec.fast_period.rate().0;
    let slow = readable(fast / spec.ratio as f64, "S/s");
    format!("{} from {converters} x {slow}", readable(fast, "S/s"))
}

fn target(spec: &Spec) -> Option<String> {
    let edge = StrictlyProper::new(&spec.target, spec.fast_period).ok()?.half_power_frequency().0;
    let share = format!("{:.2} of Nyquist", edge / PI);
    if spec.is_normalised() {
        return Some(format!("target -3 dB at {share}"));
    }
    let hertz = Hertz(edge / TAU / spec.fast_period.0);
    Some(format!("target -3 dB at {} ({share})", readable(hertz.0, "Hz")))
}

fn delays(spec: &Spec) -> String {
    let all = spec.delays_in_fast_periods();
    let shown: Vec<String> = all.iter().take(MOST_DELAYS).map(|delay| rounded(delay.0)).collect();
    let rest = if all.len() > MOST_DELAYS { ", .." } else { "" };
    format!("delays {}{rest} samples", shown.join(", "))
}

fn latency(spec: &Spec) -> Option<String> {
    let samples = spec.latency?;
    if spec.is_normalised() {
        return Some(format!("latency {samples} samples"));
    }
    let time = readable(spec.fast_period.0 * samples as f64, "s");
    Some(format!("latency {samples} samples = {time}"))
}

/// In at most seven digits after the point, without trailing zeros.
fn rounded(value: f64) -> String {
    let text = format!("{value:.7}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spec_is_one_line_in_units_of_the_user() {
        let spec = Spec::from_toml(
            "fast_rate = \"1 GS/s\"\nratio = 2\nlatency = 16\n\
             target = { filter = { family = \"butterworth\", order = 4, cutoff = \"450 MHz\" } }\n\
             channel = [{ delay = \"1.0062 ns\" }, { delay = \"0.25 samples\" }]\ndesign = { method = \"iir\" }",
            "spec.toml",
        );
        assert_eq!(
            understood(&spec.unwrap()),
            "1 GS/s from 2 x 500 MS/s; target -3 dB at 450 MHz (0.90 of Nyquist); delays 1.0062, 0.25 samples; \
             latency 16 samples = 16 ns"
        );
    }

    #[test]
    fn normalised_time_has_no_unit() {
        let spec = Spec::from_toml(
            "fast_period = 1.0\nratio = 2\nlatency = 10\n\
             target = { filter = { num = [0.25], den = [1.0, 1.0, 0.25] } }\n\
             channel = [{ delay = 1.2 }, { delay = 0.6 }]\ndesign = { method = \"iir\" }",
            "spec.toml",
        );
        assert_eq!(
            understood(&spec.unwrap()),
            "normalised time (fast period 1) from 2 x 1/2 of the rate; target -3 dB at 0.10 of Nyquist; \
             delays 1.2, 0.6 samples; latency 10 samples"
        );
    }
}
