//! The iteration. Everything happens in Gramian coordinates, relative to the least-squares outputs: there the
//! squared H2 norm is the squared norm of [C D], so the H2-optimal unknowns are a projection.

use super::coordinates::{Coordinates, gramian_coordinates};
use super::covariance::Covariance;
use super::{KypError, Problem, Settings};
use crate::linalg::{self, LinalgError, Mat};
use crate::lmi::Stop;
use crate::lmi::factor::Shifted;
use crate::lmi::step::reach;

/// Most doublings of gamma until the start is feasible.
const START_DOUBLINGS: usize = 200;
/// Steps shorter than this make no progress.
const SHORTEST_STEP: f64 = 1e-7;
/// Steps without a better gap after which a run is over.
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

/// The least gamma with its certificate and its lower bound.
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    /// Why the iteration ended.
    pub stop: Stop,
    /// The unknowns.
    pub x: Vec<f64>,
    /// The LMI holds strictly (up to rounding) for this gamma, `p` and `x`.
    pub gamma: f64,
    /// Value of the dual covariance: no unknowns reach a smaller gamma (up to rounding).
    pub lower: f64,
    /// P, r x r, in `coordinates`.
    pub p: Mat,
    /// The controllable states that P speaks of.
    pub coordinates: Coordinates,
    /// Iteration record.
    pub steps: Vec<Step>,
}

/// Minimises gamma. Every problem has a solution (the norm is bounded below by 0 and A is stable); the
/// result always holds the best unknowns found with honest bounds. Fails only on settings out of range or
/// if a decomposition does not converge.
pub fn minimise(problem: &Problem, settings: &Settings) -> Result<Solution, KypError> {
    settings.check()?;
    let reduced = Reduced::new(problem, settings.tol_rank)?;
    let n = reduced.coordinates.a.nrows();
    if reduced.scale <= settings.tol_gap_abs * reduced.size {
        // The least-squares outputs vanish but for rounding errors, whose H2 norm stands for gamma.
        let x = reduced.unknowns(&[]);
        let (p, gamma) = (Mat::zeros(n, n), reduced.scale);
        let coordinates = reduced.coordinates;
        return Ok(Solution { stop: Stop::Solved, x, gamma, lower: 0.0, p, coordinates, steps: Vec::new() });
    }
    let mut iterate = Iterate::new(&reduced)?;
    let (stop, steps) = iterate.run(settings)?;
    let x = reduced.unknowns(&iterate.x);
    let (gamma, lower) = (iterate.gamma * reduced.scale, iterate.lower * reduced.scale);
    let p = iterate.p * reduced.scale;
    let lower = lower.clamp(0.0, gamma);
    Ok(Solution { stop, x, gamma, lower, p, coordinates: reduced.coordinates, steps })
}

/// The problem as iterated on: `vec [C D] = k0 + terms y`, orthonormal `terms` orthogonal to `k0`, `|k0| = 1`.
struct Reduced {
    coordinates: Coordinates,
    outputs: usize,
    k0: Mat,
    terms: Mat,
    /// `x = origin + scale back y`.
    origin: Mat,
    back: Mat,
    scale: f64,
    size: f64,
}

impl Reduced {
    fn new(problem: &Problem, tol_rank: f64) -> Result<Self, KypError> {
        let coordinates = gramian_coordinates(&problem.a, &problem.b, tol_rank)?;
        let flat = |c: &Mat, d: &Mat| {
            let c = c * &coordinates.basis;
            Mat::from_iterator(c.len() + d.len(), 1, c.iter().chain(d.iter()).copied())
        };
        let k0 = flat(&problem.c, &problem.d);
        let columns: Vec<Mat> = problem.terms.iter().map(|(c, d)| flat(c, d)).collect();
        let strength: Vec<f64> = columns.iter().map(|k| k.norm()).collect();
        let unit = |k: usize| if strength[k] > 0.0 { 1.0 / strength[k] } else { 0.0 };
        let all = Mat::from_fn(k0.len(), columns.len(), |i, k| columns[k][i] * unit(k));
        let (terms, back) = orthonormal(&all, tol_rank)?;
        let back = Mat::from_fn(columns.len(), terms.ncols(), |k, r| unit(k) * back[(k, r)]);
        let (mut rest, mut reached) = (k0.clone(), Mat::zeros(terms.ncols(), 1));
        for _ in 0..2 {
            let seen = terms.tr_mul(&rest);
            rest -= &terms * &seen;
            reached += seen;
        }
        let (scale, size) = (rest.norm(), k0.norm());
        let origin = -(&back * reached);
        let k0 = if scale > 0.0 { rest / scale } else { rest };
        Ok(Self { coordinates, outputs: problem.c.nrows(), k0, terms, origin, back, scale, size })
    }

    fn unknowns(&self, y: &[f64]) -> Vec<f64> {
        let mut y = y.to_vec();
        y.resize(self.terms.ncols(), 0.0);
        let x = &self.origin + &self.back * Mat::from_column_slice(y.len(), 1, &y) * self.scale;
        x.as_slice().to_vec()
    }

    /// [C D], p x (n + m), for the reduced unknowns (with or without the constant part).
    fn outputs(&self, y: &[f64], constant: f64) -> Mat {
        let k = &self.k0 * constant + &self.terms * Mat::from_column_slice(y.len(), 1, y);
        Mat::from_column_slice(self.outputs, k.len() / self.outputs, k.as_slice())
    }
}

/// Orthonormal columns that span those of `all`, and the combinations of columns that give them.
fn orthonormal(all: &Mat, tol_rank: f64) -> Result<(Mat, Mat), LinalgError> {
    if all.is_empty() {
        return Ok((Mat::zeros(all.nrows(), 0), Mat::zeros(all.ncols(), 0)));
    }
    let svd = linalg::svd(all)?;
    let floor = tol_rank * svd.s.first().copied().unwrap_or(0.0);
    let rank = svd.s.iter().filter(|s| **s > floor).count();
    let back = Mat::from_fn(all.ncols(), rank, |k, r| svd.v[(k, r)] / svd.s[r]);
    Ok((svd.u.columns(0, rank).into_owned(), back))
}

struct Iterate<'a> {
    reduced: &'a Reduced,
    map: Covariance,
    /// Rows: parameters of the covariance. Columns: unknowns, then gamma.
    border: Mat,
    p: Mat,
    x: Vec<f64>,
    gamma: f64,
    s: Mat,
    w: Vec<f64>,
    z: Mat,
    lower: f64,
}

struct Direction {
    p: Mat,
    x: Vec<f64>,
    gamma: f64,
    s: Mat,
    w: Vec<f64>,
    z: Mat,
}

/// The factored Newton system of one iterate, in the Nesterov-Todd scaling: `G'SG = G^-1 Z G^-T = diag(lambda)`.
///
/// Directions are formed in scaled coordinates, where rounding errors are small beside every eigenvalue; in
/// the plain coordinates they would drown the small eigenvalues of S and Z near the optimum.
struct Newton {
    factor: Shifted,
    /// Border in half-solved coordinates: lower triangle of its Gram matrix and orthonormal columns.
    triangle: Mat,
    columns: Mat,
    g: Mat,
    g_inverse: Mat,
    lambda: Vec<f64>,
}

impl Newton {
    /// `H w + K x = image`, `K'w = wanted`, by an orthogonal projection in the coordinates where H is the
    /// identity: the dual equalities hold to rounding however ill-conditioned H is.
    fn solve(&self, image: &Mat, wanted: &Mat) -> (Mat, Mat) {
        let half = self.factor.half(image);
        let needed = linalg::solve_lower(&self.triangle, wanted);
        let seen = self.columns.tr_mul(&half) - needed;
        let x = linalg::solve_lower_transposed(&self.triangle, &seen);
        (self.factor.half_transposed(&(half - &self.columns * seen)), x)
    }

    /// Mehrotra's target: `(lambda_i + lambda_j)/2 (dS~ + dZ~)_ij = sigma_mu I - Lambda^2 - sym(dS~ dZ~)`.
    fn target(&self, sigma_mu: f64, affine: &Direction) -> Mat {
        let s = self.g.tr_mul(&affine.s) * &self.g;
        let z = &self.g_inverse * &affine.z * self.g_inverse.transpose();
        let second = linalg::symmetric_part(&(s * z));
        Mat::from_fn(self.lambda.len(), self.lambda.len(), |i, j| {
            let (a, b) = (self.lambda[i], self.lambda[j]);
            let first = if i == j { sigma_mu - a * a } else { 0.0 };
            2.0 * (first - second[(i, j)]) / (a + b)
        })
    }
}

impl<'a> Iterate<'a> {
    /// Feasible on both sides: white inputs and independent outputs on the dual, a Lyapunov matrix and a
    /// large enough gamma on the primal.
    fn new(reduced: &'a Reduced) -> Result<Self, KypError> {
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
        assemble(p, a, b, &k, gamma)
    }

    fn run(&mut self, settings: &Settings) -> Result<(Stop, Vec<Step>), KypError> {
        let mut steps = Vec::new();
        let (mut least, mut waited) = (f64::INFINITY, 0);
        while steps.len() < settings.max_iterations {
            self.lower = self.lower.max(self.dual_value());
            let gap = (self.gamma - self.lower) / self.gamma;
            if gap <= settings.tol_gap_rel {
                return Ok((Stop::Solved, steps));
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
        let stop = if gap <= settings.tol_gap_rel {
            Stop::Solved
        } else if gap <= settings.tol_gap_reduced {
            Stop::SolvedInaccurate
        } else if steps.len() >= settings.max_iterations {
            Stop::IterationLimit
        } else {
            Stop::NumericalTrouble
        };
        Ok((stop, steps))
    }

    /// Lower bound on gamma. From `0 <= <Z, S>`: `gamma (tr Zuu + tr Zyy) >= -2 <T, k0> - 2 (U'T)'y`, and
    /// unknowns that reach a gamma below the present one have `|y|^2 <= m gamma^2`, because m gamma^2
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
        let (ls, lz) = (linalg::cholesky(&self.s)?, linalg::cholesky(&self.z)?);
        let svd = linalg::svd(&ls.tr_mul(&lz))?;
        let lambda = svd.s;
        let root = |k: usize| 1.0 / lambda[k].sqrt();
        let mut g = &lz * svd.v;
        g.column_iter_mut().enumerate().for_each(|(k, mut column)| column *= root(k));
        let mut g_inverse = (&ls * svd.u).transpose();
        g_inverse.row_iter_mut().enumerate().for_each(|(k, mut row)| row *= root(k));
        let weight = linalg::symmetric_part(&g_inverse.tr_mul(&g_inverse));
        let factor = Shifted::new(self.map.newton(&weight, &weight))?;
        let (triangle, rows) = linalg::lq(&factor.half(&self.border).transpose());
        Ok(Newton { factor, triangle, columns: rows.transpose(), g, g_inverse, lambda })
    }

    /// The direction with `dS~ + dZ~ = target` in scaled coordinates, dual residual removed.
    fn direction(&self, newton: &Newton, target: &Mat) -> Direction {
        let rhs = linalg::symmetric_part(&(newton.g_inverse.tr_mul(target) * &newton.g_inverse));
        let image = self.map.adjoint(&rhs);
        let wanted = Mat::from_column_slice(self.x.len() + 1, 1, &self.dual_residual());
        let (w, x) = newton.solve(&Mat::from_column_slice(image.len(), 1, &image), &wanted);
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
        let (primal, dual) = self.reach(&affine)?;
        let after = (&self.s + &affine.s * primal.min(1.0)).dot(&(&self.z + &affine.z * dual.min(1.0)));
        let sigma = (after / (mu * order as f64)).clamp(0.0, 1.0).powi(3).clamp(1e-8, 0.9);
        let full = self.direction(&newton, &newton.target(sigma * mu, &affine));
        let (primal, dual) = self.reach(&full)?;
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

    fn reach(&self, d: &Direction) -> Result<(f64, f64), LinalgError> {
        Ok((reach(&self.s, &d.s)?, reach(&self.z, &d.z)?))
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
        // From the unknowns and parameters, not from the steps: rounding errors do not pile up.
        let (s, z) = (self.slack(&p, &x, gamma, 1.0), self.map.expand(&w));
        if linalg::cholesky(&s).is_err() || linalg::cholesky(&z).is_err() {
            return false;
        }
        (self.p, self.x, self.gamma, self.s, self.w, self.z) = (p, x, gamma, s, w, z);
        true
    }
}

/// `[P - A'PA, *, *; -B'PA, gamma I - B'PB, *; C, D, gamma I]` with `k = [C D]`.
pub(super) fn assemble(p: &Mat, a: &Mat, b: &Mat, k: &Mat, gamma: f64) -> Mat {
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
