//! The error system and second moments of its samples in 512 bits, for the search for certificates and for
//! witnesses of long filters. Only their midpoints: the proof does not use them.

use super::ball::{self, Ball};
use super::covariance::{Covariance, TapSamples};
use super::enclosed::EnclosedErrorSystem;
use super::spectrum::{self, ComplexMatrix};
use crate::arithmetic::BigFloat;
use nalgebra::DMatrix;

/// Real and imaginary part.
pub(crate) type ComplexParts = [DMatrix<BigFloat>; 2];

/// An error system xi+ = A xi + J u, e = C xi + L u with the Gram matrix S of u.
pub(crate) struct PreciseErrorSystem {
    /// [A; C], (n + M) x n.
    pub(crate) system: DMatrix<BigFloat>,
    /// [J; L] S [J; L]'.
    pub(crate) input_gram: DMatrix<BigFloat>,
}

impl EnclosedErrorSystem<'_> {
    /// The error system in 512 bits.
    pub(crate) fn in_512_bits(&self) -> PreciseErrorSystem {
        let error = self.long_equations();
        PreciseErrorSystem { system: midpoints(&error.system), input_gram: midpoints(&error.input_gram()) }
    }

    /// The point z of the unit circle that `half` names, 1 x 1, and the Gram matrix at it: that of the M
    /// reference samples and the samples of the `channels`.
    pub(crate) fn precise_gram(&self, half: [f64; 2], channels: &[usize]) -> [ComplexParts; 2] {
        let m = self.bank.ratio;
        let z = ComplexMatrix::unit(half);
        let rows: Vec<usize> = (0..m).chain(channels.iter().map(|i| m + i)).collect();
        let gram = spectrum::gram(self.long_period(), &z).select(&rows, &rows);
        [&z, &gram].map(|of| [midpoints(&of.re), midpoints(&of.im)])
    }

    /// Covariance of the samples of the `channels` over `lags` slow periods, for white noise of unit density
    /// at the input, the channels of the latest period first; and the correlations of the M reference
    /// samples (rows) with these.
    pub(crate) fn precise_covariance(
        &self,
        channels: &[usize],
        lags: usize,
    ) -> Option<[DMatrix<BigFloat>; 2]> {
        let (period, ratio) = (self.long_period(), self.bank.ratio);
        let covariance = Covariance::new(period)?;
        let samples = TapSamples { ratio, channels, lags };
        let own = covariance.of_taps(period, samples);
        Some([own, covariance.with_reference(period, samples)].map(|m| midpoints(&m)))
    }
}

fn midpoints(m: &ball::Matrix<BigFloat>) -> DMatrix<BigFloat> {
    m.map(Ball::mid)
}
