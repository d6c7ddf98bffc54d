//! The latency of recursive banks. They see all past samples, and a bank that delays its output by one fast
//! sample is a bank of one more sample of latency, so neither error grows with the latency.

use super::search::WORTHWHILE;
use crate::design::DesignError;
use crate::design::history_errors::HistoryErrors;
use crate::design::problem::Problem;
use std::collections::BTreeMap;

/// Latencies are tried up to so many slow periods beyond the longest delay.
const LONGEST_PERIODS: usize = 8;
/// Frames of history that stand for all past samples, at first and at most.
const HISTORY: (usize, usize) = (32, 2048);
/// The history suffices when its doubling changes no error by more than this fraction.
const SAME_ERROR: f64 = 1e-4;
/// Errors below this fraction of the target count as equal.
pub(super) const NEGLIGIBLE: f64 = 1e-9;

/// The least errors of all causal banks at the latencies 0, 1, .., for white noise at the analog input.
#[derive(Debug)]
pub(super) struct CausalErrors {
    /// The root mean square over all phases of the output.
    rms: Vec<f64>,
    /// The root of the largest mean square of any phase: a lower bound of gamma, up to [`SAME_ERROR`].
    worst: Vec<f64>,
    /// The rms of the target, the error of a bank that outputs zeros.
    zero_output: f64,
}

impl CausalErrors {
    /// Up to [`LONGEST_PERIODS`] beyond the longest delay.
    ///
    /// # Errors
    /// As [`HistoryErrors::new`].
    pub(super) fn new(problem: &Problem) -> Result<Self, DesignError> {
        let longest = problem.longest_delay().0.ceil() as usize + LONGEST_PERIODS * problem.ratio;
        let mut frames = longest.div_ceil(problem.ratio) + HISTORY.0;
        let mut errors = Self::with_history(problem, longest, frames)?;
        while frames < HISTORY.1 {
            frames *= 2;
            let more = Self::with_history(problem, longest, frames)?;
            let same = |(a, b): (&f64, &f64)| a - b <= SAME_ERROR * a;
            let pairs = errors.rms.iter().zip(&more.rms).chain(errors.worst.iter().zip(&more.worst));
            let done = pairs.into_iter().all(same);
            errors = more;
            if done {
                break;
            }
        }
        Ok(errors)
    }

    fn with_history(problem: &Problem, longest: usize, frames: usize) -> Result<Self, DesignError> {
        let ratio = problem.ratio as i64;
        let history = HistoryErrors::new(problem, frames, -(longest as i64)..=ratio - 1)?;
        let least = NEGLIGIBLE * NEGLIGIBLE * history.power;
        let errors = |latency: usize| (0..ratio).map(move |p| p - latency as i64);
        let square = |latency: usize| errors(latency).map(|at| history.at(at).max(least));
        Ok(Self {
            rms: (0..=longest).map(|m| (square(m).sum::<f64>() / ratio as f64).sqrt()).collect(),
            worst: (0..=longest).map(|m| square(m).fold(0.0, f64::max).sqrt()).collect(),
            zero_output: history.power.sqrt(),
        })
    }

    /// The rms of the target.
    pub(super) fn zero_output(&self) -> f64 {
        self.zero_output
    }

    /// The shortest latency whose rms error is within [`WORTHWHILE`] of the least.
    pub(super) fn shortest(&self) -> usize {
        let least = self.rms.iter().copied().fold(f64::INFINITY, f64::min);
        self.rms.iter().position(|rms| *rms <= least * (1.0 + WORTHWHILE)).unwrap_or(0)
    }

    fn longest(&self) -> usize {
        self.rms.len() - 1
    }

    /// The number of latencies, from 0 on, at which no bank has a gamma of at most `gamma`.
    fn too_short_for(&self, gamma: f64) -> usize {
        self.worst.iter().position(|worst| *worst <= gamma).unwrap_or(self.worst.len())
    }
}

/// The shortest latency whose gamma is within [`WORTHWHILE`] of the least. `design(latency)` is the gamma of
/// a design, infinite if it failed; no design has a gamma below `floor`.
pub(super) fn shortest(
    errors: &CausalErrors,
    ratio: usize,
    floor: f64,
    mut design: impl FnMut(usize) -> f64,
) -> usize {
    let start = errors.shortest();
    let mut gammas = BTreeMap::new();
    let (mut latency, mut step) = (start, ratio);
    loop {
        let gamma = design(latency).max(floor);
        gammas.insert(latency, gamma);
        if gamma <= floor * (1.0 + WORTHWHILE) || latency >= errors.longest() {
            break;
        }
        (latency, step) = ((latency + step).min(errors.longest()), 2 * step);
    }
    // Long latencies may be beyond the designer.
    let mut latency = start;
    while choice(&gammas).is_none() && latency > 0 {
        latency /= 2;
        gammas.insert(latency, design(latency).max(floor));
    }
    while let Some(latency) = between(&gammas, errors) {
        gammas.insert(latency, design(latency).max(floor));
    }
    choice(&gammas).unwrap_or(start)
}

/// The shortest latency that is almost the best of those that were designed.
fn choice(gammas: &BTreeMap<usize, f64>) -> Option<usize> {
    let best = gammas.values().copied().fold(f64::INFINITY, f64::min);
    let enough = |(_, gamma): &(&usize, &f64)| **gamma <= best * (1.0 + WORTHWHILE);
    gammas.iter().find(enough).map(|(&latency, _)| latency).filter(|_| best.is_finite())
}

/// The middle of the latencies that may be the choice: shorter than the present one, and longer than those
/// that are known to be too short.
fn between(gammas: &BTreeMap<usize, f64>, errors: &CausalErrors) -> Option<usize> {
    let chosen = choice(gammas)?;
    let best = gammas.values().copied().fold(f64::INFINITY, f64::min);
    let failed = gammas.range(..chosen).next_back().map_or(0, |(&latency, _)| latency + 1);
    let first = failed.max(errors.too_short_for(best * (1.0 + WORTHWHILE)));
    (first < chosen).then_some(first + (chosen - first) / 2)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn errors(rms: Vec<f64>) -> CausalErrors {
        CausalErrors { worst: rms.clone(), rms, zero_output: 1.0 }
    }

    #[test]
    fn the_shortest_latency_is_found_in_few_designs() {
        for knee in [0usize, 3, 17, 40, 63] {
            let gamma = |m: usize| 0.1f64.max(1.2f64.powi(knee as i32 - m as i32) * 0.1);
            let guide = errors((0..64).map(|m| 0.2 * gamma(m)).collect());
            let mut designs = 0;
            let design = |m| {
                designs += 1;
                gamma(m)
            };
            assert_eq!(shortest(&guide, 4, 0.1, design), knee);
            assert!(designs < 14, "{designs}");
        }
    }

    #[test]
    fn failed_designs_are_passed_over() {
        let guide = errors((0..32).map(|m| 0.5f64.powi(m)).collect());
        // Nothing below latency 9 and nothing from 20 on can be designed.
        let design = |m: usize| if (9..20).contains(&m) { 0.6f64.powi(m as i32) } else { f64::INFINITY };
        let chosen = shortest(&guide, 2, 1e-9, design);
        assert!((9..20).contains(&chosen), "{chosen}");
        assert_eq!(shortest(&guide, 2, 1e-9, |_| f64::INFINITY), guide.shortest());
    }
}
