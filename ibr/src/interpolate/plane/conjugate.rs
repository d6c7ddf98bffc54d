//! Conjugate gradients, all channels at a time: with diagonal preconditioner, and with multigrid from there
//! on where that does not converge soon.
//!
//! Each channel has step lengths of its own, but the matrix, most of the memory that a step reads, is read
//! once. The vectors are in single precision, whose rounding is a hundredth of the tolerance; scalar
//! products are in double precision.

use super::multigrid::Multigrid;
use super::stencil::{Stencil, add_product, total};
use super::{Convergence, PlaneSettings};
use crate::interpolate::Watch;
use rayon::prelude::*;

/// Pixels per chunk. Partial sums of a dot product follow the chunks, not the threads, so the bits do not
/// depend on them.
const CHUNK: usize = 4096;

/// Steps with the diagonal preconditioner. Fits without large holes end earlier; a multigrid step costs four
/// times as much.
const DIAGONAL_STEPS: usize = 50;

/// Solves A u = rhs for every channel; returns the values interleaved, in the memory of the right-hand
/// sides.
pub(super) fn solve<const C: usize>(
    stencil: &Stencil,
    rhs: Vec<[f32; C]>,
    settings: &PlaneSettings,
    watch: Watch<'_>,
) -> (Vec<f32>, Convergence) {
    match C {
        1 => solve_in::<C, 1>(stencil, rhs, settings, watch),
        // Four channels fill a vector register; the last one is 0.
        _ => solve_in::<C, 4>(stencil, rhs, settings, watch),
    }
}

fn solve_in<const C: usize, const L: usize>(
    stencil: &Stencil,
    mut rhs: Vec<[f32; C]>,
    settings: &PlaneSettings,
    watch: Watch<'_>,
) -> (Vec<f32>, Convergence) {
    let mut work = Work::<L>::new(stencil);
    let right = |p: usize| std::array::from_fn(|c| rhs[p].get(c).copied().unwrap_or(0.0));
    let first = PlaneSettings { iterations: settings.iterations.min(DIAGONAL_STEPS), ..*settings };
    let mut ended = work.solve(stencil, &right, &first, watch);
    if !ended.reached {
        let mut multigrid = Multigrid::new(stencil);
        ended = work.continue_with(stencil, &mut multigrid, &right, settings, ended.steps, watch);
    }
    rhs.par_iter_mut().zip(&work.u).for_each(|(r, u)| r.copy_from_slice(&u[..C]));
    (rhs.into_flattened(), ended)
}

/// The vectors of the iteration.
struct Work<const L: usize> {
    u: Vec<[f32; L]>,
    residual: Vec<[f32; L]>,
    direction: Vec<[f32; L]>,
    image: Vec<[f32; L]>,
    /// 1 / diagonal.
    inverse: Vec<f32>,
    /// Partial sums of dot products: one per image row or per chunk.
    partial: Vec<[f64; L]>,
}

/// A number for each channel.
type PerChannel<const L: usize> = [f64; L];

/// How far each channel is.
struct Progress<const L: usize> {
    /// Squares of the right-hand sides in the norm of the preconditioner.
    scale: PerChannel<L>,
    /// Squares of the residuals.
    energy: PerChannel<L>,
    tolerance: f64,
}

impl<const L: usize> Progress<L> {
    /// Whether a channel is not yet at its tolerance.
    fn open(&self, c: usize) -> bool {
        self.energy[c] > self.scale[c] * self.tolerance * self.tolerance
    }

    fn any_open(&self) -> bool {
        (0..L).any(|c| self.open(c))
    }

    /// Largest square of a relative residual.
    fn relative(&self) -> f64 {
        (0..L).map(|c| self.energy[c] / self.scale[c]).fold(0.0, f64::max)
    }

    fn ended(&self, steps: usize) -> Convergence {
        let residual = self.relative().sqrt();
        Convergence { steps, residual, reached: residual <= self.tolerance }
    }

    /// Lengths of the steps, 0 for channels that are there; nothing if a channel cannot go on.
    fn lengths(&self, product: PerChannel<L>, curvature: PerChannel<L>) -> Option<PerChannel<L>> {
        let sound = |c: usize| curvature[c].is_finite() && curvature[c] > 0.0;
        let open = |c: &usize| self.open(*c);
        (0..L)
            .filter(open)
            .all(sound)
            .then(|| std::array::from_fn(|c| if self.open(c) { product[c] / curvature[c] } else { 0.0 }))
    }
}

impl<const L: usize> Work<L> {
    fn new(a: &Stencil) -> Self {
        let zeros = || vec![[0.0; L]; a.pixels()];
        let inverse =
            (0..a.pixels()).into_par_iter().with_min_len(CHUNK).map(|p| 1.0 / a.diagonal(p)).collect();
        let partial = vec![[0.0; L]; a.rows().max(a.pixels().div_ceil(CHUNK))];
        Self { u: zeros(), residual: zeros(), direction: zeros(), image: zeros(), inverse, partial }
    }

    /// Starts from the mean of the samples around each pixel: rhs / A 1, the solution for constant values.
    fn solve(
        &mut self,
        a: &Stencil,
        rhs: &(impl Fn(usize) -> [f32; L] + Sync),
        settings: &PlaneSettings,
        watch: Watch<'_>,
    ) -> Convergence {
        self.u.fill([1.0; L]);
        self.multiply_start(a);
        self.u.par_iter_mut().zip(&self.image).enumerate().with_min_len(CHUNK).for_each(|(p, (u, sum))| {
            let share = 1.0 / sum[0].max(LEAST_SUM * a.diagonal(p));
            *u = rhs(p).map(|r| r * share);
        });
        let mut progress = self.residuals(a, rhs, settings);
        self.turn([0.0; L]);
        let mut steps = 0;
        while steps < settings.iterations && progress.any_open() {
            let curvature = a.multiply(&self.direction, &mut self.image, &mut self.partial[..a.rows()]);
            let Some(lengths) = progress.lengths(progress.energy, curvature) else { break };
            let next = self.step(lengths);
            self.turn(ratio(next, progress.energy));
            progress.energy = next;
            steps += 1;
            watch(done(progress.relative(), settings));
        }
        progress.ended(steps)
    }

    /// Goes on from u with the multigrid preconditioner.
    fn continue_with(
        &mut self,
        a: &Stencil,
        multigrid: &mut Multigrid<L>,
        rhs: &(impl Fn(usize) -> [f32; L] + Sync),
        settings: &PlaneSettings,
        mut steps: usize,
        watch: Watch<'_>,
    ) -> Convergence {
        let mut progress = self.residuals(a, rhs, settings);
        multigrid.apply(a, &self.residual, &mut self.direction);
        let mut preconditioned = vec![[0.0; L]; a.pixels()];
        let mut product = dot(&self.residual, &self.direction);
        while steps < settings.iterations && progress.any_open() {
            let curvature = a.multiply(&self.direction, &mut self.image, &mut self.partial[..a.rows()]);
            let Some(lengths) = progress.lengths(product, curvature) else { break };
            progress.energy = self.step(lengths);
            multigrid.apply(a, &self.residual, &mut preconditioned);
            let next = dot(&self.residual, &preconditioned);
            let factor = ratio(next, product).map(|f| f as f32);
            self.direction.par_iter_mut().zip(&preconditioned).with_min_len(CHUNK).for_each(|(d, z)| {
                (0..L).for_each(|c| d[c] = z[c] + factor[c] * d[c]);
            });
            product = next;
            steps += 1;
            watch(done(progress.relative(), settings));
        }
        progress.ended(steps)
    }

    /// residual = rhs - A u, and the norms.
    fn residuals(
        &mut self,
        a: &Stencil,
        rhs: &(impl Fn(usize) -> [f32; L] + Sync),
        settings: &PlaneSettings,
    ) -> Progress<L> {
        self.multiply_start(a);
        let inputs = self.image.par_chunks(CHUNK).zip(self.inverse.par_chunks(CHUNK));
        let blocks = self.residual.par_chunks_mut(CHUNK).zip(inputs);
        let sums: Vec<[[f64; L]; 2]> = blocks
            .enumerate()
            .map(|(k, (r, (image, inverse)))| {
                let mut sums = [[0.0; L]; 2];
                for (i, r) in r.iter_mut().enumerate() {
                    let right = rhs(k * CHUNK + i);
                    for c in 0..L {
                        r[c] = right[c] - image[i][c];
                        sums[0][c] += f64::from(right[c] * right[c] * inverse[i]);
                        sums[1][c] += f64::from(r[c] * r[c] * inverse[i]);
                    }
                }
                sums
            })
            .collect();
        let of = |k: usize| total(&sums.iter().map(|s| s[k]).collect::<Vec<_>>());
        let scale = of(0).map(|s| s.max(f64::MIN_POSITIVE));
        Progress { scale, energy: of(1), tolerance: settings.tolerance }
    }

    /// image = A u.
    fn multiply_start(&mut self, a: &Stencil) {
        a.multiply(&self.u, &mut self.image, &mut self.partial[..a.rows()]);
    }

    /// Steps by `lengths` along the direction; returns r . D^{-1} r of the new residual.
    fn step(&mut self, lengths: PerChannel<L>) -> PerChannel<L> {
        let lengths = lengths.map(|length| length as f32);
        let chunks = self.u.len().div_ceil(CHUNK);
        let blocks = self.u.par_chunks_mut(CHUNK).zip(self.residual.par_chunks_mut(CHUNK));
        let inputs = self.direction.par_chunks(CHUNK).zip(self.image.par_chunks(CHUNK));
        let inputs = inputs.zip(self.inverse.par_chunks(CHUNK));
        blocks.zip(inputs).zip(self.partial[..chunks].par_iter_mut()).for_each(
            |((blocks, ((p, q), inverse)), sum)| {
                let ((u, r), mut i) = (blocks, 0);
                *sum = [0.0; L];
                while i < u.len() {
                    let mut c = 0;
                    while c < L {
                        u[i][c] += lengths[c] * p[i][c];
                        r[i][c] -= lengths[c] * q[i][c];
                        c += 1;
                    }
                    add_product(sum, &r[i], &r[i], inverse[i]);
                    i += 1;
                }
            },
        );
        total(&self.partial[..chunks])
    }

    /// direction = D^{-1} residual + factor direction.
    fn turn(&mut self, factor: PerChannel<L>) {
        let factor = factor.map(|f| f as f32);
        let inputs = self.residual.par_chunks(CHUNK).zip(self.inverse.par_chunks(CHUNK));
        self.direction.par_chunks_mut(CHUNK).zip(inputs).for_each(|(p, (r, inverse))| {
            let mut i = 0;
            while i < p.len() {
                let mut c = 0;
                while c < L {
                    p[i][c] = r[i][c] * inverse[i] + factor[c] * p[i][c];
                    c += 1;
                }
                i += 1;
            }
        });
    }
}

/// u . v in every channel.
fn dot<const L: usize>(u: &[[f32; L]], v: &[[f32; L]]) -> PerChannel<L> {
    let of_chunk = |(u, v): (&[[f32; L]], &[[f32; L]])| {
        let mut sum = [0.0; L];
        let mut i = 0;
        while i < u.len() {
            add_product(&mut sum, &u[i], &v[i], 1.0);
            i += 1;
        }
        sum
    };
    total(&u.par_chunks(CHUNK).zip(v.par_chunks(CHUNK)).map(of_chunk).collect::<Vec<_>>())
}

/// The sums of the rows of A are the weights of the samples around each pixel, and 0 where there are none;
/// the start divides by this share of the diagonal there.
const LEAST_SUM: f32 = 0.05;

/// a / b in every channel, 0 where b is 0.
fn ratio<const L: usize>(a: PerChannel<L>, b: PerChannel<L>) -> PerChannel<L> {
    std::array::from_fn(|c| if b[c] == 0.0 { 0.0 } else { a[c] / b[c] })
}

/// Share of the way to the tolerance: the residual falls by about one factor per step.
fn done(energy: f64, settings: &PlaneSettings) -> f64 {
    let (now, end) = (energy.max(f64::MIN_POSITIVE).ln(), 2.0 * settings.tolerance.ln());
    if end < 0.0 { (now / end).clamp(0.0, 1.0) } else { 1.0 }
}
