//! What no bank can do better over a box of errors.
//!
//! A shift common to all channels cannot be seen. If the box holds the delays D + d and D - d for all
//! channels, the input g advanced by d and the input g delayed by d give the same samples, so the same
//! output y. The errors are W g(. + d) - y and W g(. - d) - y; one of them is at least half their
//! difference:
//!
//! ```text
//! gamma >= max over theta of [ sum_k |Phi_0(j nu_k)|^2 sin^2(nu_k d) ]^(1/2),  nu_k = theta + 2 pi k,
//! ```
//!
//! for any bank, causal or not, linear or not (h = 1). Every theta and every finite sum gives a lower bound,
//! so the search for the maximum and the cut of the sum lose nothing but size. They are computed in double
//! precision, not proven.

use super::super::plant::LiftedPlant;
use super::super::{DesignError, problem::Problem};
use super::search::moved;
use crate::bank::Bank;
use crate::units::{FastPeriods, RadiansPerFastPeriod};
use crate::verify::uncertainty::{ErrorBox, ErrorPoint};
use std::f64::consts::PI;

/// Aliases on each side.
const ALIASES: i32 = 200;
/// Frequencies tried.
const FREQUENCIES: usize = 512;
/// Golden-section steps around the best one.
const STEPS: usize = 40;

/// Lower bounds of the worst case over a box, for all banks on these front ends (computed, h = 1).
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Floor {
    /// Of a common shift of all channels that the box allows; zero with a channel whose delay is certain.
    pub common_shift: f64,
    /// The noncausal bound at the worst point; `None` where delays are closer than doubles resolve.
    pub noncausal: Option<f64>,
}

impl Floor {
    /// The larger one.
    pub fn value(&self) -> f64 {
        self.common_shift.max(self.noncausal.unwrap_or(0.0))
    }
}

/// The floor of the box `errors`, whose worst point is `worst`.
///
/// # Errors
/// As [`super::super::analyze`].
pub fn floor(bank: &Bank, errors: &ErrorBox, worst: &ErrorPoint) -> Result<Floor, DesignError> {
    let problem = Problem::of_bank(bank)?;
    let half =
        errors.delays.iter().map(|d| d.in_fast_periods(bank.fast_period).0).fold(f64::INFINITY, f64::min);
    let common_shift = common_shift(&problem, FastPeriods(half));
    let there = moved(bank, worst)?;
    let noncausal =
        if there.resolves_delays() { Some(LiftedPlant::new(&there).noncausal_bound()?.gain) } else { None };
    Ok(Floor { common_shift, noncausal })
}

fn common_shift(problem: &Problem, half: FastPeriods) -> f64 {
    if half.0 == 0.0 || !half.0.is_finite() {
        return 0.0;
    }
    let value = |theta: f64| shifted(problem, theta, half.0);
    let step = PI / FREQUENCIES as f64;
    let best = (0..=FREQUENCIES).max_by(|&a, &b| value(a as f64 * step).total_cmp(&value(b as f64 * step)));
    let centre = best.unwrap_or(0) as f64 * step;
    let (mut low, mut high) = ((centre - step).max(0.0), (centre + step).min(PI));
    let mut most = value(centre);
    for _ in 0..STEPS {
        let (a, b) = (low + 0.382 * (high - low), high - 0.382 * (high - low));
        let (at_a, at_b) = (value(a), value(b));
        most = most.max(at_a).max(at_b);
        if at_a < at_b { low = a } else { high = b }
    }
    most
}

fn shifted(problem: &Problem, theta: f64, half: f64) -> f64 {
    let term = |k: i32| {
        let nu = theta + 2.0 * PI * f64::from(k);
        problem.response(problem.target, RadiansPerFastPeriod(nu)).norm_sqr() * (nu * half).sin().powi(2)
    };
    (-ALIASES..=ALIASES).map(term).sum::<f64>().sqrt()
}
