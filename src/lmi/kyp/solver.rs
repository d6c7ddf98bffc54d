//! The least gamma of a KYP problem: the primal-dual iteration and its Newton system.

use super::covariance::Covariance;
use super::problem::{Problem, Reduced};
use crate::linalg::{self, LinalgError, Mat};
use crate::lmi::factor::RegularisedCholesky;
use crate::lmi::iteration::{self, Iterate, StepLengths, centering};
use crate::lmi::{LmiError, Outcome, Settings};
use crate::lti::GramianCoordinates;

/// Limit on the doublings of gamma until the start is feasible.
const START_DOUBLINGS: usize = 200;

/// The least gamma with its certificate and its lower bound.
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    /// Why the iteration ended.
    pub outcome: Outcome,
    /// The unknowns.
    pub x: Vec<f64>,
    /// The LMI holds strictly (up to rounding) for this gamma, `p` and `x`.
    pub gamma: f64,
    /// Value of the dual covariance: a lower bound on gamma for all unknowns, up to rounding errors.
    pub lower: f64,
    /// P, r x r, in `coordinates`.
    pub(crate) p: Mat,
    /// The coordinates of P: those of the controllable states.
    pub(crate) coordinates: GramianCoordinates,
    /// Number of steps.
    pub iterations: usize,
}

/// Minimises gamma; the module documentation has the problem and the method.
///
/// Every problem has a solution, because A is stable and a norm is at least 0. The result holds the best
/// unknowns found and bounds on the optimum, whatever the outcome.
///
/// # Errors
/// [`LmiError::Setting`] for a setting out of its range, [`LmiError::Linalg`] if a decomposition does not
/// converge.
pub fn minimise(problem: &Problem, settings: &Settings) -> Result<Solution, LmiError> {
    settings.check()?;
    let reduced = Reduced::new(problem, settings.tol_rank)?;
    let n = reduced.coordinates.a.nrows();
    if reduced.scale <= settings.tol_gap_abs * reduced.size {
        // The error of the least-squares unknowns is rounding error; its H2 norm stands for gamma.
        let x = reduced.unknowns(&[]);
        let (outcome, p, gamma) = (Outcome::Solved, Mat::zeros(n, n), reduced.scale);
        let (coordinates, lower, iterations) = (reduced.coordinates, 0.0, 0);
        return Ok(Solution { outcome, x, gamma, lower, p, coordinates, iterations });
    }
    let mut pair = PrimalDual::new(&reduced)?;
    let (outcome, iterations) = iteration::run(&mut pair, settings)?;
    let x = reduced.unknowns(&pair.x);
    let (gamma, lower) = (pair.gamma * reduced.scale, pair.lower * reduced.scale);
    let p = pair.p * reduced.scale;
    let lower = lower.clamp(0.0, gamma);
    Ok(Solution { outcome, x, gamma, lower, p, coordinates: reduced.coordinates, iterations })
}

/// A feasible pair of primal and dual points.
struct PrimalDual<'a> {
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

impl<'a> PrimalDual<'a> {
    /// Feasible on both sides: white inputs and independent outputs on the dual, a Lyapunov matrix and a
    /// large enough gamma on the primal.
    fn new(reduced: &'a Reduced) -> Result<Self, LmiError> {
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
        Err(LmiError::Unstable { radius: linalg::spectral_radius(a)? })
    }

    /// The LMI's matrix; `constant` 1 for a point, 0 for a direction.
    fn slack(&self, p: &Mat, x: &[f64], gamma: f64, constant: f64) -> Mat {
        let (a, b) = (&self.reduced.coordinates.a, &self.reduced.coordinates.b);
        let k = self.reduced.outputs(x, constant);
        lmi_matrix(p, a, b, &k, gamma)
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

    /// Step lengths to the boundary.
    fn max_steps(&self, d: &Direction) -> Result<StepLengths, LinalgError> {
        Ok(StepLengths { primal: max_step(&self.s, &d.s)?, dual: max_step(&self.z, &d.z)? })
    }

    fn advance(&mut self, d: &Direction, length: StepLengths) -> Option<()> {
        let finite = d.gamma.is_finite() && d.x.iter().chain(&d.w).all(|v| v.is_finite());
        if !finite || !length.make_progress() {
            return None;
        }
        let p = &self.p + &d.p * length.primal;
        let x: Vec<f64> = self.x.iter().zip(&d.x).map(|(a, b)| a + length.primal * b).collect();
        let gamma = self.gamma + length.primal * d.gamma;
        let w: Vec<f64> = self.w.iter().zip(&d.w).map(|(a, b)| a + length.dual * b).collect();
        // From the unknowns and parameters, not from the steps, so that rounding errors do not accumulate.
        let (s, z) = (self.slack(&p, &x, gamma, 1.0), self.map.expand(&w));
        linalg::cholesky(&s).and_then(|_| linalg::cholesky(&z)).ok()?;
        (self.p, self.x, self.gamma, self.s, self.w, self.z) = (p, x, gamma, s, w, z);
        Some(())
    }
}

impl Iterate for PrimalDual<'_> {
    fn gap(&mut self) -> f64 {
        self.lower = self.lower.max(self.dual_value());
        (self.gamma - self.lower) / self.gamma
    }

    fn judged_gap(&mut self) -> Result<f64, LmiError> {
        Ok(self.gap())
    }

    fn step(&mut self, settings: &Settings) -> Option<()> {
        let order = self.map.order() as f64;
        let mu = self.s.dot(&self.z) / order;
        let newton = Newton::new(&self.map, &self.border, &self.s, &self.z).ok()?;
        let lambda = Mat::from_diagonal(&newton.lambda.clone().into());
        let affine = self.direction(&newton, &-&lambda);
        let longest = self.max_steps(&affine).ok()?;
        let (primal, dual) = (longest.primal.min(1.0), longest.dual.min(1.0));
        let after = (&self.s + &affine.s * primal).dot(&(&self.z + &affine.z * dual));
        let sigma = centering(after / (mu * order));
        let full = self.direction(&newton, &newton.target(sigma * mu, &affine));
        let longest = self.max_steps(&full).ok()?;
        let fraction = settings.fraction(longest);
        let within = |longest: f64| (fraction * longest).min(1.0);
        self.advance(&full, StepLengths { primal: within(longest.primal), dual: within(longest.dual) })
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

/// A direction, or a step when multiplied by its length.
struct Direction {
    p: Mat,
    x: Vec<f64>,
    gamma: f64,
    s: Mat,
    w: Vec<f64>,
    z: Mat,
}

/// The factored Newton system of an iterate, in the Nesterov-Todd scaling:
/// `G'SG = G^-1 Z G^-T = diag(lambda)`.
///
/// Directions are formed in scaled coordinates, where rounding errors are small beside every eigenvalue; in
/// the plain coordinates they would drown the small eigenvalues of S and Z near the optimum.
struct Newton {
    factor: RegularisedCholesky,
    /// Border in half-solved coordinates: lower triangle of its Gram matrix and orthonormal columns.
    triangle: Mat,
    columns: Mat,
    g: Mat,
    g_inverse: Mat,
    lambda: Vec<f64>,
}

impl Newton {
    /// The system for `map` and `border` at the primal matrix `s` and the dual matrix `z`, both positive
    /// definite.
    fn new(map: &Covariance, border: &Mat, s: &Mat, z: &Mat) -> Result<Self, LinalgError> {
        let (ls, lz) = (linalg::cholesky(s)?, linalg::cholesky(z)?);
        let svd = linalg::svd(&ls.tr_mul(&lz))?;
        let lambda = svd.s;
        let root = |k: usize| 1.0 / lambda[k].sqrt();
        let mut g = &lz * svd.v;
        g.column_iter_mut().enumerate().for_each(|(k, mut column)| column *= root(k));
        let mut g_inverse = (&ls * svd.u).transpose();
        g_inverse.row_iter_mut().enumerate().for_each(|(k, mut row)| row *= root(k));
        let weight = linalg::symmetric_part(&g_inverse.tr_mul(&g_inverse));
        let factor = RegularisedCholesky::new(map.newton(&weight, &weight))?;
        let (triangle, rows) = linalg::lq(&factor.solve_half(border).transpose());
        Ok(Self { factor, triangle, columns: rows.transpose(), g, g_inverse, lambda })
    }

    /// `H w + K x = image`, `K'w = required`, by an orthogonal projection in the coordinates where H is the
    /// identity: the dual equalities hold to rounding however ill-conditioned H is.
    fn solve(&self, image: &Mat, required: &Mat) -> (Mat, Mat) {
        let half = self.factor.solve_half(image);
        let needed = linalg::solve_lower(&self.triangle, required);
        let component = self.columns.tr_mul(&half) - needed;
        let x = linalg::solve_lower_transposed(&self.triangle, &component);
        (self.factor.solve_half_transposed(&(half - &self.columns * component)), x)
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

/// Largest alpha for which `m + alpha d` stays positive semidefinite (infinite if all do); m must be
/// positive definite.
fn max_step(m: &Mat, d: &Mat) -> Result<f64, LinalgError> {
    if m.is_empty() {
        return Ok(f64::INFINITY);
    }
    let l = linalg::cholesky(m)?;
    let half = linalg::solve_lower(&l, d);
    let scaled = linalg::symmetric_part(&linalg::solve_lower(&l, &half.transpose()));
    let least = linalg::hermitian_eigenvalues(&scaled)?[0];
    Ok(if least < 0.0 { -1.0 / least } else { f64::INFINITY })
}
