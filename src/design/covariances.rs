//! Covariances of the front ends' outputs for white noise of unit density at the analog input, exact or
//! averaged over Gaussian errors of the instants.
//!
//! With x the joint analog state and X its covariance, `c(t) = E[y(s + t) y(s)'] = C e^{A t} X C'` for t >=
//! 0, and c(-t) = c(t)'. Two instants that are off by independent Gaussian errors have the covariance `E
//! c(t + d)`, d of the variance of their difference: the average multiplies the cross-spectrum by the
//! characteristic function. It is a sum over Gauss-Legendre panels that begin at the kink of c at t = 0.

use super::DesignError;
use super::lifting::JointState;
use super::problem::Problem;
use crate::linalg::GAUSS_LEGENDRE;
use crate::linalg::{self, Complex, Mat};
use crate::lti::gramian::controllability_root;
use crate::units::FastPeriods;
use std::f64::consts::TAU;

/// Deviations beyond which a Gaussian counts as zero: 2e-19 of its power lies outside.
const GAUSSIAN_REACH: f64 = 9.0;
/// Panels grow by this factor from the kink on, where fast poles still matter.
const PANEL_GROWTH: f64 = 1.5;
/// Least width of a panel over the deviation. Oscillations that are faster average out.
const LEAST_PANEL: f64 = 1.0 / 256.0;
/// Share of the power of a sample below which the difference of two covariances loses the digits of jitter.
const RESOLVED_SHARE: f64 = 1e-9;

/// The covariances of all front ends of a problem.
pub(crate) struct Covariances {
    joint: JointState,
    /// X C', one column for each front end.
    inputs: Mat,
    /// Var(C A x): of the derivatives, as far as the state determines them.
    slopes: Vec<f64>,
    poles: Vec<Complex<f64>>,
}

/// Covariances averaged over Gaussian differences of one deviation.
pub(crate) struct Averaged<'a> {
    covariances: &'a Covariances,
    deviation: f64,
    /// Of the panels in [0, 2 GAUSSIAN_REACH deviation].
    nodes: Vec<Node>,
    /// The state's part of the average at [`GAUSSIAN_REACH`]: e^{A u} X C' averaged over the Gaussian.
    far: Mat,
}

/// A node of the quadrature.
struct Node {
    time: f64,
    weight: f64,
    /// c at this time.
    value: Mat,
}

impl Covariances {
    /// Of the front ends of `problem`, after the signal's filter.
    ///
    /// # Errors
    /// [`DesignError`] if a decomposition fails or a front end is not stable.
    pub(crate) fn new(problem: &Problem) -> Result<Self, DesignError> {
        let joint = JointState::new(problem);
        let (transition, input) = joint.over(problem.ratio as f64);
        let root = controllability_root(&transition, &input)?;
        let slopes = joint.slopes() * &root;
        let mut poles = problem.signal.as_ref().map_or(Ok(Vec::new()), |w| linalg::eigenvalues(w.a()))?;
        for front_end in &problem.front_ends {
            poles.extend(linalg::eigenvalues(front_end.a())?);
        }
        Ok(Self {
            inputs: &root * (joint.c() * &root).transpose(),
            slopes: slopes.row_iter().map(|row| row.norm_squared()).collect(),
            joint,
            poles,
        })
    }

    /// The mean square of the output of a front end.
    pub(crate) fn power(&self, front_end: usize) -> f64 {
        (self.joint.c().row(front_end) * self.inputs.column(front_end))[0]
    }

    /// Mean square of the change of a front end's output over a Gaussian time of this deviation:
    /// `2 (c(0) - E c(d))`, for small ones the variance of the derivative times the square of the deviation.
    pub(crate) fn change(&self, front_end: usize, deviation: FastPeriods) -> f64 {
        if deviation.0 == 0.0 {
            return 0.0;
        }
        let power = self.power(front_end);
        let difference = 2.0 * (power - self.averaged(deviation).at(front_end, front_end, 0.0));
        if difference > RESOLVED_SHARE * power {
            return difference;
        }
        difference.max(self.slopes[front_end] * deviation.0 * deviation.0)
    }

    /// The averages over differences of this deviation; 0 for exact instants.
    pub(crate) fn averaged(&self, deviation: FastPeriods) -> Averaged<'_> {
        let mut averaged = Averaged {
            covariances: self,
            deviation: deviation.0,
            nodes: Vec::new(),
            far: self.inputs.clone(),
        };
        if deviation.0 > 0.0 {
            averaged.tabulate();
        }
        averaged
    }

    /// Widths of panels that cover [0, length]: short at the kink, then limited by oscillations.
    fn panels(&self, deviation: f64, length: f64) -> Vec<f64> {
        let fastest = |part: fn(&Complex<f64>) -> f64| self.poles.iter().map(part).fold(0.0, f64::max);
        let (size, oscillation) = (fastest(|pole| pole.norm()), fastest(|pole| pole.im.abs()));
        let within = |rate: f64| deviation.min(1.0 / rate);
        let widest = within(oscillation).max(LEAST_PANEL * deviation);
        let (mut widths, mut covered, mut width) = (Vec::new(), 0.0, within(size).min(widest));
        while covered < length {
            let next = width.min(length - covered);
            widths.push(next);
            covered += next;
            width = (PANEL_GROWTH * width).min(widest);
        }
        widths
    }
}

impl Averaged<'_> {
    fn tabulate(&mut self) {
        let joint = &self.covariances.joint;
        let (mut time, mut state) = (0.0, self.covariances.inputs.clone());
        let mut known: Option<(f64, Vec<Mat>)> = None;
        self.far = Mat::zeros(state.nrows(), state.ncols());
        for width in self.covariances.panels(self.deviation, 2.0 * GAUSSIAN_REACH * self.deviation) {
            let transitions = match known.take() {
                Some((same, transitions)) if same == width => transitions,
                _ => GAUSS_LEGENDRE
                    .iter()
                    .map(|node| node.0)
                    .chain([1.0])
                    .map(|part| joint.transition(part * width))
                    .collect(),
            };
            for ((part, share), transition) in GAUSS_LEGENDRE.into_iter().zip(&transitions) {
                let (at, weight, moved) = (time + part * width, share * width, transition * &state);
                self.far += &moved * (weight * self.density(at - GAUSSIAN_REACH * self.deviation));
                self.nodes.push(Node { time: at, weight, value: joint.c() * moved });
            }
            state = &transitions[GAUSS_LEGENDRE.len()] * state;
            time += width;
            known = Some((width, transitions));
        }
    }

    fn density(&self, difference: f64) -> f64 {
        let x = difference / self.deviation;
        (-0.5 * x * x).exp() / (self.deviation * TAU.sqrt())
    }

    /// E[y_a(s + t + d) y_b(s)].
    pub(crate) fn at(&self, a: usize, b: usize, t: f64) -> f64 {
        if t < 0.0 {
            return self.at(b, a, -t);
        }
        let joint = &self.covariances.joint;
        let beyond = t - GAUSSIAN_REACH * self.deviation;
        if beyond >= 0.0 {
            let state = joint.transition(beyond) * self.far.column(b);
            return (joint.c().row(a) * state)[0];
        }
        let term = |node: &Node| {
            let after = node.value[(a, b)] * self.density(node.time - t);
            let before = node.value[(b, a)] * self.density(node.time + t);
            node.weight * (after + before)
        };
        self.nodes.iter().map(term).sum()
    }
}

#[cfg(test)]
mod tests;
