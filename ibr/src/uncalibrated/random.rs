//! Seeded random samples, and their number for a given confidence.

use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64;

/// Probability of drawing at least one sample without outliers.
const CONFIDENCE: f64 = 0.999;

const MOST_TRIALS: usize = 5000;

/// K different indices below n >= K; the same seed gives the same ones on every platform.
fn draw<const K: usize>(random: &mut Pcg64, n: usize) -> [usize; K] {
    let mut chosen = [usize::MAX; K];
    for k in 0..K {
        // The bias of the multiplication is below n / 2^32.
        let mut below = || ((u64::from(random.next_u32()) * n as u64) >> 32) as usize;
        chosen[k] = below();
        while chosen[..k].contains(&chosen[k]) {
            chosen[k] = below();
        }
    }
    chosen
}

/// RANSAC: the largest set of `total` things that agrees with the model of some K of them; `agreeing`
/// returns the set of a sample, `None` if it has no model.
pub(super) fn consensus<const K: usize>(
    total: usize,
    seed: u64,
    agreeing: impl Fn([usize; K]) -> Option<Vec<usize>>,
) -> Vec<usize> {
    let mut random = Pcg64::seed_from_u64(seed);
    let mut best = Vec::new();
    for trial in 1..=MOST_TRIALS {
        if let Some(set) = agreeing(draw(&mut random, total)).filter(|set| set.len() > best.len()) {
            best = set;
        }
        if trial as f64 >= trials_needed(best.len(), total, K as i32, CONFIDENCE) {
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

#[cfg(test)]
pub(crate) mod dice {
    use rand_core::{Rng, SeedableRng};
    use rand_pcg::Pcg64;

    /// Random numbers for trials.
    pub(crate) struct Dice(Pcg64);

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
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn subsets_are_repeatable_and_without_repetition() {
        let (mut a, mut b) = (Pcg64::seed_from_u64(7), Pcg64::seed_from_u64(7));
        for n in 8..40 {
            let drawn = draw::<8>(&mut a, n);
            assert_eq!(drawn, draw::<8>(&mut b, n));
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
