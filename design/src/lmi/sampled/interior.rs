//! One primal-dual predictor-corrector iteration, shared by both objectives.
//!
//! minimise `t` (or the weighted mean square with t fixed) subject to `S_l(t, x) >= 0`. The slacks are
//! functions of the unknowns, so the primal is feasible in every iteration; only the dual equality
//! `c - A*(Z) = 0` starts out violated.

use super::blocks::{Cone, SlackStep};
use super::newton::{self, ChannelProjection};
use super::prepare::Reduced;
use super::quadratic::Quadratic;
use crate::lmi::IsDue;
use crate::lmi::factor::RegularisedCholesky;
use crate::lmi::iteration::{self, StepLengths, centering};
use crate::lmi::settings::SETTINGS;
use hybank_linalg::Mat;
use hybank_linalg::blocks::Batch;

/// The objective.
#[derive(Debug, Clone)]
pub(super) enum Objective {
    /// `t`, itself an unknown.
    WorstCase,
    /// A quadratic function of the taps, with t fixed.
    MeanSquare(Quadratic),
}

/// The iterate.
pub(super) struct InteriorIterate<'a> {
    reduced: &'a Reduced,
    objective: Objective,
    /// The unknown taps in reduced coordinates.
    pub(super) x: Vec<f64>,
    pub(super) cone: Cone<'a>,
    curvature: Option<Mat>,
    is_due: IsDue<'a>,
}

/// A direction: taps, slack and dual matrices.
struct NewtonDirection {
    taps: Vec<f64>,
    slack: SlackStep,
}

impl<'a> InteriorIterate<'a> {
    /// Starts at the taps `x` with `t`, which must be above every `sigma_max(K_l)^2`; `None` otherwise.
    pub(super) fn new(
        reduced: &'a Reduced,
        objective: Objective,
        x: Vec<f64>,
        t: f64,
        is_due: IsDue<'a>,
    ) -> Option<Self> {
        let mut cone = Cone::new(t, reduced.error(&x), reduced.g.clone(), is_due);
        if !cone.invert() {
            return None;
        }
        let (curvature, start) = match &objective {
            Objective::WorstCase => (None, None),
            Objective::MeanSquare(quadratic) => {
                let gap = SETTINGS.starting_gap * quadratic.value(&cone.k, &x).max(f64::MIN_POSITIVE);
                (Some(quadratic.curvature(reduced)), Some(gap / cone.order() as f64))
            }
        };
        cone.center(start);
        Some(Self { reduced, objective, x, cone, curvature, is_due })
    }

    fn free_t(&self) -> bool {
        matches!(self.objective, Objective::WorstCase)
    }

    /// The value being minimised.
    pub(super) fn value(&self) -> f64 {
        match &self.objective {
            Objective::WorstCase => self.cone.t,
            Objective::MeanSquare(quadratic) => quadratic.value(&self.cone.k, &self.x),
        }
    }

    /// Gradient of the objective in the taps, then in t if that is free.
    fn cost(&self) -> Vec<f64> {
        match &self.objective {
            Objective::WorstCase => {
                let mut c = vec![0.0; self.x.len()];
                c.push(1.0);
                c
            }
            Objective::MeanSquare(quadratic) => quadratic.gradient(self.reduced, &self.cone.k, &self.x),
        }
    }

    /// `A*(Y)`: derivative of `sum <S_l, Y_l>` in the unknowns.
    fn adjoint(&self, y: &Batch) -> Vec<f64> {
        let (m, k1) = (self.cone.m, self.cone.k1);
        let mut off = Batch::zeros(y.count(), m, k1);
        for l in 0..y.count() {
            let block = y.block(l);
            let to = off.block_mut(l).data;
            (0..m * k1).for_each(|e| to[e] = -block.at(e % m, m + e / m));
        }
        let mut a = self.reduced.adjoint(&off);
        if self.free_t() {
            a.push(self.cone.trace(y));
        }
        a
    }

    /// `c - A*(Z)`.
    pub(super) fn dual_residual(&self) -> Vec<f64> {
        self.cost().iter().zip(self.adjoint(&self.cone.z)).map(|(c, a)| c - a).collect()
    }

    fn newton(&self) -> Option<RegularisedCholesky> {
        let Reduced { h, layout, phases, .. } = self.reduced;
        let taps = self.x.len();
        let order = taps + usize::from(self.free_t());
        let mut matrix = match &self.curvature {
            Some(q) => q.clone(),
            None => Mat::zeros(order, order),
        };
        let [x, z] = [&self.cone.x, &self.cone.z].map(|blocks| ChannelProjection::new(blocks, h));
        newton::add_taps(&mut matrix, layout, phases, &x, &z);
        if self.free_t() {
            let (row, corner) = newton::border(self.reduced, &x, &z);
            row.iter().enumerate().for_each(|(a, v)| matrix[(taps, a)] = *v);
            matrix[(taps, taps)] = corner;
        }
        RegularisedCholesky::new(matrix).ok()
    }

    fn direction(&self, newton: &RegularisedCholesky, rhs: &[f64]) -> NewtonDirection {
        let mut taps = newton.solve(rhs);
        let t = if self.free_t() { taps.pop().unwrap_or(0.0) } else { 0.0 };
        let mut k = self.reduced.image(&taps);
        k.as_mut_slice().iter_mut().for_each(|z| *z = -*z);
        NewtonDirection { taps, slack: SlackStep { t, k } }
    }

    /// One step; `None` if rounding errors prevent it or its end is due. The iterate changes only if all
    /// goes well.
    pub(super) fn step(&mut self) -> Option<()> {
        if !self.cone.invert() {
            return None;
        }
        let gap = self.cone.gap();
        let mu = gap / self.cone.order() as f64;
        let newton = self.newton().filter(|_| !(self.is_due)())?;
        let cost = self.cost();

        let minus_cost: Vec<f64> = cost.iter().map(|c| -c).collect();
        let affine = self.direction(&newton, &minus_cost);
        let dz = self.cone.dual_step(&affine.slack, 0.0, None);
        let predicted = self.max_steps(&affine, &dz, 1.0);
        let sigma = centering(self.gap_after(gap, &affine, &dz, predicted) / gap);

        let corrector = self.cone.corrector(&affine.slack, &dz);
        let (center, second) = (self.adjoint(&self.cone.x), self.adjoint(&corrector));
        let rhs: Vec<f64> = (0..cost.len()).map(|a| sigma * mu * center[a] - second[a] - cost[a]).collect();
        let full = self.direction(&newton, &rhs);
        let dz = self.cone.dual_step(&full.slack, sigma * mu, Some(&corrector));
        let fraction = iteration::fraction(predicted);
        let StepLengths { primal, dual } = self.max_steps(&full, &dz, 1.0 / fraction);
        let length = StepLengths { primal: fraction * primal, dual: fraction * dual };

        if (self.is_due)() { None } else { self.advance(&full, &dz, length) }
    }

    /// Step lengths to the boundary. With a quadratic objective the dual residual moves with the taps, so
    /// both take the shorter one.
    fn max_steps(&mut self, d: &NewtonDirection, dz: &Batch, most: f64) -> StepLengths {
        let primal = self.cone.max_primal_step(&d.slack, most);
        let dual = self.cone.max_dual_step(dz, most);
        let both = primal.min(dual);
        if self.free_t() { StepLengths { primal, dual } } else { StepLengths { primal: both, dual: both } }
    }

    fn gap_after(&self, gap: f64, d: &NewtonDirection, dz: &Batch, length: StepLengths) -> f64 {
        // <S, dZ> = <S, Z + dZ> - <S, Z>, and S itself is linear in (t, K) up to its constant part.
        let slack_dz = self.cone.inner_slack(dz);
        gap + length.primal * self.cone.inner(&d.slack, &self.cone.z)
            + length.dual * slack_dz
            + length.primal * length.dual * self.cone.inner(&d.slack, dz)
    }

    fn advance(&mut self, d: &NewtonDirection, dz: &Batch, length: StepLengths) -> Option<()> {
        let finite = d.taps.iter().all(|v| v.is_finite()) && d.slack.t.is_finite();
        if !finite || !length.make_progress() {
            return None;
        }
        for (x, dx) in self.x.iter_mut().zip(&d.taps) {
            *x += length.primal * dx;
        }
        self.cone.t += length.primal * d.slack.t;
        // From the unknowns, not from the step, so that rounding errors do not accumulate.
        self.cone.k = self.reduced.error(&self.x);
        self.cone.z.add_scaled(length.dual, dz);
        Some(())
    }
}

pub(super) fn norm(v: &[f64]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}
