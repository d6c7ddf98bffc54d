//! What limits a bank over the band of its signal: the signal itself, or the noise of the converters.

use super::DesignError;
use super::fir_errors::FirErrors;
use super::known_instants::with_noise;
use super::problem::Problem;
use super::responses::impulse_responses;
use hybank_core::bank::Bank;

/// Ratio of error powers, half a decibel, from which on a second design is made and kept: it takes as long
/// as the first one.
const WORTHWHILE: f64 = 1.122;
/// Samples that the filters see, at most: covariances of more take seconds.
const MOST_SAMPLES: usize = 1024;

/// Mean squares of the error of a bank per fast sample.
pub(super) struct BandError {
    /// From the signal, white in its band.
    signal: f64,
    /// Of the noise of the converters, or of 16 bits where the spec states none.
    noise: f64,
}

impl BandError {
    /// `None` for filters that see more than 1024 samples.
    ///
    /// # Errors
    /// As [`Problem::of_bank`].
    pub(super) fn of(bank: &Bank) -> Result<Option<Self>, DesignError> {
        let noisy = with_noise(Problem::of_bank(bank)?, bank.spec.as_ref());
        let (taps, latency) = (impulse_responses(bank), bank.latency);
        let length = taps.first().map_or(0, Vec::len);
        if length.div_ceil(bank.ratio) * noisy.channels.len() > MOST_SAMPLES {
            return Ok(None);
        }
        let quiet = Problem { noise: vec![0.0; noisy.noise.len()], ..noisy.clone() };
        let errors = FirErrors::new(&quiet, &[], length, latency..=latency);
        let signal = errors.square_of(&taps, latency);
        Ok(Some(Self { signal, noise: errors.noise_of(&taps, &noisy.noise) }))
    }

    /// Whether the band limits the bank: without the error from the signal it would be better.
    pub(super) fn is_of_signal(&self) -> bool {
        self.total() > WORTHWHILE * self.noise
    }

    /// Whether this bank is better than another one.
    pub(super) fn is_better_than(&self, other: &Self) -> bool {
        WORTHWHILE * self.total() < other.total()
    }

    fn total(&self) -> f64 {
        self.signal + self.noise
    }
}
