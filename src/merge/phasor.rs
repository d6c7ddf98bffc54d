//! The phase of a tone in a block of samples, beside whatever signal.

use crate::linalg::Complex;
use crate::sampling::median;
use std::f64::consts::{LN_2, PI, TAU};
use std::ops::RangeInclusive;

/// Coefficients of the window: what is more than four bins away leaks by -92 dB (F. J. Harris, *On the use
/// of windows for harmonic analysis with the discrete Fourier transform*, Proc. IEEE 66, 1978).
const BLACKMAN_HARRIS: [f64; 4] = [0.35875, -0.48829, 0.14128, -0.01168];
/// Bins away from the tone whose median power is that of the signal below it: beyond the main lobe.
const BESIDE: RangeInclusive<i32> = 6..=10;
/// Power of a tone over that of what lies beside it, from which on it counts as found.
const LEAST_RATIO: f64 = 50.0;

/// A tone in the samples of one channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Phasor {
    /// Amplitude and phase in the middle of the block.
    pub(super) value: Complex<f64>,
    /// Deviation of its phase, radians.
    pub(super) deviation: f64,
}

impl Phasor {
    /// Of a tone of so many cycles per sample; lost samples are NaN. `None` if it is not found.
    pub(super) fn of(samples: &[f64], cycles: f64) -> Option<Self> {
        let whole = bridged(samples)?;
        let windowed: Vec<f64> = whole.iter().zip(window(samples.len())).map(|(x, w)| x * w).collect();
        let bin = 1.0 / samples.len() as f64;
        let at = |bins: i32| correlation(&windowed, cycles + bin * f64::from(bins));
        let beside = BESIDE.flat_map(|k| [at(-k), at(k)]).map(|x| x.norm_sqr()).collect();
        // Powers of noise have an exponential law, whose median is ln 2 of its mean.
        let (value, power) = (at(0), median(beside) / LN_2);
        let deviation = (0.5 * power / value.norm_sqr()).sqrt();
        (value.norm_sqr() > LEAST_RATIO * power).then_some(Self { value, deviation })
    }

    /// Whether a tone and its mirror image are so close to each other in the spectrum of `count` samples
    /// that neither has a phase of its own.
    pub(super) fn is_mirrored(cycles: f64, count: usize) -> bool {
        (2.0 * cycles - (2.0 * cycles).round()).abs() < 2.0 * Self::least_distance(count)
    }

    /// How far a tone is from multiples of half the rate at least, in cycles per sample.
    pub(super) fn least_distance(count: usize) -> f64 {
        f64::from(*BESIDE.end()) / count as f64
    }
}

/// The samples with lines over those that are lost; `None` if more than an eighth are.
fn bridged(samples: &[f64]) -> Option<Vec<f64>> {
    let there: Vec<usize> = (0..samples.len()).filter(|&n| samples[n].is_finite()).collect();
    if 8 * there.len() < 7 * samples.len() {
        return None;
    }
    let mut whole = samples.to_vec();
    whole[..there[0]].fill(samples[there[0]]);
    whole[there[there.len() - 1]..].fill(samples[there[there.len() - 1]]);
    for ends in there.windows(2) {
        let step = (samples[ends[1]] - samples[ends[0]]) / (ends[1] - ends[0]) as f64;
        (ends[0] + 1..ends[1]).for_each(|n| whole[n] = samples[ends[0]] + step * (n - ends[0]) as f64);
    }
    Some(whole)
}

fn window(count: usize) -> impl Iterator<Item = f64> {
    let step = TAU / count as f64;
    (0..count).map(move |n| {
        let angle = step * (n as f64 + 0.5);
        BLACKMAN_HARRIS.iter().zip(0..).map(|(c, k)| c * (f64::from(k) * angle).cos()).sum()
    })
}

/// Relative to the middle of the samples.
fn correlation(samples: &[f64], cycles: f64) -> Complex<f64> {
    let middle = 0.5 * (samples.len() as f64 - 1.0);
    let turn = |n: usize| -2.0 * PI * (cycles * (n as f64 - middle)).fract();
    samples.iter().enumerate().map(|(n, x)| Complex::from_polar(*x, turn(n))).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// Beside noise that is as strong, in any zone: the phase errs as stated.
    #[test]
    fn a_tone_beside_noise_has_its_phase() {
        let mut random = Random(4);
        for cycles in [0.0231, 0.731, 3.41] {
            let mut squares = 0.0;
            for trial in 0..100 {
                let phase = 0.06 * f64::from(trial);
                let tone = |n: usize| (TAU * cycles * (n as f64 - 1023.5) + phase).cos();
                let samples: Vec<f64> = (0..2048).map(|n| tone(n) + 1.2 * random.sample()).collect();
                let Phasor { value, deviation } = Phasor::of(&samples, cycles).unwrap();
                let miss = (value * Complex::from_polar(1.0, -phase)).arg();
                squares += (miss / deviation).powi(2) / 100.0;
            }
            assert!((0.6..1.6).contains(&squares), "{cycles}: {squares}");
        }
    }

    #[test]
    fn noise_and_lost_samples_have_no_tone() {
        let mut random = Random(5);
        let noise: Vec<f64> = (0..2048).map(|_| random.sample()).collect();
        assert!(Phasor::of(&noise, 0.2).is_none() && Phasor::of(&[0.0; 2048], 0.2).is_none());
        assert!(Phasor::of(&[f64::NAN; 2048], 0.2).is_none());
        let tone = |n: usize| (TAU * 0.3 * n as f64).cos();
        let far: Vec<f64> = (0..2048).map(tone).collect();
        assert!(Phasor::of(&far, 0.2).is_none());
        assert!(Phasor::is_mirrored(2.5001, 2048) && Phasor::is_mirrored(1.0, 2048));
        assert!(!Phasor::is_mirrored(0.02, 2048));
    }
}
