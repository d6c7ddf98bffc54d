//! Missing samples of the converters of a bank, estimated from all samples around them.

use super::DesignError;
use super::deviations::Deviations;
use super::known_instants::with_noise;
use super::problem::Problem;
use super::root_covariance::RootCovariance;
use hybank_core::bank::Bank;
use hybank_core::pipeline::{GapEstimate, GapEstimator};

/// Samples of all converters on either side of a frame, about.
const SAMPLES: usize = 48;

/// Estimates missing samples by the spec of a bank: its front ends, delays and gains with their uncertainty,
/// the spectrum of the signal and the noise; a converter without stated noise has that of 16 bits.
///
/// With the samples y and the target z as random variables, the estimate of a missing sample is its
/// projection on the known ones, and the error of an output that of the projection of z on them
/// (`design/root_covariance.rs`).
#[derive(Debug)]
pub struct MissingSamples {
    root: RootCovariance,
    reach: usize,
    /// Samples of a frame.
    samples: usize,
    /// M.
    ratio: usize,
    /// S.
    wait: usize,
    /// The errors of the outputs of a frame where nothing is missing.
    errors: Vec<f64>,
}

impl MissingSamples {
    /// Of the converters of a bank.
    ///
    /// # Errors
    /// [`DesignError::NoSpec`] for a bank without front ends; as [`Problem::new`] and
    /// [`Problem::check_size`].
    pub fn of_bank(bank: &Bank) -> Result<Self, DesignError> {
        let problem = Problem::of_bank(bank)?;
        problem.check_size()?;
        let deviations = bank.spec.as_ref().map(Deviations::uncertain).unwrap_or_default();
        Ok(Self::of(&with_noise(problem, bank.spec.as_ref()), &deviations))
    }

    fn of(problem: &Problem, deviations: &[Deviations]) -> Self {
        let (samples, ratio, wait) = (problem.channels.len(), problem.ratio, problem.wait);
        let reach = SAMPLES.div_ceil(samples);
        let instants = instants(reach, ratio, wait);
        let root = RootCovariance::new(problem, deviations, 2 * reach + 1, instants[0]..=instants[ratio - 1]);
        let errors = instants.iter().map(|&instant| root.error(2 * reach + 1, instant)).collect();
        Self { root, reach, samples, ratio, wait, errors }
    }

    /// The place in the root, where frames stand from the newest on, of a place in the frames in their
    /// order.
    fn place(&self, index: usize) -> usize {
        let (frame, sample) = (index / self.samples, index % self.samples);
        (2 * self.reach - frame) * self.samples + sample
    }
}

impl GapEstimator for MissingSamples {
    fn reach(&self) -> usize {
        self.reach
    }

    fn error(&self) -> f64 {
        self.errors.iter().sum::<f64>() / (self.ratio as f64 * self.root.power)
    }

    fn estimate(&self, is_there: &[bool]) -> GapEstimate {
        let known: Vec<usize> = (0..is_there.len()).filter(|&k| is_there[k]).collect();
        let partial = self.root.of_known(&known.iter().map(|&k| self.place(k)).collect::<Vec<_>>());
        let own = self.reach * self.samples..(self.reach + 1) * self.samples;
        let missing: Vec<_> = own.filter(|&k| !is_there[k]).map(|k| partial.sample(self.place(k))).collect();
        let spread = |weights: &[f64]| {
            let mut all = vec![0.0; is_there.len()];
            known.iter().zip(weights).for_each(|(&k, weight)| all[k] = *weight);
            all
        };
        let instants = instants(self.reach, self.ratio, self.wait);
        let added = instants.iter().zip(&self.errors).map(|(&t, whole)| partial.target_error(t) - whole);
        GapEstimate {
            weights: missing.iter().map(|estimate| spread(&estimate.weights)).collect(),
            deviations: missing.iter().map(|estimate| (estimate.error / self.root.power).sqrt()).collect(),
            added_error: added.fold(0.0, f64::max) / self.root.power,
        }
    }
}

/// The outputs of the middle frame, after the newest frame.
fn instants(reach: usize, ratio: usize, wait: usize) -> Vec<i64> {
    (0..ratio).map(|p| p as i64 - (reach * ratio + wait) as i64).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use hybank_core::spec::Spec;

    /// Two channels of 24 kS/s after Butterworth 4 at 14 kHz, the second 0.4 periods later, band to 18 kHz;
    /// noise of 1e-8 and 1e-8 / 0.36 of the signal before the filters.
    fn two_channels() -> Problem {
        let text = "fast_rate = 96000\nratio = 4\n\
            [target]\nfilter = { family = \"butterworth\", order = 4, cutoff = 14000 }\n\
            [signal]\nband = 18000\n\
            [[channel]]\ndelay = \"4 samples\"\n[[channel]]\ndelay = \"2.4 samples\"\n\
            [design]\nmethod = \"h2\"\ntaps = 32\n";
        let problem = Problem::new(&Spec::from_toml(text, "test").unwrap(), 0).unwrap();
        let root = RootCovariance::new(&problem, &[], 1, 0..=0);
        // Of unit density in the band.
        let power = 2.0 * 18_000.0 / 96_000.0;
        let noise = [1.0, 1.0 / 0.36].map(|share| 1e-8 * share * power / root.noise_scale).to_vec();
        Problem { noise, ..problem }
    }

    /// The ratios at t = 0, 1/4 and 1/2 slow periods without the samples -5 to 4 of the second channel, from
    /// the samples -23 to 24 of both, by dense solves with 1,600 nodes in other code.
    #[test]
    fn a_gap_costs_what_dense_solves_say() {
        // Sample n of both channels is in frame 24 + n of 49; the newest frame is at 0.
        let root = RootCovariance::new(&two_channels(), &[], 49, -100..=-98);
        let db = |error: f64| 10.0 * (root.power / error).log10();
        let of = |is_known: &dyn Fn(usize, i32) -> bool| {
            let all = (-23..=24).flat_map(|n| [(n, 0), (n, 1)]);
            let known: Vec<usize> = all
                .filter(|&(n, channel)| is_known(channel, n))
                .map(|(n, channel)| 2 * (24 - n) as usize + channel)
                .collect();
            let partial = root.of_known(&known);
            [-100, -99, -98].map(|instant| db(partial.target_error(instant)))
        };
        let whole = of(&|_, _| true);
        let lost = of(&|channel, n| channel == 0 || !(-5..=4).contains(&n));
        for p in 0..3 {
            assert!((whole[p] - [79.446, 77.707, 75.640][p]).abs() < 0.001, "{p}: {whole:?}");
            assert!((lost[p] - [78.922, 9.161, 6.447][p]).abs() < 0.001, "{p}: {lost:?}");
        }
    }

    /// The taps for all samples, with estimates for the missing ones, have the error of the taps for the
    /// samples that are there.
    #[test]
    fn estimates_of_samples_make_the_best_outputs() {
        let missing = MissingSamples::of(&two_channels(), &[]);
        let (reach, frames) = (missing.reach, 2 * missing.reach + 1);
        let mut is_there = vec![true; 2 * frames];
        (is_there[2 * reach], is_there[2 * reach + 1]) = (false, false);
        let estimate = missing.estimate(&is_there);
        let mut added = 0.0_f64;
        for (p, instant) in instants(reach, 4, 0).into_iter().enumerate() {
            let whole = missing.root.taps(frames, instant);
            let mut taps = whole.clone();
            for (k, weights) in estimate.weights.iter().enumerate() {
                let lost = missing.place(2 * reach + k);
                for (place, weight) in weights.iter().enumerate() {
                    taps[missing.place(place)] += whole[lost] * weight;
                }
                taps[lost] = 0.0;
            }
            added = added.max(missing.root.error_of(&taps, instant) - missing.errors[p]);
        }
        assert!((added / missing.root.power / estimate.added_error - 1.0).abs() < 1e-6);
    }
}
