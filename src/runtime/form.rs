//! Which form a FIR bank runs in, and what it costs.
//!
//! The cost of a tick is counted in multiply-adds of whole vectors. Its constants were fitted by `tools/form_costs.py` to what
//! `cargo bench --bench crossover` measured (see `benches/README.md`), in f32 and f64 alike. They depend on the bank and the
//! number type only, not on the processor, its load or the length of calls: a bank gives the same bits everywhere.

use super::overlap_save::Shape;
use super::simd::{SHORTEST_TRANSFORM, group_lanes};
use super::{BuildError, Precision};

/// The form of a FIR bank.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Form {
    /// Every product is made, and no sample is later than the bank's latency.
    #[default]
    Direct,
    /// By Fourier transforms of F ticks, a power of two from 16 on that is at least K, or of the best such length:
    /// for long filters a fraction of the work, but later by
    /// [`extra_latency`](crate::runtime::Reconstructor::extra_latency).
    OverlapSave(Option<usize>),
    /// Whichever takes least time by the measured costs of both.
    Fastest,
}

/// Transforms longer than this are not tried.
const LONGEST_TRANSFORM: usize = 1 << 24;

/// Each pair of a phase and a vector of products: adding its lanes.
const DIRECT_SUM: f64 = 2.0;
/// Each output of the direct form.
const DIRECT_OUTPUT: f64 = 0.33;
/// A row in one level of radix 2 of a transform: 3 multiply-adds, 4 additions, loads and stores.
const ROW_LEVEL: f64 = 4.4;
/// Each output of overlap-save: from rows to frames.
const BLOCK_OUTPUT: f64 = 0.8;
/// Each input of overlap-save, and each tick.
const BLOCK_INPUT: f64 = 0.5;
const BLOCK_TICK: f64 = 1.0;

/// A longer transform must be cheaper by this factor: it makes outputs later.
const WORTH_LENGTH: f64 = 0.93;
/// Overlap-save must be cheaper than the direct form by this factor.
const WORTH_FORM: f64 = 0.9;

/// K: ticks that the filters `taps` reach over, at least one.
pub(crate) fn lags(taps: &[Vec<f64>], ratio: usize) -> usize {
    taps.iter().map(|f| f.len().div_ceil(ratio)).max().unwrap_or(0).max(1)
}

impl Form {
    /// F, if the bank is to run by transforms.
    ///
    /// # Errors
    /// [`BuildError::Transform`] if no transform, or not the given one, can hold the filters.
    pub(crate) fn transform_len(
        self,
        taps: &[Vec<f64>],
        ratio: usize,
        precision: Precision,
    ) -> Result<Option<usize>, BuildError> {
        let size = Size { channels: taps.len(), ratio, lags: lags(taps, ratio), group: group(precision) };
        let refused = |len| BuildError::Transform { len, lags: size.lags, shortest: SHORTEST_TRANSFORM };
        match self {
            Self::Direct => Ok(None),
            Self::OverlapSave(Some(len)) if !size.holds(len) => Err(refused(len)),
            Self::OverlapSave(Some(len)) => Ok(Some(len)),
            Self::OverlapSave(None) => match size.best_transform() {
                Some((len, _)) => Ok(Some(len)),
                None => Err(refused(LONGEST_TRANSFORM)),
            },
            Self::Fastest => {
                let worth = |&(_, cost): &(usize, f64)| cost < WORTH_FORM * size.direct();
                Ok(size.best_transform().filter(worth).map(|(len, _)| len))
            }
        }
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
    lags: usize,
    group: usize,
}

impl Size {
    fn holds(&self, len: usize) -> bool {
        len.is_power_of_two() && (self.lags.max(SHORTEST_TRANSFORM)..=LONGEST_TRANSFORM).contains(&len)
    }

    /// A tick in the direct form.
    fn direct(&self) -> f64 {
        // Windows are cut into whole groups, or whole frames.
        let frame = self.channels;
        let depth = if frame < self.group && frame.is_power_of_two() { frame } else { self.group };
        let steps = (self.lags as f64 * frame as f64 / depth as f64).ceil();
        let vectors = (self.ratio * depth) as f64 / self.group as f64;
        vectors * (steps + DIRECT_SUM) + DIRECT_OUTPUT * self.ratio as f64
    }

    fn shape(&self, len: usize) -> Shape {
        Shape::new(self.channels, self.ratio, self.lags - 1, len, self.group)
    }

    /// A tick with transforms of length `len`.
    fn overlap_save(&self, len: usize) -> f64 {
        let shape = self.shape(len);
        let (inputs, outputs) = (shape.inputs() as f64, shape.outputs() as f64);
        let transforms = ROW_LEVEL * (inputs + outputs) * f64::from(len.ilog2());
        let products = 4.0 * outputs * self.channels as f64;
        let frames = BLOCK_OUTPUT * self.ratio as f64 + BLOCK_INPUT * self.channels as f64 + BLOCK_TICK;
        len as f64 / shape.batch() as f64 * (transforms + products) + frames
    }

    /// The shortest transform that costs hardly more than the best one, and its cost.
    fn best_transform(&self) -> Option<(usize, f64)> {
        let shortest = self.lags.checked_next_power_of_two()?.max(SHORTEST_TRANSFORM);
        let lengths =
            (0..6).map(|i| shortest << i).filter(|&len| self.holds(len) && self.shape(len).spectra_fit());
        lengths
            .map(|len| (len, self.overlap_save(len)))
            .reduce(|best, next| if next.1 < WORTH_LENGTH * best.1 { next } else { best })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chosen(n: usize, m: usize, lags: usize, form: Form) -> Result<Option<usize>, BuildError> {
        form.transform_len(&vec![vec![1.0; lags * m]; n], m, Precision::Single)
    }

    #[test]
    fn long_filters_are_transformed_and_short_ones_are_not() {
        // Measured: the direct form wins at the first K, overlap-save at the second by a third at least.
        for (n, m, short, long) in
            [(1, 1, 16, 512), (2, 2, 8, 128), (4, 4, 4, 64), (8, 8, 4, 16), (16, 16, 2, 8)]
        {
            assert_eq!(chosen(n, m, short, Form::Fastest), Ok(None), "N {n} M {m} K {short}");
            assert!(chosen(n, m, long, Form::Fastest).unwrap().is_some(), "N {n} M {m} K {long}");
        }
        assert_eq!(chosen(8, 8, 16, Form::OverlapSave(None)), Ok(Some(64)));
    }

    #[test]
    fn a_choice_once_made_stays_for_longer_filters() {
        for (n, m) in (1..=17).flat_map(|n| (1..=17).map(move |m| (n, m))) {
            let size = |lags| Size { channels: n, ratio: m, lags, group: 8 };
            let wins =
                |lags: usize| size(lags).best_transform().unwrap().1 < WORTH_FORM * size(lags).direct();
            let first = (0..14).map(|i| 1usize << i).find(|&lags| wins(lags)).unwrap();
            assert!((0..6).map(|i| first << i).all(wins), "N {n} M {m}: first at K = {first}");
        }
    }

    #[test]
    fn transforms_that_cannot_hold_the_filters_are_refused() {
        let refused = |len| BuildError::Transform { len, lags: 40, shortest: 16 };
        for len in [0, 8, 32, 63, 100, 1 << 25] {
            assert_eq!(chosen(2, 2, 40, Form::OverlapSave(Some(len))), Err(refused(len)));
        }
        assert_eq!(chosen(2, 2, 40, Form::OverlapSave(Some(64))), Ok(Some(64)));
    }
}
