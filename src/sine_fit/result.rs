//! What a fit found.

use super::Estimate;
use super::columns::{BLOCK, Oscillator, fraction_of_turn};
use super::normal::linear_count;
use crate::linalg::{Mat, PositiveFactor};
use crate::units::{Hertz, Radians, Seconds};
use std::f64::consts::{PI, TAU};
use std::ops::Range;

/// Sines fitted to the records of one or several channels.
#[derive(Debug, Clone)]
pub struct SineFit {
    /// Rate of the samples.
    pub rate: Hertz,
    /// f_k, in the Nyquist zone where the fit started; sigma is 0 for known frequencies.
    pub frequencies: Vec<Estimate<Hertz>>,
    /// One per record.
    pub channels: Vec<ChannelFit>,
    /// Gauss-Newton steps; 0 for known frequencies.
    pub iterations: usize,
    /// Cycles per sample.
    cycles: Vec<f64>,
    /// Coefficients of 1, cosines and sines of each channel, phases at the centre of its record.
    linear: Vec<Vec<f64>>,
    /// Sample index at the centre of each record.
    centres: Vec<f64>,
    /// Instant of sample 0 of each channel.
    offsets: Vec<Seconds>,
    covariance: Covariance,
}

/// What was fitted to one channel. Amplitudes and constants have the unit of the samples.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct ChannelFit {
    /// c_i.
    pub constant: Estimate<f64>,
    /// One per tone.
    pub tones: Vec<ToneFit>,
    /// Square root of the mean square of what the fit leaves.
    pub residual_rms: f64,
    /// Standard deviation of the noise: the same with the degrees of freedom in place of the samples.
    pub noise: f64,
    /// Samples that took part.
    pub used: usize,
    /// Samples that are not finite or were masked.
    pub left_out: usize,
}

/// One tone in one channel.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct ToneFit {
    /// A_ik.
    pub amplitude: Estimate<f64>,
    /// phi_ik, the phase at the instant 0, in -pi ..= pi. Its error contains that of the frequency times the
    /// distance of the record from the instant 0; the difference of two channels does not, see
    /// [`SineFit::lag_between`].
    pub phase: Estimate<Radians>,
}

/// What the iteration hands over.
pub(super) struct Parts {
    pub(super) rate: Hertz,
    pub(super) cycles: Vec<f64>,
    pub(super) linear: Vec<Vec<f64>>,
    /// Residual energy and number of samples of each channel.
    pub(super) squares: Vec<(f64, usize)>,
    pub(super) lengths: Vec<usize>,
    pub(super) centres: Vec<f64>,
    pub(super) offsets: Vec<Seconds>,
    pub(super) covariance: Covariance,
    pub(super) iterations: usize,
}

/// The covariance of all parameters. Channel i has the coefficients theta_i; the frequencies u (radians over
/// half the longest record) are common:
///
/// ```text
/// cov(u) = U      cov(theta_i, u) = -C_i U      cov(theta_i, theta_j) = [i = j] s_i^2 G_i^-1 + C_i U C_j'
/// ```
#[derive(Debug, Clone)]
pub(super) struct Covariance {
    /// Cholesky factors of G_i.
    pub(super) factors: Vec<PositiveFactor>,
    /// C_i = G_i^-1 B_i.
    pub(super) couplings: Vec<Mat>,
    /// s_i^2.
    pub(super) variances: Vec<f64>,
    /// U.
    pub(super) frequencies: Mat,
    /// Samples in half the longest record.
    pub(super) unit: f64,
}

/// The derivative of a quantity by the parameters.
struct Gradient {
    /// By the coefficients of some channels, each of which occurs once.
    channels: Vec<(usize, Mat)>,
    /// By the frequencies, in radians over half the longest record.
    frequencies: Mat,
}

impl Covariance {
    /// The standard deviation of a quantity.
    fn sigma(&self, gradient: &Gradient) -> f64 {
        let mut common = gradient.frequencies.clone();
        let mut variance = 0.0;
        for (i, own) in &gradient.channels {
            common -= self.couplings[*i].transpose() * own;
            variance += self.variances[*i] * own.dot(&self.factors[*i].solve(own));
        }
        (variance + common.dot(&(&self.frequencies * &common))).max(0.0).sqrt()
    }
}

impl SineFit {
    pub(super) fn assemble(parts: Parts) -> Self {
        let Parts { rate, cycles, linear, squares, lengths, centres, offsets, covariance, iterations } =
            parts;
        let channels = Vec::new();
        let frequencies = Vec::new();
        let mut fit =
            Self { rate, frequencies, channels, iterations, cycles, linear, centres, offsets, covariance };
        fit.frequencies = (0..fit.cycles.len()).map(|k| fit.frequency(k)).collect();
        let channel = |(i, ((squares, used), length)): (usize, (&(f64, usize), &usize))| ChannelFit {
            constant: fit.constant(i),
            tones: (0..fit.cycles.len()).map(|k| fit.tone(i, k)).collect(),
            residual_rms: (squares / *used as f64).sqrt(),
            noise: fit.covariance.variances[i].sqrt(),
            used: *used,
            left_out: length - used,
        };
        fit.channels = squares.iter().zip(&lengths).enumerate().map(channel).collect();
        fit
    }

    /// Samples minus fitted sines and constant, of channel `channel` (from 0) and from its first sample on.
    /// Samples that were left out are subtracted from as well.
    ///
    /// # Panics
    /// If there is no such channel.
    pub fn residual(&self, channel: usize, samples: &[f64]) -> Vec<f64> {
        self.subtracted(channel, samples, 0..self.cycles.len(), self.linear[channel][0])
    }

    /// Samples minus some of the fitted tones (from 0) of channel `channel`; the constant stays.
    ///
    /// # Panics
    /// If there is no such channel or tone.
    pub fn without(&self, channel: usize, samples: &[f64], tones: Range<usize>) -> Vec<f64> {
        self.subtracted(channel, samples, tones, 0.0)
    }

    fn subtracted(&self, channel: usize, samples: &[f64], tones: Range<usize>, constant: f64) -> Vec<f64> {
        let linear = &self.linear[channel];
        let oscillators: Vec<_> = tones.clone().map(|k| Oscillator::new(self.cycles[k])).collect();
        let mut residual = samples.to_vec();
        let (mut cosines, mut sines) = (vec![0.0; BLOCK], vec![0.0; BLOCK]);
        for (number, block) in residual.chunks_mut(BLOCK).enumerate() {
            block.iter_mut().for_each(|r| *r -= constant);
            for (k, oscillator) in tones.clone().zip(&oscillators) {
                let (a, b) = (linear[linear_count(k)], linear[linear_count(k) + 1]);
                oscillator.fill((number * BLOCK) as f64 - self.centres[channel], &mut cosines, &mut sines);
                let waves = cosines.iter().zip(&sines);
                block.iter_mut().zip(waves).for_each(|(r, (c, s))| *r -= a * c + b * s);
            }
        }
        residual
    }

    /// The delay by which tone `tone` comes later in `channel` than in `reference` (both from 0), beyond
    /// what their offsets explain. It is known modulo the period of the tone; the value nearest to 0 is
    /// given:
    ///
    /// ```text
    /// delay = -(phi_channel - phi_reference) / (2 pi f),   sigma = sqrt(2 / (N SNR)) / (2 pi f)
    /// ```
    ///
    /// A converter that samples at k T - D_i, of which the offset says -D, is late by D_i - D. The equation
    /// for sigma is that of two equal channels.
    ///
    /// # Panics
    /// If there is no such channel or tone.
    pub fn lag_between(&self, channel: usize, reference: usize, tone: usize) -> Estimate<Seconds> {
        let (own, other) = (self.channels[channel].tones[tone], self.channels[reference].tones[tone]);
        let omega = TAU * self.frequencies[tone].value.0;
        let difference = wrapped(own.phase.value.0 - other.phase.value.0);
        if channel == reference {
            return Estimate { value: Seconds(0.0), sigma: Seconds(0.0) };
        }
        let mut one = self.phase_difference_gradient(channel, reference, tone);
        // d(phase / omega) also contains the error of omega.
        one.frequencies[(tone, 0)] -= difference / (TAU * self.cycles[tone] * self.covariance.unit);
        Estimate {
            value: Seconds(-difference / omega),
            sigma: Seconds(self.covariance.sigma(&one) / omega.abs()),
        }
    }

    /// The phase of tone `tone` in `channel` minus that in `reference` (all from 0), in -pi ..= pi.
    ///
    /// # Panics
    /// If there is no such channel or tone.
    pub fn phase_between(&self, channel: usize, reference: usize, tone: usize) -> Estimate<Radians> {
        if channel == reference {
            return Estimate { value: Radians(0.0), sigma: Radians(0.0) };
        }
        let sigma = self.covariance.sigma(&self.phase_difference_gradient(channel, reference, tone));
        let difference = wrapped(self.phase(channel, tone) - self.phase(reference, tone));
        Estimate { value: Radians(difference), sigma: Radians(sigma) }
    }

    /// The amplitude of tone `tone` in `channel` divided by that in `reference` (all from 0).
    ///
    /// # Panics
    /// If there is no such channel or tone.
    pub fn gain_between(&self, channel: usize, reference: usize, tone: usize) -> Estimate<f64> {
        if channel == reference {
            return Estimate { value: 1.0, sigma: 0.0 };
        }
        let ratio = self.amplitude(channel, tone) / self.amplitude(reference, tone);
        let (mut one, two) =
            (self.amplitude_gradient(channel, tone), self.amplitude_gradient(reference, tone));
        one.channels.extend(two.channels.into_iter().map(|(i, own)| (i, own * -ratio)));
        Estimate { value: ratio, sigma: self.covariance.sigma(&one) / self.amplitude(reference, tone) }
    }

    /// The number of tones.
    pub fn tones(&self) -> usize {
        self.cycles.len()
    }

    pub(super) fn coefficients(&self, channel: usize, tone: usize) -> (f64, f64) {
        let linear = &self.linear[channel];
        (linear[linear_count(tone)], linear[linear_count(tone) + 1])
    }

    fn amplitude(&self, channel: usize, tone: usize) -> f64 {
        let (a, b) = self.coefficients(channel, tone);
        a.hypot(b)
    }

    fn frequency(&self, tone: usize) -> Estimate<Hertz> {
        let sigma = self.covariance.frequencies[(tone, tone)].max(0.0).sqrt() / (TAU * self.covariance.unit);
        Estimate { value: self.rate * self.cycles[tone], sigma: self.rate * sigma }
    }

    fn constant(&self, channel: usize) -> Estimate<f64> {
        let mut own = Mat::zeros(self.linear[channel].len(), 1);
        own[(0, 0)] = 1.0;
        Estimate {
            value: self.linear[channel][0],
            sigma: self.covariance.sigma(&self.gradient(channel, own)),
        }
    }

    fn tone(&self, channel: usize, tone: usize) -> ToneFit {
        let sigma = |gradient: Gradient| self.covariance.sigma(&gradient);
        let amplitude = Estimate {
            value: self.amplitude(channel, tone),
            sigma: sigma(self.amplitude_gradient(channel, tone)),
        };
        let phase = Estimate {
            value: Radians(self.phase(channel, tone)),
            sigma: Radians(sigma(self.phase_gradient(channel, tone))),
        };
        ToneFit { amplitude, phase }
    }

    /// Samples from the instant 0 to the centre of the record.
    pub(super) fn distance(&self, channel: usize) -> f64 {
        (self.offsets[channel] * self.rate.0).0 + self.centres[channel]
    }

    /// The phase at the instant 0; a cos + b sin has the phase atan2(-b, a) at the centre.
    fn phase(&self, channel: usize, tone: usize) -> f64 {
        let (a, b) = self.coefficients(channel, tone);
        wrapped((-b).atan2(a) - self.phase_to_centre(channel, tone))
    }

    /// 2 pi f t from the instant 0 to the centre of the record, without whole turns.
    pub(super) fn phase_to_centre(&self, channel: usize, tone: usize) -> f64 {
        let whole = fraction_of_turn(self.cycles[tone], self.centres[channel])
            + fraction_of_turn(self.cycles[tone], (self.offsets[channel] * self.rate.0).0);
        TAU * whole
    }

    /// The standard deviation of a quantity with the derivatives `by_pairs` by the cosine and the sine of a
    /// tone in some channels, and `by_frequency` by its frequency in radians per sample.
    pub(super) fn sigma_of(&self, tone: usize, by_pairs: &[(usize, (f64, f64))], by_frequency: f64) -> f64 {
        let own = |&(channel, (a, b)): &(usize, (f64, f64))| {
            let mut own = Mat::zeros(self.linear[channel].len(), 1);
            own[(linear_count(tone), 0)] = a;
            own[(linear_count(tone) + 1, 0)] = b;
            (channel, own)
        };
        let mut frequencies = Mat::zeros(self.cycles.len(), 1);
        frequencies[(tone, 0)] = by_frequency / self.covariance.unit;
        self.covariance.sigma(&Gradient { channels: by_pairs.iter().map(own).collect(), frequencies })
    }

    /// A gradient by the coefficients of one channel.
    fn gradient(&self, channel: usize, own: Mat) -> Gradient {
        Gradient { channels: vec![(channel, own)], frequencies: Mat::zeros(self.cycles.len(), 1) }
    }

    fn amplitude_gradient(&self, channel: usize, tone: usize) -> Gradient {
        let (a, b) = self.coefficients(channel, tone);
        let mut own = Mat::zeros(self.linear[channel].len(), 1);
        own[(linear_count(tone), 0)] = a / a.hypot(b);
        own[(linear_count(tone) + 1, 0)] = b / a.hypot(b);
        self.gradient(channel, own)
    }

    fn phase_gradient(&self, channel: usize, tone: usize) -> Gradient {
        let (a, b) = self.coefficients(channel, tone);
        let square = a * a + b * b;
        let mut own = Mat::zeros(self.linear[channel].len(), 1);
        own[(linear_count(tone), 0)] = b / square;
        own[(linear_count(tone) + 1, 0)] = -a / square;
        let mut gradient = self.gradient(channel, own);
        gradient.frequencies[(tone, 0)] = -self.distance(channel) / self.covariance.unit;
        gradient
    }

    /// The gradient of the phase in `channel` minus that in `reference`, which is another one.
    fn phase_difference_gradient(&self, channel: usize, reference: usize, tone: usize) -> Gradient {
        let (mut one, mut two) = (self.phase_gradient(channel, tone), self.phase_gradient(reference, tone));
        two.channels[0].1.neg_mut();
        one.channels.append(&mut two.channels);
        one.frequencies -= two.frequencies;
        one
    }
}

/// An angle in -pi ..= pi.
pub(super) fn wrapped(angle: f64) -> f64 {
    let whole = (angle / TAU).round();
    (angle - whole * TAU).clamp(-PI, PI)
}
