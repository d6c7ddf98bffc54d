//! Which form a FIR bank runs in, and what it costs.
//!
//! The cost of a tick is counted in multiply-adds of whole vectors. Its constants were fitted by `tools/form_costs.py` to what
//! `cargo bench --bench algorithm_crossover` measured (see `benches/README.md`), in f32 and f64 alike. They depend on the bank and the
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
    /// Ticks by twos, through three filters of half the length in place of four (Karatsuba), for filters that reach over
    /// K >= 2 ticks: up to a quarter less work for long ones, and no sample is later. The error is relative to the norms
    /// of each channel's filter and of the inputs in its memory and not to each product: a few eps, for white noise up to
    /// 1.4 times that of the direct form.
    Fast,
    /// By Fourier transforms of F ticks, a power of two from 16 on that is at least K, or of the best such length:
    /// for long filters a fraction of the work, but later by
    /// [`extra_latency`](crate::Plan::extra_latency).
    OverlapSave(Option<usize>),
    /// Whichever takes least time by the measured costs of all.
    Fastest,
    /// Whichever of the forms that are not late takes least time.
    FastestPrompt,
}

/// The form that a bank is to run in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Choice {
    Direct,
    Fast,
    /// By transforms of F ticks.
    OverlapSave(usize),
}

/// Transforms longer than this are not tried.
const LONGEST_TRANSFORM: usize = 1 << 24;

/// Each pair of a phase and a vector of products: adding its lanes.
const DIRECT_SUM: f64 = 1.2;
/// Each output of the direct form.
const DIRECT_OUTPUT: f64 = 0.3;
/// A row in one level of radix 2 of a transform: 3 multiply-adds, 4 additions, loads and stores.
const ROW_LEVEL: f64 = 4.2;
/// Each output of overlap-save: from rows to frames.
const BLOCK_OUTPUT: f64 = 0.8;
/// Each vector of outputs of the fast form: from products to frames; each vector of inputs: to halves and means.
const PAIR_OUTPUTS: f64 = 12.0;
const PAIR_INPUTS: f64 = 10.0;
/// Each input of overlap-save, and each tick.
const BLOCK_INPUT: f64 = 0.5;
const BLOCK_TICK: f64 = 1.0;

/// A longer transform must be cheaper by this factor: it makes outputs later.
const WORTH_LENGTH: f64 = 0.93;
/// A form must be cheaper by this factor than one that rounds less or is not late.
const WORTH_FORM: f64 = 0.9;

/// K: ticks that the filters `taps` reach over, at least one.
pub(crate) fn lags(taps: &[Vec<f64>], ratio: usize) -> usize {
    taps.iter().map(|f| f.len().div_ceil(ratio)).max().unwrap_or(0).max(1)
}

impl Form {
    /// The form that filters are to run in.
    ///
    /// # Errors
    /// [`BuildError::Transform`] if no transform, or not the given one, can hold the filters; [`BuildError::TooShort`]
    /// if they are to be halved and cannot.
    pub(crate) fn choose(
        self,
        taps: &[Vec<f64>],
        ratio: usize,
        precision: Precision,
    ) -> Result<Choice, BuildError> {
        let size = Size { channels: taps.len(), ratio, lags: lags(taps, ratio), group: group(precision) };
        let refused = |len| BuildError::Transform { len, lags: size.lags, shortest: SHORTEST_TRANSFORM };
        match self {
            Self::Direct => Ok(Choice::Direct),
            Self::Fast if size.lags < 2 => Err(BuildError::TooShort { lags: size.lags }),
            Self::Fast => Ok(Choice::Fast),
            Self::OverlapSave(Some(len)) if !size.holds(len) => Err(refused(len)),
            Self::OverlapSave(Some(len)) => Ok(Choice::OverlapSave(len)),
            Self::OverlapSave(None) => match size.best_transform() {
                Some((len, _)) => Ok(Choice::OverlapSave(len)),
                None => Err(refused(LONGEST_TRANSFORM)),
            },
            Self::Fastest => Ok(size.fastest()),
            Self::FastestPrompt => Ok(size.fastest_prompt().0),
        }
    }

    /// # Errors
    /// [`BuildError::Recursive`] if only FIR filters have this form.
    pub(crate) fn check_recursive(self) -> Result<(), BuildError> {
        match self {
            Self::Direct | Self::Fastest | Self::FastestPrompt => Ok(()),
            Self::Fast => Err(BuildError::Recursive { form: "the fast form" }),
            Self::OverlapSave(_) => Err(BuildError::Recursive { form: "overlap-save" }),
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
        self.direct_with(self.lags)
    }

    /// A tick in the direct form with so many lags.
    fn direct_with(&self, lags: usize) -> f64 {
        // Windows are cut into whole groups, or whole frames.
        let frame = self.channels;
        let depth = if frame < self.group && frame.is_power_of_two() { frame } else { self.group };
        let steps = (lags as f64 * frame as f64 / depth as f64).ceil();
        let vectors = (self.ratio * depth) as f64 / self.group as f64;
        vectors * (steps + DIRECT_SUM) + DIRECT_OUTPUT * self.ratio as f64
    }

    /// A tick in the fast form: half a tick of each of three filters.
    fn fast(&self) -> f64 {
        let (odd, even) = (self.lags / 2, self.lags.div_ceil(2));
        let filters = 2.0 * self.direct_with(even) + self.direct_with(odd);
        let pairs = PAIR_OUTPUTS * self.ratio as f64 + PAIR_INPUTS * self.channels as f64;
        filters / 2.0 + pairs / self.group as f64
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

    /// The form that is not late, and its cost.
    fn fastest_prompt(&self) -> (Choice, f64) {
        let (direct, fast) = (self.direct(), self.fast());
        if self.lags > 1 && fast < WORTH_FORM * direct {
            (Choice::Fast, fast)
        } else {
            (Choice::Direct, direct)
        }
    }

    fn fastest(&self) -> Choice {
        let (prompt, cost) = self.fastest_prompt();
        let worth = |&(_, late): &(usize, f64)| late < WORTH_FORM * cost;
        self.best_transform().filter(worth).map_or(prompt, |(len, _)| Choice::OverlapSave(len))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chosen(n: usize, m: usize, lags: usize, form: Form) -> Result<Choice, BuildError> {
        form.choose(&vec![vec![1.0; lags * m]; n], m, Precision::Single)
    }

    #[test]
    fn long_filters_are_transformed_and_short_ones_are_not() {
        // Measured: the direct form wins at the first K, overlap-save at the second by a third at least.
        for (n, m, short, long) in
            [(1, 1, 16, 512), (2, 2, 8, 128), (4, 4, 4, 64), (8, 8, 4, 16), (16, 16, 2, 8)]
        {
            assert_eq!(chosen(n, m, short, Form::Fastest), Ok(Choice::Direct), "N {n} M {m} K {short}");
            let choice = chosen(n, m, long, Form::Fastest).unwrap();
            assert!(matches!(choice, Choice::OverlapSave(_)), "N {n} M {m} K {long}: {choice:?}");
        }
        assert_eq!(chosen(8, 8, 16, Form::OverlapSave(None)), Ok(Choice::OverlapSave(64)));
    }

    #[test]
    fn what_must_not_be_late_is_fast_if_it_is_long() {
        // Measured: the direct form wins at the first K, the fast form at the second by a tenth at least.
        for (n, m, short, long) in
            [(1, 1, 64, 512), (2, 2, 32, 128), (4, 4, 16, 64), (8, 8, 8, 64), (16, 16, 4, 32)]
        {
            assert_eq!(chosen(n, m, short, Form::FastestPrompt), Ok(Choice::Direct), "N {n} M {m} K {short}");
            assert_eq!(chosen(n, m, long, Form::FastestPrompt), Ok(Choice::Fast), "N {n} M {m} K {long}");
        }
    }

    #[test]
    fn a_choice_once_made_stays_for_longer_filters() {
        for (n, m) in (1..=17).flat_map(|n| (1..=17).map(move |m| (n, m))) {
            let size = |lags| Size { channels: n, ratio: m, lags, group: 8 };
            let transformed = |lags: usize| matches!(size(lags).fastest(), Choice::OverlapSave(_));
            let fast = |lags: usize| size(lags).fastest_prompt().0 == Choice::Fast;
            for wins in [&transformed as &dyn Fn(usize) -> bool, &fast] {
                let first = (0..14).map(|i| 1usize << i).find(|&lags| wins(lags)).unwrap();
                assert!((0..6).map(|i| first << i).all(wins), "N {n} M {m}: first at K = {first}");
            }
        }
    }

    #[test]
    fn one_tick_is_never_halved() {
        for (n, m) in (1..=17).flat_map(|n| (1..=17).map(move |m| (n, m))) {
            assert_eq!(chosen(n, m, 1, Form::FastestPrompt), Ok(Choice::Direct));
            assert_ne!(chosen(n, m, 1, Form::Fastest), Ok(Choice::Fast));
        }
        assert_eq!(chosen(1, 1, 1, Form::Fast), Err(BuildError::TooShort { lags: 1 }));
    }

    #[test]
    fn transforms_that_cannot_hold_the_filters_are_refused() {
        let refused = |len| BuildError::Transform { len, lags: 40, shortest: 16 };
        for len in [0, 8, 32, 63, 100, 1 << 25] {
            assert_eq!(chosen(2, 2, 40, Form::OverlapSave(Some(len))), Err(refused(len)));
        }
        assert_eq!(chosen(2, 2, 40, Form::OverlapSave(Some(64))), Ok(Choice::OverlapSave(64)));
    }
}
