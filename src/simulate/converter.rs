//! A virtual converter with errors of its own.

use super::capture::{Analog, target};
use super::normal::{Normal, Purpose};
use super::response::Instants;
use crate::design::Problem;
use crate::runtime::Nonlinearity;
use crate::units::FastPeriods;
use std::ops::Range;

/// Steps to the sample of a converter with a nonlinearity: its last digit.
const BENDING_STEPS: usize = 16;

/// How a converter differs from the ideal sampler of a channel. Sample k of channel i, with the front end
/// Phi_i and the gain g_i of the problem, is
///
/// ```text
/// q(e(level g_i (1 + gain error) (phi_i * f)(t_k) + offset + noise n_k))
/// t_k = k T_i / (1 + drift) - D_i - delay error + jitter j_k
/// ```
///
/// with independent normal numbers n_k and j_k of variance 1, the quantiser q, and e(x) the sample y that is
/// x without its nonlinearity. The numbers depend on the seed, the channel and k only.
#[derive(Debug, Clone, PartialEq)]
pub struct Sampler {
    /// The true delay minus D_i.
    pub delay_error: FastPeriods,
    /// Relative error of the gain.
    pub gain_error: f64,
    /// What is added to each sample, relative to full scale.
    pub offset: f64,
    /// The static nonlinearity.
    pub nonlinearity: Nonlinearity,
    /// By how much the clock is too fast, relatively.
    pub drift: f64,
    /// Rms of the aperture jitter.
    pub jitter: FastPeriods,
    /// Rms of white noise, relative to full scale.
    pub noise: f64,
    /// `None` does not round.
    pub quantiser: Option<Quantiser>,
    /// Seed of all random numbers.
    pub seed: u64,
}

/// What a converter delivered.
#[derive(Debug, Clone, PartialEq)]
pub struct Delivered {
    /// Sample k, or its real part.
    pub samples: Vec<f64>,
    /// The imaginary parts of a complex signal.
    pub imaginary: Option<Vec<f64>>,
    /// Samples, or parts of them, that saturated.
    pub clipped: usize,
}

impl Sampler {
    /// Largest modulus of a jitter's random number: no sample is taken further than this times the rms from
    /// its instant.
    pub const MOST_SIGMAS: f64 = Normal::MOST;

    /// The ideal sampler.
    pub fn ideal() -> Self {
        Self {
            delay_error: FastPeriods(0.0),
            gain_error: 0.0,
            offset: 0.0,
            nonlinearity: Nonlinearity::default(),
            drift: 0.0,
            jitter: FastPeriods(0.0),
            noise: 0.0,
            quantiser: None,
            seed: 0,
        }
    }

    /// Captures `periods` frames of converter `channel` of `problem`, from 0, with the signal times `level`.
    pub fn capture(
        &self,
        problem: &Problem,
        channel: usize,
        signal: &Analog,
        level: f64,
        periods: usize,
    ) -> Delivered {
        self.capture_part(problem, channel, signal, level, periods, Purpose::Noise)
    }

    /// As [`Sampler::capture`], with noise of a purpose: of a complex signal the converters of
    /// both parts have the same clock and front end, hence the same jitter, and noise of their own.
    pub(super) fn capture_part(
        &self,
        problem: &Problem,
        channel: usize,
        signal: &Analog,
        level: f64,
        periods: usize,
        noise: Purpose,
    ) -> Delivered {
        let samples = &problem.converters()[channel];
        let of = &problem.channels[samples.start];
        let front_end = &problem.front_ends[of.front_end];
        let Instants { first, step, count } = instants(problem, samples, periods);
        let (first, step) = (first - self.delay_error, FastPeriods(step.0 / (1.0 + self.drift)));
        let instants = Instants { first, step, count };
        let analog = match self.shifts(channel, count) {
            Some(shifts) => signal.filtered_near(front_end, instants, &shifts),
            None => signal.filtered(front_end, instants),
        };
        let gain = level * of.gain * (1.0 + self.gain_error);
        self.convert(Normal::new(self.seed, channel, noise), analog, gain)
    }

    /// The jitter of each sample.
    fn shifts(&self, channel: usize, count: usize) -> Option<Vec<FastPeriods>> {
        let normal = Normal::new(self.seed, channel, Purpose::Jitter);
        let shifts = || (0..count).map(|k| self.jitter * normal.at(k)).collect();
        (self.jitter.0 > 0.0).then(shifts)
    }

    /// From voltages to samples, with the noise `normal`.
    fn convert(&self, normal: Normal, mut samples: Vec<f64>, gain: f64) -> Delivered {
        let mut clipped = 0;
        for (k, x) in samples.iter_mut().enumerate() {
            *x *= gain;
            if self.offset != 0.0 {
                *x += self.offset;
            }
            if self.noise > 0.0 {
                *x += self.noise * normal.at(k);
            }
            if !self.nonlinearity.is_straight() {
                *x = bent(&self.nonlinearity, *x);
            }
            if let Some(quantiser) = self.quantiser {
                let (code, saturated) = quantiser.quantise(*x);
                *x = code;
                clipped += usize::from(saturated);
            }
        }
        Delivered { samples, imaginary: None, clipped }
    }
}

/// The y of which y less its nonlinearity is x. A step errs by what the slope of the curve leaves of the one
/// before, a tenth at most. Where a table leaves a gap between two cells it is in one of them.
fn bent(nonlinearity: &Nonlinearity, x: f64) -> f64 {
    (0..BENDING_STEPS).fold(x, |y, _| x + nonlinearity.at(y))
}

/// The instants of the samples of a converter, whose `samples` per frame these are, on its own time axis.
fn instants(problem: &Problem, samples: &Range<usize>, periods: usize) -> Instants {
    let delay = problem.channels[samples.start].delay.later_by(-(problem.wait as f64));
    let step = FastPeriods(problem.ratio as f64 / samples.len() as f64);
    Instants { first: -delay.in_fast_periods(), step, count: periods * samples.len() }
}

/// The slow samples of all channels and the reference fast samples over the same time.
#[derive(Debug, Clone, PartialEq)]
pub struct Captured {
    /// `channels[i][k]` = g_i (phi_i * f)(k T_i - D_i), with the gain g_i of the converter and without its
    /// offset; T_i = M unless converters have rates of their own.
    pub channels: Vec<Vec<f64>>,
    /// `target[n]` = (phi_0 * f)(n - m0), M samples per slow period, m0 without the wait for a frame.
    pub target: Vec<f64>,
}

/// Captures `periods` slow periods of `signal`, or frames: slow samples k = 0 .. periods of each channel, or
/// so many times the samples that it has in a frame, and M times as many reference samples.
pub fn capture(problem: &Problem, signal: &Analog, periods: usize) -> Captured {
    let slow = |i| Sampler::ideal().capture(problem, i, signal, 1.0, periods).samples;
    let channels = (0..problem.converters().len()).map(slow).collect();
    Captured { channels, target: target(problem, signal, periods) }
}

/// A quantiser of B bits: codes -2^(B-1) .. 2^(B-1) - 1 in steps of 2^(1-B), zero among them, rounded to the
/// nearest one, ties to even. What lies beyond saturates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Quantiser {
    bits: u32,
}

impl Quantiser {
    /// Fewest bits: sign and one more.
    pub const LEAST_BITS: u32 = 2;
    /// Most bits: every code is a 32-bit float.
    pub const MOST_BITS: u32 = 24;

    /// `None` unless `bits` are [`LEAST_BITS`](Self::LEAST_BITS) to [`MOST_BITS`](Self::MOST_BITS).
    pub fn new(bits: u32) -> Option<Self> {
        (Self::LEAST_BITS..=Self::MOST_BITS).contains(&bits).then_some(Self { bits })
    }

    /// The code's value, and whether it saturated.
    pub fn quantise(self, x: f64) -> (f64, bool) {
        let half = f64::from(1u32 << (self.bits - 1));
        let code = (x * half).round_ties_even();
        let clipped = code.clamp(-half, half - 1.0);
        (clipped / half, clipped != code)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{Periodic, Source, capture};
    use crate::spec::Spec;
    use crate::units::Seconds;
    use std::f64::consts::TAU;

    /// 0.25 / (s + 0.5)^2, M = 2; the second channel has a gain.
    fn problem() -> Problem {
        let text = "fast_period = 1.0\nratio = 2\nlatency = 3\n\
             channel = [{ delay = 1.2 }, { delay = 0.6, gain = -2.0 }]\n\
             target = { filter = { num = [0.25], den = [1.0, 1.0, 0.25] } }\n";
        Problem::new(&Spec::from_toml(text, "spec.toml").unwrap(), 3).unwrap()
    }

    fn tone(omega: f64) -> Analog {
        let source: Source = format!("tones:{omega}").parse().unwrap();
        Analog::Known(source.normalised(Seconds(1.0)))
    }

    /// The response of the front end to cos(omega t) at t.
    fn exact(omega: f64, t: f64) -> f64 {
        0.25 / (omega * omega + 0.25) * (omega * t - 2.0 * (omega / 0.5).atan()).cos()
    }

    fn rms(values: impl Iterator<Item = f64> + Clone) -> f64 {
        let count = values.clone().count();
        (values.map(|x| x * x).sum::<f64>() / count as f64).sqrt()
    }

    fn differences<'a>(a: &'a [f64], b: &'a [f64]) -> impl Iterator<Item = f64> + Clone + 'a {
        a.iter().zip(b).map(|(a, b)| a - b)
    }

    #[test]
    fn an_ideal_converter_captures_what_the_problem_says() {
        let signal = tone(0.7);
        let want = capture(&problem(), &signal, 50);
        for (channel, want) in want.channels.iter().enumerate() {
            let got = Sampler::ideal().capture(&problem(), channel, &signal, 1.0, 50);
            assert_eq!((&got.samples, got.clipped), (want, 0));
        }
    }

    #[test]
    fn errors_of_delay_gain_offset_and_clock_have_their_closed_form() {
        let converter = Sampler {
            delay_error: FastPeriods(0.03),
            gain_error: 0.01,
            offset: -0.2,
            drift: 1e-4,
            ..Sampler::ideal()
        };
        let got = converter.capture(&problem(), 1, &tone(0.7), 3.0, 4000);
        for (k, x) in got.samples.iter().enumerate() {
            let t = k as f64 * 2.0 / 1.0001 - 0.63;
            let want = 3.0 * -2.0 * 1.01 * exact(0.7, t) - 0.2;
            assert!((x - want).abs() < 1e-11, "{k}: {x} {want}");
        }
    }

    #[test]
    fn noise_has_its_rms_and_is_white() {
        let converter = Sampler { noise: 0.003, seed: 5, ..Sampler::ideal() };
        let count = 200_000;
        let captured: Vec<Vec<f64>> =
            (0..2).map(|i| converter.capture(&problem(), i, &tone(0.7), 0.0, count).samples).collect();
        for noise in &captured {
            // Five standard deviations of the estimate, 1 / sqrt(2 N) = 0.16 %.
            let found = rms(noise.iter().copied());
            assert!((found / 0.003 - 1.0).abs() < 0.008, "{found}");
        }
        let product = |lag: usize| {
            captured[0].iter().zip(&captured[1][lag..]).map(|(a, b)| a * b).sum::<f64>()
                / (count - lag) as f64
        };
        assert!((0..3).all(|lag| product(lag).abs() < 0.012 * 0.003 * 0.003));
    }

    /// -20 log10(omega sigma), omega = 2 pi f: the slope of the sine times the jitter, both independent.
    #[test]
    fn jitter_has_the_snr_of_its_formula() {
        for (omega, sigma) in [(0.3, 0.01), (1.1, 0.003), (2.5, 1e-5)] {
            let converter = Sampler { jitter: FastPeriods(sigma), seed: 9, ..Sampler::ideal() };
            let count = 100_000;
            let [ideal, jittered] = [Sampler::ideal(), converter]
                .map(|c| c.capture(&problem(), 0, &tone(omega), 1.0, count).samples);
            let error = rms(differences(&ideal, &jittered));
            let snr = 20.0 * (rms(ideal.iter().copied()) / error).log10();
            let formula = -20.0 * (omega * sigma).log10();
            assert!((snr - formula).abs() < 0.1, "{omega} {sigma}: {snr:.3} dB, formula {formula:.3} dB");
        }
    }

    #[test]
    fn a_quantised_full_scale_sine_has_the_snr_of_its_formula() {
        let omega = TAU * (5f64.sqrt() - 1.0) / 4.0;
        let full_scale = (1.0 - 0.5f64.powi(12)) * (omega * omega + 0.25) / 0.25;
        let capture = |quantiser| {
            let converter = Sampler { quantiser, ..Sampler::ideal() };
            converter.capture(&problem(), 0, &tone(omega), full_scale, 100_000)
        };
        let (ideal, rounded) = (capture(None), capture(Quantiser::new(12)));
        let error = rms(differences(&ideal.samples, &rounded.samples));
        let snr = 20.0 * (rms(ideal.samples.iter().copied()) / error).log10();
        assert!((snr - (6.0206 * 12.0 + 1.7609)).abs() < 0.05, "{snr}");
        let clipped = Sampler { quantiser: Quantiser::new(12), ..Sampler::ideal() };
        let clipped = clipped.capture(&problem(), 0, &tone(omega), 2.0 * full_scale, 30_000).clipped;
        // A sine of twice the full scale is beyond it for two thirds of its period.
        assert!((clipped as f64 / 30_000.0 - 2.0 / 3.0).abs() < 1e-3, "{clipped}");
    }

    /// Every kind of signal is taken at the very instants of the jitter, and recordings in any rate.
    #[test]
    fn jittered_samples_are_those_of_their_instants() {
        let length = 401;
        let omega = TAU * 90.0 / f64::from(length);
        let recorded: Vec<f64> = (0..length).map(|n| (omega * f64::from(n)).cos()).collect();
        for (signal, omega) in [
            (tone(omega), omega),
            (Analog::Recorded(Periodic::new(&recorded, FastPeriods(1.0))), omega),
            (Analog::Recorded(Periodic::new(&recorded, FastPeriods(0.4))), omega / 0.4),
            (Analog::Recorded(Periodic::new(&recorded, FastPeriods(2.5))), omega / 2.5),
        ] {
            let converter = Sampler { jitter: FastPeriods(0.1), drift: -3e-5, seed: 2, ..Sampler::ideal() };
            let shifts = converter.shifts(0, 300).unwrap();
            let got = converter.capture(&problem(), 0, &signal, 1.0, 300).samples;
            for (k, x) in got.iter().enumerate() {
                let want = exact(omega, k as f64 * 2.0 / (1.0 - 3e-5) - 1.2 + shifts[k].0);
                assert!((x - want).abs() < 1e-11, "{omega} {k}: {x} {want}");
            }
        }
    }

    #[test]
    fn samples_depend_on_seed_channel_and_number_only() {
        let converter = Sampler { jitter: FastPeriods(0.01), noise: 0.1, seed: 3, ..Sampler::ideal() };
        let capture = |converter: &Sampler, channel, periods| {
            converter.capture(&problem(), channel, &tone(0.4), 1.0, periods).samples
        };
        let long = capture(&converter, 1, 500);
        assert_eq!(capture(&converter, 1, 200), long[..200]);
        assert_ne!(capture(&Sampler { seed: 4, ..converter.clone() }, 1, 200), long[..200]);
        assert_ne!(capture(&converter, 0, 200), long[..200]);
    }

    #[test]
    fn codes_saturate_at_both_ends_of_the_full_scale() {
        let three = Quantiser::new(3).unwrap();
        for (x, want) in [
            (0.0, (0.0, false)),
            (0.124, (0.0, false)),
            (0.126, (0.25, false)),
            (0.125, (0.0, false)),
            (0.375, (0.5, false)),
            (0.75, (0.75, false)),
            (0.88, (0.75, true)),
            (2.0, (0.75, true)),
            (-1.0, (-1.0, false)),
            (-1.2, (-1.0, true)),
        ] {
            assert_eq!(three.quantise(x), want, "{x}");
        }
        assert!(Quantiser::new(1).is_none() && Quantiser::new(25).is_none());
    }

    /// 6.02 B + 1.76 dB for a sine of full scale whose frequency is no rational multiple of the rate.
    #[test]
    fn the_error_of_a_full_scale_sine_is_that_of_the_formula() {
        for bits in [6, 8, 10, 12, 14, 16] {
            let quantiser = Quantiser::new(bits).unwrap();
            let (count, turn) = (200_000, (5f64.sqrt() - 1.0) / 2.0);
            // Full scale less half a step above, so that nothing saturates.
            let amplitude = 1.0 - 0.5f64.powi(bits as i32);
            let (mut signal, mut error) = (0.0, 0.0);
            for k in 0..count {
                let x = amplitude * (TAU * (turn * f64::from(k)).fract()).sin();
                let (y, clipped) = quantiser.quantise(x);
                assert!(!clipped || x > 1.0 - 0.5f64.powi(bits as i32 - 1));
                signal += x * x;
                error += (y - x).powi(2);
            }
            let snr = 10.0 * f64::log10(signal / error);
            let formula = 20.0 * f64::from(bits) * 2f64.log10() + 10.0 * 1.5f64.log10();
            // The formula takes the error as uniform; the amplitude is a part of a step short of 1.
            let tolerance = 0.05 + 0.5 * 0.5f64.powi(bits as i32 - 6);
            assert!((snr - formula).abs() < tolerance, "{bits} bits: {snr:.3} dB, formula {formula:.3} dB");
        }
    }
}
