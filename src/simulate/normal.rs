//! Normal random numbers that are a function of seed, converter, purpose and index, so that neither the
//! order of computing nor the number of threads or converters changes them.

use std::f64::consts::TAU;

/// What the numbers are drawn for; purposes are independent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Purpose {
    Jitter = 1,
    Noise = 2,
    /// Noise of the imaginary part of complex samples.
    ImaginaryNoise = 3,
}

/// A sequence of independent numbers of mean 0 and variance 1.
#[derive(Debug, Clone, Copy)]
pub(super) struct Normal {
    key: u64,
}

impl Normal {
    /// The largest modulus of a number, sqrt(2 ln 2^53).
    pub(super) const MOST: f64 = 8.6;

    pub(super) fn new(seed: u64, converter: usize, purpose: Purpose) -> Self {
        let key = mix(mix(mix(seed).wrapping_add(converter as u64)).wrapping_add(purpose as u64));
        Self { key }
    }

    /// Number `index`: cosine and sine of one pair are two numbers (Box and Muller, 1958).
    pub(super) fn at(self, index: usize) -> f64 {
        let pair = index as u64 / 2;
        let radius = (-2.0 * self.uniform(2 * pair).ln()).sqrt();
        let angle = TAU * self.uniform(2 * pair + 1);
        radius * if index.is_multiple_of(2) { angle.cos() } else { angle.sin() }
    }

    /// In (0, 1], by SplitMix64 (Steele, Lea and Flood, 2014).
    fn uniform(self, index: u64) -> f64 {
        let bits = mix(self.key.wrapping_add(index.wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15)));
        ((bits >> 11) + 1) as f64 / (1u64 << 53) as f64
    }
}

fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    const COUNT: usize = 400_000;

    fn numbers(seed: u64, converter: usize, purpose: Purpose) -> Vec<f64> {
        let normal = Normal::new(seed, converter, purpose);
        (0..COUNT).map(|k| normal.at(k)).collect()
    }

    /// Mean of the product, with the standard deviation 1 / sqrt(COUNT) = 0.0016 for independent numbers.
    fn correlation(a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>() / a.len().min(b.len()) as f64
    }

    #[test]
    fn the_moments_are_those_of_the_normal_law() {
        let x = numbers(1, 0, Purpose::Noise);
        let moment = |p: i32| x.iter().map(|x| x.powi(p)).sum::<f64>() / COUNT as f64;
        // Five standard deviations: sqrt(var / COUNT) with the variances 1, 2, 15 and 96.
        for (p, want, variance) in [(1, 0.0, 1.0f64), (2, 1.0, 2.0), (3, 0.0, 15.0), (4, 3.0, 96.0)] {
            let tolerance = 5.0 * (variance / COUNT as f64).sqrt();
            assert!((moment(p) - want).abs() < tolerance, "{p}: {}", moment(p));
        }
        // The share beyond three sigmas is 0.0027.
        let tail = x.iter().filter(|x| x.abs() > 3.0).count() as f64 / COUNT as f64;
        assert!((tail - 0.0027).abs() < 5.0 * (0.0027 / COUNT as f64).sqrt(), "{tail}");
        assert!(x.iter().all(|x| x.abs() <= Normal::MOST));
    }

    #[test]
    fn indices_converters_purposes_and_seeds_are_independent() {
        let x = numbers(7, 0, Purpose::Noise);
        for lag in [1, 2, 3, 64] {
            assert!(correlation(&x, &x[lag..]).abs() < 0.008, "lag {lag}");
        }
        let others = [
            (7, 1, Purpose::Noise),
            (7, 0, Purpose::Jitter),
            (8, 0, Purpose::Noise),
            (0, 7, Purpose::Noise),
            (7, 0, Purpose::ImaginaryNoise),
        ];
        for (seed, converter, purpose) in others {
            let other = numbers(seed, converter, purpose);
            for (a, b) in [(&x[..], &other[..]), (&x[1..], &other), (&x, &other[1..])] {
                assert!(correlation(a, b).abs() < 0.008, "{seed} {converter} {purpose:?}");
            }
        }
    }
}
