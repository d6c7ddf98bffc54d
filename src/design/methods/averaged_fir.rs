//! The FIR bank with the least mean-square error for channels whose delays and gains are uncertain: the
//! error is averaged over Gaussian errors that each converter keeps.
//!
//! The samples of one converter share their error, so their covariances among one another stay as they are;
//! the covariances of different converters are multiplied by the characteristic functions of both errors in
//! the spectrum, and those with the target by that of one. That is the same as a channel of less gain at
//! high frequencies with further noise. A channel of which little is known so gets little weight, and the
//! bank is never worse than the best single channel.

use super::mean_square_fir::{of_phases, with_rounding};
use super::{Deviations, Synthesis};
use crate::design::DesignError;
use crate::design::covariances::{Averaged, Covariances};
use crate::design::plant::LiftedPlant;
use crate::design::problem::Problem;
use crate::linalg::{self, Mat};
use crate::units::FastPeriods;

/// Share of a sample's power that is added to it: covariances have no more digits. Errors of banks are known
/// down to 140 dB below the samples.
const COVARIANCE_RESOLUTION: f64 = 1e-14;

/// The `length` taps per channel with the least mean of `||K||_2^2` over the errors, plus
/// `sum_i noise_i ||f_i||^2`. Its norm is that for channels without errors.
///
/// # Errors
/// [`DesignError::Lti`] for unstable plants, [`DesignError::Linalg`] if the covariances are not positive.
pub(crate) fn synthesise(
    plant: &LiftedPlant,
    length: usize,
    deviations: &[Deviations],
) -> Result<Synthesis, DesignError> {
    let problem = with_rounding(plant)?;
    let samples = Samples::new(&problem, deviations)?;
    let taps = of_phases(&problem, length, |frames, instants| {
        let normal = samples.among(frames);
        let targets: Vec<Mat> = instants.map(|instant| samples.with_target(frames, instant)).collect();
        let weights = linalg::solve_positive(&normal, &linalg::hstack(&targets.iter().collect::<Vec<_>>()))?;
        let channels = problem.channels.len();
        let of = |k: usize, i: usize| (0..frames).map(|j| weights[(j * channels + i, k)]).collect();
        Ok((0..targets.len()).map(|k| (0..channels).map(|i| of(k, i)).collect()).collect())
    })?;
    Synthesis::of_taps(plant, taps)
}

/// The covariances of all samples.
struct Samples<'a> {
    problem: &'a Problem,
    deviations: &'a [Deviations],
    covariances: Covariances,
}

impl<'a> Samples<'a> {
    fn new(problem: &'a Problem, deviations: &'a [Deviations]) -> Result<Self, DesignError> {
        Ok(Self { problem, deviations, covariances: Covariances::new(problem)? })
    }

    /// R: of the samples among one another, frame by frame and channels inside.
    fn among(&self, frames: usize) -> Mat {
        let channels = self.problem.channels.len();
        let mut all = Mat::zeros(frames * channels, frames * channels);
        for (i, k) in (0..channels).flat_map(|i| (0..=i).map(move |k| (i, k))) {
            // Of a sample of channel i and one of channel k so many frames before it.
            let averaged = self.covariances.averaged(self.difference(i, k));
            let last = frames as i64 - 1;
            let lags: Vec<f64> = (-last..=last).map(|lag| self.pair(&averaged, i, k, lag)).collect();
            for (j, l) in (0..frames).flat_map(|j| (0..frames).map(move |l| (j, l))) {
                let value = lags[l + frames - 1 - j];
                all[(j * channels + i, l * channels + k)] = value;
                all[(l * channels + k, j * channels + i)] = value;
            }
        }
        for r in 0..all.nrows() {
            all[(r, r)] += COVARIANCE_RESOLUTION * all[(r, r)] + self.problem.noise[r % channels];
        }
        all
    }

    fn pair(&self, averaged: &Averaged<'_>, i: usize, k: usize, lag: i64) -> f64 {
        let (a, b) = (&self.problem.channels[i], &self.problem.channels[k]);
        let later = b.delay.later_by(lag as f64 * self.problem.ratio as f64).since(a.delay).0;
        let is_one = a.converter == b.converter;
        let common = if is_one { 1.0 + self.deviations[a.converter].gain.powi(2) } else { 1.0 };
        a.gain * b.gain * common * averaged.at(a.front_end, b.front_end, later)
    }

    /// The deviation of the difference of the errors of two samples; those of one converter share theirs.
    fn difference(&self, i: usize, k: usize) -> FastPeriods {
        let [one, other] = [i, k].map(|channel| self.problem.channels[channel].converter);
        let [a, b] = [one, other].map(|converter| self.deviations[converter].delay.0);
        FastPeriods(if one == other { 0.0 } else { a.hypot(b) })
    }

    /// b: of the samples with the target at `instant`.
    fn with_target(&self, frames: usize, instant: i64) -> Mat {
        let channels = self.problem.channels.len();
        let mut all = Mat::zeros(frames * channels, 1);
        for (i, channel) in self.problem.channels.iter().enumerate() {
            let averaged = self.covariances.averaged(self.deviations[channel.converter].delay);
            for j in 0..frames {
                let later = channel.delay.later_by((j * self.problem.ratio) as f64 + instant as f64);
                let later = later.in_fast_periods().0;
                all[j * channels + i] =
                    channel.gain * averaged.at(self.problem.target, channel.front_end, later);
            }
        }
        all
    }
}
