//! The primal-dual iteration of the KYP problem.

use super::covariance::Covariance;
use super::newton::{Direction, Newton};
use super::problem::KypError;
use super::reduced::Reduced;
use super::step::max_step;
use crate::linalg::{self, LinalgError, Mat};
use crate::lmi::Settings;
use crate::lmi::outcome::Outcome;

/// Most doublings of gamma until the start is feasible.
const START_DOUBLINGS: usize = 200;
/// Steps shorter than this make no progress.
const SHORTEST_STEP: f64 = 1e-7;
/// Steps without a better gap after which the iteration ends.
const PATIENCE: usize = 6;

/// One line of the iteration record, in units of the least-squares H2 norm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// gamma at the start of the step.
    pub gamma: f64,
    /// `<S, Z>` over the order of the LMI.
    pub mu: f64,
    /// Norm of the residual of the dual equalities.
    pub dual_residual: f64,
    /// Step length of P, x and gamma.
    pub alpha_primal: f64,
    /// Step length of the covariance.
    pub alpha_dual: f64,
    /// Diagonal shift that the Newton matrix needed (0 nearly always).
    pub shift: f64,
}

/// A feasible pair of primal and dual points.
pub(super) struct Iterate<'a> {
    reduced: &'a Reduced,
    map: Covariance,
    /// Rows: parameters of the covariance. Columns: unknowns, then gamma.
    border: Mat,
    pub(super) p: Mat,
    pub(super) x: Vec<f64>,
    pub(super) gamma: f64,
    s: Mat,
    w: Vec<f64>,
    z: Mat,
    pub(super) lower: f64,
}

impl<'a> Iterate<'a> {
    /// Feasible on both sides: white inputs and independent outputs on the dual, a Lyapunov matrix and a
    /// large enough gamma on the primal.
    pub(super) fn new(reduced: &'a Reduced) -> Result<Self, KypError> {
        let (a, b) = (&reduced.coordinates.a, &reduced.coordinates.b);
        let map = Covariance::new(a, b, reduced.outputs);
        let (n, order) = (map.n, map.order());
        let mut start = Mat::zeros(order, order);
        (n..order).for_each(|i| start[(i, i)] = 1.0 / (order - n) as f64);
        let w = map.parameters(&start);
        let z = map.expand(&w);
        let x = vec![0.0; reduced.terms.ncols()];
        let c = reduced.outputs(&x, 1.0).columns(0, n).into_owned();
        let p = map.lyapunov().adjoint(&(Mat::identity(n, n) + c.tr_mul(&c)));
        let border = border(reduced, &map);
        let s = Mat::zeros(order, order);
        let mut iterate = Self { reduced, map, border, p, x, gamma: 2.0, s, w, z, lower: 0.0 };
        for _ in 0..START_DOUBLINGS {
            iterate.s = iterate.slack(&iterate.p, &iterate.x, iterate.gamma, 1.0);
            if linalg::cholesky(&iterate.s).is_ok() {
                return Ok(iterate);
            }
            iterate.gamma *= 2.0;
        }
        Err(KypError::Unstable { radius: linalg::spectral_radius(a)? })
    }

    /// The LMI's matrix; `constant` 1 for a point, 0 for a direction.
    fn slack(&self, p: &Mat, x: &[f64], gamma: f64, constant: f64) -> Mat {
        let (a, b) = (&self.reduced.coordinates.a, &self.reduced.coordinates.b);
        let k = self.reduced.outputs(x, constant);
        lmi_matrix(p, a, b, &k, gamma)
    }

    /// Iterates until the gap is within its tolerance, the progress ends or the limit is reached.
    pub(super) fn run(&mut self, settings: &Settings) -> Result<(Outcome, Vec<Step>), KypError> {
        let mut steps = Vec::new();
        let (mut least, mut waited) = (f64::INFINITY, 0);
        while steps.len() < settings.max_iterations {
            self.lower = self.lower.max(self.dual_value());
            let gap = (self.gamma - self.lower) / self.gamma;
            if gap <= settings.tol_gap_rel {
                return Ok((Outcome::Solved, steps));
            }
            waited = if gap < 0.95 * least { 0 } else { waited + 1 };
            least = least.min(gap);
            // The first steps may go by without a useful bound.
            if waited > PATIENCE && gap < 0.5 {
                break;
            }
            match self.step(settings) {
                Ok(Some(step)) => steps.push(step),
                Ok(None) | Err(_) => break,
            }
        }
        self.lower = self.lower.max(self.dual_value());
        let gap = (self.gamma - self.lower) / self.gamma;
        let limit_reached = steps.len() >= settings.max_iterations;
        let solved = [settings.tol_gap_rel, settings.tol_gap_reduced].map(|tol| gap <= tol);
        let outcome = Outcome::at_end(solved, limit_reached);
        Ok((outcome, steps))
    }

    /// Lower bound on gamma. From `0 <= <Z, S>`: `gamma (tr Zuu + tr Zyy) >= -2 <T, k0> - 2 (U'T)'y`, and
    /// unknowns that achieve a gamma below the present one have `|y|^2 <= m gamma^2`, because m gamma^2
    /// bounds the squared H2 norm `1 + |y|^2`.
    fn dual_value(&self) -> f64 {
        let residual = self.border.tr_mul(&Mat::from_column_slice(self.w.len(), 1, &self.w));
        let unknowns = self.x.len();
        let trace = residual[unknowns];
        let leak = residual.rows(0, unknowns).norm() * (self.map.m as f64).sqrt() * self.gamma;
        let inner = self.outputs_part(&self.z).dot(&self.reduced.outputs(&vec![0.0; unknowns], 1.0));
        (-2.0 * inner - leak) / trace
    }

    /// [Zyx Zyu].
    fn outputs_part(&self, z: &Mat) -> Mat {
        let first = self.map.n + self.map.m;
        z.view((first, 0), (self.map.p, first)).into_owned()
    }

    fn newton(&self) -> Result<Newton, LinalgError> {
        Newton::new(&self.map, &self.border, &self.s, &self.z)
    }

    /// The direction with `dS~ + dZ~ = target` in scaled coordinates, dual residual removed.
    fn direction(&self, newton: &Newton, target: &Mat) -> Direction {
        let rhs = linalg::symmetric_part(&(newton.g_inverse.tr_mul(target) * &newton.g_inverse));
        let image = self.map.adjoint(&rhs);
        let required = Mat::from_column_slice(self.x.len() + 1, 1, &self.dual_residual());
        let (w, x) = newton.solve(&Mat::from_column_slice(image.len(), 1, &image), &required);
        let mut x = x.as_slice().to_vec();
        let z = self.map.expand(w.as_slice());
        let gamma = x.pop().unwrap_or(0.0);
        let n = self.map.n;
        let scaled = target - &newton.g_inverse * &z * newton.g_inverse.transpose();
        let slack = newton.g_inverse.tr_mul(&scaled) * &newton.g_inverse;
        let states = linalg::symmetric_part(&slack.view((0, 0), (n, n)).into_owned());
        let p = self.map.lyapunov().adjoint(&states);
        let s = self.slack(&p, &x, gamma, 0.0);
        Direction { p, x, gamma, s, w: w.as_slice().to_vec(), z }
    }

    /// `(0, .., 0, 1) - B*(Z)`.
    fn dual_residual(&self) -> Vec<f64> {
        let image = self.border.tr_mul(&Mat::from_column_slice(self.w.len(), 1, &self.w));
        let last = self.x.len();
        image.iter().enumerate().map(|(k, v)| f64::from(u8::from(k == last)) - v).collect()
    }

    fn step(&mut self, settings: &Settings) -> Result<Option<Step>, LinalgError> {
        let order = self.map.order();
        let mu = self.s.dot(&self.z) / order as f64;
        let dual_residual = self.dual_residual().iter().map(|r| r * r).sum::<f64>().sqrt();
        let newton = self.newton()?;
        let lambda = Mat::from_diagonal(&newton.lambda.clone().into());
        let affine = self.direction(&newton, &-&lambda);
        let (primal, dual) = self.max_steps(&affine)?;
        let after = (&self.s + &affine.s * primal.min(1.0)).dot(&(&self.z + &affine.z * dual.min(1.0)));
        let sigma = (after / (mu * order as f64)).clamp(0.0, 1.0).powi(3).clamp(1e-8, 0.9);
        let full = self.direction(&newton, &newton.target(sigma * mu, &affine));
        let (primal, dual) = self.max_steps(&full)?;
        let fraction = settings.step_fraction.min(0.9 + 0.09 * primal.min(dual).min(1.0));
        let alpha = ((fraction * primal).min(1.0), (fraction * dual).min(1.0));
        let step = Step {
            gamma: self.gamma,
            mu,
            dual_residual,
            alpha_primal: alpha.0,
            alpha_dual: alpha.1,
            shift: newton.factor.shift,
        };
        Ok(self.advance(&full, alpha).then_some(step))
    }

    /// Primal and dual step lengths to the boundary.
    fn max_steps(&self, d: &Direction) -> Result<(f64, f64), LinalgError> {
        Ok((max_step(&self.s, &d.s)?, max_step(&self.z, &d.z)?))
    }

    fn advance(&mut self, d: &Direction, (primal, dual): (f64, f64)) -> bool {
        let finite = d.gamma.is_finite() && d.x.iter().chain(&d.w).all(|v| v.is_finite());
        if !finite || primal.is_nan() || dual.is_nan() || primal.max(dual) < SHORTEST_STEP {
            return false;
        }
        let p = &self.p + &d.p * primal;
        let x: Vec<f64> = self.x.iter().zip(&d.x).map(|(a, b)| a + primal * b).collect();
        let gamma = self.gamma + primal * d.gamma;
        let w: Vec<f64> = self.w.iter().zip(&d.w).map(|(a, b)| a + dual * b).collect();
        // From the unknowns and parameters, not from the steps, so that rounding errors do not accumulate.
        let (s, z) = (self.slack(&p, &x, gamma, 1.0), self.map.expand(&w));
        if linalg::cholesky(&s).is_err() || linalg::cholesky(&z).is_err() {
            return false;
        }
        (self.p, self.x, self.gamma, self.s, self.w, self.z) = (p, x, gamma, s, w, z);
        true
    }
}

/// `[P - A'PA, *, *; -B'PA, gamma I - B'PB, *; C, D, gamma I]` with `k = [C D]`.
fn lmi_matrix(p: &Mat, a: &Mat, b: &Mat, k: &Mat, gamma: f64) -> Mat {
    let (n, m, q) = (a.nrows(), b.ncols(), k.nrows());
    let pb = p * b;
    let mut s = Mat::zeros(n + m + q, n + m + q);
    s.view_mut((0, 0), (n, n)).copy_from(&(p - a.tr_mul(&(p * a))));
    s.view_mut((0, n), (n, m)).copy_from(&-(a.tr_mul(&pb)));
    s.view_mut((n, n), (m, m)).copy_from(&-(b.tr_mul(&pb)));
    s.view_mut((0, n + m), (n + m, q)).copy_from(&k.transpose());
    (n..n + m + q).for_each(|i| s[(i, i)] += gamma);
    for j in 0..n + m + q {
        for i in 0..j {
            let v = if j < n || (i >= n && j < n + m) { 0.5 * (s[(i, j)] + s[(j, i)]) } else { s[(i, j)] };
            s[(i, j)] = v;
            s[(j, i)] = v;
        }
    }
    s
}

/// Inner products of every parameter's covariance with the coefficients of the unknowns and of gamma.
fn border(reduced: &Reduced, map: &Covariance) -> Mat {
    let (unknowns, order) = (reduced.terms.ncols(), map.order());
    let first = map.n + map.m;
    let mut border = Mat::zeros(map.len(), unknowns + 1);
    for k in 0..unknowns {
        let mut y = Mat::zeros(order, order);
        for j in 0..first {
            for i in 0..map.p {
                let v = reduced.terms[(i + map.p * j, k)];
                y[(first + i, j)] = v;
                y[(j, first + i)] = v;
            }
        }
        border.column_mut(k).copy_from_slice(&map.adjoint_of_outputs(&y));
    }
    let mut y = Mat::zeros(order, order);
    (map.n..order).for_each(|i| y[(i, i)] = 1.0);
    border.column_mut(unknowns).copy_from_slice(&map.adjoint_of_outputs(&y));
    border
}
