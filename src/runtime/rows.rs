//! Planar blocks between the kernels and samples as they lie in memory.
//!
//! A block may be *folded*: T successive ticks form one super-tick with N T inputs and M T outputs, so
//! that one load of input serves T times as many sums. Row r N + i then holds channel i of the
//! ticks whose place in their super-tick is r. A call may begin inside a super-tick, `lead` ticks
//! after its beginning.

use super::simd::Isa;

/// How ticks become rows.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Fold {
    /// T, at least 1.
    pub(crate) ticks: usize,
    /// Place of the block's first tick in its super-tick.
    pub(crate) lead: usize,
}

impl Fold {
    /// Super-ticks that `ticks` ticks touch.
    pub(crate) fn super_ticks(self, ticks: usize) -> usize {
        (self.lead + ticks).div_ceil(self.ticks)
    }

    /// Row block r and column of tick t.
    pub(crate) fn place(self, t: usize) -> (usize, usize) {
        if self.ticks == 1 { (0, t) } else { ((self.lead + t) % self.ticks, (self.lead + t) / self.ticks) }
    }

    /// The first tick that begins a super-tick, and how many whole super-ticks follow it.
    pub(crate) fn whole(self, ticks: usize) -> (usize, usize) {
        let head = ((self.ticks - self.lead) % self.ticks).min(ticks);
        (head, (ticks - head) / self.ticks)
    }
}

/// Rows to be filled with the samples of a block.
pub(crate) struct RowsMut<'a, T> {
    pub(crate) samples: &'a mut [T],
    /// Samples from row to row.
    pub(crate) stride: usize,
    /// N.
    pub(crate) channels: usize,
    pub(crate) fold: Fold,
    pub(crate) isa: Isa,
}

impl<T> RowsMut<'_, T> {
    /// Where channel i of tick t goes.
    #[inline(always)]
    pub(crate) fn slot(&mut self, i: usize, t: usize) -> &mut T {
        let (r, column) = self.fold.place(t);
        &mut self.samples[(r * self.channels + i) * self.stride + column]
    }
}

/// Rows that hold the output of a block.
pub(crate) struct Rows<'a, T> {
    pub(crate) samples: &'a [T],
    /// Samples from row to row.
    pub(crate) stride: usize,
    /// M.
    pub(crate) phases: usize,
    pub(crate) fold: Fold,
    pub(crate) isa: Isa,
}

impl<T: Copy> Rows<'_, T> {
    /// Phase p of tick t.
    #[inline(always)]
    pub(crate) fn get(&self, p: usize, t: usize) -> T {
        let (r, column) = self.fold.place(t);
        self.samples[(r * self.phases + p) * self.stride + column]
    }
}
