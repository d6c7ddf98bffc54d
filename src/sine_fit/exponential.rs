//! Tones of complex records z[n] = x_0[n] + j x_1[n]: the parts are two channels that are fitted jointly.
//!
//! With the phasors P_i = A_i e^{j phi_i} of a tone in both parts, the record holds two exponentials, the
//! tone and its image at the negative frequency:
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

use super::Estimate;
use super::result::{SineFit, ToneFit, wrapped};
use crate::linalg::Complex;
use crate::units::Radians;

/// One of the two exponentials of a tone in a complex record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// At +f.
    Forward,
    /// At -f.
    Backward,
}

impl Direction {
    /// The sign of the frequency.
    pub(crate) fn sign(self) -> f64 {
        match self {
            Self::Forward => 1.0,
            Self::Backward => -1.0,
        }
    }
}

/// The channels that are the real and the imaginary part of a complex record.
pub type ComplexChannel = [usize; 2];

/// An exponential at the centre of its record, and its derivatives by the cosine and the sine in each part.
struct AtCentre {
    value: Complex<f64>,
    /// Of ln abs.
    magnitude: [(usize, (f64, f64)); 2],
    /// Of the phase.
    phase: [(usize, (f64, f64)); 2],
}

impl SineFit {
    /// The exponential of tone `tone` (from 0) in the complex record of the channels `parts` (from 0), which
    /// are of one length. The phase is that at the instant 0.
    ///
    /// # Panics
    /// If there is no such tone or channel.
    pub fn exponential(&self, parts: ComplexChannel, tone: usize, direction: Direction) -> ToneFit {
        let AtCentre { value, magnitude, phase } = self.exponential_at_centre(parts, tone, direction);
        let sign = direction.sign();
        let by_frequency = -sign * self.distance(parts[0]);
        ToneFit {
            amplitude: Estimate {
                value: value.norm(),
                sigma: value.norm() * self.sigma_of(tone, &magnitude, 0.0),
            },
            phase: Estimate {
                value: Radians(wrapped(value.arg() - sign * self.phase_to_centre(parts[0], tone))),
                sigma: Radians(self.sigma_of(tone, &phase, by_frequency)),
            },
        }
    }

    /// The standard deviations of ln abs(a / a') and of the phase of a / a', a and a' being the exponentials
    /// at +f of tone `tone` in two complex records. For equal noise and known frequencies both are
    /// sqrt(1 / (N SNR)).
    ///
    /// # Panics
    /// If there is no such tone or channel.
    pub fn exponential_ratio_sigmas(
        &self,
        parts: ComplexChannel,
        reference: ComplexChannel,
        tone: usize,
    ) -> (f64, Radians) {
        if parts == reference {
            return (0.0, Radians(0.0));
        }
        let [own, other] =
            [parts, reference].map(|parts| self.exponential_at_centre(parts, tone, Direction::Forward));
        let apart = self.distance(reference[0]) - self.distance(parts[0]);
        let magnitude = self.sigma_of(tone, &difference(own.magnitude, other.magnitude), 0.0);
        let phase = self.sigma_of(tone, &difference(own.phase, other.phase), apart);
        (magnitude, Radians(phase))
    }

    fn exponential_at_centre(
        &self,
        [real, imaginary]: ComplexChannel,
        tone: usize,
        direction: Direction,
    ) -> AtCentre {
        let ((a0, b0), (a1, b1)) = (self.coefficients(real, tone), self.coefficients(imaginary, tone));
        // P = a - j b is the phasor of a cos + b sin.
        let sign = direction.sign();
        let value = Complex::new(0.5 * (a0 + sign * b1), 0.5 * (a1 - sign * b0));
        let (re, im) = (0.5 * value.re / value.norm_sqr(), 0.5 * value.im / value.norm_sqr());
        AtCentre {
            value,
            magnitude: [(real, (re, -sign * im)), (imaginary, (im, sign * re))],
            phase: [(real, (-im, -sign * re)), (imaginary, (re, -sign * im))],
        }
    }
}

/// The derivatives of a difference of quantities of different channels.
fn difference(one: [(usize, (f64, f64)); 2], two: [(usize, (f64, f64)); 2]) -> Vec<(usize, (f64, f64))> {
    one.into_iter().chain(two.map(|(channel, (a, b))| (channel, (-a, -b)))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use crate::sine_fit::{Channel, fit, fit_known};
    use crate::units::Hertz;
    use std::f64::consts::TAU;

    const RATE: Hertz = Hertz(1e6);

    /// c + a e^{j w n} + b e^{-j w n} with noise of the standard deviation `sigma` in each part.
    fn record(
        count: usize,
        cycles: f64,
        [c, a, b]: [Complex<f64>; 3],
        sigma: f64,
        seed: u64,
    ) -> [Vec<f64>; 2] {
        let mut random = Random(seed);
        let mut gaussian =
            || (-2.0 * (1.0 - random.part()).ln()).sqrt() * (TAU * random.part()).cos() * sigma;
        let at = |n: usize| {
            let turn = Complex::from_polar(1.0, TAU * cycles * n as f64);
            c + a * turn + b * turn.conj() + Complex::new(gaussian(), gaussian())
        };
        let samples: Vec<Complex<f64>> = (0..count).map(at).collect();
        [samples.iter().map(|z| z.re).collect(), samples.iter().map(|z| z.im).collect()]
    }

    fn angle(a: f64, b: f64) -> f64 {
        wrapped(a - b).abs()
    }

    #[test]
    fn both_exponentials_are_those_that_are_there() {
        let (a, b) = (Complex::from_polar(0.7, 0.4), Complex::from_polar(0.02, -2.0));
        for cycles in [0.13, -0.31, 0.004, 1.2, -2.4] {
            for count in [300, 511, 2000] {
                let parts = record(count, cycles, [Complex::new(0.1, -0.2), a, b], 0.0, 0);
                let channels = [Channel::new(&parts[0]), Channel::new(&parts[1])];
                let found = fit(&channels, RATE, &[RATE * (cycles + 0.1 / count as f64)]).unwrap();
                assert!((found.frequencies[0].value / RATE - cycles).abs() < 1e-13, "{cycles} {count}");
                for (direction, z) in [(Direction::Forward, a), (Direction::Backward, b)] {
                    let ToneFit { amplitude, phase } = found.exponential([0, 1], 0, direction);
                    assert!((amplitude.value - z.norm()).abs() < 1e-12, "{cycles} {count} {direction:?}");
                    assert!(angle(phase.value.0, z.arg()) < 1e-9, "{cycles} {count} {direction:?}");
                }
                assert!((found.channels[1].constant.value + 0.2).abs() < 1e-12);
            }
        }
    }

    /// The standard deviations are the closed forms of Rife and Boorstyn, whatever the image.
    #[test]
    fn standard_deviations_are_the_cramer_rao_bounds_of_an_exponential() {
        let (count, cycles, size, sigma) = (1000, -0.2345, 0.8, 1e-2);
        let parts = record(count, cycles, [0.1.into(), size.into(), (0.1 * size).into()], sigma, 5);
        let channels = [Channel::new(&parts[0]), Channel::new(&parts[1])];
        let n = count as f64;
        let found = fit(&channels, RATE, &[RATE * cycles]).unwrap();
        let noise = 0.5 * found.channels.iter().map(|part| part.noise.powi(2)).sum::<f64>();
        let snr = size * size / (2.0 * noise);
        let close = |got: f64, want: f64| assert!((got / want - 1.0).abs() < 0.02, "{got} {want}");
        close(
            TAU * (found.frequencies[0].sigma / RATE),
            // The image has a hundredth of the power and tells of the frequency too.
            (6.0 / (snr * 1.01 * n * (n * n - 1.0))).sqrt(),
        );
        let tone = found.exponential([0, 1], 0, Direction::Forward);
        close(tone.amplitude.sigma / size, 1.0 / (2.0 * n * snr).sqrt());
        // At the beginning of the record the error of the frequency adds three times the variance.
        close(tone.phase.sigma.0, (4.0 / (2.0 * n * snr)).sqrt());
        let known =
            fit_known(&channels, RATE, &[RATE * cycles]).unwrap().exponential([0, 1], 0, Direction::Forward);
        close(known.phase.sigma.0, 1.0 / (2.0 * n * snr).sqrt());
        let image = found.exponential([0, 1], 0, Direction::Backward);
        close(image.amplitude.sigma, tone.amplitude.sigma);
    }

    #[test]
    fn standard_deviations_are_the_scatter_of_repeated_records() {
        let (count, cycles, trials, sigma) = (64, 0.313_7, 1500, 0.05);
        let a = Complex::from_polar(1.0, 0.9);
        let mut ratios = [0.0; 4];
        for seed in 0..trials {
            let parts = record(count, cycles, [0.0.into(), a, 0.0.into()], sigma, 100 + seed);
            let channels = [Channel::new(&parts[0]), Channel::new(&parts[1])];
            let found = fit(&channels, RATE, &[RATE * cycles]).unwrap();
            let ToneFit { amplitude, phase } = found.exponential([0, 1], 0, Direction::Forward);
            let frequency = found.frequencies[0];
            let quadrature = found.phase_between(1, 0, 0);
            let errors = [
                (frequency.value - RATE * cycles) / frequency.sigma,
                (amplitude.value - 1.0) / amplitude.sigma,
                wrapped(phase.value.0 - 0.9) / phase.sigma.0,
                (quadrature.value.0 + 0.5 * std::f64::consts::PI) / quadrature.sigma.0,
            ];
            ratios.iter_mut().zip(errors).for_each(|(sum, error)| *sum += error * error / trials as f64);
        }
        // The mean of 1500 squares has a standard deviation of 0.037.
        assert!(ratios.iter().all(|ratio| (ratio - 1.0).abs() < 0.13), "{ratios:?}");
    }
}
