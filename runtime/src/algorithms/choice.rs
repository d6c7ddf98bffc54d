//! Which algorithm FIR filters run by, and what it costs.
//!
//! The cost of a frame is counted in multiply-adds of whole vectors. Its constants were fitted by
//! `tools/algorithm_costs.py` to what `cargo bench --bench algorithm_crossover` measured (see
//! `benches/README.md`), in f32 and f64 alike. They depend on the bank and the number type only, not on the
//! processor, its load or the length of calls: a bank gives the same bits everywhere. The algorithms round
//! differently, so a model for each instruction set would let the processor choose the bits.

use super::filter::phase_taps;
use super::overlap_save::Shape;
use crate::simd::{SHORTEST_TRANSFORM, group_lanes};
use crate::{BuildError, PcmFormat};
use std::fmt;
use std::str::FromStr;

/// How FIR filters are computed. All give the same sums up to rounding.
///
/// The names are those of [`FromStr`] and [`Display`](fmt::Display): `auto`, `direct` and `overlap-save`.
///
/// ```
/// use hybank_runtime::{Algorithm, ParseAlgorithmError};
/// assert_eq!("overlap-save".parse(), Ok(Algorithm::OverlapSave { transform: None }));
/// assert_eq!("fft".parse::<Algorithm>(), Err(ParseAlgorithmError("fft".into())));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Algorithm {
    /// Every product is computed; no sample is later than the bank's latency.
    #[default]
    Direct,
    /// Fourier transforms of `transform` = F frames, a power of two from 16 on that is at least K, or of the
    /// best such length. For long filters a fraction of the work, but the output is later by
    /// [`extra_latency`](crate::Plan::extra_latency).
    OverlapSave {
        /// F; `None` for the best length.
        transform: Option<usize>,
    },
    /// The faster one by the measured costs of both; the output may be later than the bank's latency.
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
        use PcmFormat::{F64Be, F64Le, S32Be, S32Le};
        if matches!(format, F64Be | F64Le | S32Be | S32Le) { Self::Double } else { Self::Single }
    }
}

/// The algorithm that a bank runs by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ChosenAlgorithm {
    Direct,
    /// By transforms of F frames.
    OverlapSave(usize),
}

/// Transforms longer than this are not tried.
const LONGEST_TRANSFORM: usize = 1 << 24;

/// Each pair of a phase and a vector of products: adding its lanes.
const DIRECT_SUM: f64 = 1.2;
/// Each output of the direct algorithm.
const DIRECT_OUTPUT: f64 = 0.3;
/// A row in one pass of a transform, of radix 4 (the last one may be of radix 2): 17 operations, loads,
/// stores.
const ROW_PASS: f64 = 8.0;
/// Each doubling of F beyond this many rows, which fill half of a first-level cache of 32 KB, makes a pass
/// longer by this part of it.
const CACHED_ROWS: f64 = 256.0;
const CACHE_MISSES: f64 = 0.15;
/// Each batch: the calls of its kernels, and the search for what is not finite.
const BATCH: f64 = 400.0;
/// Each output of overlap-save: from rows to frames.
const BLOCK_OUTPUT: f64 = 0.8;
/// Each input of overlap-save, and each frame.
const BLOCK_INPUT: f64 = 0.5;
const BLOCK_FRAME: f64 = 1.0;

/// A longer transform must be cheaper by this factor: it makes outputs later, and the model errs by as much.
const WORTH_LENGTH: f64 = 0.95;
/// Overlap-save must be cheaper by this factor than the direct algorithm, which rounds less and adds no
/// latency.
const WORTH_CHANGE: f64 = 0.9;

impl Algorithm {
    /// All algorithms; overlap-save with the best length.
    pub const ALL: [Self; 3] = [Self::Auto, Self::Direct, Self::OverlapSave { transform: None }];

    /// The name, without the length of a transform.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Direct => "direct",
            Self::OverlapSave { .. } => "overlap-save",
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
    /// [`BuildError::Transform`] if no transform, or not the given one, can hold the filters.
    pub(crate) fn choose(
        self,
        taps: &[Vec<f64>],
        ratio: usize,
        precision: Precision,
    ) -> Result<ChosenAlgorithm, BuildError> {
        let size = Size::new(taps, ratio, precision);
        let refused =
            |len| BuildError::Transform { len, phase_taps: size.phase_taps, shortest: SHORTEST_TRANSFORM };
        match self {
            Self::Direct => Ok(ChosenAlgorithm::Direct),
            Self::OverlapSave { transform: Some(len) } if !size.holds(len) => Err(refused(len)),
            Self::OverlapSave { transform: Some(len) } => Ok(ChosenAlgorithm::OverlapSave(len)),
            Self::OverlapSave { transform: None } => match size.best_transform() {
                Some((len, _)) => Ok(ChosenAlgorithm::OverlapSave(len)),
                None => Err(refused(LONGEST_TRANSFORM)),
            },
            Self::Auto => Ok(size.fastest()),
        }
    }
}

/// # Errors
/// [`BuildError::Recursive`] if only FIR filters run by this algorithm.
pub(crate) fn check_recursive(algorithm: Algorithm) -> Result<(), BuildError> {
    match algorithm {
        Algorithm::Direct | Algorithm::Auto => Ok(()),
        Algorithm::OverlapSave { .. } => Err(BuildError::Recursive { algorithm: algorithm.name() }),
    }
}

/// Lanes of a group.
fn group(precision: Precision) -> usize {
    match precision {
        Precision::Single => group_lanes::<f32>(),
        Precision::Double => group_lanes::<f64>(),
    }
}

/// What the cost depends on.
#[derive(Debug, Clone, Copy)]
struct Size {
    channels: usize,
    ratio: usize,
    /// K.
    phase_taps: usize,
    group: usize,
}

impl Size {
    fn new(taps: &[Vec<f64>], ratio: usize, precision: Precision) -> Self {
        Self { channels: taps.len(), ratio, phase_taps: phase_taps(taps, ratio), group: group(precision) }
    }

    fn holds(&self, len: usize) -> bool {
        len.is_power_of_two() && (self.phase_taps.max(SHORTEST_TRANSFORM)..=LONGEST_TRANSFORM).contains(&len)
    }

    /// A frame by the direct algorithm.
    fn direct(&self) -> f64 {
        // Windows are cut into whole groups, or whole frames.
        let frame = self.channels;
        let depth = if frame < self.group && frame.is_power_of_two() { frame } else { self.group };
        let steps = (self.phase_taps as f64 * frame as f64 / depth as f64).ceil();
        let vectors = (self.ratio * depth) as f64 / self.group as f64;
        vectors * (steps + DIRECT_SUM) + DIRECT_OUTPUT * self.ratio as f64
    }

    fn shape(&self, len: usize) -> Shape {
        Shape::new(self.channels, self.ratio, self.phase_taps - 1, len, self.group)
    }

    /// A frame with transforms of length `len`.
    fn overlap_save(&self, len: usize) -> f64 {
        let shape = self.shape(len);
        let (inputs, outputs) = (shape.inputs() as f64, shape.outputs() as f64);
        let misses = CACHE_MISSES * (len as f64 / CACHED_ROWS).log2().max(0.0);
        let passes = f64::from(len.ilog2().div_ceil(2));
        let transforms = ROW_PASS * (1.0 + misses) * (inputs + outputs) * passes;
        let products = 4.0 * outputs * self.channels as f64;
        let samples = BLOCK_OUTPUT * self.ratio as f64 + BLOCK_INPUT * self.channels as f64 + BLOCK_FRAME;
        (len as f64 * (transforms + products) + BATCH) / shape.batch() as f64 + samples
    }

    /// The shortest transform that costs hardly more than the best one, and its cost.
    fn best_transform(&self) -> Option<(usize, f64)> {
        let shortest = self.phase_taps.checked_next_power_of_two()?.max(SHORTEST_TRANSFORM);
        let lengths =
            (0..6).map(|i| shortest << i).filter(|&len| self.holds(len) && self.shape(len).spectra_fit());
        lengths
            .map(|len| (len, self.overlap_save(len)))
            .reduce(|best, next| if next.1 < WORTH_LENGTH * best.1 { next } else { best })
    }

    fn fastest(&self) -> ChosenAlgorithm {
        let pays = |&(_, transformed): &(usize, f64)| transformed < WORTH_CHANGE * self.direct();
        let transform = self.best_transform().filter(pays);
        transform.map_or(ChosenAlgorithm::Direct, |(len, _)| ChosenAlgorithm::OverlapSave(len))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chosen(
        n: usize,
        m: usize,
        phase_taps: usize,
        algorithm: Algorithm,
    ) -> Result<ChosenAlgorithm, BuildError> {
        algorithm.choose(&vec![vec![1.0; phase_taps * m]; n], m, Precision::Single)
    }

    #[test]
    fn long_filters_are_transformed_and_short_ones_are_not() {
        // Measured: the direct algorithm wins at the first K, overlap-save at the second by a third at
        // least.
        for (n, m, short, long) in
            [(1, 1, 16, 512), (2, 2, 8, 128), (4, 4, 4, 64), (8, 8, 4, 16), (16, 16, 2, 8)]
        {
            assert_eq!(
                chosen(n, m, short, Algorithm::Auto),
                Ok(ChosenAlgorithm::Direct),
                "N {n} M {m} K {short}"
            );
            let choice = chosen(n, m, long, Algorithm::Auto).unwrap();
            assert!(matches!(choice, ChosenAlgorithm::OverlapSave(_)), "N {n} M {m} K {long}: {choice:?}");
        }
        // Measured for K = 16: 64 frames take 5 % longer on a Xeon, 10 % on a Zen 5.
        for (k, best) in [(4, 64), (16, 256), (64, 256)] {
            let choice = chosen(8, 8, k, Algorithm::OverlapSave { transform: None });
            assert_eq!(choice, Ok(ChosenAlgorithm::OverlapSave(best)), "K {k}");
        }
    }

    #[test]
    fn a_choice_once_made_stays_for_longer_filters() {
        for (n, m) in (1..=17).flat_map(|n| (1..=17).map(move |m| (n, m))) {
            let wins = |phase_taps: usize| {
                let size = Size { channels: n, ratio: m, phase_taps, group: 8 };
                matches!(size.fastest(), ChosenAlgorithm::OverlapSave(_))
            };
            let first = (0..14).map(|i| 1usize << i).find(|&phase_taps| wins(phase_taps)).unwrap();
            assert!((0..6).map(|i| first << i).all(wins), "N {n} M {m}: first at K = {first}");
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
    fn transforms_that_cannot_hold_the_filters_are_refused() {
        let refused = |len| BuildError::Transform { len, phase_taps: 40, shortest: 16 };
        for len in [0, 8, 32, 63, 100, 1 << 25] {
            assert_eq!(chosen(2, 2, 40, Algorithm::OverlapSave { transform: Some(len) }), Err(refused(len)));
        }
        assert_eq!(
            chosen(2, 2, 40, Algorithm::OverlapSave { transform: Some(64) }),
            Ok(ChosenAlgorithm::OverlapSave(64))
        );
    }
}
