//! Analog signals, and the samples of the ideal fast converter.

use super::recording::Periodic;
use super::response::{Instants, sample};
use super::source::NormalisedSource;
use super::walk::sample_at;
use crate::analog::StrictlyProper;
use crate::design::{NearestSample, Problem, nearest_samples};
use crate::units::FastPeriods;

/// An analog signal in normalised time.
#[derive(Debug, Clone)]
pub enum Analog {
    /// Known in closed form.
    Known(NormalisedSource),
    /// A recording, periodic and band-limited.
    Recorded(Periodic),
}

/// The reference samples (phi_0 * f)(n - m0), M per slow period, with the latency m0 of the problem without
/// its wait. With m0 = 0 they lie on the time axis of the channels, as `fuse` gives its output.
pub fn target(problem: &Problem, signal: &Analog, periods: usize) -> Vec<f64> {
    let (first, step) = (FastPeriods(problem.wait as f64 - problem.latency as f64), FastPeriods(1.0));
    let instants = Instants { first, step, count: periods * problem.ratio };
    signal.filtered(&problem.front_ends[problem.target], instants)
}

impl Analog {
    /// (phi * f)(t) at the given instants.
    pub(super) fn filtered(&self, filter: &StrictlyProper, instants: Instants) -> Vec<f64> {
        match self {
            Self::Known(source) => sample(filter, source, instants),
            Self::Recorded(recording) => recording.sample(filter, instants),
        }
    }

    /// (phi * f)(t) at the given instants, each later by its shift.
    pub(super) fn filtered_near(
        &self,
        filter: &StrictlyProper,
        instants: Instants,
        shifts: &[FastPeriods],
    ) -> Vec<f64> {
        match self {
            Self::Known(source) => {
                let times: Vec<_> =
                    shifts.iter().enumerate().map(|(n, &shift)| instants.at(n) + shift).collect();
                sample_at(filter, source, &times)
            }
            Self::Recorded(recording) => recording.sample_near(filter, instants, shifts),
        }
    }
}

/// Plain interleaving, for comparison, as if all front ends were alike: output n is the slow sample whose
/// instant lies nearest to n - m0, also a later one; 0 where that sample has not been captured.
pub fn interleaved(delays: &[FastPeriods], ratio: usize, latency: usize, channels: &[Vec<f64>]) -> Vec<f64> {
    let nearest = nearest_samples(delays, ratio, latency, i64::MIN);
    let frames = channels.iter().map(Vec::len).min().unwrap_or(0);
    let sample = |frame: usize, sample: &NearestSample| {
        let index = usize::try_from(frame as i64 - sample.lag).ok();
        index.and_then(|index| channels[sample.channel].get(index)).copied().unwrap_or(0.0)
    };
    (0..frames).flat_map(|frame| nearest.iter().map(move |near| sample(frame, near))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::capture;
    use crate::spec::Spec;
    use crate::units::Seconds;

    fn problem(delays: [f64; 2], latency: usize) -> Problem {
        let text = format!(
            "fast_period = 1.0\nratio = 2\nlatency = {latency}\n\
             channel = [{{ delay = {:?} }}, {{ delay = {:?} }}]\n\
             target = {{ filter = {{ num = [0.25], den = [1.0, 1.0, 0.25] }} }}\n",
            delays[0], delays[1]
        );
        Problem::new(&Spec::from_toml(&text, "spec.toml").unwrap(), latency).unwrap()
    }

    #[test]
    fn a_delayed_channel_captures_what_an_undelayed_one_captures_of_the_delayed_signal() {
        let signal = |at: f64| Analog::Known(NormalisedSource::Step { at: FastPeriods(at), height: 2.0 });
        let late = capture(&problem([0.75, 0.0], 0), &signal(3.0), 20);
        let shifted = capture(&problem([0.0, 0.0], 0), &signal(3.75), 20);
        for (a, b) in late.channels[0].iter().zip(&shifted.channels[0]) {
            assert!((a - b).abs() < 1e-14, "{a} {b}");
        }
    }

    #[test]
    fn whole_delays_are_perfectly_interleaved() {
        let problem = problem([1.0, 0.0], 1);
        let source: crate::simulate::Source = "tones:0.3,0.8".parse().unwrap();
        let captured = capture(&problem, &Analog::Known(source.normalised(Seconds(1.0))), 40);
        let fast = interleaved(&problem.delays(), problem.ratio, problem.latency, &captured.channels);
        assert_eq!(fast.len(), captured.target.len());
        for (n, (a, b)) in fast.iter().zip(&captured.target).enumerate() {
            assert!((a - b).abs() < 1e-13, "{n}: {a} {b}");
        }
    }
}
