//! Least-squares fits of sines to records: IEEE Std 1057-2017 and 1241-2023 (three and four parameters),
//! sums of several tones, and one frequency fitted jointly over the channels of a converter.
//!
//! Sample n of channel i is taken at the instant t = t_i + n T, with T the period of the samples and t_i the
//! known [`Channel::offset`]. K tones are fitted to it:
//!
//! ```text
//! x_i[n] = c_i + sum over k = 1..K of  A_ik cos(2 pi f_k t + phi_ik) + noise
//! ```
//!
//! The constant c_i, the amplitudes A_ik and the phases phi_ik belong to a channel; the frequencies f_k are
//! common to all. [`fit_known`] keeps the frequencies (three parameters per tone and channel), [`fit`] finds
//! them too (Gauss-Newton, each step a least-squares problem). A frequency may lie in any Nyquist zone of
//! the sample rate: the fit starts there and stays there.
//!
//! # Errors of the estimates
//!
//! Every value is an [`Estimate`] with its standard deviation sigma: the Cramer-Rao bound for independent
//! Gaussian noise whose variance per channel is that of the residual. One tone, N samples, noise of variance
//! s^2, SNR = A^2 / (2 s^2) (Rife and Boorstyn, 1974):
//!
//! ```text
//! sigma(c) = s / sqrt(N)        sigma(A) / A = 1 / sqrt(N SNR)
//! sigma(2 pi f T)^2 = 12 / (SNR N (N^2 - 1))
//! ```
//!
//! A complex record is two channels, its real and its imaginary part, fitted jointly:
//! [`Component::Complex`]. The frequency of C joint channels has 1/C of that variance. Noise that repeats
//! with the tone, such as the quantisation of few distinct phases, is not independent, and sigma is then
//! too small.
//!
//! # Cost
//!
//! A pass over the samples accumulates the normal equations of all columns in blocks; nothing of the size of
//! samples times parameters is stored. Time counts from the centre of each record in units of half the
//! longest one, which makes the columns nearly orthogonal.

mod error;
mod gauss_newton;
mod nonlinearity;
mod nonlinearity_table;
mod normal;
mod result;
mod search;

pub use error::SineFitError;
pub use gauss_newton::{fit, fit_known};
pub use nonlinearity::{CurveFit, CurveKind};
pub(crate) use result::wrapped;
pub use result::{ChannelFit, ComplexChannel, Component, Ratio, Sense, SineFit, ToneFit};
pub(crate) use search::with_lines;
pub use search::{find_tones, locate};

use crate::spec::HALF_WIDTH;
use crate::units::Seconds;
use serde::ser::{Serialize, SerializeStruct, Serializer};
use std::ops::Mul;

/// An estimate with its standard deviation, in one unit. Reports have the half-width of its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate<Q> {
    /// The value.
    pub value: Q,
    /// The standard deviation.
    pub sigma: Q,
}

impl<Q: Copy + Mul<f64, Output = Q>> Estimate<Q> {
    /// The half-width of the 95 % interval.
    pub fn half_width(&self) -> Q {
        self.sigma * HALF_WIDTH
    }
}

impl<Q: Serialize + Copy + Mul<f64, Output = Q>> Serialize for Estimate<Q> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut interval = serializer.serialize_struct("Estimate", 2)?;
        interval.serialize_field("value", &self.value)?;
        interval.serialize_field("half_width", &self.half_width())?;
        interval.end()
    }
}

/// The record of one converter.
#[derive(Debug, Clone, Copy)]
pub struct Channel<'a> {
    /// The samples. NaN and infinities are left out.
    pub samples: &'a [f64],
    /// Instant of sample 0.
    pub offset: Seconds,
    /// False where a sample is left out, for example because it is clipped; as long as the samples.
    pub keep: Option<&'a [bool]>,
}

impl<'a> Channel<'a> {
    /// All finite `samples`, the first of them taken at the instant 0.
    pub fn new(samples: &'a [f64]) -> Self {
        Self { samples, offset: Seconds(0.0), keep: None }
    }

    /// True if sample `n` takes part in the fit.
    pub(crate) fn uses(&self, n: usize) -> bool {
        self.samples[n].is_finite() && self.keep.is_none_or(|keep| keep[n])
    }

    /// The number of samples that take part in the fit.
    pub fn used(&self) -> usize {
        (0..self.samples.len()).filter(|&n| self.uses(n)).count()
    }

    /// The samples that take part, minus their mean; 0 in place of the others.
    pub(crate) fn deviations(&self) -> Vec<f64> {
        let used = || (0..self.samples.len()).filter(|&n| self.uses(n));
        let mean = used().map(|n| self.samples[n]).sum::<f64>() / used().count().max(1) as f64;
        let deviation = |n: usize| if self.uses(n) { self.samples[n] - mean } else { 0.0 };
        (0..self.samples.len()).map(deviation).collect()
    }
}

/// Distance of a frequency in cycles per sample to the nearest multiple of 1/2, where sine and cosine
/// coincide.
pub(crate) fn distance_to_edge(cycles: f64) -> f64 {
    0.5 * (2.0 * cycles - (2.0 * cycles).round()).abs()
}

/// The frequency in 0 ..= 1/2 cycles per sample at which samples show `cycles`.
pub(crate) fn alias(cycles: f64) -> f64 {
    (cycles - cycles.round()).abs()
}

#[cfg(test)]
mod tests;
