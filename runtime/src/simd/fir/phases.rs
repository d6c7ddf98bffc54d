//! Direct FIR for two to four phases: P phases times R vectors of frames in registers.
//!
//! Steps are taken from the newest on: one input vector serves P phases, one vector of coefficients R
//! vectors of input.
//!
//! Where a frame has eight lanes the end of a tile is done in two parts, because its sums are ready all at
//! once and a long chain of shuffles and stores after them would stop the multiply-adds: the first lanes are
//! added in registers and go to scratch memory; from there they are brought into order after the next tile.
//!
//! Unsafe functions here run in code compiled for the instruction set of V. They read windows of the chunks'
//! frames and coefficients of the job, and write outputs of these frames and to the scratch: memory whose
//! bounds `Polyphase::run` asserts for whole vectors of frames.

use super::super::vector::Vector;
use super::tiling::{FirJob, FrameChunk, sized, tile_size};

/// The work of one group of phases on all frames of a job.
pub(super) struct Phases<'a, V: Vector, const D: usize, const P: usize> {
    job: &'a FirJob<'a, V::Sample>,
    chunk: FrameChunk<V::Sample>,
    /// The tile in scratch: its first frame and its vectors, 0 if there is none.
    first: usize,
    waiting: usize,
    /// Of the sums of the first phase, lane by lane: not finite if one of them is not.
    total: V,
}

impl<'a, V: Vector, const D: usize, const P: usize> Phases<'a, V, D, P> {
    /// Frames of a vector.
    const FRAMES: usize = V::LANES / D;
    /// Vectors of the largest tile: as many as registers hold, and at most 6, as compilers spill more. Where
    /// each frame has one lane the end of a tile needs registers too. Twelve sums of steps that do not fill
    /// a group leave no register free for a coefficient: compilers spill some, and eight are a third faster.
    const MOST: usize = {
        let most = match (P, V::SUMS) {
            (4, 12) if D < V::GROUP => 2,
            (4, _) if D == 1 => 4,
            _ => 6,
        };
        if V::SUMS / P < most { V::SUMS / P } else { most }
    };
    /// Whether tiles end in two parts.
    const IN_PARTS: bool = D == 8;

    /// Samples from vector to vector; a constant where D = hop does not fill a group.
    #[inline(always)]
    fn stride(hop: usize) -> usize {
        V::GROUPS * if D < V::GROUP { V::GROUP } else { hop }
    }

    /// # Safety
    /// As for [`Vector`].
    #[inline(always)]
    pub(super) unsafe fn new(job: &'a FirJob<'a, V::Sample>) -> Self {
        Self { job, chunk: FrameChunk::NONE, first: 0, waiting: 0, total: V::zero() }
    }

    /// All frames.
    ///
    /// # Safety
    /// As for [`Vector`]; the job's memory is there.
    #[inline(always)]
    pub(super) unsafe fn run(&mut self) -> bool {
        for &FrameChunk { x, out, frames } in self.job.chunks {
            self.chunk = FrameChunk { x, out: out.wrapping_add(self.job.first), frames };
            self.run_chunk();
        }
        self.total.finite()
    }

    /// In the largest tiles; what is left is halved, so that no tile is small.
    #[inline(always)]
    unsafe fn run_chunk(&mut self) {
        let mut left = self.chunk.frames / Self::FRAMES;
        let mut first = 0;
        while left > 0 {
            let vectors = tile_size(left, Self::MOST);
            // The tiles are all within the job.
            sized!(vectors, R => self.tile::<R>(first));
            first += vectors * Self::FRAMES;
            left -= vectors;
        }
        if const { Self::IN_PARTS } {
            self.flush();
        }
    }

    /// R vectors from frame `first` on.
    #[inline(always)]
    unsafe fn tile<const R: usize>(&mut self, first: usize) {
        // The compiler is spared the tiles that no call asks for.
        if const { R > Self::MOST } {
            return;
        }
        // Where frames of a whole group follow each other the compiler can see it.
        let hop = self.job.tiling.hop;
        let sums = if const { V::GROUPS > 1 && D == V::GROUP } && hop == D {
            self.multiply::<R>(first, D)
        } else {
            self.multiply::<R>(first, hop)
        };
        if const { !Self::IN_PARTS } {
            // Where outputs follow each other too.
            match self.job.out_hop {
                hop if hop == P => self.store(&sums, first, P),
                hop => self.store(&sums, first, hop),
            }
            self.check(&sums[0]);
        } else {
            self.flush();
            self.check(&sums[0]);
            (self.first, self.waiting) = (first, R);
            self.reduce(&sums);
        }
    }

    /// Remembers whether inputs are finite: they reach the sums of every phase, whatever the coefficients.
    #[inline(always)]
    fn check<const R: usize>(&mut self, sums: &[V; R]) {
        sums.iter().for_each(|sum| self.total = self.total.add(*sum));
    }

    /// The sums of a tile to their places in the output, in the order of frames.
    #[inline(always)]
    unsafe fn store<const R: usize>(&self, sums: &[[V; R]; P], first: usize, hop: usize) {
        let out = self.chunk.out.add(first * hop);
        let sum = |p: usize, r: usize| sums[p.min(P - 1)][r];
        let at = |r: usize| out.add(r * Self::FRAMES * hop);
        for r in 0..R {
            if const { P == 2 && D == 4 } {
                let next = (r + 1).min(R - 1);
                if r % 2 == 0 {
                    let halves = [sum(0, r), sum(1, r), sum(0, next), sum(1, next)];
                    V::store_halves(halves, [at(r), at(next)], hop);
                }
            } else {
                let sums = [sum(0, r), sum(1, r), sum(2, r), sum(3, r)];
                V::store_frames::<P, D>(sums, at(r), hop);
            }
        }
    }

    /// The multiply-adds of a tile.
    #[inline(always)]
    unsafe fn multiply<const R: usize>(&self, first: usize, hop: usize) -> [[V; R]; P] {
        let steps = self.job.tiling.steps;
        let mut x = self.chunk.x.add(first * hop);
        let mut w = self.job.coefficients;
        let mut sums = [[V::zero(); R]; P];
        // Two steps an iteration: half the loop's own work, and an end that is foreseen more often. The
        // pointers may leave the slices after the last step, where nothing is read.
        if steps % 2 == 1 {
            Self::step(x, w, hop, &mut sums);
            (x, w) = (x.wrapping_sub(D), w.wrapping_add(P * D));
        }
        for _ in 0..steps / 2 {
            Self::step(x, w, hop, &mut sums);
            Self::step(x.wrapping_sub(D), w.wrapping_add(P * D), hop, &mut sums);
            (x, w) = (x.wrapping_sub(2 * D), w.wrapping_add(2 * P * D));
        }
        sums
    }

    /// One step: an input for each of R vectors, a vector of coefficients for each of P phases.
    // Indices, because a step is a product of two index ranges.
    #[allow(clippy::needless_range_loop)]
    #[inline(always)]
    unsafe fn step<const R: usize>(
        x: *const V::Sample,
        w: *const V::Sample,
        hop: usize,
        sums: &mut [[V; R]; P],
    ) {
        let stride = Self::stride(hop);
        // The smaller side waits in registers, the other one streams through a single one:
        // together with the sums they just fit.
        if const { P < R } {
            let mut held = [V::zero(); P];
            for p in 0..P {
                held[p] = V::broadcast::<D>(w.add(p * D));
            }
            for r in 0..R {
                let input = V::frames::<D>(x.add(r * stride), hop);
                for p in 0..P {
                    sums[p][r] = input.mul_add(held[p], sums[p][r]);
                }
            }
        } else {
            let mut held = [V::zero(); R];
            for r in 0..R {
                held[r] = V::frames::<D>(x.add(r * stride), hop);
            }
            for p in 0..P {
                let coefficient = V::broadcast::<D>(w.add(p * D));
                for r in 0..R {
                    sums[p][r] = held[r].mul_add(coefficient, sums[p][r]);
                }
            }
        }
    }

    /// Adds lanes of all sums with D = 8, four to a half of a group, to scratch.
    #[inline(always)]
    unsafe fn reduce<const R: usize>(&self, sums: &[[V; R]; P]) {
        let sum = |p: usize, r: usize| sums[p.min(P - 1)][r];
        for r in (0..R).step_by(if P == 2 { 2 } else { 1 }) {
            let next = (r + 1).min(R - 1);
            let (reduced, index) = match P {
                2 => (V::diagonal_halves([sum(0, r), sum(1, r), sum(0, next), sum(1, next)]), r / 2),
                3 => (V::diagonal_halves([sum(0, r), sum(1, r), sum(2, r), sum(2, r)]), r),
                _ => (V::diagonal_quads([sum(0, r), sum(1, r), sum(2, r), sum(3, r)]), r),
            };
            reduced.store(self.job.scratch.add(index * V::LANES));
        }
    }

    /// Brings the tile in scratch to its place in the output.
    #[inline(always)]
    unsafe fn flush(&mut self) {
        if self.waiting == 0 {
            return;
        }
        // What is known beforehand makes straight code; short filters notice.
        match (self.waiting == Self::MOST, self.job.out_hop) {
            (true, hop) if hop == P => self.flush_vectors(Self::MOST, P),
            (true, hop) => self.flush_vectors(Self::MOST, hop),
            (false, hop) => self.flush_vectors(self.waiting, hop),
        }
        self.waiting = 0;
    }

    #[inline(always)]
    unsafe fn flush_vectors(&self, vectors: usize, hop: usize) {
        let out = self.chunk.out.add(self.first * hop);
        if const { P > 2 } {
            return V::add_halves(self.job.scratch, vectors, out, hop);
        }
        for (twos, g) in (0..vectors.div_ceil(2)).flat_map(|twos| (0..V::GROUPS).map(move |g| (twos, g))) {
            // Two phases of a frame of one vector, and of one of the next.
            let from = self.job.scratch.add((twos * V::GROUPS + g) * V::GROUP);
            let outputs: [_; 4] = std::array::from_fn(|i| *from.add(i) + *from.add(4 + i));
            let frame = out.add((2 * twos * V::GROUPS + g) * hop);
            if V::GROUPS == 1 && hop == P && 2 * twos + 1 < vectors {
                frame.copy_from_nonoverlapping(outputs.as_ptr(), 4);
                continue;
            }
            frame.copy_from_nonoverlapping(outputs.as_ptr(), 2);
            if 2 * twos + 1 < vectors {
                frame.add(V::GROUPS * hop).copy_from_nonoverlapping(outputs[2..].as_ptr(), 2);
            }
        }
    }
}
