//! What a fit found.
//!
//! A tone of a complex record z[n] = x_0[n] + j x_1[n], whose parts are two channels, is two exponentials:
//! the tone and its image at the negative frequency. With the phasors P_i = A_i e^{j phi_i} of both parts
//!
//! ```text
//! z = a e^{2 pi j f t} + b e^{-2 pi j f t},    a = (P_0 + j P_1) / 2,    b = conj(P_0 - j P_1) / 2
//! ```
//!
//! A converter of equal parts in quadrature (A_1 = A_0, phi_1 = phi_0 - pi/2) has no image. N complex
//! samples with noise of variance s^2 in each part, SNR = abs(a)^2 / (2 s^2), give (Rife and Boorstyn, 1974)
//!
//! ```text
//! sigma(abs a) / abs a = 1 / sqrt(2 N SNR)        sigma(2 pi f T)^2 = 6 / (SNR N (N^2 - 1))
//! ```

use super::normal::{BLOCK, Oscillator, fractional_cycles, linear_count};
use super::{Channel, Estimate};
use crate::linalg::{Complex, Mat, PositiveFactor};
use crate::units::{Hertz, Radians, Seconds};
use std::f64::consts::{PI, TAU};
use std::ops::Range;

const J: Complex<f64> = Complex::new(0.0, 1.0);

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
    pub(super) cycles: Vec<f64>,
    /// Coefficients of 1, cosines and sines of each channel, phases at the centre of its record.
    pub(super) linear: Vec<Vec<f64>>,
    /// Sample index at the centre of each record.
    pub(super) centres: Vec<f64>,
    /// Instant of sample 0 of each channel, seconds.
    pub(super) starts: Vec<f64>,
    pub(super) covariance: FitCovariance,
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

/// One tone in one channel, or an exponential of a complex record.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct ToneFit {
    /// A_ik.
    pub amplitude: Estimate<f64>,
    /// phi_ik, the phase at the instant 0, in -pi ..= pi. Its error contains that of the frequency times the
    /// distance of the record from the instant 0; the difference of two channels does not, see
    /// [`SineFit::ratio`].
    pub phase: Estimate<Radians>,
}

/// One phasor over another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ratio {
    /// Of the amplitudes.
    pub gain: Estimate<f64>,
    /// The difference of the phases, in -pi ..= pi.
    pub phase: Estimate<Radians>,
}

/// One of the two exponentials of a tone in a complex record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sense {
    /// At +f.
    Forward,
    /// At -f.
    Backward,
}

impl Sense {
    /// The sign of the frequency.
    pub(crate) fn sign(self) -> f64 {
        if self == Self::Forward { 1.0 } else { -1.0 }
    }
}

/// The channels that are the real and the imaginary part of a complex record.
pub type ComplexChannel = [usize; 2];

/// What carries a phasor of a tone; channels count from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Component {
    /// The sine in a channel.
    Real(usize),
    /// An exponential in a complex record, whose parts are of one length.
    Complex(ComplexChannel, Sense),
}

/// The covariance of all parameters. Channel i has the coefficients theta_i; the frequencies u (radians over
/// half the longest record) are common:
///
/// ```text
/// cov(u) = U      cov(theta_i, u) = -C_i U      cov(theta_i, theta_j) = [i = j] s_i^2 G_i^-1 + C_i U C_j'
/// ```
#[derive(Debug, Clone)]
pub(super) struct FitCovariance {
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

/// The logarithm of a phasor at the instant 0, or a difference of two, with its derivatives.
struct LogPhasor {
    amplitude: f64,
    phase: f64,
    /// By the cosine and the sine of the tone in some channels, each of which occurs once.
    by_pairs: Vec<(usize, [Complex<f64>; 2])>,
    /// Of the phase by the frequency in radians per sample.
    by_frequency: f64,
}

impl LogPhasor {
    /// The logarithm of a ratio.
    fn over(mut self, other: Self) -> Self {
        self.by_pairs.extend(other.by_pairs.into_iter().map(|(i, [a, b])| (i, [-a, -b])));
        Self {
            amplitude: self.amplitude / other.amplitude,
            phase: wrapped(self.phase - other.phase),
            by_frequency: self.by_frequency - other.by_frequency,
            ..self
        }
    }
}

impl SineFit {
    /// With the estimates of all channels, whose residual energies and numbers of used samples are given.
    pub(super) fn described(mut self, channels: &[Channel<'_>], squares: &[(f64, usize)]) -> Self {
        let frequency = |k: usize| {
            let sigma = self.covariance.frequencies[(k, k)].max(0.0).sqrt() / (TAU * self.covariance.unit);
            Estimate { value: self.rate * self.cycles[k], sigma: self.rate * sigma }
        };
        self.frequencies = (0..self.tones()).map(frequency).collect();
        let channel = |i: usize| {
            let (squares, used) = squares[i];
            let mut first = Mat::zeros(self.linear[i].len(), 1);
            first[(0, 0)] = 1.0;
            let sigma = self.covariance.sigma(&[(i, first)], &Mat::zeros(self.tones(), 1));
            ChannelFit {
                constant: Estimate { value: self.linear[i][0], sigma },
                tones: (0..self.tones()).map(|k| self.phasor(Component::Real(i), k)).collect(),
                residual_rms: (squares / used as f64).sqrt(),
                noise: self.covariance.variances[i].sqrt(),
                used,
                left_out: channels[i].samples.len() - used,
            }
        };
        self.channels = (0..channels.len()).map(channel).collect();
        self
    }

    /// Samples minus fitted sines and constant, of channel `channel` (from 0) and from its first sample on.
    /// Samples that were left out are subtracted from as well.
    ///
    /// # Panics
    /// If there is no such channel.
    pub fn residual(&self, channel: usize, samples: &[f64]) -> Vec<f64> {
        self.subtracted(channel, samples, 0..self.tones(), self.linear[channel][0])
    }

    /// Samples minus some of the fitted tones (from 0) of channel `channel`; the constant stays.
    ///
    /// # Panics
    /// If there is no such channel or tone.
    pub fn without(&self, channel: usize, samples: &[f64], tones: Range<usize>) -> Vec<f64> {
        self.subtracted(channel, samples, tones, 0.0)
    }

    fn subtracted(&self, channel: usize, samples: &[f64], tones: Range<usize>, constant: f64) -> Vec<f64> {
        let oscillators: Vec<_> = tones.clone().map(|k| Oscillator::new(self.cycles[k])).collect();
        let mut residual = samples.to_vec();
        let (mut cosines, mut sines) = (vec![0.0; BLOCK], vec![0.0; BLOCK]);
        for (number, block) in residual.chunks_mut(BLOCK).enumerate() {
            block.iter_mut().for_each(|r| *r -= constant);
            for (k, oscillator) in tones.clone().zip(&oscillators) {
                let [a, b] = self.coefficients(channel, k);
                oscillator.fill((number * BLOCK) as f64 - self.centres[channel], &mut cosines, &mut sines);
                let waves = cosines.iter().zip(&sines);
                block.iter_mut().zip(waves).for_each(|(r, (c, s))| *r -= a * c + b * s);
            }
        }
        residual
    }

    /// The slope of the fitted sines at the first `count` samples of channel `channel` (from 0), per sample.
    ///
    /// # Panics
    /// If there is no such channel.
    pub fn slopes(&self, channel: usize, count: usize) -> Vec<f64> {
        let (mut cosines, mut sines) = (vec![0.0; BLOCK], vec![0.0; BLOCK]);
        let mut slopes = vec![0.0; count];
        for (k, &cycles) in self.cycles.iter().enumerate() {
            let ([a, b], oscillator) = (self.coefficients(channel, k), Oscillator::new(cycles));
            for (number, block) in slopes.chunks_mut(BLOCK).enumerate() {
                oscillator.fill((number * BLOCK) as f64 - self.centres[channel], &mut cosines, &mut sines);
                let waves = cosines.iter().zip(&sines);
                block.iter_mut().zip(waves).for_each(|(v, (c, s))| *v += TAU * cycles * (b * c - a * s));
            }
        }
        slopes
    }

    /// Amplitude and phase of tone `tone` (from 0).
    ///
    /// # Panics
    /// If there is no such tone or channel.
    pub fn phasor(&self, wave: Component, tone: usize) -> ToneFit {
        let log = self.log_phasor(wave, tone);
        let Ratio { gain: amplitude, phase } = self.estimated(tone, &log);
        ToneFit { amplitude, phase }
    }

    /// The phasor of tone `tone` (from 0) over that in `reference`. For equal noise and known frequencies
    /// the standard deviations of ln gain and of the phase are sqrt(2 / (N SNR)) for sines, and sqrt(1 / (N
    /// SNR)) for exponentials.
    ///
    /// # Panics
    /// If there is no such channel or tone.
    pub fn ratio(&self, wave: Component, reference: Component, tone: usize) -> Ratio {
        if wave == reference {
            let (zero, none) = (Radians(0.0), Estimate { value: 1.0, sigma: 0.0 });
            return Ratio { gain: none, phase: Estimate { value: zero, sigma: zero } };
        }
        let log = self.log_phasor(wave, tone).over(self.log_phasor(reference, tone));
        self.estimated(tone, &log)
    }

    /// The delay by which tone `tone` comes later in `channel` than in `reference` (all from 0), beyond
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
        if channel == reference {
            return Estimate { value: Seconds(0.0), sigma: Seconds(0.0) };
        }
        let [one, two] = [channel, reference].map(|i| self.log_phasor(Component::Real(i), tone));
        let mut log = one.over(two);
        // d(phase / omega) also contains the error of omega.
        log.by_frequency -= log.phase / (TAU * self.cycles[tone]);
        let omega = TAU * self.frequencies[tone].value.0;
        let sigma = self.estimated(tone, &log).phase.sigma.0 / omega.abs();
        Estimate { value: Seconds(-log.phase / omega), sigma: Seconds(sigma) }
    }

    /// The number of tones.
    pub fn tones(&self) -> usize {
        self.cycles.len()
    }

    /// Cosine and sine of a tone at the centre of the record.
    fn coefficients(&self, channel: usize, tone: usize) -> [f64; 2] {
        [0, 1].map(|part| self.linear[channel][linear_count(tone) + part])
    }

    fn log_phasor(&self, wave: Component, tone: usize) -> LogPhasor {
        // P = a - j b is the phasor of a cos + b sin; these are the weights of a and b in each channel.
        let (weights, sign) = match wave {
            Component::Real(i) => (vec![(i, [Complex::ONE, -J])], 1.0),
            Component::Complex([real, imaginary], direction) => {
                let (half, sign) = (Complex::from(0.5), direction.sign());
                (vec![(real, [half, -J * half * sign]), (imaginary, [J * half, half * sign])], sign)
            }
        };
        let term = |(i, [p, q]): &(usize, [Complex<f64>; 2])| {
            let [a, b] = self.coefficients(*i, tone);
            p * a + q * b
        };
        let value: Complex<f64> = weights.iter().map(term).sum();
        let (first, samples) = (weights[0].0, self.starts[weights[0].0] * self.rate.0);
        // From the instant 0 to the centre of the record, without whole cycles and with them.
        let cycles = fractional_cycles(self.cycles[tone], self.centres[first])
            + fractional_cycles(self.cycles[tone], samples);
        LogPhasor {
            amplitude: value.norm(),
            phase: wrapped(value.arg() - sign * TAU * cycles),
            by_pairs: weights.into_iter().map(|(i, [p, q])| (i, [p / value, q / value])).collect(),
            by_frequency: -sign * (samples + self.centres[first]),
        }
    }

    /// Amplitude and phase with their standard deviations.
    fn estimated(&self, tone: usize, log: &LogPhasor) -> Ratio {
        let sigma = |part: fn(&Complex<f64>) -> f64, by_frequency: f64| {
            let own = |(i, [a, b]): &(usize, [Complex<f64>; 2])| {
                let mut own = Mat::zeros(self.linear[*i].len(), 1);
                own[(linear_count(tone), 0)] = part(a);
                own[(linear_count(tone) + 1, 0)] = part(b);
                (*i, own)
            };
            let mut frequencies = Mat::zeros(self.tones(), 1);
            frequencies[(tone, 0)] = by_frequency / self.covariance.unit;
            let by_pairs: Vec<_> = log.by_pairs.iter().map(own).collect();
            self.covariance.sigma(&by_pairs, &frequencies)
        };
        Ratio {
            gain: Estimate { value: log.amplitude, sigma: log.amplitude * sigma(|x| x.re, 0.0) },
            phase: Estimate { value: Radians(log.phase), sigma: Radians(sigma(|x| x.im, log.by_frequency)) },
        }
    }
}

impl FitCovariance {
    /// The standard deviation of a quantity with these derivatives by the coefficients of some channels,
    /// each of which occurs once, and by the frequencies in radians over half the longest record.
    fn sigma(&self, by_channels: &[(usize, Mat)], by_frequencies: &Mat) -> f64 {
        let mut common = by_frequencies.clone();
        let mut variance = 0.0;
        for (i, own) in by_channels {
            common -= self.couplings[*i].transpose() * own;
            variance += self.variances[*i] * own.dot(&self.factors[*i].solve(own));
        }
        (variance + common.dot(&(&self.frequencies * &common))).max(0.0).sqrt()
    }
}

/// An angle in -pi ..= pi.
pub(crate) fn wrapped(angle: f64) -> f64 {
    (angle - (angle / TAU).round() * TAU).clamp(-PI, PI)
}
