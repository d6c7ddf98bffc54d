//! Nonuniform samples with bounded errors of value and position (jitter).
//!
//! The model of the thesis (sections 3.2 and 3.4): a sample is taken at x + mu instead of x and has the
//! value f(x + mu) + e, with |e| <= E and |mu| <= B known.
//!
//! # Aperture jitter of converters
//!
//! Here x is time, mu the aperture jitter and e the error of quantisation. A signal whose spectrum ends at
//! the frequency F and that stays within A has |f'| <= 2 pi F A and |f''| <= (2 pi F)^2 A (Bernstein), which
//! is [`Smoothness::band_limited`]. Jitter is equivalent to a value error of |f'| B, so B seconds cost no
//! more than half a step of an n-bit converter, A 2^{-n}, up to F = 2^{-n} / (2 pi B):
//!
//! ```
//! use hybank::sampling::nonuniform::Smoothness;
//! let (bits, jitter) = (12, 1e-12);
//! let highest = 0.5_f64.powi(bits) / (std::f64::consts::TAU * jitter);
//! let worst = Smoothness::band_limited(1.0, highest).slope * jitter;
//! assert!((worst - 0.5_f64.powi(12)).abs() < 1e-12 && (highest / 1e6 - 38.86).abs() < 0.01);
//! // Random jitter of this root mean square leaves a sine of that frequency 72.2 dB: the rms slope is
//! // 1 / sqrt(2) of the largest, and so is the rms of the sine of its amplitude.
//! let snr = -20.0 * (std::f64::consts::TAU * highest * jitter).log10();
//! assert!((snr - 72.2).abs() < 0.1);
//! ```

/// One sample as a measurement: nominal position, value, and a bound on the error of each.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// Nominal position.
    pub x: f64,
    /// Measured value.
    pub value: f64,
    /// Bound of the error of the value, >= 0.
    pub error: f64,
    /// Bound of the jitter of the position, >= 0, in units of x.
    pub jitter: f64,
}

impl Measured {
    /// error^2 + slope^2 jitter^2: a displacement of the position has the effect of a value error of |f'|
    /// times the displacement.
    pub fn variance(&self, square_slope: f64) -> f64 {
        self.error * self.error + square_slope * self.jitter * self.jitter
    }

    /// Weight for a least-squares fit: 1 / (error^2 + (slope jitter)^2), `slope` a typical |f'|.
    ///
    /// The floor keeps the weight of a perfect sample finite: 1 / floor^2.
    pub fn weight(&self, slope: f64, floor: f64) -> f64 {
        1.0 / (self.variance(slope * slope) + floor.powi(2))
    }
}

/// Bounds of the function that is sampled, on the hull of the samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Smoothness {
    /// sup |f'|.
    pub slope: f64,
    /// sup |f''|.
    pub curvature: f64,
}

impl Smoothness {
    /// Of a function with |f| <= `amplitude` whose spectrum ends at `frequency` (cycles per unit of x), by
    /// Bernstein's inequality; a sine of that frequency and amplitude reaches both.
    pub fn band_limited(amplitude: f64, frequency: f64) -> Self {
        let omega = std::f64::consts::TAU * frequency;
        Self { slope: omega * amplitude, curvature: omega * omega * amplitude }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn exact(x: f64, value: f64) -> Measured {
        Measured { x, value, error: 0.0, jitter: 0.0 }
    }

    #[test]
    fn a_sine_attains_bernsteins_inequality() {
        let limits = Smoothness::band_limited(1.5, 2.0);
        let at = |k: i32| std::f64::consts::TAU * 2.0 * f64::from(k) / 1000.0;
        let slope = (0..1000).map(|k| 1.5 * std::f64::consts::TAU * 2.0 * at(k).cos()).fold(0.0, f64::max);
        assert!((limits.slope - slope).abs() < 1e-9);
        assert!((limits.curvature / slope / (std::f64::consts::TAU * 2.0) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn weights_fall_with_error_and_jitter() {
        let good = exact(0.0, 1.0).weight(10.0, 0.1);
        let noisy = Measured { error: 0.3, ..exact(0.0, 1.0) }.weight(10.0, 0.1);
        let shaky = Measured { jitter: 0.03, ..exact(0.0, 1.0) }.weight(10.0, 0.1);
        assert!((good - 100.0).abs() < 1e-9);
        assert!((noisy - 10.0).abs() < 1e-9 && (noisy - shaky).abs() < 1e-9);
    }
}
