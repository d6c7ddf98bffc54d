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
use crate::{BuildError, Precision};

/// How FIR filters are computed. All give the same sums up to rounding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Algorithm {
    /// Every product is computed; no sample is later than the bank's latency.
    #[default]
    Direct,
    /// Two-parallel fast FIR: pairs of frames through three filters of half the length in place of four
    /// (Karatsuba), for filters of K >= 2 taps per phase. Up to a quarter less work for long ones, and no
    /// sample is later. The error is relative to the norms of each channel's filter and of the inputs in its
    /// history and not to each product: a few eps, for white noise up to 1.4 times that of the direct
    /// algorithm.
    FastFir,
    /// Fourier transforms of `transform` = F frames, a power of two from 16 on that is at least K, or of the
    /// best such length. For long filters a fraction of the work, but the output is later by
    /// [`extra_latency`](crate::Plan::extra_latency).
    OverlapSave {
        /// F; `None` for the best length.
        transform: Option<usize>,
    },
    /// The fastest algorithm by the measured costs of all; overlap-save only if `added_latency` is true.
    Auto {
        /// May the output be later than the bank's latency?
        added_latency: bool,
    },
}

/// The algorithm that a bank runs by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ChosenAlgorithm {
    Direct,
    FastFir,
    /// By transforms of F frames.
    OverlapSave(usize),
}

/// Transforms longer than this are not tried.
const LONGEST_TRANSFORM: usize = 1 << 24;

/// Each pair of a phase and a vector of products: adding its lanes.
const DIRECT_SUM: f64 = 1.2;
/// Each output of the direct algorithm.
const DIRECT_OUTPUT: f64 = 0.3;
/// A row in one level of radix 2 of a transform: 3 multiply-adds, 4 additions, loads and stores.
const ROW_LEVEL: f64 = 4.2;
/// Each output of overlap-save: from rows to frames.
const BLOCK_OUTPUT: f64 = 0.8;
/// Each vector of outputs of fast FIR: from products to frames; each vector of inputs: to halves and means.
const PAIR_OUTPUTS: f64 = 12.0;
const PAIR_INPUTS: f64 = 10.0;
/// Each input of overlap-save, and each frame.
const BLOCK_INPUT: f64 = 0.5;
const BLOCK_FRAME: f64 = 1.0;

/// A longer transform must be cheaper by this factor: it makes outputs later.
const WORTH_LENGTH: f64 = 0.93;
/// An algorithm must be cheaper by this factor than one that rounds less or adds no latency.
const WORTH_CHANGE: f64 = 0.9;

impl Algorithm {
    /// The algorithm that filters are to run by.
    ///
    /// # Errors
    /// [`BuildError::Transform`] if no transform, or not the given one, can hold the filters;
    /// [`BuildError::TooShort`] if there are no pairs of taps to halve.
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
            Self::FastFir if size.phase_taps < 2 => Err(BuildError::TooShort { phase_taps: size.phase_taps }),
            Self::FastFir => Ok(ChosenAlgorithm::FastFir),
            Self::OverlapSave { transform: Some(len) } if !size.holds(len) => Err(refused(len)),
            Self::OverlapSave { transform: Some(len) } => Ok(ChosenAlgorithm::OverlapSave(len)),
            Self::OverlapSave { transform: None } => match size.best_transform() {
                Some((len, _)) => Ok(ChosenAlgorithm::OverlapSave(len)),
                None => Err(refused(LONGEST_TRANSFORM)),
            },
            Self::Auto { added_latency: true } => Ok(size.fastest()),
            Self::Auto { added_latency: false } => Ok(size.fastest_without_latency().0),
        }
    }
}

impl ChosenAlgorithm {
    /// Bytes of the coefficients and of the state of one stream, about.
    pub(crate) fn bytes(self, taps: &[Vec<f64>], ratio: usize, precision: Precision) -> f64 {
        let size = Size::new(taps, ratio, precision);
        let numbers = match self {
            Self::OverlapSave(len) => size.shape(len).numbers(),
            // The filters of all phases and the history, both rounded up to whole vectors.
            Self::Direct | Self::FastFir => {
                2.0 * (size.phase_taps * size.channels) as f64 * (size.ratio + 2) as f64
            }
        };
        numbers * precision.bytes()
    }
}

/// # Errors
/// [`BuildError::Recursive`] if only FIR filters run by this algorithm.
pub(crate) fn check_recursive(algorithm: Algorithm) -> Result<(), BuildError> {
    match algorithm {
        Algorithm::Direct | Algorithm::Auto { .. } => Ok(()),
        Algorithm::FastFir => Err(BuildError::Recursive { algorithm: "fast-fir" }),
        Algorithm::OverlapSave { .. } => Err(BuildError::Recursive { algorithm: "overlap-save" }),
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
        self.direct_with(self.phase_taps)
    }

    /// A frame by the direct algorithm with K = `phase_taps`.
    fn direct_with(&self, phase_taps: usize) -> f64 {
        // Windows are cut into whole groups, or whole frames.
        let frame = self.channels;
        let depth = if frame < self.group && frame.is_power_of_two() { frame } else { self.group };
        let steps = (phase_taps as f64 * frame as f64 / depth as f64).ceil();
        let vectors = (self.ratio * depth) as f64 / self.group as f64;
        vectors * (steps + DIRECT_SUM) + DIRECT_OUTPUT * self.ratio as f64
    }

    /// A frame by fast FIR: half a frame of each of three filters.
    fn fast(&self) -> f64 {
        let (odd, even) = (self.phase_taps / 2, self.phase_taps.div_ceil(2));
        let filters = 2.0 * self.direct_with(even) + self.direct_with(odd);
        let pairs = PAIR_OUTPUTS * self.ratio as f64 + PAIR_INPUTS * self.channels as f64;
        filters / 2.0 + pairs / self.group as f64
    }

    fn shape(&self, len: usize) -> Shape {
        Shape::new(self.channels, self.ratio, self.phase_taps - 1, len, self.group)
    }

    /// A frame with transforms of length `len`.
    fn overlap_save(&self, len: usize) -> f64 {
        let shape = self.shape(len);
        let (inputs, outputs) = (shape.inputs() as f64, shape.outputs() as f64);
        let transforms = ROW_LEVEL * (inputs + outputs) * f64::from(len.ilog2());
        let products = 4.0 * outputs * self.channels as f64;
        let samples = BLOCK_OUTPUT * self.ratio as f64 + BLOCK_INPUT * self.channels as f64 + BLOCK_FRAME;
        len as f64 / shape.batch() as f64 * (transforms + products) + samples
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

    /// The algorithm that adds no latency, and its cost.
    fn fastest_without_latency(&self) -> (ChosenAlgorithm, f64) {
        let (direct, fast) = (self.direct(), self.fast());
        if self.phase_taps > 1 && fast < WORTH_CHANGE * direct {
            (ChosenAlgorithm::FastFir, fast)
        } else {
            (ChosenAlgorithm::Direct, direct)
        }
    }

    fn fastest(&self) -> ChosenAlgorithm {
        let (prompt, cost) = self.fastest_without_latency();
        let pays = |&(_, transformed): &(usize, f64)| transformed < WORTH_CHANGE * cost;
        self.best_transform().filter(pays).map_or(prompt, |(len, _)| ChosenAlgorithm::OverlapSave(len))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ANY: Algorithm = Algorithm::Auto { added_latency: true };
    const PROMPT: Algorithm = Algorithm::Auto { added_latency: false };

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
            assert_eq!(chosen(n, m, short, ANY), Ok(ChosenAlgorithm::Direct), "N {n} M {m} K {short}");
            let choice = chosen(n, m, long, ANY).unwrap();
            assert!(matches!(choice, ChosenAlgorithm::OverlapSave(_)), "N {n} M {m} K {long}: {choice:?}");
        }
        assert_eq!(
            chosen(8, 8, 16, Algorithm::OverlapSave { transform: None }),
            Ok(ChosenAlgorithm::OverlapSave(64))
        );
    }

    #[test]
    fn without_added_latency_long_filters_run_by_fast_fir() {
        // Measured: the direct algorithm wins at the first K, fast FIR at the second by a tenth at least.
        for (n, m, short, long) in
            [(1, 1, 64, 512), (2, 2, 32, 128), (4, 4, 16, 64), (8, 8, 8, 64), (16, 16, 4, 32)]
        {
            assert_eq!(chosen(n, m, short, PROMPT), Ok(ChosenAlgorithm::Direct), "N {n} M {m} K {short}");
            assert_eq!(chosen(n, m, long, PROMPT), Ok(ChosenAlgorithm::FastFir), "N {n} M {m} K {long}");
        }
    }

    #[test]
    fn a_choice_once_made_stays_for_longer_filters() {
        for (n, m) in (1..=17).flat_map(|n| (1..=17).map(move |m| (n, m))) {
            let size = |phase_taps| Size { channels: n, ratio: m, phase_taps, group: 8 };
            let transformed =
                |phase_taps: usize| matches!(size(phase_taps).fastest(), ChosenAlgorithm::OverlapSave(_));
            let fast =
                |phase_taps: usize| size(phase_taps).fastest_without_latency().0 == ChosenAlgorithm::FastFir;
            for wins in [&transformed as &dyn Fn(usize) -> bool, &fast] {
                let first = (0..14).map(|i| 1usize << i).find(|&phase_taps| wins(phase_taps)).unwrap();
                assert!((0..6).map(|i| first << i).all(wins), "N {n} M {m}: first at K = {first}");
            }
        }
    }

    #[test]
    fn one_frame_is_never_halved() {
        for (n, m) in (1..=17).flat_map(|n| (1..=17).map(move |m| (n, m))) {
            assert_eq!(chosen(n, m, 1, PROMPT), Ok(ChosenAlgorithm::Direct));
            assert_ne!(chosen(n, m, 1, ANY), Ok(ChosenAlgorithm::FastFir));
        }
        assert_eq!(chosen(1, 1, 1, Algorithm::FastFir), Err(BuildError::TooShort { phase_taps: 1 }));
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
