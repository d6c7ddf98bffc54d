//! Seeded random samples, and their number for a given confidence.

use super::RobustSettings;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64;

/// Draws subsets of indices; the same seed gives the same subsets on every platform.
struct Subsets {
    generator: Pcg64,
}

impl Subsets {
    fn new(seed: u64) -> Self {
        Self { generator: Pcg64::seed_from_u64(seed) }
    }

    /// K different indices below n >= K.
    fn draw<const K: usize>(&mut self, n: usize) -> [usize; K] {
        let mut chosen = [usize::MAX; K];
        for k in 0..K {
            loop {
                let i = self.below(n);
                if !chosen[..k].contains(&i) {
                    chosen[k] = i;
                    break;
                }
            }
        }
        chosen
    }

    /// A number below n; the bias of the multiplication is below n / 2^32.
    fn below(&mut self, n: usize) -> usize {
        ((u64::from(self.generator.next_u32()) * n as u64) >> 32) as usize
    }
}

/// RANSAC: the largest set of `total` things that agrees with the model of some K of them; `agreeing`
/// returns the set of a sample, `None` if it has no model.
pub(super) fn consensus<const K: usize>(
    total: usize,
    settings: &RobustSettings,
    agreeing: impl Fn([usize; K]) -> Option<Vec<usize>>,
) -> Vec<usize> {
    let mut subsets = Subsets::new(settings.seed);
    let mut best = Vec::new();
    for trial in 1..=settings.trials {
        if let Some(set) = agreeing(subsets.draw::<K>(total)).filter(|set| set.len() > best.len()) {
            best = set;
        }
        if trial as f64 >= trials_needed(best.len(), total, K as i32, settings.confidence) {
            break;
        }
    }
    best
}

/// Samples of `size` needed to draw one without outliers with probability `confidence`:
/// log(1 - p) / log(1 - w^size), w the share of inliers.
fn trials_needed(inliers: usize, total: usize, size: i32, confidence: f64) -> f64 {
    let clean = (inliers as f64 / total as f64).powi(size);
    if clean >= 1.0 { 1.0 } else { (1.0 - confidence).ln() / (-clean).ln_1p() }
}

/// Random numbers for trials.
#[cfg(test)]
pub(crate) struct Dice(Pcg64);

#[cfg(test)]
impl Dice {
    pub(crate) fn new(seed: u64) -> Self {
        Self(Pcg64::seed_from_u64(seed))
    }

    pub(crate) fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Nearly normal, of variance one.
    pub(crate) fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.within(-0.5, 0.5)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn subsets_are_repeatable_and_without_repetition() {
        let (mut a, mut b) = (Subsets::new(7), Subsets::new(7));
        for n in 8..40 {
            let drawn = a.draw::<8>(n);
            assert_eq!(drawn, b.draw::<8>(n));
            let mut sorted = drawn;
            sorted.sort_unstable();
            assert!(sorted.windows(2).all(|w| w[0] < w[1]) && sorted[7] < n);
        }
    }

    #[test]
    fn half_outliers_need_a_thousand_samples() {
        assert_eq!(trials_needed(10, 10, 8, 0.999), 1.0);
        assert!((trials_needed(50, 100, 8, 0.999) - 1764.9).abs() < 0.1);
        assert!(trials_needed(0, 100, 8, 0.999) > 1e12);
    }
}
