//! The least errors of FIR banks at all latencies and of all lengths up to a longest one, with the taps that
//! attain them: the whole error, that of the signal and the noise of the converters at the output.
//!
//! Phase p of the output has `J_p = ceil((taps - p) / M)` lags, so it sees the newest `J_p` frames. Its
//! least mean-square error depends only on the instant `p - m0` of the target relative to these frames: see
//! [`RootCovariance`].

use super::DesignError;
use super::deviations::Deviations;
use super::problem::Problem;
use super::root_covariance::RootCovariance;
use hybank_core::spec::MAX_LATENCY;
use std::ops::RangeInclusive;

/// Share of the target's power that some phase must be able to remove. Below it the error is that of zero
/// output.
const LEAST_REMOVED: f64 = 1e-3;
/// Mean squares below this share of the target's count as equal: rounding decides between them.
const SAME_SQUARE: f64 = 1e-28;

/// Latency and number of taps of a bank.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct BankSize {
    /// Per channel at the fast rate; 0 for recursive filters.
    pub(super) taps: usize,
    pub(super) latency: usize,
}

/// The least errors of FIR banks.
#[derive(Debug)]
pub(super) struct FirErrors {
    root: RootCovariance,
    ratio: usize,
    channels: usize,
    pub(super) longest: usize,
    latencies: RangeInclusive<usize>,
}

impl FirErrors {
    /// Of banks of at most `most` taps per channel at these latencies. `deviations` are those of the
    /// converters, over which the errors are means; none if all are exact.
    pub(super) fn new(
        problem: &Problem,
        deviations: &[Deviations],
        most: usize,
        latencies: RangeInclusive<usize>,
    ) -> Self {
        let (ratio, channels) = (problem.ratio, problem.channels.len());
        let instants = -(*latencies.end() as i64)..=(ratio as i64 - 1 - *latencies.start() as i64);
        let root = RootCovariance::new(problem, deviations, most.div_ceil(ratio), instants);
        Self { root, ratio, channels, longest: most, latencies }
    }

    /// The mean square of the target, the error of a bank that outputs zeros.
    pub(super) fn zero_output(&self) -> f64 {
        self.root.power
    }

    /// The least mean square over all phases.
    pub(super) fn square(&self, size: BankSize) -> f64 {
        self.phases(size).map(|(frames, instant)| self.root.error(frames, instant)).sum::<f64>()
            / self.ratio as f64
    }

    /// The latency of the least error with so many taps: the shortest one where rounding would choose.
    pub(super) fn best(&self, taps: usize) -> BankSize {
        let floor = SAME_SQUARE * self.zero_output();
        let error = |latency: &usize| self.square(BankSize { taps, latency: *latency }).max(floor);
        let least = self.latencies.clone().min_by(|a, b| error(a).total_cmp(&error(b)));
        BankSize { taps, latency: least.unwrap_or(*self.latencies.start()) }
    }

    /// The taps of the least error, `[i][n]` of channel i.
    pub(super) fn taps(&self, size: BankSize) -> Vec<Vec<f64>> {
        let mut taps = vec![vec![0.0; size.taps]; self.channels];
        for (p, (frames, instant)) in self.phases(size).enumerate() {
            for (k, weight) in self.root.taps(frames, instant).into_iter().enumerate() {
                taps[k % self.channels][p + k / self.channels * self.ratio] = weight;
            }
        }
        taps
    }

    /// The mean square over all phases with any taps.
    pub(super) fn square_of(&self, taps: &[Vec<f64>], latency: usize) -> f64 {
        let size = BankSize { taps: taps[0].len(), latency };
        let phase = |(p, (frames, instant)): (usize, (usize, i64))| {
            let lags = (0..frames).map(|j| p + j * self.ratio);
            let own: Vec<f64> = lags.flat_map(|n| taps.iter().map(move |tap| tap[n])).collect();
            self.root.error_of(&own, instant)
        };
        self.phases(size).enumerate().map(phase).sum::<f64>() / self.ratio as f64
    }

    /// The mean square over all phases of noise with these powers, in the scale of the problem.
    pub(super) fn noise_of(&self, taps: &[Vec<f64>], noise: &[f64]) -> f64 {
        let own = |(tap, power): (&Vec<f64>, &f64)| power * tap.iter().map(|x| x * x).sum::<f64>();
        self.root.noise_scale * taps.iter().zip(noise).map(own).sum::<f64>() / self.ratio as f64
    }

    /// Whether some phase can remove a noticeable part of the target.
    fn removes(&self, size: BankSize) -> bool {
        let most = (1.0 - LEAST_REMOVED) * self.zero_output();
        self.phases(size).any(|(frames, instant)| self.root.error(frames, instant) <= most)
    }

    /// Frames and instant of each phase.
    fn phases(&self, BankSize { taps, latency }: BankSize) -> impl Iterator<Item = (usize, i64)> {
        let ratio = self.ratio;
        (0..ratio).map(move |p| (taps.saturating_sub(p).div_ceil(ratio), p as i64 - latency as i64))
    }
}

/// Refuses a latency at which no tap sees a sample that has to do with the target.
///
/// # Errors
/// [`DesignError::OutOfReach`] with the latencies that the taps reach.
pub(super) fn check_reach(problem: Problem, taps: usize) -> Result<(), DesignError> {
    let latency = problem.latency;
    if is_covered(&problem, taps) {
        return Ok(());
    }
    // Where there is much noise no tap removes anything, however near its sample is.
    let problem = Problem { noise: vec![0.0; problem.noise.len()], ..problem };
    if FirErrors::new(&problem, &[], taps, latency..=latency).removes(BankSize { taps, latency }) {
        return Ok(());
    }
    let latencies = candidates(&problem, taps);
    let errors = FirErrors::new(&problem, &[], taps, latencies.clone());
    let reached = |latency: &usize| errors.removes(BankSize { taps, latency: *latency });
    let shortest = latencies.clone().find(reached).unwrap_or_default();
    let longest = latencies.rev().find(reached).unwrap_or_default();
    Err(DesignError::OutOfReach { latency, taps, shortest, longest })
}

/// Whether an output instant lies between the samples that the taps of one channel see.
fn is_covered(problem: &Problem, taps: usize) -> bool {
    let history = (taps.div_ceil(problem.ratio).saturating_sub(1) * problem.ratio) as f64;
    let mut instants = (0..taps.min(problem.ratio)).map(|p| p as f64 - problem.latency as f64);
    let sees = |newest: f64, instant: f64| (newest - history..=newest).contains(&instant);
    instants.any(|instant| problem.delays().iter().any(|delay| sees(-delay.0, instant)))
}

/// All latencies that are candidates for a design: from the wait for a whole frame up to the oldest sample
/// that a tap sees.
pub(super) fn candidates(problem: &Problem, taps: usize) -> RangeInclusive<usize> {
    problem.wait..=(taps + problem.longest_delay().0.ceil() as usize).min(MAX_LATENCY)
}
