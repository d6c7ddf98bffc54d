//! Covariances of the front ends' outputs for white noise of unit density at the analog input, and what
//! jitter makes of them.
//!
//! With x the joint analog state and X its covariance, `c(t) = E[y(s + t) y(s)] = C e^{A t} X C'` for t >=
//! 0, and c(-t) = c(t). Over a Gaussian time d an output changes by the mean square `2 (c(0) - E c(d))`.
//! That is a sum over Gauss-Legendre panels that begin at the kink of c at t = 0.

use super::DesignError;
use super::lifting::JointState;
use super::problem::Problem;
use crate::lti::gramian::controllability_root;
use hybank_core::units::FastPeriods;
use hybank_linalg::GAUSS_LEGENDRE;
use hybank_linalg::{Complex, Mat};
use std::f64::consts::TAU;

/// How the integrals of the covariances are cut.
struct Settings {
    /// Deviations beyond which a Gaussian counts as zero: 2e-19 of its power lies outside.
    gaussian_reach: f64,
    /// Panels grow by this factor from the kink on, where fast poles still matter.
    panel_growth: f64,
    /// Least width of a panel over the deviation. Oscillations that are faster average out.
    least_panel: f64,
    /// Share of the power of a sample below which the difference of two covariances loses the digits of
    /// jitter.
    resolved_share: f64,
}

/// Of every integral.
const SETTINGS: Settings =
    Settings { gaussian_reach: 9.0, panel_growth: 1.5, least_panel: 1.0 / 256.0, resolved_share: 1e-9 };

/// The covariances of all front ends of a problem.
pub(crate) struct Covariances {
    joint: JointState,
    /// X C', one column for each front end.
    inputs: Mat,
    /// Var(C A x): of the derivatives, as far as the state determines them.
    slopes: Vec<f64>,
    poles: Vec<Complex<f64>>,
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
        let slopes = &joint.slopes * &root;
        let mut poles =
            problem.signal.as_ref().map_or(Ok(Vec::new()), |w| hybank_linalg::eigenvalues(w.a()))?;
        for front_end in &problem.front_ends {
            poles.extend(hybank_linalg::eigenvalues(front_end.a())?);
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
        let difference = self.averaged_change(front_end, deviation.0);
        if difference > SETTINGS.resolved_share * power {
            return difference;
        }
        difference.max(self.slopes[front_end] * deviation.0 * deviation.0)
    }

    /// The change as a sum over panels.
    fn averaged_change(&self, front_end: usize, deviation: f64) -> f64 {
        let (output, power) = (self.joint.c().row(front_end), self.power(front_end));
        let density = |t: f64| (-0.5 * (t / deviation).powi(2)).exp() * 2.0 / (deviation * TAU.sqrt());
        let (mut time, mut state, mut sum) = (0.0, self.inputs.column(front_end).into_owned(), 0.0);
        for width in self.panels(deviation, SETTINGS.gaussian_reach * deviation) {
            for (part, share) in GAUSS_LEGENDRE {
                let covariance = (output * (self.joint.transition(part * width) * &state))[0];
                sum += share * width * density(time + part * width) * 2.0 * (power - covariance);
            }
            state = self.joint.transition(width) * state;
            time += width;
        }
        sum
    }

    /// Widths of panels that cover [0, length]: short at the kink, then limited by oscillations.
    fn panels(&self, deviation: f64, length: f64) -> Vec<f64> {
        let fastest = |part: fn(&Complex<f64>) -> f64| self.poles.iter().map(part).fold(0.0, f64::max);
        let (size, oscillation) = (fastest(|pole| pole.norm()), fastest(|pole| pole.im.abs()));
        let within = |rate: f64| deviation.min(1.0 / rate);
        let widest = within(oscillation).max(SETTINGS.least_panel * deviation);
        let (mut widths, mut covered, mut width) = (Vec::new(), 0.0, within(size).min(widest));
        while covered < length {
            let next = width.min(length - covered);
            widths.push(next);
            covered += next;
            width = (SETTINGS.panel_growth * width).min(widest);
        }
        widths
    }
}

#[cfg(test)]
mod tests;
