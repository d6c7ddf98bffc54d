//! A real or complex analog signal.

use super::normal::Purpose;
use super::{Analog, ComplexSource, Delivered, Sampler, WorkloadError, frames, target};
use crate::design::Problem;
use crate::units::Seconds;

/// An analog signal in normalised time.
#[derive(Debug, Clone)]
pub struct Signal {
    /// The signal, or its real part.
    pub real: Analog,
    /// The imaginary part of a complex signal.
    pub imaginary: Option<Analog>,
}

impl Signal {
    /// A source in fast periods of this length.
    pub fn of_source(source: &ComplexSource, fast_period: Seconds) -> Self {
        let (real, imaginary) = source.parts();
        let known = |part: super::Source| Analog::Known(part.normalised(fast_period));
        Self { real: known(real), imaginary: (!source.is_real()).then(|| known(imaginary)) }
    }

    /// Real and imaginary part.
    pub fn parts(&self) -> impl Iterator<Item = &Analog> + Clone {
        std::iter::once(&self.real).chain(&self.imaginary)
    }

    /// The frames of `samples` fast samples, or of the longer part; `jittered` as in [`frames`].
    ///
    /// # Errors
    /// Those of [`frames`].
    pub fn frames(
        &self,
        problem: &Problem,
        samples: Option<usize>,
        jittered: bool,
    ) -> Result<usize, WorkloadError> {
        let usual = || self.parts().map(|part| part.usual_samples(problem.ratio)).max().unwrap_or(0);
        let samples = samples.unwrap_or_else(usual);
        let count = |part| frames(problem, part, samples, jittered);
        self.parts().map(count).try_fold(0, |most, count| Ok(most.max(count?)))
    }

    /// What `converter` delivers of both parts, times `level`, as channel `i` of `problem`.
    pub fn captured(
        &self,
        problem: &Problem,
        i: usize,
        converter: &Sampler,
        level: f64,
        frames: usize,
    ) -> Delivered {
        let real = converter.capture(problem, i, &self.real, level, frames);
        let Some(part) = &self.imaginary else { return real };
        let imaginary = converter.capture_part(problem, i, part, level, frames, Purpose::ImaginaryNoise);
        let clipped = real.clipped + imaginary.clipped;
        Delivered { imaginary: Some(imaginary.samples), clipped, ..real }
    }

    /// The samples of both parts, times `level`, of the ideal fast converter.
    pub fn target(&self, problem: &Problem, level: f64, frames: usize) -> (Vec<f64>, Option<Vec<f64>>) {
        let amplified = |part| {
            let mut samples = target(problem, part, frames);
            samples.iter_mut().for_each(|x| *x *= level);
            samples
        };
        (amplified(&self.real), self.imaginary.as_ref().map(amplified))
    }
}
