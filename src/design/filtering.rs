//! A-posteriori filtering: the best causal estimate of z from y for a blocked plant, in the worst-case
//! (H-infinity) or mean-square (H2) sense, by one Riccati equation (thesis 5.3; Hassibi, Sayed,
//! Kailath, "Indefinite-Quadratic Estimation and Control", 1999, ch. 4).

use super::DesignError;
use super::equivalence::BlockedPlant;
use crate::linalg::{self, Mat};
use crate::lti::gramian::controllability_root;
use crate::lti::riccati::{self, RiccatiOutcome, RiccatiSolution};
use crate::lti::{LtiError, StateSpace};

/// A measurement whose fresh information is below this fraction of its size (a channel that is whole
/// ticks late has none) gets white noise in the Riccati equation and nowhere else: gamma is always
/// computed without it.
const INNOVATION_FLOOR: f64 = 1e-9;
/// That noise as a fraction of the gamma that is aimed at: noise sigma costs at most
/// sqrt(gamma^2 + sigma^2 ||F||^2), 5e-9 relative for filters of gain one.
const NOISE_TO_GAMMA: f64 = 1e-4;
/// The least noise, as a fraction of the measurement: the weight 1 / noise^2 must stay invertible.
const LEAST_NOISE: f64 = 1e-8;
/// A verdict "impossible" is believed up to this relative residual of the Riccati equation.
const RESIDUAL_OF_PROOF: f64 = 1e-7;
/// Eigenvalues of a semidefinite matrix may fall this far (relative) below zero by rounding.
const ROUNDING: f64 = 1e-9;

/// The plant with the measured inputs taken out: with y = L (C2 x + u1) and yw = L^-1 y,
///
/// x+ = F x + B1 yw + B2 u2,  yw = C2 x + u1,  z = C1 x + X yw + Y u2.
///
/// The samples are nearly noise-free, so the square D2 D2' may be as ill-conditioned as 1e22; here it
/// never appears, only its triangular root L.
#[derive(Debug, Clone)]
pub(super) struct Innovations {
    f: Mat,
    b1: Mat,
    b2: Mat,
    c1: Mat,
    c2: Mat,
    x: Mat,
    y: Mat,
    /// N x N lower triangular: y = root * yw.
    root: Mat,
}

/// A filter xh+ = a xh + b y, zh = c xh + d y.
pub(super) type Filter = StateSpace;

/// What one gamma came to.
#[derive(Debug, Clone)]
pub(super) enum Trial {
    /// A stable filter that achieves it.
    Achieved(Filter),
    /// The stabilising solution exists and has the wrong inertia: no filter achieves it.
    Impossible,
    /// The numerics say nothing.
    Unresolved,
}

impl Innovations {
    /// Separates fresh information (u1) from the rest (u2) by one LQ factorisation of [D2; D1].
    /// `aim` is a lower bound of the gammas that will be tried.
    pub(super) fn new(plant: &BlockedPlant, aim: f64) -> Result<Self, DesignError> {
        let system = &plant.system;
        let noise = stabilising_noise(plant, aim)?;
        let (measured, wanted) = (plant.measured, plant.wanted);
        let inputs = system.inputs();
        let mut d = Mat::zeros(measured + wanted, inputs + measured);
        d.columns_mut(0, inputs).copy_from(system.d());
        let mut b = Mat::zeros(system.order(), inputs + measured);
        b.columns_mut(0, inputs).copy_from(system.b());
        for (i, sigma) in noise.into_iter().enumerate() {
            d[(i, inputs + i)] = sigma;
        }
        Ok(Self::separate(plant, &b, &d))
    }

    fn separate(plant: &BlockedPlant, b: &Mat, d: &Mat) -> Self {
        let (measured, wanted, n) = (plant.measured, plant.wanted, plant.system.order());
        let (p, inputs) = (measured + wanted, d.ncols());
        // [D; B] = L Q: in the rotated inputs D is lower triangular and B has at most p + n columns.
        let mut stacked = Mat::zeros(p + n, inputs);
        stacked.rows_mut(0, p).copy_from(d);
        stacked.rows_mut(p, n).copy_from(b);
        let l = linalg::lq_factor(&stacked);
        let rest = l.ncols() - measured;
        let root = l.view((0, 0), (measured, measured)).into_owned();
        let b1 = l.view((p, 0), (n, measured)).into_owned();
        let b2 = l.view((p, measured), (n, rest)).into_owned();
        let x = l.view((measured, 0), (wanted, measured)).into_owned();
        let y = l.view((measured, measured), (wanted, rest)).into_owned();
        let c2 = linalg::solve_lower(&root, &plant.system.c().rows(0, measured).into_owned());
        let c1 = plant.system.c().rows(measured, wanted) - &x * &c2;
        let f = plant.system.a() - &b1 * &c2;
        Self { f, b1, b2, c1, c2, x, y, root }
    }

    /// No causal filter beats the part of z that is fresh and unmeasured: sigma_max(Y).
    pub(super) fn fresh_error(&self) -> Result<f64, DesignError> {
        if self.y.is_empty() {
            return Ok(0.0);
        }
        Ok(linalg::singular_values(&self.y)?[0])
    }

    /// The mean-square optimal (Kalman) filter: gamma to infinity.
    pub(super) fn h2(&self) -> Option<Filter> {
        let g = self.c2.transpose() * &self.c2;
        let h = &self.b2 * self.b2.transpose();
        match riccati::solve_doubling(&self.f.transpose(), &g, &h) {
            RiccatiOutcome::Solved(solution) => self.filter(&solution.x),
            RiccatiOutcome::Unresolved { .. } => None,
        }
    }

    /// Tries one gamma.
    pub(super) fn h_infinity(&self, gamma: f64) -> Trial {
        let Some((f, g, h, slack)) = self.weights(gamma) else {
            return Trial::Impossible;
        };
        match riccati::solve_doubling(&f.transpose(), &g, &h) {
            RiccatiOutcome::Solved(solution) => self.judge(&solution, &slack),
            RiccatiOutcome::Unresolved { .. } => Trial::Unresolved,
        }
    }

    /// (F, G, H) of the Riccati equation P = F P (I + G P)^-1 F' + H and E = gamma^2 I - Y Y' > 0;
    /// `None` when E is not positive.
    fn weights(&self, gamma: f64) -> Option<(Mat, Mat, Mat, Mat)> {
        let wanted = self.y.nrows();
        let slack = Mat::identity(wanted, wanted) * (gamma * gamma) - &self.y * self.y.transpose();
        linalg::cholesky(&slack).ok()?;
        let mut right = Mat::zeros(wanted, self.c1.ncols() + self.y.ncols());
        right.columns_mut(0, self.c1.ncols()).copy_from(&self.c1);
        right.columns_mut(self.c1.ncols(), self.y.ncols()).copy_from(&self.y);
        let solved = linalg::solve_positive(&slack, &right).ok()?;
        let (ec, ey) = (solved.columns(0, self.c1.ncols()), solved.columns(self.c1.ncols(), self.y.ncols()));
        let by = &self.b2 * self.y.transpose();
        let f = &self.f + &by * ec;
        let g = self.c2.transpose() * &self.c2 - self.c1.transpose() * ec;
        let h = &self.b2 * self.b2.transpose() + &by * ey * self.b2.transpose();
        Some((f, linalg::symmetric_part(&g), linalg::symmetric_part(&h), slack))
    }

    /// Achieved iff P >= 0 and C1 P+ C1' < E, P+ = P - P C2' Ry^-1 C2 P the a-posteriori covariance.
    fn judge(&self, solution: &RiccatiSolution, slack: &Mat) -> Trial {
        let p = &solution.x;
        let refused =
            if solution.residual < RESIDUAL_OF_PROOF { Trial::Impossible } else { Trial::Unresolved };
        let Ok(eigenvalues) = linalg::symmetric_eigenvalues(p) else { return Trial::Unresolved };
        let largest = eigenvalues.iter().fold(0.0_f64, |m, e| m.max(e.abs()));
        if eigenvalues.first().is_some_and(|&least| least < -ROUNDING * largest) {
            return refused;
        }
        let posterior = self.posterior(p);
        let margin = slack - &self.c1 * posterior * self.c1.transpose();
        if linalg::cholesky(&margin).is_err() {
            return refused;
        }
        self.filter(p).map_or(Trial::Unresolved, Trial::Achieved)
    }

    fn posterior(&self, p: &Mat) -> Mat {
        let cp = &self.c2 * p;
        match linalg::solve_positive(&self.innovation(p), &cp) {
            Ok(gain) => p - cp.transpose() * gain,
            Err(_) => p.clone(),
        }
    }

    /// Ry = I + C2 P C2'.
    fn innovation(&self, p: &Mat) -> Mat {
        linalg::symmetric_part(&(&self.c2 * p * self.c2.transpose()))
            + Mat::identity(self.c2.nrows(), self.c2.nrows())
    }

    /// The central filter of a covariance: gains K = F P C2' Ry^-1 and Df = C1 P C2' Ry^-1.
    fn filter(&self, p: &Mat) -> Option<Filter> {
        let pc = p * self.c2.transpose();
        let gain = linalg::solve_positive(&self.innovation(p), &pc.transpose()).ok()?.transpose();
        let k = &self.f * &gain;
        let df = &self.c1 * &gain;
        let a = &self.f - &k * &self.c2;
        let c = &self.c1 - &df * &self.c2;
        let b = self.unwhiten(&(&self.b1 + k));
        let d = self.unwhiten(&(&self.x + df));
        if linalg::spectral_radius(&a).ok()? >= 1.0 {
            return None;
        }
        StateSpace::new(a, b, c, d).ok()
    }

    /// m root^-1: from gains on yw to gains on y.
    fn unwhiten(&self, m: &Mat) -> Mat {
        let n = self.root.nrows();
        let flipped = |m: &Mat| Mat::from_fn(m.nrows(), m.ncols(), |i, j| m[(m.nrows() - 1 - i, j)]);
        // root' x = m' is upper triangular: turn both upside down to use the lower solver.
        let upper = Mat::from_fn(n, n, |i, j| self.root[(n - 1 - j, n - 1 - i)]);
        flipped(&linalg::solve_lower(&upper, &flipped(&m.transpose()))).transpose()
    }
}

/// Standard deviation of the noise that each measurement needs before its fresh part can be inverted.
fn stabilising_noise(plant: &BlockedPlant, aim: f64) -> Result<Vec<f64>, LtiError> {
    let system = &plant.system;
    let root = controllability_root(system.a(), system.b())?;
    let history = system.c() * root;
    let d2 = system.d().rows(0, plant.measured).into_owned();
    let fresh = linalg::lq_factor(&d2);
    Ok((0..plant.measured)
        .map(|i| {
            let size = history.row(i).norm().hypot(d2.row(i).norm());
            let innovation = if i < fresh.ncols() { fresh[(i, i)].abs() } else { 0.0 };
            if innovation < INNOVATION_FLOOR * size {
                (NOISE_TO_GAMMA * aim).max(LEAST_NOISE * size)
            } else {
                0.0
            }
        })
        .collect())
}
