//! Direct FIR for a single phase: too few products share an input, so pairs of steps share them.
//!
//! Vector r of a tile holds frames that are c D samples after those of vector r - 1. What it reads for step
//! s + c is then what vector r - 1 reads for step s: one load serves both. Steps are taken in pairs, s + c
//! before s, for s = 0 .. c - 1, then the next 2 c steps; where a step has no partner it comes alone, after
//! the pairs. This order is the same for every tile and every instruction set.
//!
//! If a frame fills a group (D = group), c D must be a whole number of hops: then q = c D / N frames lie
//! between those of neighbouring vectors, and q tiles are needed to cover all frames.
//!
//! Unsafe functions here ask for the same as those of `phases`.

use super::super::vector::Vector;
use super::tiling::{FirJob, FrameChunk, Pairing, sized, tile_size};

/// A single phase on all frames of a job, in vectors of one group.
pub(super) struct Single<'a, V: Vector, const D: usize> {
    job: &'a FirJob<'a, V::Sample>,
    /// Of the sums of the first phase, lane by lane: not finite if one of them is not.
    total: V,
}

impl<'a, V: Vector, const D: usize> Single<'a, V, D> {
    /// # Safety
    /// As for [`Vector`].
    #[inline(always)]
    pub(super) unsafe fn new(job: &'a FirJob<'a, V::Sample>) -> Self {
        Self { job, total: V::zero() }
    }

    /// All frames.
    ///
    /// # Safety
    /// As for [`Vector`]; the job's memory is there.
    #[inline(always)]
    pub(super) unsafe fn run(&mut self) -> bool {
        for chunk in self.job.chunks {
            self.chunk(chunk);
        }
        self.total.finite()
    }

    /// Blocks of as many frames as a group has lanes: their sums are added together.
    #[inline(always)]
    unsafe fn chunk(&mut self, &FrameChunk { x, out, frames }: &FrameChunk<V::Sample>) {
        let FirJob { tiling, scratch, .. } = *self.job;
        let pairing = tiling.pairing;
        // Vectors of a block in each of the tiles, and blocks at once: of twelve sums three blocks of 8 are
        // two tiles.
        let vectors = if D < V::GROUP { D } else { V::GROUP / pairing.tiles };
        let most = if D < V::GROUP { V::SUMS / D } else { (2 * V::SUMS / vectors).min(V::SUMS) };
        let (mut first, mut left) = (0, frames / V::GROUP);
        while left > 0 {
            let blocks = tile_size(left, most);
            // The tiles are all within the chunk, and their sums within the scratch.
            for q in 0..pairing.tiles {
                let x = x.add((first + q) * tiling.hop);
                let to = if D < V::GROUP { out.add(first) } else { scratch.add(q * D) };
                self.tiles(blocks * vectors, x, to);
            }
            if const { D == V::GROUP } {
                for block in 0..blocks {
                    let sums = scratch.add(block * V::GROUP * D);
                    let outputs = V::sum_frames::<D>(|t| V::load(sums.add(t * D)));
                    self.store(block, outputs, out.add(first));
                }
            }
            first += blocks * V::GROUP;
            left -= blocks;
        }
    }

    /// Samples from vector to vector; a constant where D does not fill a group.
    #[inline(always)]
    fn stride(apart: usize) -> usize {
        if D < V::GROUP { V::GROUP } else { apart * D }
    }

    /// Stores the outputs of a block, and remembers whether they are finite.
    #[inline(always)]
    unsafe fn store(&mut self, block: usize, outputs: V, out: *mut V::Sample) {
        self.total = self.total.add(outputs);
        outputs.store(out.add(block * V::GROUP));
    }

    /// At most two tiles of the same size.
    #[inline(always)]
    unsafe fn tiles(&mut self, vectors: usize, x: *const V::Sample, to: *mut V::Sample) {
        let Pairing { apart, tiles, .. } = self.job.tiling.pairing;
        if const { D < V::GROUP } {
            return self.tile_of(vectors, x, to);
        }
        let parts = if vectors > V::SUMS { 2 } else { 1 };
        let size = vectors / parts;
        for first in (0..parts).map(|part| part * size) {
            self.tile_of(size, x.add(first * Self::stride(apart)), to.add(first * tiles * V::GROUP));
        }
    }

    #[inline(always)]
    unsafe fn tile_of(&mut self, vectors: usize, x: *const V::Sample, to: *mut V::Sample) {
        sized!(vectors, R => self.tile::<R>(x, to));
    }

    /// R vectors, the newest step of whose first one is at `x`. Their outputs go to `to`, or if D fills a
    /// group their sums, as far apart as their frames.
    #[inline(always)]
    unsafe fn tile<const R: usize>(&mut self, mut x: *const V::Sample, to: *mut V::Sample) {
        // The compiler is spared the tiles that no call asks for.
        if const { R > V::SUMS || D < V::GROUP && !R.is_multiple_of(D) } {
            return;
        }
        let Pairing { apart, blocks, pairs, singles, tiles } = self.job.tiling.pairing;
        let mut w = self.job.coefficients;
        // The pointers may leave the slices after the last step, where nothing is read.
        let mut sums = [V::zero(); R];
        for _ in 0..blocks {
            Self::pairs(x, w, apart, apart, &mut sums);
            (x, w) = (x.wrapping_sub(2 * apart * D), w.wrapping_add(2 * apart * D));
        }
        Self::pairs(x, w, pairs, apart, &mut sums);
        (x, w) = (x.wrapping_sub(pairs * D), w.wrapping_add(2 * pairs * D));
        for _ in 0..singles {
            let coefficient = V::broadcast::<D>(w);
            for (r, sum) in sums.iter_mut().enumerate() {
                *sum = V::load(x.add(r * Self::stride(apart))).mul_add(coefficient, *sum);
            }
            (x, w) = (x.wrapping_sub(D), w.wrapping_add(D));
        }
        if const { D == V::GROUP } {
            for (r, sum) in sums.into_iter().enumerate() {
                sum.store(to.add(r * tiles * V::GROUP));
            }
            return;
        }
        for block in 0..R / D {
            self.store(block, V::sum_frames::<D>(|r| sums[block * D + r]), to);
        }
    }

    /// `count` pairs from the step at `x` on.
    #[inline(always)]
    unsafe fn pairs<const R: usize>(
        mut x: *const V::Sample,
        mut w: *const V::Sample,
        count: usize,
        apart: usize,
        sums: &mut [V; R],
    ) {
        let stride = Self::stride(apart);
        for _ in 0..count {
            let (older, newer) = (V::broadcast::<D>(w), V::broadcast::<D>(w.add(D)));
            sums[0] = V::load(x.sub(stride)).mul_add(older, sums[0]);
            for r in 0..R {
                let input = V::load(x.add(r * stride));
                if r + 1 < R {
                    sums[r + 1] = input.mul_add(older, sums[r + 1]);
                }
                sums[r] = input.mul_add(newer, sums[r]);
            }
            (x, w) = (x.wrapping_sub(D), w.wrapping_add(2 * D));
        }
    }
}
