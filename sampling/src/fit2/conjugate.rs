//! Conjugate gradients, all channels at a time: with diagonal preconditioner, and with multigrid from there
//! on where that does not converge soon.
//!
//! Each channel has step lengths of its own, but the matrix, most of the memory that a step reads, is read
//! once. The vectors are in single precision, whose rounding is a hundredth of a usual tolerance; scalar
//! products are summed row by row in double precision, so their bits do not depend on the threads.

use super::multigrid::Multigrid;
use super::planes::{BlocksMut, LANES, LaneBlocks, Planes, ROWS_AT_ONCE, blocks, blocks_mut};
use super::stencil::{self, Stencil, sum, total};
use super::{Convergence, Iteration};
use rayon::prelude::*;

/// Steps with the diagonal preconditioner. Fits without large holes end earlier; a multigrid step costs four
/// times as much.
const DIAGONAL_STEPS: usize = 50;

/// The sums of the rows of A are the weights of the samples around each coefficient, and 0 where there are
/// none; the start divides by this share of the diagonal there.
const LEAST_SUM: f32 = 0.05;

/// Called with the share of the way that is done, 0 to 1.
pub(super) type Watch<'a> = &'a (dyn Fn(f64) + Sync);

/// A number for each channel.
type PerChannel<const C: usize> = [f64; C];

/// Solves A u = rhs for every channel. Nothing is left of A then, which takes most of the memory.
pub(super) fn solve<const C: usize>(
    a: Stencil,
    rhs: Planes,
    iteration: &Iteration,
    watch: Watch<'_>,
) -> (Planes, Convergence) {
    let mut work = Work::<C>::new(&a, rhs);
    let first = Iteration { steps: iteration.steps.min(DIAGONAL_STEPS), ..*iteration };
    let (mut progress, mut steps) = work.solve(&a, &first, watch);
    if progress.any_open() && steps < iteration.steps {
        let mut multigrid = Multigrid::new(&a);
        steps = work.continue_with(&a, &mut multigrid, &mut progress, iteration.steps, steps, watch);
    }
    (work.u, progress.ended(steps))
}

/// The vectors of the iteration.
struct Work<const C: usize> {
    u: Planes,
    /// The right-hand sides at first.
    residual: Planes,
    direction: Planes,
    image: Planes,
    /// 1 / diagonal, 0 beside the grid.
    inverse: Planes,
}

/// How far each channel is.
struct Progress<const C: usize> {
    /// Squares of the right-hand sides in the norm of the preconditioner.
    scale: PerChannel<C>,
    /// Squares of the residuals.
    energy: PerChannel<C>,
    tolerance: f64,
}

impl<const C: usize> Progress<C> {
    /// Whether a channel is not yet at its tolerance.
    fn open(&self, c: usize) -> bool {
        self.energy[c] > self.scale[c] * self.tolerance * self.tolerance
    }

    fn any_open(&self) -> bool {
        (0..C).any(|c| self.open(c))
    }

    /// Largest square of a relative residual.
    fn relative(&self) -> f64 {
        (0..C).map(|c| self.energy[c] / self.scale[c]).fold(0.0, f64::max)
    }

    fn ended(&self, steps: usize) -> Convergence {
        let residual = self.relative().sqrt();
        Convergence { steps, residual, reached: residual <= self.tolerance }
    }

    /// Lengths of the steps, 0 for channels that are there; nothing if a channel cannot go on.
    fn lengths(&self, product: PerChannel<C>, curvature: PerChannel<C>) -> Option<PerChannel<C>> {
        let sound = |c: usize| curvature[c].is_finite() && curvature[c] > 0.0;
        let open = |c: &usize| self.open(*c);
        (0..C)
            .filter(open)
            .all(sound)
            .then(|| std::array::from_fn(|c| if self.open(c) { product[c] / curvature[c] } else { 0.0 }))
    }

    /// Share of the way to the tolerance: the residual falls by about one factor per step.
    fn done(&self) -> f64 {
        let (now, end) = (self.relative().max(f64::MIN_POSITIVE).ln(), 2.0 * self.tolerance.ln());
        if end < 0.0 { (now / end).clamp(0.0, 1.0) } else { 1.0 }
    }
}

impl<const C: usize> Work<C> {
    fn new(a: &Stencil, rhs: Planes) -> Self {
        let zeros = || Planes::zeros(a.grid(), C);
        let mut inverse = Planes::zeros(a.grid(), 1);
        inverse.par_rows_mut().enumerate().with_min_len(ROWS_AT_ONCE).for_each(|(y, inverse)| {
            let pairs = inverse.iter_mut().zip(a.diagonal_row(y));
            pairs.for_each(|(i, d)| *i = if *d > 0.0 { 1.0 / d } else { 0.0 });
        });
        Self { u: zeros(), residual: rhs, direction: zeros(), image: zeros(), inverse }
    }

    /// Conjugate gradients with diagonal preconditioner; the steps taken.
    fn solve(&mut self, a: &Stencil, end: &Iteration, watch: Watch<'_>) -> (Progress<C>, usize) {
        self.start(a);
        let mut progress = self.residuals(a, end.tolerance);
        self.turn([0.0; C]);
        let mut steps = 0;
        while steps < end.steps && progress.any_open() {
            let curvature = a.multiply(&self.direction, &mut self.image);
            let Some(lengths) = progress.lengths(progress.energy, curvature) else { break };
            let next = self.step(lengths);
            self.turn(ratio(next, progress.energy));
            progress.energy = next;
            steps += 1;
            watch(progress.done());
        }
        (progress, steps)
    }

    /// Goes on from u with the multigrid preconditioner, up to `most` steps; all steps taken.
    fn continue_with(
        &mut self,
        a: &Stencil,
        multigrid: &mut Multigrid<C>,
        progress: &mut Progress<C>,
        most: usize,
        mut steps: usize,
        watch: Watch<'_>,
    ) -> usize {
        // The direction so far counts no more; it is overwritten in its place.
        add_multiple(multigrid.apply(a, &self.residual, &mut self.image), [0.0; C], &mut self.direction);
        let mut product = dot(&self.residual, &self.direction);
        while steps < most && progress.any_open() {
            let curvature = a.multiply(&self.direction, &mut self.image);
            let Some(lengths) = progress.lengths(product, curvature) else { break };
            progress.energy = self.step(lengths);
            let preconditioned = multigrid.apply(a, &self.residual, &mut self.image);
            let next = dot(&self.residual, preconditioned);
            add_multiple(preconditioned, ratio(next, product), &mut self.direction);
            product = next;
            steps += 1;
            watch(progress.done());
        }
        steps
    }

    /// The mean of the samples around each coefficient: rhs / A 1, the solution for constant values.
    fn start(&mut self, a: &Stencil) {
        let stride = a.grid().stride();
        let rows = self.u.par_rows_mut().zip(self.residual.par_rows()).enumerate().with_min_len(ROWS_AT_ONCE);
        rows.for_each_init(
            || vec![0.0; stride],
            |sums, (y, (u, rhs))| {
                a.row_sums(y, sums);
                for (sum, d) in sums.iter_mut().zip(a.diagonal_row(y)) {
                    *sum = if *d > 0.0 { 1.0 / sum.max(LEAST_SUM * d) } else { 0.0 };
                }
                for (u, rhs) in u.chunks_mut(stride).zip(rhs.chunks(stride)) {
                    u.iter_mut().zip(rhs).zip(&*sums).for_each(|((u, r), share)| *u = r * share);
                }
            },
        );
    }

    /// residual = rhs - A u in place of rhs, and the norms of both.
    fn residuals(&mut self, a: &Stencil, tolerance: f64) -> Progress<C> {
        a.multiply::<C>(&self.u, &mut self.image);
        let stride = a.grid().stride();
        let mut sums = vec![([0.0; C], [0.0; C]); a.grid().height];
        let inputs = self.image.par_rows().zip(self.inverse.par_rows());
        let rows = self.residual.par_rows_mut().zip(inputs).zip(&mut sums).with_min_len(ROWS_AT_ONCE);
        rows.for_each(|((residual, (image, inverse)), (scale, energy))| {
            for c in 0..C {
                let row = c * stride..(c + 1) * stride;
                let (r, image) = (blocks_mut(&mut residual[row.clone()]), blocks(&image[row]));
                scale[c] = energy_of(r, blocks(inverse));
                r.iter_mut().zip(image).for_each(|(r, q)| (0..LANES).for_each(|l| r[l] -= q[l]));
                energy[c] = energy_of(r, blocks(inverse));
            }
        });
        let (scale, energy): (Vec<_>, Vec<_>) = sums.into_iter().unzip();
        let scale = total(&scale).map(|s| s.max(f64::MIN_POSITIVE));
        Progress { scale, energy: total(&energy), tolerance }
    }

    /// Steps by `lengths` along the direction; returns r . D^{-1} r of the new residual.
    fn step(&mut self, lengths: PerChannel<C>) -> PerChannel<C> {
        let stride = self.u.grid().stride();
        let mut sums = vec![[0.0; C]; self.u.grid().height];
        let outputs = self.u.par_rows_mut().zip(self.residual.par_rows_mut());
        let inputs = self.direction.par_rows().zip(self.image.par_rows()).zip(self.inverse.par_rows());
        let rows = outputs.zip(inputs).zip(&mut sums).with_min_len(ROWS_AT_ONCE);
        rows.for_each(|(((u, residual), ((direction, image), inverse)), sums)| {
            for c in 0..C {
                let row = c * stride..(c + 1) * stride;
                let (u, r) = (blocks_mut(&mut u[row.clone()]), blocks_mut(&mut residual[row.clone()]));
                let (p, q) = (blocks(&direction[row.clone()]), blocks(&image[row]));
                sums[c] = step_row(lengths[c] as f32, u, r, p, q, blocks(inverse));
            }
        });
        total(&sums)
    }

    /// direction = D^{-1} residual + factor direction.
    fn turn(&mut self, factor: [f32; C]) {
        let stride = self.u.grid().stride();
        let rows = self.direction.par_rows_mut().zip(self.residual.par_rows()).zip(self.inverse.par_rows());
        rows.with_min_len(ROWS_AT_ONCE).for_each(|((direction, residual), inverse)| {
            let channels = direction.chunks_mut(stride).zip(residual.chunks(stride)).zip(factor);
            for ((direction, residual), factor) in channels {
                let inputs = blocks(residual).iter().zip(blocks(inverse));
                for (p, (r, i)) in blocks_mut(direction).iter_mut().zip(inputs) {
                    (0..LANES).for_each(|l| p[l] = r[l] * i[l] + factor * p[l]);
                }
            }
        });
    }
}

/// u += length p and r -= length q along a row; the sum of r r / d.
#[inline]
fn step_row(
    length: f32,
    u: BlocksMut<'_>,
    r: BlocksMut<'_>,
    p: LaneBlocks<'_>,
    q: LaneBlocks<'_>,
    inverse: LaneBlocks<'_>,
) -> f64 {
    let mut sums = [0.0; LANES];
    let inputs = p.iter().zip(q).zip(inverse);
    for ((u, r), ((p, q), i)) in u.iter_mut().zip(r).zip(inputs) {
        for l in 0..LANES {
            u[l] += length * p[l];
            r[l] -= length * q[l];
            sums[l] += r[l] * r[l] * i[l];
        }
    }
    sum(sums)
}

/// The sum of r r / d along a row.
#[inline]
fn energy_of(r: LaneBlocks<'_>, inverse: LaneBlocks<'_>) -> f64 {
    let mut sums = [0.0; LANES];
    for (r, i) in r.iter().zip(inverse) {
        (0..LANES).for_each(|l| sums[l] += r[l] * r[l] * i[l]);
    }
    sum(sums)
}

/// d = z + factor d in all channels: the next direction.
fn add_multiple<const C: usize>(z: &Planes, factor: [f32; C], d: &mut Planes) {
    let stride = z.grid().stride();
    d.par_rows_mut().zip(z.par_rows()).with_min_len(ROWS_AT_ONCE).for_each(|(d, z)| {
        for ((d, z), factor) in d.chunks_mut(stride).zip(z.chunks(stride)).zip(factor) {
            for (d, z) in blocks_mut(d).iter_mut().zip(blocks(z)) {
                d.iter_mut().zip(z).for_each(|(d, z)| *d = z + factor * *d);
            }
        }
    });
}

/// u . v in every channel.
fn dot<const C: usize>(u: &Planes, v: &Planes) -> PerChannel<C> {
    let stride = u.grid().stride();
    let of_row = |(u, v): (&[f32], &[f32])| {
        std::array::from_fn(|c| {
            let row = c * stride..(c + 1) * stride;
            stencil::dot(blocks(&u[row.clone()]), blocks(&v[row]))
        })
    };
    total(&u.par_rows().zip(v.par_rows()).with_min_len(ROWS_AT_ONCE).map(of_row).collect::<Vec<_>>())
}

/// a / b in every channel, 0 where b is 0.
fn ratio<const C: usize>(a: PerChannel<C>, b: PerChannel<C>) -> [f32; C] {
    std::array::from_fn(|c| if b[c] == 0.0 { 0.0 } else { (a[c] / b[c]) as f32 })
}
