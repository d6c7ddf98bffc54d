//! The secondary objective in the coordinates of the iteration.
//!
//! With taps `F = start + cap x mix` the objective, in units of `unit cap^2`, is a convex quadratic function
//! of the unknowns: `sum_l w_l ||k_l||_F^2`, and for each row and lag of the taps a term `x G x' + b x' + c`
//! of the noise.

use super::newton;
use super::prepare::Reduced;
use super::problem::MeanSquareObjective;
use crate::lti::FirMatrix;
use hybank_linalg::Mat;
use hybank_linalg::blocks::Batch;

/// See the module's text.
#[derive(Debug, Clone)]
pub(super) struct Quadratic {
    weights: Vec<f64>,
    /// G, n x n.
    gram: Mat,
    /// b of all unknowns.
    linear: Vec<f64>,
    /// The sum of all c.
    constant: f64,
}

impl Quadratic {
    /// `square` about `start`, the taps in units of `cap`, the objective in units of `unit cap^2`.
    pub(super) fn new(
        reduced: &Reduced,
        square: &MeanSquareObjective,
        start: &FirMatrix,
        cap: f64,
        unit: f64,
    ) -> Self {
        let weights = square.weights.iter().map(|w| w / unit).collect();
        let mut noisy = reduced.mix.clone();
        noisy.column_iter_mut().zip(&square.noise).for_each(|(mut column, noise)| column *= *noise);
        let gram = &noisy * reduced.mix.transpose() / unit;
        let (m, n) = (reduced.layout.rows, reduced.layout.channels);
        let mut slope = Mat::zeros(m * n, start.lags().len());
        let mut constant = 0.0;
        for (j, f) in start.lags().iter().enumerate() {
            let cross = f * noisy.transpose() * (2.0 / (unit * cap));
            slope.column_mut(j).copy_from_slice(cross.as_slice());
            let power = f.column_iter().zip(&square.noise).map(|(c, noise)| noise * c.norm_squared());
            constant += power.sum::<f64>() / (unit * cap * cap);
        }
        Self { weights, gram, linear: reduced.layout.gather(&slope), constant }
    }

    /// The objective at the unknowns `x`, whose errors are `k`.
    pub(super) fn value(&self, k: &Batch, x: &[f64]) -> f64 {
        let square = |l: usize| k.block(l).data.iter().map(|z| z.norm_sqr()).sum::<f64>();
        let errors: f64 = self.weights.iter().enumerate().map(|(l, w)| w * square(l)).sum();
        let (bent, straight) = self.noise_slope(x);
        let noise: f64 = x.iter().zip(bent.iter().zip(straight)).map(|(x, (b, s))| x * (0.5 * b + s)).sum();
        errors + noise + self.constant
    }

    /// Its derivative in the unknowns.
    pub(super) fn gradient(&self, reduced: &Reduced, k: &Batch, x: &[f64]) -> Vec<f64> {
        let mut weighted = k.clone();
        let size = weighted.rows() * weighted.cols();
        for (i, z) in weighted.as_mut_slice().iter_mut().enumerate() {
            *z *= -self.weights[i / size];
        }
        let (bent, straight) = self.noise_slope(x);
        let noise = bent.iter().zip(straight).map(|(b, s)| b + s);
        reduced.adjoint(&weighted).iter().zip(noise).map(|(error, noise)| error + noise).collect()
    }

    /// Its second derivative (lower triangle).
    pub(super) fn curvature(&self, reduced: &Reduced) -> Mat {
        let unknowns = reduced.layout.unknowns();
        let mut q = Mat::zeros(unknowns, unknowns);
        newton::add_mean_square(&mut q, &reduced.layout, &reduced.phases, &reduced.h, &self.weights);
        let n = self.gram.nrows();
        for first in (0..unknowns).step_by(n.max(1)) {
            let mut block = q.view_mut((first, first), (n, n));
            block += 2.0 * &self.gram;
        }
        q
    }

    /// `2 G x` and `b`: the unknowns of one row and lag, one for each channel, stand together.
    fn noise_slope(&self, x: &[f64]) -> (Vec<f64>, &[f64]) {
        let n = self.gram.nrows();
        let lags = Mat::from_column_slice(n, x.len() / n.max(1), x);
        ((2.0 * &self.gram * lags).as_slice().to_vec(), &self.linear)
    }
}
