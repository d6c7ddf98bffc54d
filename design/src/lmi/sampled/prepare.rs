//! The problem of the iteration: inputs compressed at each point, channels mixed to equal strength without
//! correlation.

use super::fourier::{LagPhasors, Layout};
use super::problem::SampledProblem;
use crate::lmi::settings::SETTINGS;
use crate::lti::FirMatrix;
use hybank_linalg::blocks::Batch;
use hybank_linalg::{CMat, LinalgError, Mat};

/// The problem in well-conditioned coordinates.
#[derive(Debug, Clone)]
pub(super) struct Reduced {
    /// Mixed channels, n x k1.
    pub(super) h: Batch,
    /// The reference in the inputs that the channels measure, M x k1.
    pub(super) w: Batch,
    /// The reference in the other inputs, M x k2; the taps do not act on it.
    pub(super) w_rest: Batch,
    /// `w_rest w_rest*`, M x M.
    pub(super) g: Batch,
    /// Orthonormal rows (k1 + k2) x q at each point: the original inputs of the compressed ones.
    pub(super) inputs: Vec<CMat>,
    /// n x N: `H_l Q_l* = ` original channels, mixed by `mix`; taps = reduced taps times `mix`.
    pub(super) mix: Mat,
    pub(super) layout: Layout,
    pub(super) phases: LagPhasors,
}

impl Reduced {
    pub(super) fn new(problem: &SampledProblem) -> Result<Self, LinalgError> {
        let (m, n, q) = (problem.rows(), problem.channels(), problem.inputs());
        let count = problem.points().len();
        let (k1, k) = (n.min(q), (m + n).min(q));
        let mut channels = Batch::zeros(count, n, k1);
        let mut w = Batch::zeros(count, m, k1);
        let mut w_rest = Batch::zeros(count, m, k - k1);
        let mut inputs = Vec::with_capacity(count);
        for (l, point) in problem.points().iter().enumerate() {
            let (lower, basis) = hybank_linalg::lq(&stack(&point.h, &point.w));
            channels.set(l, &lower.view((0, 0), (n, k1)).into_owned());
            w.set(l, &lower.view((n, 0), (m, k1)).into_owned());
            w_rest.set(l, &lower.view((n, k1), (m, k - k1)).into_owned());
            inputs.push(basis);
        }
        let mix = mixing(&channels)?;
        let h = mixed(&channels, &mix);
        let g = gram(&w_rest);
        let omega: Vec<f64> = problem.points().iter().map(|p| p.omega).collect();
        let layout = Layout::new(mix.nrows(), problem.lags());
        let phases = LagPhasors::new(&omega, problem.max_lags());
        Ok(Self { h, w, w_rest, g, inputs, mix, layout, phases })
    }

    pub(super) fn count(&self) -> usize {
        self.h.count()
    }

    /// `k_l = w_l - F(omega_l) h_l` for the unknowns `x`.
    pub(super) fn error(&self, x: &[f64]) -> Batch {
        let mut k = self.w.clone();
        k.add_scaled(-1.0, &self.image(x));
        k
    }

    /// `F(omega_l) h_l` for the unknowns `x`.
    pub(super) fn image(&self, x: &[f64]) -> Batch {
        let mut f = Batch::zeros(self.count(), self.layout.rows, self.layout.channels);
        self.phases.response(&self.layout.scatter(x), &mut f);
        let mut image = Batch::zeros(self.count(), self.layout.rows, self.h.cols());
        for l in 0..self.count() {
            image.block_mut(l).set_product(1.0, f.block(l).plain(), self.h.block(l).plain());
        }
        image
    }

    /// `2 Re sum_l e^{i omega_l j} (y_l h_l*)_{p,i}` for all unknowns: the adjoint of
    /// [`Reduced::image`] for the inner product `2 Re sum tr(y* k)`.
    pub(super) fn adjoint(&self, y: &Batch) -> Vec<f64> {
        let mut e = Batch::zeros(self.count(), self.layout.rows, self.layout.channels);
        for l in 0..self.count() {
            e.block_mut(l).set_product(2.0, y.block(l).plain(), self.h.block(l).adjoint());
        }
        self.layout.gather(&self.phases.adjoint_sum(&e))
    }

    /// The taps in the original channels.
    pub(super) fn taps(&self, x: &[f64]) -> FirMatrix {
        let (m, n) = (self.layout.rows, self.layout.channels);
        let c = self.layout.scatter(x);
        c.column_iter().map(|col| Mat::from_column_slice(m, n, col.as_slice()) * &self.mix).collect()
    }

    /// Divides the reference by `scale`.
    pub(super) fn rescale(&mut self, scale: f64) {
        for (blocks, factor) in [
            (&mut self.w, 1.0 / scale),
            (&mut self.w_rest, 1.0 / scale),
            (&mut self.g, 1.0 / (scale * scale)),
        ] {
            blocks.as_mut_slice().iter_mut().for_each(|z| *z *= factor);
        }
    }
}

fn stack(h: &CMat, w: &CMat) -> CMat {
    let mut both = CMat::zeros(h.nrows() + w.nrows(), h.ncols());
    both.rows_mut(0, h.nrows()).copy_from(h);
    both.rows_mut(h.nrows(), w.nrows()).copy_from(w);
    both
}

/// n x N real matrix after which the channels, summed over all points, have unit mean power each and
/// no correlation. Equal channels become one, zero channels none.
fn mixing(channels: &Batch) -> Result<Mat, LinalgError> {
    let (n, k, count) = (channels.rows(), channels.cols(), channels.count());
    let half = k * count;
    let mut all = Mat::from_fn(n, 2 * half, |i, c| {
        let z = channels.as_slice()[i + n * (c % half)];
        if c < half { z.re } else { z.im }
    });
    let strength: Vec<f64> = (0..n).map(|i| all.row(i).norm()).collect();
    let unit: Vec<f64> = strength.iter().map(|s| if *s > 0.0 { 1.0 / s } else { 0.0 }).collect();
    all.row_iter_mut().zip(&unit).for_each(|(mut row, unit)| row *= *unit);
    let svd = hybank_linalg::svd(&hybank_linalg::lq_factor(&all))?;
    let rank = svd.rank(SETTINGS.channel_rank);
    let power = (count as f64).sqrt();
    Ok(Mat::from_fn(rank, n, |r, i| power / svd.s[r] * svd.u[(i, r)] * unit[i]))
}

fn mixed(channels: &Batch, mix: &Mat) -> Batch {
    let mix = hybank_linalg::to_complex(mix);
    let mut h = Batch::zeros(channels.count(), mix.nrows(), channels.cols());
    for l in 0..channels.count() {
        h.set(l, &(&mix * channels.to_matrix(l)));
    }
    h
}

fn gram(a: &Batch) -> Batch {
    let mut g = Batch::zeros(a.count(), a.rows(), a.rows());
    for l in 0..a.count() {
        g.block_mut(l).set_product(1.0, a.block(l).plain(), a.block(l).adjoint());
    }
    g
}
