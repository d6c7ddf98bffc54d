//! What was understood from a spec, in one line of the user's units.

use crate::analog::StrictlyProper;
use crate::messages::counted;
use crate::quantity::readable;
use crate::spec::Spec;
use std::f64::consts::{PI, TAU};

/// Delays that a line holds.
const MOST_DELAYS: usize = 8;

/// The rates, the band of the target, the delays and the latency of `spec`.
pub fn understood(spec: &Spec) -> String {
    let parts = [Some(rates(spec)), target(spec), Some(delays(spec)), latency(spec)];
    parts.into_iter().flatten().collect::<Vec<_>>().join("; ")
}

fn rates(spec: &Spec) -> String {
    let (converters, ratio) = (spec.channels.len(), spec.ratio);
    let rates: Vec<f64> = spec.channels.iter().filter_map(|channel| Some(channel.rate?.0)).collect();
    if !rates.is_empty() {
        let shown: Vec<String> = rates.iter().map(|rate| readable(*rate, "S/s")).collect();
        let output = readable(spec.fast_period.rate().0, "S/s");
        return format!("{output} from {}, in frames of {ratio} samples", shown.join(" and "));
    }
    if spec.is_normalised() {
        let who = if converters == 1 { "one converter".into() } else { format!("{converters} converters") };
        let rate =
            if ratio == 1 { "the output rate".into() } else { format!("1/{ratio} of the output rate") };
        return format!("normalised time (fast period 1) from {who} at {rate}");
    }
    let fast = spec.fast_period.rate().0;
    let (output, slow) = (readable(fast, "S/s"), readable(fast / ratio as f64, "S/s"));
    match converters {
        1 if ratio == 1 => format!("{output} from one converter of the same rate"),
        1 => format!("{output} from one converter at {slow}"),
        _ => format!("{output} from {converters} x {slow}"),
    }
}

fn target(spec: &Spec) -> Option<String> {
    let band = StrictlyProper::new(&spec.target, spec.fast_period).ok()?.half_power_band();
    let edges = band.map(|w| two_digits(w.0 / PI));
    let hertz = band.map(|w| readable(w.0 / TAU / spec.fast_period.0, "Hz"));
    let (share, hertz) = if band[0].0 == 0.0 {
        (format!("{} of Nyquist", edges[1]), hertz[1].clone())
    } else {
        (format!("{} and {} of Nyquist", edges[0], edges[1]), hertz.join(" and "))
    };
    if spec.is_normalised() {
        return Some(format!("target -3 dB at {share}"));
    }
    Some(format!("target -3 dB at {hertz} ({share})"))
}

fn delays(spec: &Spec) -> String {
    let all = spec.delays_in_fast_periods();
    let shown: Vec<String> = all.iter().take(MOST_DELAYS).map(|delay| rounded(delay.0)).collect();
    let rest = if all.len() > MOST_DELAYS { ", .." } else { "" };
    match shown[..] {
        [ref only] => format!("delay {}", counted(only, "sample")),
        _ => format!("delays {}{rest} samples", shown.join(", ")),
    }
}

fn latency(spec: &Spec) -> Option<String> {
    let latency = spec.latency?;
    let text = format!("latency {}", counted(latency, "sample"));
    if spec.is_normalised() || latency == 0 {
        return Some(text);
    }
    Some(format!("{text} = {}", readable(spec.fast_period.0 * latency as f64, "s")))
}

/// A share with two digits after the point, or more where both would be zeros.
fn two_digits(share: f64) -> String {
    let leading = if share > 0.0 { (-share.log10()).ceil().clamp(1.0, 12.0) as usize } else { 1 };
    format!("{share:.*}", leading + 1)
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
            "normalised time (fast period 1) from 2 converters at 1/2 of the output rate; target -3 dB at 0.10 of Nyquist; \
             delays 1.2, 0.6 samples; latency 10 samples"
        );
    }
}
