//! Taps of least mean-square error for a set of samples, and the error of any taps.

use super::signals::Signals;
use hybank_core::units::FastPeriods;
use hybank_linalg::{LinalgError, Mat, PositiveFactor};

/// A sample of a set.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimedSample {
    /// Its converter.
    pub converter: usize,
    /// Its true instant, relative to any origin that all instants of a call share.
    pub instant: FastPeriods,
}

/// A mean-square error, over the power of the target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeanSquare {
    /// What is wrong of the signal; it grows with the power of the signal.
    pub signal: f64,
    /// The noise of the samples in the output.
    pub noise: f64,
}

impl MeanSquare {
    /// The mean of some; there is at least one.
    pub(super) fn mean(errors: &[Self]) -> Self {
        let mean = |part: fn(&Self) -> f64| errors.iter().map(part).sum::<f64>() / errors.len() as f64;
        Self { signal: mean(|error| error.signal), noise: mean(|error| error.noise) }
    }

    /// Of both.
    pub fn total(self) -> f64 {
        self.signal + self.noise
    }
}

/// Taps for a set of samples.
#[derive(Debug, Clone, PartialEq)]
pub struct EstimatorTaps {
    /// Weights of the samples (rows) for each instant (columns).
    pub weights: Mat,
    /// The error at each instant.
    pub errors: Vec<MeanSquare>,
}

/// Estimates the target from any set of samples.
///
/// ```
/// use hybank_core::units::{CyclesPerFastPeriod, FastPeriods};
/// use hybank_instants::{Converter, Estimator, TimedSample, Signals, Spectrum};
/// use hybank_linalg::Complex;
/// // Two converters of half the rate, band up to 0.375 cycles per fast period, no front ends.
/// let band = CyclesPerFastPeriod(0.0)..CyclesPerFastPeriod(0.375);
/// let spectrum = Spectrum::flat(band, FastPeriods(64.0));
/// let converters = vec![Converter::exact(0, 1.0, 1e-8), Converter::exact(0, -0.5, 1e-8)];
/// let signals = Signals::new(&spectrum, &[&|_| Complex::from(1.0)], 0, converters);
/// let at = |converter, instant| TimedSample { converter, instant: FastPeriods(instant) };
/// let pair = |n: i32| [at(0, 2.0 * f64::from(n)), at(1, 2.0 * f64::from(n) + 0.8)];
/// let samples: Vec<TimedSample> = (-15..15).flat_map(pair).collect();
/// let taps = Estimator::new(signals).taps(&samples, &[FastPeriods(1.0)])?;
/// assert!(taps.errors[0].total() < 1e-7);
/// # Ok::<(), hybank_linalg::LinalgError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Estimator {
    signals: Signals,
}

impl Estimator {
    /// For samples with these covariances.
    pub fn new(signals: Signals) -> Self {
        Self { signals }
    }

    /// The covariances.
    pub fn signals(&self) -> &Signals {
        &self.signals
    }

    /// The covariances of some samples among one another. All instants of a call lie within
    /// [`Signals::longest`] of one another.
    pub fn set<'a>(&'a self, samples: &'a [TimedSample]) -> SampleSet<'a> {
        let mut among = self.signal_covariances(samples);
        for (k, sample) in samples.iter().enumerate() {
            among[(k, k)] += self.signals.noise_of(sample.converter);
        }
        SampleSet { signals: &self.signals, samples, among }
    }

    /// The covariances of some samples among one another without noise, the lower triangle. It is filled
    /// diagonal by diagonal, because times hardly change along these where clocks are even.
    pub(super) fn signal_covariances(&self, samples: &[TimedSample]) -> Mat {
        let count = samples.len();
        let mut among = Mat::zeros(count, count);
        for below in 0..count {
            let pairs: Vec<_> = samples[below..].iter().zip(samples).collect();
            let mut diagonal = among.as_mut_slice()[below..].iter_mut().step_by(count + 1);
            let converters =
                |(first, second): &(&TimedSample, &TimedSample)| (first.converter, second.converter);
            for run in pairs.chunk_by(|one, next| converters(one) == converters(next)) {
                let mut times: Vec<f64> =
                    run.iter().map(|(first, second)| (first.instant - second.instant).0).collect();
                let (first, second) = converters(&run[0]);
                self.signals.of_samples(first, second).of_times(&mut times);
                times.iter().zip(&mut diagonal).for_each(|(covariance, entry)| *entry = *covariance);
            }
        }
        among
    }

    /// The taps `C^-1 r` for the target at each of `instants`.
    ///
    /// # Errors
    /// [`LinalgError::NotPositiveDefinite`] for samples that are given twice.
    pub fn taps(
        &self,
        samples: &[TimedSample],
        instants: &[FastPeriods],
    ) -> Result<EstimatorTaps, LinalgError> {
        let set = self.set(samples);
        let with_target = set.with_target(instants);
        set.taps(&with_target)
    }
}

/// The covariances C of a set of samples.
#[derive(Debug)]
pub struct SampleSet<'a> {
    signals: &'a Signals,
    samples: &'a [TimedSample],
    /// C, its lower triangle.
    among: Mat,
}

impl SampleSet<'_> {
    /// r, one column for each instant.
    pub fn with_target(&self, instants: &[FastPeriods]) -> Mat {
        Mat::from_fn(self.samples.len(), instants.len(), |k, column| {
            let TimedSample { converter, instant } = self.samples[k];
            self.signals.of_target(converter).at((instant - instants[column]).0)
        })
    }

    /// The factor of C.
    ///
    /// # Errors
    /// [`LinalgError::NotPositiveDefinite`] for samples that are given twice.
    pub fn factor(&self) -> Result<PositiveFactor, LinalgError> {
        PositiveFactor::new(&self.among)
    }

    /// The best taps, from r.
    ///
    /// # Errors
    /// [`LinalgError::NotPositiveDefinite`] for samples that are given twice.
    pub fn taps(&self, with_target: &Mat) -> Result<EstimatorTaps, LinalgError> {
        // Nothing is known without samples, and 0 is the best estimate.
        let weights =
            if self.samples.is_empty() { with_target.clone() } else { self.factor()?.solve(with_target) };
        let errors = self.best_errors(&weights, with_target);
        Ok(EstimatorTaps { weights, errors })
    }

    /// The errors `1 - r' g / P_0` of the best taps g.
    pub fn best_errors(&self, weights: &Mat, with_target: &Mat) -> Vec<MeanSquare> {
        let power = self.signals.target_power();
        let error =
            |k: usize| self.parted(weights, k, 1.0 - weights.column(k).dot(&with_target.column(k)) / power);
        (0..weights.ncols()).map(error).collect()
    }

    /// The errors `1 - (2 g' r - g' C g) / P_0` of any taps g.
    pub fn errors(&self, weights: &Mat, with_target: &Mat) -> Vec<MeanSquare> {
        let power = self.signals.target_power();
        let squares = symmetric_product(&self.among, weights);
        let error = |k: usize| {
            let tap = weights.column(k);
            let total = 1.0 - (2.0 * tap.dot(&with_target.column(k)) - tap.dot(&squares.column(k))) / power;
            self.parted(weights, k, total)
        };
        (0..weights.ncols()).map(error).collect()
    }

    fn parted(&self, weights: &Mat, k: usize, total: f64) -> MeanSquare {
        let noise = |(tap, sample): (&f64, &TimedSample)| tap * tap * self.signals.noise_of(sample.converter);
        let noise: f64 = weights.column(k).iter().zip(self.samples).map(noise).sum();
        let noise = noise / self.signals.target_power();
        MeanSquare { signal: (total - noise).max(0.0), noise }
    }
}

/// The product of a symmetric matrix, of which the lower triangle is given, and another one.
fn symmetric_product(lower: &Mat, other: &Mat) -> Mat {
    let mut product = Mat::zeros(lower.nrows(), other.ncols());
    for k in 0..other.ncols() {
        product.column_mut(k).sygemv(1.0, lower, &other.column(k), 0.0);
    }
    product
}
