//! What double precision can tell apart: the delays of channels.

use super::problem::Problem;

/// Delays of like channels closer than this (in fast periods, and up to whole slow periods) are not
/// resolved. The difference of their samples has lost half of its digits or more, and a bank of large taps
/// may gain by it what no computation in doubles shows.
const RESOLUTION: f64 = 1e-8;
/// Relative difference of two delays that comes from rounding: they are meant to be equal.
const ROUNDING: f64 = 1e-14;

/// Whether the delays of all channels with the same front end are equal or far enough apart for bounds that
/// hold for all banks.
pub(super) fn resolves_delays(problem: &Problem) -> bool {
    let period = problem.ratio as f64;
    problem.channels.iter().enumerate().all(|(i, a)| {
        problem.channels[..i].iter().filter(|b| b.front_end == a.front_end).all(|b| {
            let apart = (a.delay - b.delay).0;
            let from_whole_periods = (apart - (apart / period).round() * period).abs();
            let rounding = ROUNDING * a.delay.0.max(b.delay.0).max(1.0);
            from_whole_periods <= rounding || from_whole_periods >= RESOLUTION
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spec::Spec;

    fn resolves(delays: &[f64]) -> bool {
        let channels: Vec<String> = delays.iter().map(|delay| format!("{{ delay = {delay:?} }}")).collect();
        let text = format!(
            "fast_period = 1.0\nratio = 2\nlatency = 3\n\
             target = {{ filter = {{ num = [0.25], den = [1.0, 1.0, 0.25] }} }}\n\
             channel = [{}]\ndesign = {{ method = \"iir\" }}",
            channels.join(", ")
        );
        resolves_delays(&Problem::new(&Spec::from_toml(&text, "spec.toml").unwrap(), 3).unwrap())
    }

    #[test]
    fn equal_delays_and_distant_ones_are_resolved() {
        assert!(resolves(&[0.6]) && resolves(&[0.6, 0.6]) && resolves(&[0.6, 0.6 + 1e-7]));
        assert!(resolves(&[0.1 + 0.2, 0.3]) && resolves(&[0.2, 2.2]) && resolves(&[0.1, 4.1]));
    }

    #[test]
    fn nearly_equal_delays_are_not_even_whole_periods_apart() {
        for apart in [1e-13, 3e-12, 1e-9] {
            assert!(!resolves(&[0.6, 0.6 + apart]), "{apart}");
        }
        assert!(!resolves(&[0.6, 1.0, 2.6 + 3e-12]));
    }
}
