//! The iteration on the homogeneous self-dual embedding.
//!
//! With the constants `F0` and the map `F x = sum x_i F_i`, it drives to zero
//!
//! ```text
//! rp = F x + F0 tau - S        rd = c tau - F*Z - A'lambda
//! re = A x - b tau             rg = c'x + <F0, Z> - b'lambda + kappa
//! ```
//!
//! with S, Z >= 0 and tau, kappa >= 0. At a solution with tau > 0 the point divided by tau is
//! optimal; with kappa > 0 it certifies infeasibility.

use super::cone::Element;
use super::equilibrate::Scaling;
use super::newton::{self, Newton};
use super::problem::{GeneralError, Problem, dot, norm};
use super::{Dual, Outcome, Settings, Solution};
use crate::linalg::{LinalgError, Mat};

/// Steps shorter than this make no progress.
const SHORTEST_STEP: f64 = 1e-8;
/// Steps without a better merit after which a run is over.
const PATIENCE: usize = 15;

/// How far a point is from optimal, in the units of the problem as given.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Residuals {
    /// Largest violation: `|| (F(x))_- ||` and `||A x - b||`, relative to `1 + ` the largest constant.
    pub primal: f64,
    /// `||c - F*Z - A'lambda||` relative to `1 + ||c||`.
    pub dual: f64,
    /// `|c'x - dual objective|`.
    pub gap_abs: f64,
    /// The same, relative to `1 + ` the smaller modulus of the two objectives.
    pub gap_rel: f64,
}

impl Residuals {
    fn within(&self, feasibility: f64, abs: f64, rel: f64) -> bool {
        self.primal <= feasibility && self.dual <= feasibility && (self.gap_abs <= abs || self.gap_rel <= rel)
    }

    fn merit(&self) -> f64 {
        let m = self.primal.max(self.dual).max(self.gap_rel);
        if m.is_nan() { f64::INFINITY } else { m }
    }
}

/// Solves the problem; see the module's text. Fails only on settings out of range; infeasible, unbounded
/// and numerically hopeless problems are outcomes.
pub fn minimise(problem: &Problem, settings: &Settings) -> Result<Solution, GeneralError> {
    settings.check()?;
    let (scaling, scaled) = Scaling::new(problem, settings.equilibrate_rounds);
    let mut iterate = Iterate::new(&scaled);
    let mut best = judge(problem, &scaling, &iterate);
    let (mut least, mut waited) = (f64::INFINITY, 0);
    let mut ended = Outcome::IterationLimit;
    for _ in 0..settings.max_iterations {
        let solution = judge(problem, &scaling, &iterate);
        if let Some(outcome) = verdict(problem, settings, &scaling, &iterate, &solution) {
            return Ok(Solution { outcome, ..solution });
        }
        if solution.residuals.merit() <= best.residuals.merit() {
            best = solution;
        }
        let merit = iterate.merit(&scaled);
        waited = if merit < 0.9 * least { 0 } else { waited + 1 };
        least = least.min(merit);
        if waited > PATIENCE || iterate.step(&scaled, settings).is_err() {
            ended = Outcome::NumericalTrouble;
            break;
        }
    }
    let last = judge(problem, &scaling, &iterate);
    if last.residuals.merit() <= best.residuals.merit() {
        best = last;
    }
    best.iterations = iterate.steps;
    let reduced = settings.tol_reduced;
    let tight = best.residuals.within(settings.tol_feasibility, settings.tol_gap_abs, settings.tol_gap_rel);
    best.outcome = if tight {
        Outcome::Solved
    } else if best.residuals.within(reduced, reduced, reduced) {
        Outcome::SolvedInaccurate
    } else {
        certificate(problem, reduced, &scaling, &iterate).unwrap_or(ended)
    };
    Ok(best)
}

fn verdict(
    problem: &Problem,
    settings: &Settings,
    scaling: &Scaling,
    iterate: &Iterate,
    solution: &Solution,
) -> Option<Outcome> {
    if solution.residuals.within(settings.tol_feasibility, settings.tol_gap_abs, settings.tol_gap_rel) {
        return Some(Outcome::Solved);
    }
    certificate(problem, settings.tol_infeasible, scaling, iterate)
}

/// The iterate divided by tau, in the problem's own units.
fn judge(problem: &Problem, scaling: &Scaling, iterate: &Iterate) -> Solution {
    let inverse = 1.0 / iterate.tau;
    let mut x = scaling.x(&iterate.x);
    x.iter_mut().for_each(|v| *v *= inverse);
    let dual = iterate.dual(scaling, inverse);
    let objective = dot(&problem.cost, &x);
    let dual_objective = problem.dual_objective(&dual);
    let gap_abs = (objective - dual_objective).abs();
    let residuals = Residuals {
        primal: primal_violation(problem, &x),
        dual: norm(&problem.dual_residual(1.0, &dual)) / (1.0 + norm(&problem.cost)),
        gap_abs,
        gap_rel: gap_abs / (1.0 + objective.abs().min(dual_objective.abs())),
    };
    let outcome = Outcome::IterationLimit;
    Solution { outcome, x, objective, dual, dual_objective, residuals, iterations: iterate.steps }
}

fn primal_violation(problem: &Problem, x: &[f64]) -> f64 {
    let mut worst = 0.0f64;
    for (k, block) in problem.matrices.iter().enumerate() {
        let unit = 1.0 + block.constant.largest(block.order);
        let f = problem.matrix_at(k, x);
        // Eigenvalues of a matrix that holds NaN do not exist; that is as bad as can be.
        let least = match crate::linalg::symmetric_eigenvalues(&f) {
            Ok(values) => values.first().copied().unwrap_or(0.0),
            Err(_) => f64::NEG_INFINITY,
        };
        worst = worst.max(-least / unit);
    }
    for (k, block) in problem.linear.iter().enumerate() {
        let unit = 1.0 + block.constant.iter().fold(0.0f64, |a, c| a.max(c.abs()));
        worst = problem.linear_at(k, x).iter().fold(worst, |w, v| w.max(-v / unit));
    }
    let unit = 1.0 + norm(&problem.rhs);
    let image = &problem.equality * Mat::from_column_slice(x.len(), 1, x);
    image.iter().zip(&problem.rhs).fold(worst, |w, (a, b)| w.max((a - b).abs() / unit))
}

/// A certificate of infeasibility whose residual is within the tolerance, if the iterate is one.
fn certificate(problem: &Problem, tolerance: f64, scaling: &Scaling, iterate: &Iterate) -> Option<Outcome> {
    let x = scaling.x(&iterate.x);
    let fall = -dot(&problem.cost, &x);
    if fall > 0.0 {
        let ray: Vec<f64> = x.iter().map(|v| v / fall).collect();
        if ray_violation(problem, &ray) <= tolerance {
            return Some(Outcome::DualInfeasible { certificate: ray });
        }
    }
    let dual = iterate.dual(scaling, 1.0);
    let rise = problem.dual_objective(&dual);
    if rise > 0.0 {
        let ray = iterate.dual(scaling, 1.0 / rise);
        let size = 1.0 + largest_term(problem);
        if norm(&problem.dual_residual(0.0, &ray)) <= tolerance * size {
            return Some(Outcome::PrimalInfeasible { certificate: ray });
        }
    }
    None
}

fn largest_term(problem: &Problem) -> f64 {
    let matrices = problem.matrices.iter().flat_map(|b| b.terms.iter().map(|(_, t)| t.largest(b.order)));
    matrices
        .chain(problem.linear.iter().flat_map(|b| b.entries.iter().map(|e| e.2.abs())))
        .fold(0.0, f64::max)
}

/// Violation of `F x >= 0`, `A x = 0` (no constants).
fn ray_violation(problem: &Problem, x: &[f64]) -> f64 {
    let mut homogeneous = problem.clone();
    homogeneous.matrices.iter_mut().for_each(|b| b.constant = super::Coefficient::zero());
    homogeneous.linear.iter_mut().for_each(|b| b.constant.fill(0.0));
    homogeneous.rhs.fill(0.0);
    primal_violation(&homogeneous, x)
}

/// A point of the embedding (scaled problem).
#[derive(Debug, Clone)]
struct Iterate {
    x: Vec<f64>,
    lambda: Vec<f64>,
    s: Element,
    z: Element,
    f0: Element,
    tau: f64,
    kappa: f64,
    steps: usize,
}

struct Residue {
    rp: Element,
    rd: Vec<f64>,
    re: Vec<f64>,
    rg: f64,
}

struct Direction {
    x: Vec<f64>,
    lambda: Vec<f64>,
    s: Element,
    z: Element,
    tau: f64,
    kappa: f64,
}

/// Everything about the present point that both solves of a step share.
struct Frame<'a> {
    newton: Newton<'a>,
    inverse: Element,
    residue: Residue,
    /// `H(F0)`-image in the unknowns and its own size.
    h: Vec<f64>,
    f00: f64,
    pull: (Vec<f64>, Vec<f64>),
}

impl Iterate {
    fn new(problem: &Problem) -> Self {
        Self {
            x: vec![0.0; problem.unknowns()],
            lambda: vec![0.0; problem.rhs.len()],
            s: Element::identity(problem),
            z: Element::identity(problem),
            f0: Element::constants(problem),
            tau: 1.0,
            kappa: 1.0,
            steps: 0,
        }
    }

    fn dual(&self, scaling: &Scaling, factor: f64) -> Dual {
        let mut z = self.z.clone();
        z.scale(factor);
        let equalities = self.lambda.iter().map(|l| l * factor).collect();
        scaling.dual(&Dual { matrices: z.matrices, vectors: z.vectors, equalities })
    }

    fn mu(&self) -> f64 {
        (self.s.inner(&self.z) + self.tau * self.kappa) / (self.s.order() + 1) as f64
    }

    fn residue(&self, problem: &Problem) -> Residue {
        let mut rp = Element::image(problem, &self.x);
        rp.add(self.tau, &self.f0);
        rp.add(-1.0, &self.s);
        let image = self.z.adjoint(problem);
        let a = &problem.equality;
        let rd = (0..self.x.len())
            .map(|i| problem.cost[i] * self.tau - image[i] - dot(a.column(i).as_slice(), &self.lambda));
        let re = (0..self.lambda.len()).map(|r| {
            a.row(r).iter().zip(&self.x).map(|(a, x)| a * x).sum::<f64>() - problem.rhs[r] * self.tau
        });
        let rg = dot(&problem.cost, &self.x) + self.f0.inner(&self.z) - dot(&problem.rhs, &self.lambda)
            + self.kappa;
        Residue { rp, rd: rd.collect(), re: re.collect(), rg }
    }

    /// What falls steadily while there is progress, whichever way the problem ends.
    fn merit(&self, problem: &Problem) -> f64 {
        let r = self.residue(problem);
        let size = self.tau.max(self.kappa);
        (r.rp.norm() + norm(&r.rd) + norm(&r.re) + r.rg.abs() + self.mu()) / size
    }

    fn step(&mut self, problem: &Problem, settings: &Settings) -> Result<(), LinalgError> {
        let frame = self.frame(problem)?;
        let mu = self.mu();
        let affine = self.direction(problem, &frame, 0.0, 0.0, None);
        let reach = self.reach(&affine)?.min(1.0);
        let sigma = ((1.0 - reach).powi(2) * (1.0 - 0.5 * reach)).clamp(1e-6, 0.9);
        let full = self.direction(problem, &frame, sigma, sigma * mu, Some(&affine));
        let fraction = settings.step_fraction.min(0.9 + 0.09 * reach);
        let alpha = (fraction * self.reach(&full)?).min(1.0);
        self.advance(&full, alpha)
    }

    fn frame<'a>(&self, problem: &'a Problem) -> Result<Frame<'a>, LinalgError> {
        let inverse = self.s.inverse()?;
        let matrix = newton::assemble(problem, &inverse, &self.z);
        let newton = Newton::new(matrix, &problem.equality)?;
        let image = self.f0.between(&inverse, &self.z);
        let h = image.adjoint(problem);
        let f00 = image.inner(&self.f0);
        let push: Vec<f64> = problem.cost.iter().zip(&h).map(|(c, h)| -(c + h)).collect();
        let pull = newton.solve(&push, &problem.rhs);
        Ok(Frame { newton, inverse, residue: self.residue(problem), h, f00, pull })
    }

    /// The direction with centering `sigma` and target `sigma_mu`, corrected by a predictor's products.
    fn direction(
        &self,
        problem: &Problem,
        frame: &Frame<'_>,
        sigma: f64,
        sigma_mu: f64,
        predictor: Option<&Direction>,
    ) -> Direction {
        let eta = 1.0 - sigma;
        let r = &frame.residue;
        // Target of the dual step without its dependence on dS.
        let mut target = frame.inverse.clone();
        target.scale(sigma_mu);
        target.add(-1.0, &self.z);
        let mut rk = sigma_mu - self.kappa * self.tau;
        if let Some(p) = predictor {
            target.add(-1.0, &p.s.between(&frame.inverse, &p.z));
            rk -= p.tau * p.kappa;
        }
        let mut constant = target;
        constant.add(-eta, &r.rp.between(&frame.inverse, &self.z));
        let image = constant.adjoint(problem);
        let p: Vec<f64> = image.iter().zip(&r.rd).map(|(a, d)| a - eta * d).collect();
        let q: Vec<f64> = r.re.iter().map(|e| -eta * e).collect();
        let (u2, v2) = frame.newton.solve(&p, &q);
        let (u1, v1) = &frame.pull;
        let lean = |u: &[f64], v: &[f64]| dot(&problem.cost, u) - dot(&frame.h, u) - dot(&problem.rhs, v);
        let top = -eta * r.rg - self.f0.inner(&constant) - rk / self.tau - lean(&u2, &v2);
        let tau = top / (lean(u1, v1) - frame.f00 - self.kappa / self.tau);
        let x: Vec<f64> = u1.iter().zip(&u2).map(|(a, b)| a * tau + b).collect();
        let lambda = v1.iter().zip(&v2).map(|(a, b)| a * tau + b).collect();
        let mut s = Element::image(problem, &x);
        s.add(tau, &self.f0);
        let mut z = constant;
        z.add(-1.0, &s.between(&frame.inverse, &self.z));
        s.add(eta, &r.rp);
        Direction { x, lambda, s, z, tau, kappa: (rk - self.kappa * tau) / self.tau }
    }

    fn reach(&self, d: &Direction) -> Result<f64, LinalgError> {
        let mut reach = self.s.reach(&d.s)?.min(self.z.reach(&d.z)?);
        for (value, change) in [(self.tau, d.tau), (self.kappa, d.kappa)] {
            if change < 0.0 {
                reach = reach.min(-value / change);
            }
        }
        Ok(reach)
    }

    fn advance(&mut self, d: &Direction, alpha: f64) -> Result<(), LinalgError> {
        let finite = d.x.iter().all(|v| v.is_finite()) && d.tau.is_finite() && d.kappa.is_finite();
        if !finite || alpha.is_nan() || alpha < SHORTEST_STEP {
            let rows = self.x.len();
            return Err(LinalgError::NotFinite { routine: "interior-point step", rows, cols: 1 });
        }
        self.x.iter_mut().zip(&d.x).for_each(|(x, d)| *x += alpha * d);
        self.lambda.iter_mut().zip(&d.lambda).for_each(|(l, d)| *l += alpha * d);
        self.s.add(alpha, &d.s);
        self.z.add(alpha, &d.z);
        self.tau += alpha * d.tau;
        self.kappa += alpha * d.kappa;
        self.steps += 1;
        self.normalise();
        Ok(())
    }

    /// The embedding is homogeneous: keep `max(tau, kappa)` near one, so that nothing over- or underflows.
    fn normalise(&mut self) {
        let factor = 1.0 / self.tau.max(self.kappa);
        if (0.01..100.0).contains(&factor) {
            return;
        }
        self.x.iter_mut().for_each(|x| *x *= factor);
        self.lambda.iter_mut().for_each(|l| *l *= factor);
        self.s.scale(factor);
        self.z.scale(factor);
        self.tau *= factor;
        self.kappa *= factor;
    }
}
