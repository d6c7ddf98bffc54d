//! Direct FIR for a single phase: too few products share an input, so pairs of steps share them.
//!
//! Vector r of a tile holds ticks that are c D samples after those of vector r - 1. What it reads for step s + c is
//! then what vector r - 1 reads for step s: one load serves both. Steps are taken in pairs, s + c before s, for s =
//! 0 .. c - 1, then the next 2 c steps; where a step has no partner it comes alone, after the pairs. This order is the
//! same for every tile and every instruction set.
//!
//! If a tick fills a group (D = group), c D must be a whole number of hops: then q = c D / N ticks lie between
//! those of neighbouring vectors, and q tiles are needed to cover all ticks.

use super::fir::{Job, tile};
use super::lanes::{Group, Lanes};

/// The order of steps, and how they share inputs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Pairing {
    /// c.
    apart: usize,
    /// Times 2 c steps that are all pairs.
    blocks: usize,
    /// Pairs and single steps of the rest.
    pairs: usize,
    singles: usize,
    /// q.
    tiles: usize,
}

impl Pairing {
    pub(super) fn new(depth: usize, hop: usize, group: usize, steps: usize) -> Self {
        let tiles = if depth < group { 1 } else { group >> hop.trailing_zeros().min(group.trailing_zeros()) };
        let apart = if depth < group { group / depth } else { hop * tiles / group };
        let rest = steps % (2 * apart);
        let pairs = rest.saturating_sub(apart);
        Self { apart, blocks: steps / (2 * apart), pairs, singles: rest.min(apart) - pairs, tiles }
    }

    /// All steps in the order of use.
    pub(super) fn order(self) -> Vec<usize> {
        let pairs = |first: usize, count: usize| (first..first + count).flat_map(|s| [s + self.apart, s]);
        let rest = self.blocks * 2 * self.apart;
        (0..self.blocks)
            .flat_map(|b| pairs(b * 2 * self.apart, self.apart))
            .chain(pairs(rest, self.pairs))
            .chain((0..self.singles).map(|s| rest + self.pairs + s))
            .collect()
    }
}

/// Vectors of the largest tile: with an input and two coefficients they fit 16 registers.
const WIDEST: usize = 12;

/// A single phase on all ticks of a job.
pub(super) struct Single<'a, V: Lanes, const D: usize> {
    job: &'a Job<'a, V::Sample>,
    total: V::Group,
}

impl<'a, V: Lanes<Group = V> + Group<Sample = <V as Lanes>::Sample>, const D: usize> Single<'a, V, D> {
    /// # Safety
    /// As for [`Lanes`].
    #[inline(always)]
    pub(super) unsafe fn new(job: &'a Job<'a, <V as Lanes>::Sample>) -> Self {
        // SAFETY: the caller's.
        Self { job, total: unsafe { V::zero() } }
    }

    /// All ticks.
    ///
    /// # Safety
    /// As for [`Lanes`]; the job's memory is there.
    #[inline(always)]
    pub(super) unsafe fn run(&mut self) -> bool {
        // SAFETY: the caller's.
        unsafe {
            for part in self.job.parts {
                self.part(part.x, part.out, part.ticks);
            }
            self.total.finite()
        }
    }

    /// Units of as many ticks as a group has lanes: their sums are added together.
    #[inline(always)]
    unsafe fn part(&mut self, x: *const <V as Lanes>::Sample, out: *mut <V as Lanes>::Sample, ticks: usize) {
        let Job { cut, scratch, .. } = *self.job;
        let pairing = cut.pairing;
        // Vectors of a unit in each of the tiles, and units at once: three units of 8 are two tiles of 12.
        let vectors = if D < V::GROUP { D } else { V::GROUP / pairing.tiles };
        let most = if D < V::GROUP { WIDEST / D } else { (2 * WIDEST / vectors).min(WIDEST) };
        let (mut first, mut left) = (0, ticks / V::GROUP);
        while left > 0 {
            let units = tile(left, most);
            // SAFETY: the caller's; the tiles are all within the part, and their sums within the scratch.
            unsafe {
                for q in 0..pairing.tiles {
                    let x = x.add((first + q) * cut.hop);
                    let to = if D < V::GROUP { out.add(first) } else { scratch.add(q * D) };
                    self.tiles(units * vectors, x, to);
                }
                if D == V::GROUP {
                    for unit in 0..units {
                        let sums = scratch.add(unit * V::GROUP * D);
                        let outputs = V::ticks::<D>(|t| V::load(sums.add(t * D)));
                        self.put(unit, units, outputs, out.add(first));
                    }
                }
            }
            first += units * V::GROUP;
            left -= units;
        }
    }

    /// Samples from vector to vector; a constant where D does not fill a group.
    #[inline(always)]
    fn stride(apart: usize) -> usize {
        if D < V::GROUP { V::GROUP } else { apart * D }
    }

    /// Stores the outputs of a unit, and remembers whether they are finite as in groups of phases.
    #[inline(always)]
    unsafe fn put(&mut self, unit: usize, units: usize, outputs: V, out: *mut <V as Lanes>::Sample) {
        // SAFETY: the caller's.
        unsafe {
            if unit + 1 == units || self.job.cut.watched >> unit & 1 == 1 {
                self.total = self.total.add(outputs);
            }
            outputs.store(out.add(unit * V::GROUP));
        }
    }

    /// At most two tiles of the same size.
    #[inline(always)]
    unsafe fn tiles(
        &mut self,
        vectors: usize,
        x: *const <V as Lanes>::Sample,
        to: *mut <V as Lanes>::Sample,
    ) {
        let Pairing { apart, tiles, .. } = self.job.cut.pairing;
        // SAFETY: the caller's.
        unsafe {
            if vectors <= WIDEST {
                return self.tile_of(vectors, x, to);
            }
            let half = vectors / 2;
            self.tile_of(half, x, to);
            self.tile_of(half, x.add(half * Self::stride(apart)), to.add(half * tiles * V::GROUP));
        }
    }

    #[inline(always)]
    unsafe fn tile_of(
        &mut self,
        vectors: usize,
        x: *const <V as Lanes>::Sample,
        to: *mut <V as Lanes>::Sample,
    ) {
        // SAFETY: the caller's.
        unsafe {
            match vectors {
                1 => self.tile::<1>(x, to),
                2 => self.tile::<2>(x, to),
                3 => self.tile::<3>(x, to),
                4 => self.tile::<4>(x, to),
                5 => self.tile::<5>(x, to),
                6 => self.tile::<6>(x, to),
                7 => self.tile::<7>(x, to),
                8 => self.tile::<8>(x, to),
                9 => self.tile::<9>(x, to),
                10 => self.tile::<10>(x, to),
                11 => self.tile::<11>(x, to),
                _ => self.tile::<12>(x, to),
            }
        }
    }

    /// R vectors, the newest step of whose first one is at `x`. Their outputs go to `to`, or if D fills a group their
    /// sums, as far apart as their ticks.
    #[inline(always)]
    unsafe fn tile<const R: usize>(&mut self, x: *const <V as Lanes>::Sample, to: *mut <V as Lanes>::Sample) {
        let Pairing { apart, blocks, pairs, singles, tiles } = self.job.cut.pairing;
        let (mut x, mut w) = (x, self.job.coefficients);
        // SAFETY: the caller's. The pointers may leave the slices after the last step, where nothing is read.
        unsafe {
            let mut sums = [V::zero(); R];
            for _ in 0..blocks {
                Self::pairs(x, w, apart, apart, &mut sums);
                (x, w) = (x.wrapping_sub(2 * apart * D), w.wrapping_add(2 * apart * D));
            }
            Self::pairs(x, w, pairs, apart, &mut sums);
            (x, w) = (x.wrapping_sub(pairs * D), w.wrapping_add(2 * pairs * D));
            for _ in 0..singles {
                let coefficient = V::spread::<D>(w);
                for (r, sum) in sums.iter_mut().enumerate() {
                    *sum = V::windows::<D>(x.add(r * Self::stride(apart)), 0).mul_add(coefficient, *sum);
                }
                (x, w) = (x.wrapping_sub(D), w.wrapping_add(D));
            }
            if D == V::GROUP {
                for (r, sum) in sums.into_iter().enumerate() {
                    sum.store(to.add(r * tiles * V::GROUP));
                }
                return;
            }
            for unit in 0..R / D {
                self.put(unit, R / D, V::ticks::<D>(|r| sums[unit * D + r]), to);
            }
        }
    }

    /// `count` pairs from the step at `x` on.
    #[inline(always)]
    unsafe fn pairs<const R: usize>(
        mut x: *const <V as Lanes>::Sample,
        mut w: *const <V as Lanes>::Sample,
        count: usize,
        apart: usize,
        sums: &mut [V; R],
    ) {
        let stride = Self::stride(apart);
        // SAFETY: the caller's.
        unsafe {
            for _ in 0..count {
                let (older, newer) = (V::spread::<D>(w), V::spread::<D>(w.add(D)));
                sums[0] = V::windows::<D>(x.sub(stride), 0).mul_add(older, sums[0]);
                for r in 0..R {
                    let input = V::windows::<D>(x.add(r * stride), 0);
                    if r + 1 < R {
                        sums[r + 1] = input.mul_add(older, sums[r + 1]);
                    }
                    sums[r] = input.mul_add(newer, sums[r]);
                }
                (x, w) = (x.wrapping_sub(D), w.wrapping_add(2 * D));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_step_is_taken_once_and_pairs_share_inputs() {
        for (hop, group) in (1..40usize).flat_map(|hop| [(hop, 4), (hop, 8)]) {
            let depth = if hop < group && hop.is_power_of_two() { hop } else { group };
            for steps in hop.div_ceil(depth)..70 {
                let pairing = Pairing::new(depth, hop, group, steps);
                let mut order = pairing.order();
                assert!(order[..steps - pairing.singles].chunks(2).all(|p| p[0] == p[1] + pairing.apart));
                order.sort_unstable();
                assert_eq!(order, (0..steps).collect::<Vec<_>>());
                // Vectors are whole ticks apart: those of the tiles in between, or those of a vector.
                let ticks = if depth < group { group / depth } else { pairing.tiles };
                assert_eq!(pairing.apart * depth, ticks * hop);
            }
        }
    }
}
