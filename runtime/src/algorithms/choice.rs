//! Which algorithm FIR filters run by.
//!
//! The choice depends on the sizes of the bank only, not on the processor, its load or the length of calls:
//! the algorithms round differently, and a bank gives the same bits everywhere.

use super::filter::phase_taps;
use super::overlap_save::TransformShape;
use crate::simd::group_lanes;
use crate::{BuildError, PcmFormat};
use std::fmt;
use std::str::FromStr;

/// How FIR filters are computed. All give the same sums up to rounding.
///
/// The names are those of [`FromStr`] and [`Display`](fmt::Display): `auto`, `direct` and `overlap-save`.
///
/// ```
/// use hybank_runtime::{Algorithm, ParseAlgorithmError};
/// assert_eq!("overlap-save".parse(), Ok(Algorithm::OverlapSave));
/// assert_eq!("fft".parse::<Algorithm>(), Err(ParseAlgorithmError("fft".into())));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Algorithm {
    /// Every product is computed; no sample is later than the bank's latency.
    #[default]
    Direct,
    /// Fourier transforms of blocks. For long filters a fraction of the work, but the output is later by
    /// [`extra_latency`](crate::Plan::extra_latency).
    OverlapSave,
    /// Overlap-save for long filters, else direct; the output may be later than the bank's latency.
    Auto,
}

/// A name that is not one of [`Algorithm::ALL`].
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("\"{0}\" is unknown; choose auto, direct or overlap-save")]
pub struct ParseAlgorithmError(pub String);

impl fmt::Display for Algorithm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Algorithm {
    type Err = ParseAlgorithmError;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        let known = Self::ALL.into_iter().find(|algorithm| algorithm.name() == name);
        known.ok_or_else(|| ParseAlgorithmError(name.to_owned()))
    }
}

/// Number type of the kernels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Precision {
    /// Coefficients and sums in f32: error about 1e-7 of full scale.
    #[default]
    Single,
    /// Coefficients and sums in f64, at half the speed.
    Double,
}

impl Precision {
    /// For samples of a format: those with more digits than f32 need sums in f64.
    pub fn of(format: PcmFormat) -> Self {
        if format.bytes() == 8 || (format.bytes() == 4 && !format.is_float()) {
            Self::Double
        } else {
            Self::Single
        }
    }

    /// Numbers of a lane group.
    fn lanes(self) -> usize {
        match self {
            Self::Single => group_lanes::<f32>(),
            Self::Double => group_lanes::<f64>(),
        }
    }
}

/// The algorithm that a bank runs by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ChosenAlgorithm {
    Direct,
    OverlapSave(TransformShape),
}

/// Transforms pay from so many lags K on, times N M / (N + M): sums take K N M multiply-adds per frame,
/// transforms a time by N + M.
const LONG: usize = 96;

impl Algorithm {
    /// All algorithms.
    pub const ALL: [Self; 3] = [Self::Auto, Self::Direct, Self::OverlapSave];

    /// The name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Direct => "direct",
            Self::OverlapSave => "overlap-save",
            Self::Auto => "auto",
        }
    }

    /// The same with [`Algorithm::Direct`] for [`Algorithm::Auto`], where a later output is not wanted.
    pub fn without_added_latency(self) -> Self {
        if self == Self::Auto { Self::Direct } else { self }
    }

    /// The algorithm that filters are to run by.
    ///
    /// # Errors
    /// [`BuildError::Spectra`] if no transform can hold the filters.
    pub(crate) fn choose(
        self,
        taps: &[Vec<f64>],
        ratio: usize,
        precision: Precision,
    ) -> Result<ChosenAlgorithm, BuildError> {
        let (channels, lags) = (taps.len(), phase_taps(taps, ratio));
        let [sums, transforms] = [lags * channels * ratio, LONG * (channels + ratio)];
        if self == Self::Direct || (self == Self::Auto && sums < transforms) {
            return Ok(ChosenAlgorithm::Direct);
        }
        match TransformShape::new(channels, ratio, lags, precision.lanes()) {
            Some(shape) => Ok(ChosenAlgorithm::OverlapSave(shape)),
            None if self == Self::Auto => Ok(ChosenAlgorithm::Direct),
            None => Err(BuildError::Spectra { channels, ratio, lags }),
        }
    }
}

/// # Errors
/// [`BuildError::Recursive`] if only FIR filters run by this algorithm.
pub(crate) fn check_recursive(algorithm: Algorithm) -> Result<(), BuildError> {
    match algorithm {
        Algorithm::Direct | Algorithm::Auto => Ok(()),
        Algorithm::OverlapSave => Err(BuildError::Recursive { algorithm: algorithm.name() }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is_transformed(n: usize, m: usize, lags: usize, algorithm: Algorithm) -> bool {
        let choice = algorithm.choose(&vec![vec![1.0; lags * m]; n], m, Precision::Single).unwrap();
        matches!(choice, ChosenAlgorithm::OverlapSave(_))
    }

    #[test]
    fn long_filters_are_transformed_and_short_ones_are_not() {
        // Measured: the direct algorithm wins at the first K, overlap-save at the second by a third at
        // least.
        for (n, m, short, long) in
            [(1, 1, 64, 512), (2, 2, 64, 128), (4, 4, 32, 64), (8, 8, 8, 32), (16, 16, 4, 16)]
        {
            assert!(!is_transformed(n, m, short, Algorithm::Auto), "N {n} M {m} K {short}");
            assert!(is_transformed(n, m, long, Algorithm::Auto), "N {n} M {m} K {long}");
        }
    }

    #[test]
    fn names_go_both_ways_and_a_wrong_one_is_named() {
        for algorithm in Algorithm::ALL {
            assert_eq!(algorithm.to_string().parse(), Ok(algorithm));
        }
        let refused = "fast-fir".parse::<Algorithm>().unwrap_err().to_string();
        assert_eq!(refused, "\"fast-fir\" is unknown; choose auto, direct or overlap-save");
        let [auto, direct, overlap_save] = Algorithm::ALL.map(Algorithm::without_added_latency);
        assert_eq!([auto, direct, overlap_save], [Algorithm::Direct, Algorithm::Direct, Algorithm::ALL[2]]);
    }

    #[test]
    fn spectra_that_would_fill_the_memory_are_refused_or_not_chosen() {
        let taps = vec![vec![1.0]; 8192];
        let refused = BuildError::Spectra { channels: 8192, ratio: 1024, lags: 1 };
        let choose = |algorithm: Algorithm| algorithm.choose(&taps, 1024, Precision::Single);
        assert_eq!(choose(Algorithm::OverlapSave), Err(refused));
        assert_eq!(choose(Algorithm::Auto), Ok(ChosenAlgorithm::Direct));
    }
}
