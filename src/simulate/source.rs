//! Analytic sources: analog signals known in closed form.

use crate::analog::StrictlyProper;
use crate::linalg::Complex;
use crate::quantity::readable;
use crate::units::{FastPeriods, Hertz, Quantity, RadiansPerSecond, Seconds, Time};
use std::f64::consts::TAU;
use std::fmt;

/// An analog signal f(t) on the time base `T`: [`Seconds`] as it is written down, [`FastPeriods`] as it is
/// simulated.
///
/// Frequencies follow the time base ([`Time::Frequency`]): hertz and rad/s go with seconds, cycles and
/// radians per fast period with fast periods. [`Source::normalised`] is the one way from the first to the
/// second.
///
/// ```
/// use hybank::simulate::{Analog, Source};
/// use hybank::units::Seconds;
/// let step: Source = Source::Step { at: Seconds(0.3), height: 1.0 };
/// let signal = Analog::Known(step.normalised(Seconds(1.0 / 48_000.0)));
/// ```
///
/// A source in seconds is refused by the simulator:
///
/// ```compile_fail,E0308
/// use hybank::simulate::{Analog, Source};
/// use hybank::units::Seconds;
/// let signal = Analog::Known(Source::Step { at: Seconds(0.3), height: 1.0 });
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Source<T: Time = Seconds> {
    /// f(t) = 0 for t < at, `height` for t >= at (thesis 5.42).
    Step {
        /// Instant of the step.
        at: T,
        /// Height of the step.
        height: f64,
    },
    /// f(t) = sum of A cos(w t + phase) over the tones, from t = minus infinity (thesis 5.43).
    Tones(Vec<Tone<T>>),
    /// f(t) = A sin(2 pi (f0 t + (f1 - f0) t^2 / (2 L))) for 0 <= t < L, 0 elsewhere.
    Chirp {
        /// f0, the frequency at t = 0.
        start: T::Frequency,
        /// f1, the frequency at t = L.
        end: T::Frequency,
        /// L, the duration.
        length: T,
        /// A.
        amplitude: f64,
    },
    /// The sum of several sources.
    Sum(Vec<Source<T>>),
}

/// A source in normalised time t' = t / h, as [`sample`](super::sample) reads it.
pub type NormalisedSource = Source<FastPeriods>;

/// A cos(w t + phase).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tone<T: Time = Seconds> {
    /// w.
    pub omega: T::AngularFrequency,
    /// A.
    pub amplitude: f64,
    /// Phase at t = 0, rad.
    pub phase: f64,
}

impl Source {
    /// The same signal in normalised time: t' = t / h, f' = f h, w' = w h. Values do not change:
    /// f'(t / h) = f(t).
    pub fn normalised(&self, fast_period: Seconds) -> NormalisedSource {
        let time = |t: Seconds| t.in_fast_periods(fast_period);
        let frequency = |f: Hertz| f.per_fast_period(fast_period);
        let angular = |w: RadiansPerSecond| w.per_fast_period(fast_period);
        match self {
            Self::Step { at, height } => Source::Step { at: time(*at), height: *height },
            Self::Tones(tones) => Source::Tones(
                tones
                    .iter()
                    .map(|&Tone { omega, amplitude, phase }| Tone { omega: angular(omega), amplitude, phase })
                    .collect(),
            ),
            &Self::Chirp { start, end, length, amplitude } => Source::Chirp {
                start: frequency(start),
                end: frequency(end),
                length: time(length),
                amplitude,
            },
            Self::Sum(terms) => Source::Sum(terms.iter().map(|term| term.normalised(fast_period)).collect()),
        }
    }
}

impl<T: Time> Source<T> {
    /// The instant after which the signal no longer changes its law: the end of a chirp, the instant of a
    /// step, the latest of a sum. `None` for tones alone, which go on for ever.
    pub fn duration(&self) -> Option<T> {
        match self {
            Self::Chirp { length, .. } => Some(*length),
            Self::Step { at, .. } => Some(*at),
            Self::Sum(terms) => {
                let later = |a: T, b: T| if b.value() > a.value() { b } else { a };
                terms.iter().filter_map(Self::duration).reduce(later)
            }
            Self::Tones(_) => None,
        }
    }

    /// f(t).
    pub fn value(&self, t: T) -> f64 {
        match self {
            Self::Step { at, height } => {
                if t.value() >= at.value() {
                    *height
                } else {
                    0.0
                }
            }
            Self::Tones(tones) => tones.iter().map(|tone| tone.value(t)).sum(),
            Self::Chirp { start, end, length, amplitude } => {
                let (start, end, length, t) = (start.value(), end.value(), length.value(), t.value());
                if !(0.0..length).contains(&t) {
                    return 0.0;
                }
                amplitude * (TAU * (start + (end - start) * t / (2.0 * length)) * t).sin()
            }
            Self::Sum(terms) => terms.iter().map(|term| term.value(t)).sum(),
        }
    }
}

impl Tone<FastPeriods> {
    /// The phasor of the steady state after a filter: amplitude Phi(j omega) e^{j phase}.
    pub(super) fn response(&self, filter: &StrictlyProper) -> Complex<f64> {
        filter.response(self.omega) * Complex::from_polar(self.amplitude, self.phase)
    }
}

impl<T: Time> Tone<T> {
    /// A cos(w t + phase).
    pub fn value(&self, t: T) -> f64 {
        self.amplitude * (self.omega.value() * t.value() + self.phase).cos()
    }
}

/// Tones that a line holds.
const MOST_TONES: usize = 8;

impl fmt::Display for Source {
    /// Frequencies in hertz and times in seconds, with SI prefixes and at most six digits.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Step { at, .. } => write!(f, "a step at {}", readable(at.0, "s")),
            Self::Tones(tones) => write!(f, "{}", tones_text(tones)),
            Self::Chirp { start, end, length, .. } => {
                let [start, end] = [start, end].map(|frequency| readable(frequency.0, "Hz"));
                write!(f, "a chirp from {start} to {end} in {}", readable(length.0, "s"))
            }
            Self::Sum(terms) => {
                let terms: Vec<String> = terms.iter().map(ToString::to_string).collect();
                write!(f, "{}", terms.join(" plus "))
            }
        }
    }
}

fn tones_text(tones: &[Tone]) -> String {
    let shown = tones.iter().take(MOST_TONES).map(|tone| readable(tone.omega.in_hertz().0, "Hz"));
    let shown: Vec<String> = shown.collect();
    let rest = if tones.len() > MOST_TONES { ", .." } else { "" };
    let plural = if tones.len() == 1 { "a tone" } else { "tones" };
    format!("{plural} at {}{rest}", shown.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::CyclesPerFastPeriod;
    use proptest::prelude::*;

    #[test]
    fn every_kind_has_the_units_of_its_time_base() {
        let source: Source = "step@0.5+tones:3+chirp:100Hz..200Hz@2s".parse().unwrap();
        let Source::Sum(terms) = source.normalised(Seconds(1e-3)) else { panic!("a sum stays one") };
        assert_eq!(terms[0], Source::Step { at: FastPeriods(500.0), height: 1.0 });
        let Source::Chirp { start, length, .. } = terms[2] else { panic!("a chirp stays one") };
        assert_eq!((start, length), (CyclesPerFastPeriod(0.1), FastPeriods(2000.0)));
    }

    #[test]
    fn a_sum_lasts_as_long_as_its_longest_term() {
        let duration = |text: &str| text.parse::<Source>().unwrap().duration();
        assert_eq!(duration("step@0.5+chirp:1..2@3"), Some(Seconds(3.0)));
        assert_eq!(duration("chirp:1..2@3+step@5+tones:1"), Some(Seconds(5.0)));
        assert_eq!(duration("tones:1,2"), None);
    }

    #[test]
    fn a_chirp_has_its_frequencies_at_both_ends() {
        // The instantaneous frequency is the slope of the phase: count the zero crossings of one half
        // second each.
        let chirp: Source = "chirp:10Hz..90Hz@8s".parse().unwrap();
        let crossings = |from: f64| {
            let value = |n: usize| chirp.value(Seconds(from + n as f64 * 0.5 / 4096.0));
            (0..4096).filter(|&n| value(n) * value(n + 1) < 0.0).count()
        };
        assert!(crossings(0.0).abs_diff(2 * 6) <= 2, "{}", crossings(0.0));
        assert!(crossings(7.49).abs_diff(2 * 44) <= 2, "{}", crossings(7.49));
        assert_eq!((chirp.value(Seconds(-1e-9)), chirp.value(Seconds(8.0))), (0.0, 0.0));
    }

    proptest! {
        #[test]
        fn the_unit_of_time_changes_no_value(decade in -9.0..9.0f64, t in 0.0..3.0f64) {
            let h = Seconds(10f64.powf(decade));
            let source: Source = "tones:3,4+chirp:1Hz..2Hz@4s".parse().unwrap();
            let t = Seconds(t);
            let normalised = source.normalised(h).value(t.in_fast_periods(h));
            prop_assert!((source.value(t) - normalised).abs() < 1e-12);
        }
    }
}
