//! Direct FIR for two to four phases: P phases times R vectors of frames in registers.
//!
//! Steps are taken from the newest on: one input vector serves P phases, one vector of coefficients R vectors of input.
//!
//! Where a tick has eight lanes the end of a tile is done in two parts, because its sums are ready all at once and a long
//! chain of shuffles and stores behind them would stop the multiply-adds: the first lanes are added in
//! registers and go to scratch memory; from there they are brought into order after the next tile.

use super::fir::{Cut, Job, Part, tile};
use super::lanes::{Group, Lanes};

/// The work of one group of phases on all ticks of a job.
pub(super) struct Phases<'a, V: Lanes, const D: usize, const P: usize> {
    job: &'a Job<'a, V::Sample>,
    part: Part<V::Sample>,
    /// The tile in scratch: its first tick and its vectors, 0 if there is none.
    first: usize,
    waiting: usize,
    /// Of the sums that are looked at, lane by lane: not finite if one of them is not.
    total: V::Group,
}

impl<'a, V: Lanes, const D: usize, const P: usize> Phases<'a, V, D, P> {
    /// Ticks of a group.
    const TICKS: usize = V::GROUP / D;

    /// Samples from vector to vector; a constant where D = hop does not fill a group.
    #[inline(always)]
    fn stride(hop: usize) -> usize {
        V::GROUPS * if D < V::GROUP { V::GROUP } else { hop }
    }

    /// `zero`: what sums begin with.
    #[inline(always)]
    pub(super) fn new(job: &'a Job<'a, V::Sample>, zero: V::Group) -> Self {
        Self { job, part: Part::NONE, first: 0, waiting: 0, total: zero }
    }

    /// All ticks.
    ///
    /// # Safety
    /// As for [`Lanes`]; the job's memory is there.
    #[inline(always)]
    pub(super) unsafe fn run(&mut self) -> bool {
        for &Part { x, out, ticks } in self.job.parts {
            self.part = Part { x, out: out.wrapping_add(self.job.first), ticks };
            // SAFETY: the caller's.
            unsafe { self.part() };
        }
        // SAFETY: the caller's.
        unsafe { self.total.finite() }
    }

    /// In the largest tiles; what is left is halved, so that no tile is small.
    #[inline(always)]
    unsafe fn part(&mut self) {
        let mut left = self.part.ticks / (Self::TICKS * V::GROUPS);
        let mut first = 0;
        while left > 0 {
            let vectors = tile(left, V::SUMS / P);
            // SAFETY: the caller's; the tiles are all within the job.
            unsafe { self.tile_of(vectors, first) };
            first += vectors * Self::TICKS * V::GROUPS;
            left -= vectors;
        }
        // SAFETY: the caller's.
        unsafe { self.settle() };
    }

    #[inline(always)]
    unsafe fn tile_of(&mut self, vectors: usize, first: usize) {
        // SAFETY: the caller's.
        unsafe {
            match vectors {
                0 => {}
                1 => self.tile::<1>(first),
                2 => self.tile::<2>(first),
                3 => self.tile::<3>(first),
                4 => self.tile::<4>(first),
                5 => self.tile::<5>(first),
                6 => self.tile::<6>(first),
                7 => self.tile::<7>(first),
                8 => self.tile::<8>(first),
                9 => self.tile::<9>(first),
                10 => self.tile::<10>(first),
                11 => self.tile::<11>(first),
                _ => self.tile::<12>(first),
            }
        }
    }

    /// R vectors from tick `first` on.
    #[inline(always)]
    unsafe fn tile<const R: usize>(&mut self, first: usize) {
        // The compiler is spared the tiles that no call asks for.
        if const { P * R > V::SUMS } {
            return;
        }
        // SAFETY: the caller's.
        unsafe {
            let sums = self.multiply::<R>(first);
            self.settle();
            if D < 8 {
                // Where outputs follow each other the compiler is told so.
                match self.job.out_hop {
                    hop if hop == P => self.store(&sums, first, P),
                    hop => self.store(&sums, first, hop),
                }
                return self.watch(&sums[0]);
            }
            self.watch(&sums[0]);
            (self.first, self.waiting) = (first, R);
            for g in 0..V::GROUPS {
                self.reduce(&sums, g);
            }
        }
    }

    /// Remembers whether inputs are finite: they reach the sums of every phase, whatever the coefficients.
    #[inline(always)]
    unsafe fn watch<const R: usize>(&mut self, sums: &[V; R]) {
        let watched = self.job.cut.watched;
        // Long filters are asked once a tile.
        if watched & const { (1 << (R - 1)) - 1 } != 0 {
            for (r, sum) in sums.iter().enumerate() {
                if r + 1 < R && watched >> r & 1 == 1 {
                    // SAFETY: the caller's.
                    unsafe { self.note(*sum) };
                }
            }
        }
        // SAFETY: the caller's.
        unsafe { self.note(sums[R - 1]) };
    }

    #[inline(always)]
    unsafe fn note(&mut self, sum: V) {
        for g in 0..V::GROUPS {
            // SAFETY: the caller's.
            self.total = unsafe { self.total.add(sum.group(g)) };
        }
    }

    /// The sums of a tile to their places in the output, in the order of ticks.
    #[inline(always)]
    unsafe fn store<const R: usize>(&self, sums: &[[V; R]; P], first: usize, hop: usize) {
        // SAFETY: the caller's.
        unsafe {
            let out = self.part.out.add(first * hop);
            let sum = |p: usize, r: usize, g: usize| sums[p.min(P - 1)][r].group(g);
            for (r, g) in (0..R).flat_map(|r| (0..V::GROUPS).map(move |g| (r, g))) {
                let at = |r: usize| out.add((r * V::GROUPS + g) * Self::TICKS * hop);
                if P == 2 && D == 4 {
                    let next = (r + 1).min(R - 1);
                    if r % 2 == 0 {
                        let halves = [sum(0, r, g), sum(1, r, g), sum(0, next, g), sum(1, next, g)];
                        V::Group::store_halves(halves, [at(r), at(next)], hop);
                    }
                } else {
                    let sums = [sum(0, r, g), sum(1, r, g), sum(2, r, g), sum(3, r, g)];
                    V::Group::store_ticks::<P, D>(sums, at(r), hop);
                }
            }
        }
    }

    /// The multiply-adds of a tile.
    #[inline(always)]
    unsafe fn multiply<const R: usize>(&self, first: usize) -> [[V; R]; P] {
        let Cut { hop, steps, .. } = *self.job.cut;
        let stride = Self::stride(hop);
        // SAFETY: the caller's.
        unsafe {
            let mut x = self.part.x.add(first * hop);
            let mut w = self.job.coefficients;
            let mut sums = [[V::zero(); R]; P];
            if const { P == 4 && R == 3 }
                && let Some(tile) = V::full_tile::<D>(x, stride, w, steps)
            {
                for (row, full) in sums.iter_mut().zip(tile) {
                    row.copy_from_slice(&full[..R]);
                }
                return sums;
            }
            // Two steps a turn: half the loop's own work, and an end that is foreseen more often. The pointers
            // may leave the slices after the last step, where nothing is read.
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
        // SAFETY: the caller's.
        unsafe {
            // The smaller side waits in registers, the other one streams through a single one:
            // together with the sums they just fit.
            if const { P < R } {
                let held: [V; P] = std::array::from_fn(|p| V::spread::<D>(w.add(p * D)));
                for r in 0..R {
                    let input = V::windows::<D>(x.add(r * stride), hop);
                    for p in 0..P {
                        sums[p][r] = input.mul_add(held[p], sums[p][r]);
                    }
                }
            } else {
                let held: [V; R] = std::array::from_fn(|r| V::windows::<D>(x.add(r * stride), hop));
                for p in 0..P {
                    let coefficient = V::spread::<D>(w.add(p * D));
                    for r in 0..R {
                        sums[p][r] = held[r].mul_add(coefficient, sums[p][r]);
                    }
                }
            }
        }
    }

    /// Adds the quads of all sums with D = 8, group after group, to scratch.
    #[inline(always)]
    unsafe fn reduce<const R: usize>(&self, sums: &[[V; R]; P], g: usize) {
        // SAFETY: the caller's.
        unsafe {
            let sum = |p: usize, r: usize| sums[p.min(P - 1)][r].group(g);
            let place = |index: usize| self.job.scratch.add((index * V::GROUPS + g) * V::GROUP);
            for r in (0..R).step_by(if P == 2 { 2 } else { 1 }) {
                if P == 2 {
                    let next = (r + 1).min(R - 1);
                    let halves = [sum(0, r), sum(1, r), sum(0, next), sum(1, next)];
                    V::Group::diagonal_halves(halves).store(place(r / 2));
                    continue;
                }
                let quads = [sum(0, r), sum(1, r), sum(2, r), sum(3, r)];
                let sums = match P {
                    3 => V::Group::diagonal_halves(quads),
                    _ => V::Group::diagonal_quads(quads),
                };
                sums.store(place(r));
            }
        }
    }

    /// Brings the tile in scratch to its place in the output.
    #[inline(always)]
    unsafe fn settle(&mut self) {
        if self.waiting == 0 {
            return;
        }
        // What is known beforehand makes straight code; short filters notice.
        let most = V::SUMS / P;
        // SAFETY: the caller's.
        unsafe {
            match (self.waiting == most, self.job.out_hop) {
                (true, hop) if hop == P => self.settle_vectors(most, P),
                (true, hop) => self.settle_vectors(most, hop),
                (false, hop) => self.settle_vectors(self.waiting, hop),
            }
        }
        self.waiting = 0;
    }

    #[inline(always)]
    unsafe fn settle_vectors(&self, vectors: usize, hop: usize) {
        // SAFETY: the caller's.
        unsafe {
            let out = self.part.out.add(self.first * hop);
            if P > 2 {
                for index in 0..vectors * V::GROUPS {
                    Self::put_quad(self.added(index), out.add(index * hop));
                }
                return;
            }
            for (twos, g) in (0..vectors.div_ceil(2)).flat_map(|twos| (0..V::GROUPS).map(move |g| (twos, g)))
            {
                let quad = self.added(twos * V::GROUPS + g);
                let tick = out.add((2 * twos * V::GROUPS + g) * hop);
                if V::GROUPS == 1 && hop == P && 2 * twos + 1 < vectors {
                    Self::put_quad(quad, tick);
                    continue;
                }
                tick.copy_from_nonoverlapping(quad.as_ptr(), 2);
                if 2 * twos + 1 < vectors {
                    tick.add(V::GROUPS * hop).copy_from_nonoverlapping(quad[2..].as_ptr(), 2);
                }
            }
        }
    }

    /// The sum of the two quads of a group in scratch.
    #[inline(always)]
    unsafe fn added(&self, group: usize) -> [V::Sample; 4] {
        // SAFETY: the caller's.
        unsafe {
            let from = self.job.scratch.add(group * V::GROUP);
            std::array::from_fn(|i| *from.add(i) + *from.add(4 + i))
        }
    }

    /// Four phases, or two of two ticks; or three and the place behind them, which is written before it gets its own.
    #[inline(always)]
    unsafe fn put_quad(quad: [V::Sample; 4], to: *mut V::Sample) {
        // SAFETY: the caller's.
        unsafe { to.copy_from_nonoverlapping(quad.as_ptr(), 4) }
    }
}
