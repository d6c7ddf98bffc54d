//! What a simulation computes, and its limits.

use super::capture::Analog;
use super::response::panels;
use crate::design::Problem;
use crate::units::FastPeriods;

/// Least number of fast samples of an analytic source whose length is not given (thesis 5.6).
const USUAL_SAMPLES: f64 = 200.0;
/// Largest number of fast samples of a simulation: the transforms of a recording of this length take 4 GiB.
pub const MOST_SAMPLES: usize = 1 << 25;
/// Largest number of quadrature panels of a chirp per converter, about ten seconds of computing.
const MOST_PANELS: f64 = 2e7;

/// A simulation that is refused before it starts.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum WorkloadError {
    /// No sample at all.
    #[error("shorter than one slow sample, so there is nothing to capture")]
    Nothing,
    /// More than [`MOST_SAMPLES`].
    #[error("{samples} fast samples are more than the limit of {MOST_SAMPLES}; ask for fewer samples")]
    Samples {
        /// Fast samples.
        samples: usize,
    },
    /// The quadrature takes too long.
    #[error(
        "the chirp or a front end is too fast for the fast rate: it takes {panels:.1e} integration steps, more than \
         the limit of {MOST_PANELS:.0e}; check the units of frequencies and fast_period, or ask for fewer samples"
    )]
    Panels {
        /// Panels per converter.
        panels: f64,
    },
}

impl Analog {
    /// Fast samples to its end, at least 200 for a closed form; whole frames of a recording.
    pub fn usual_samples(&self, ratio: usize) -> usize {
        match self {
            Self::Known(source) => {
                let length = source.duration().unwrap_or_default().0.ceil();
                length.clamp(USUAL_SAMPLES, MOST_SAMPLES as f64 + 1.0) as usize
            }
            Self::Recorded(recording) => {
                let length = (recording.duration() * (1.0 + 1e-12)).0.floor() as usize;
                length / ratio * ratio
            }
        }
    }
}

/// The frames of `samples` fast samples, if they are not more than can be simulated; `jittered`: the
/// instants of the converters jitter.
///
/// # Errors
/// [`WorkloadError`]: no sample or too many, or a chirp or a front end so fast that the quadrature would
/// take too long.
pub fn frames(
    problem: &Problem,
    signal: &Analog,
    samples: usize,
    jittered: bool,
) -> Result<usize, WorkloadError> {
    match samples {
        0 => return Err(WorkloadError::Nothing),
        _ if samples > MOST_SAMPLES => return Err(WorkloadError::Samples { samples }),
        _ => {}
    }
    let frames = samples.div_ceil(problem.ratio);
    let panels = most_panels(problem, signal, frames * problem.ratio, jittered);
    if panels <= MOST_PANELS { Ok(frames) } else { Err(WorkloadError::Panels { panels }) }
}

fn most_panels(problem: &Problem, signal: &Analog, samples: usize, jittered: bool) -> f64 {
    let Analog::Known(source) = signal else { return 0.0 };
    let span = FastPeriods(samples as f64);
    let filters = problem.front_ends.iter();
    filters.map(|filter| panels(filter, source, span, jittered)).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{Periodic, Source};
    use crate::spec::Spec;
    use crate::units::Seconds;

    fn problem() -> Problem {
        let text = "fast_period = 1.0\nratio = 2\nlatency = 0\nchannel = [{ delay = 0.5 }]\n\
                    target = { filter = { num = [0.25], den = [1.0, 1.0, 0.25] } }";
        Problem::new(&Spec::from_toml(text, "spec.toml").unwrap(), 0).unwrap()
    }

    fn known(text: &str) -> Analog {
        Analog::Known(text.parse::<Source>().unwrap().normalised(Seconds(1.0)))
    }

    #[test]
    fn a_source_is_simulated_to_its_end() {
        assert_eq!(known("tones:0.3").usual_samples(2), 200);
        assert_eq!(known("chirp:0.01Hz..0.1Hz@1234.5s").usual_samples(2), 1235);
        let recording = Periodic::new(&[0.0; 11], FastPeriods(1.0));
        assert_eq!(Analog::Recorded(recording).usual_samples(4), 8);
    }

    #[test]
    fn work_has_limits() {
        let (problem, tone) = (problem(), known("tones:0.3"));
        assert_eq!(frames(&problem, &tone, 201, true), Ok(101));
        assert_eq!(frames(&problem, &tone, 0, false), Err(WorkloadError::Nothing));
        let samples = MOST_SAMPLES + 1;
        assert_eq!(frames(&problem, &tone, samples, false), Err(WorkloadError::Samples { samples }));
        let chirp = known("chirp:1Hz..1e9Hz@1000s");
        assert!(matches!(frames(&problem, &chirp, 1000, false), Err(WorkloadError::Panels { .. })));
    }
}
