//! How the stream is cut into transforms.

/// The shortest transform: below it the calls of a batch take longer than its arithmetic.
const SHORTEST: usize = 128;

/// Frames of a transform for each lag of the filters, at least: of the frames of a transform a block gives
/// outputs for three quarters at least, seven eighths at most.
const FRAMES_PER_LAG: usize = 4;

/// Lane groups of all spectra, at most: more would take gigabytes.
const MOST_SPECTRA: usize = 1 << 24;

/// How the stream is cut into transforms.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct TransformShape {
    /// N.
    pub(super) channels: usize,
    /// M.
    pub(super) ratio: usize,
    /// K - 1: frames that the filters look back.
    pub(super) history: usize,
    /// F.
    pub(super) len: usize,
    /// D, lanes of a segment.
    pub(super) depth: usize,
    /// S, segments side by side.
    pub(super) segments: usize,
}

impl TransformShape {
    /// For N channels, M phases and K lags in groups of so many lanes; `None` if the spectra would take
    /// gigabytes.
    pub(crate) fn new(channels: usize, ratio: usize, lags: usize, lanes: usize) -> Option<Self> {
        let len = lags.checked_mul(FRAMES_PER_LAG)?.checked_next_power_of_two()?.max(SHORTEST);
        let depth = channels.max(ratio).checked_next_power_of_two()?.min(lanes);
        let (history, segments) = (lags - 1, lanes / depth);
        let shape = Self { channels, ratio, history, len, depth, segments };
        let spectra = channels.checked_mul(shape.outputs())?.checked_mul(len / 2 + 1)?;
        (spectra <= MOST_SPECTRA).then_some(shape)
    }

    /// B, frames of a block.
    pub(crate) fn block(&self) -> usize {
        self.len - self.history
    }

    /// Frames that are filtered at once: each segment is a complex block, whose parts are two real ones.
    pub(crate) fn batch(&self) -> usize {
        2 * self.segments * self.block()
    }

    /// Lane groups that hold the channels.
    pub(super) fn inputs(&self) -> usize {
        self.channels.div_ceil(self.depth)
    }

    /// Lane groups that hold the phases.
    pub(super) fn outputs(&self) -> usize {
        self.ratio.div_ceil(self.depth)
    }

    /// Multiply-adds for each output sample; products and sums of the transforms count as such.
    pub(crate) fn multiply_adds(&self) -> f64 {
        // A butterfly of radix 4 with its factors takes 34 operations: for four rows, of two levels.
        let transforms = (self.inputs() + self.outputs()) as f64 * 4.25 * f64::from(self.len.ilog2());
        let products = (4 * self.channels * self.outputs()) as f64;
        (self.len * self.depth * self.segments) as f64 * (transforms + products)
            / (self.batch() * self.ratio) as f64
    }
}
