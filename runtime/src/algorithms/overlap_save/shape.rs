//! How the stream is cut into transforms, and what they cost.

/// Samples of all spectra: more would take gigabytes.
const MOST_SPECTRA: f64 = (1u64 << 28) as f64;

/// How the stream is cut into transforms.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Shape {
    pub(crate) channels: usize,
    pub(crate) ratio: usize,
    /// K - 1: frames that the filters look back.
    pub(crate) history: usize,
    /// F.
    pub(crate) len: usize,
    /// D, lanes of a segment in a group.
    pub(super) depth: usize,
    /// S, segments in a group.
    pub(super) segments: usize,
}

impl Shape {
    /// For vectors of `group` lanes; F > K - 1.
    pub(crate) fn new(channels: usize, ratio: usize, history: usize, len: usize, group: usize) -> Self {
        let depth = channels.max(ratio).next_power_of_two().min(group);
        Self { channels, ratio, history, len, depth, segments: group / depth }
    }

    /// B, frames of a block.
    pub(crate) fn block(&self) -> usize {
        self.len - self.history
    }

    /// Frames that are made at once.
    pub(crate) fn batch(&self) -> usize {
        2 * self.segments * self.block()
    }

    /// Frames by which outputs are late.
    pub(crate) fn delay(&self) -> usize {
        self.batch() - 1
    }

    /// Groups of lanes that hold the channels.
    pub(crate) fn inputs(&self) -> usize {
        self.channels.div_ceil(self.depth)
    }

    /// Groups of lanes that hold the phases.
    pub(crate) fn outputs(&self) -> usize {
        self.ratio.div_ceil(self.depth)
    }

    /// Operations on single lanes for each fast sample.
    pub(crate) fn multiply_adds(&self) -> f64 {
        // A level of radix 2 takes 3 multiply-adds and 2 additions for each complex lane of half of the
        // rows, as one half of a pass of radix 4: 17 operations per row in two levels, 8.5 in one.
        let transforms = (self.inputs() + self.outputs()) as f64 * 3.5 * f64::from(self.len.ilog2());
        let products = (4 * self.channels * self.outputs()) as f64;
        let lanes = (self.len * self.depth * self.segments) as f64 * (transforms + products);
        lanes / (self.batch() * self.ratio) as f64
    }

    /// False if the spectra would take gigabytes.
    pub(crate) fn spectra_fit(&self) -> bool {
        let rows = (self.len / 2 + 1) as f64 * (self.outputs() * self.channels) as f64;
        rows * (2 * self.depth * self.segments) as f64 <= MOST_SPECTRA
    }
}
