//! The exact derivatives of gamma with respect to the delays.
//!
//! Sample i is C_i x(kM - D_i), so its derivative with respect to D_i is -C_i A x at the same instant: H'_i
//! is the lifted plant with the output row C_i A in place of C_i, and dK/dD_i = F_i H'_i. At a simple peak
//! with the singular vectors u, v of K
//!
//! ```text
//! d gamma / d D_i = Re (u* F_i)(H'_i v).
//! ```
//!
//! [H; H'; W] share their input, so they are lifted together.

use super::super::lifting::lift_with_slopes;
use super::super::plant::LiftedPlant;
use super::super::problem::Problem;
use super::super::{DesignError, filters};
use crate::bank::Bank;
use crate::linalg::{self, Complex};
use crate::lti::FrequencyResponse;
use crate::lti::peak::peaks_above;
use crate::units::Hertz;
use crate::units::RadiansPerSlowPeriod;

/// Relative distance within which another peak makes gamma not differentiable.
const EQUAL_PEAKS: f64 = 1e-7;
/// Frequencies closer than this belong to one peak, in radians per slow period.
const SAME_PEAK: f64 = 1e-2;
/// c b relative to |c| |b| above which a front end has relative degree 1.
const DEGREE_ONE: f64 = 1e-12;

/// The derivatives of gamma with respect to the delays.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct DelayDerivatives {
    /// Change of gamma per fast period of each delay; not a number for front ends of relative degree 1,
    /// whose samples are not differentiable.
    pub per_fast_period: Vec<f64>,
    /// Frequency of the peak.
    pub peak_hertz: Hertz,
    /// The peak is the only one and has a single largest singular value. Otherwise the derivatives are those
    /// of one of several equal peaks.
    pub simple: bool,
}

/// The derivatives of the norm of `bank` with respect to its delays.
///
/// # Errors
/// As [`super::super::analyze`].
pub fn delay_derivatives(bank: &Bank) -> Result<DelayDerivatives, DesignError> {
    let problem = Problem::of_bank(bank)?;
    let plant = LiftedPlant::new(&problem);
    let peak = plant.bank_norm(&bank.filters)?;
    let (system, delays) = lift_with_slopes(&problem);
    let mut response = FrequencyResponse::new(&system).at_frequency(peak.frequency);
    for (mut row, &delay) in response.row_iter_mut().zip(&delays) {
        row *= Complex::from_polar(1.0, -peak.frequency * delay as f64);
    }
    let (n, m) = (plant.channels(), plant.ratio());
    let block = filters::lifted(&bank.filters, bank.ratio);
    let f = block.response_at(Complex::from_polar(1.0, peak.frequency));
    let k = response.rows(2 * n, m) - &f * response.rows(0, n);
    let svd = linalg::svd(&k)?;
    let (u, v) = (svd.u.column(0), svd.v.column(0));
    let derivative = |i: usize| {
        let front_end = &problem.front_ends[problem.channels[i].front_end];
        let feedthrough = problem.signal.as_ref().map_or(1.0, |signal| signal.d());
        let direct = (front_end.c() * front_end.b())[(0, 0)].abs();
        if feedthrough != 0.0 && direct > DEGREE_ONE * front_end.c().norm() * front_end.b().norm() {
            return f64::NAN;
        }
        let from_error: Complex<f64> = u.iter().zip(f.column(i).iter()).map(|(u, f)| u.conj() * f).sum();
        let slope: Complex<f64> = response.row(n + i).iter().zip(v.iter()).map(|(h, v)| h * v).sum();
        (from_error * slope).re
    };
    // The samples of a converter have one delay.
    let of_converter = |of: usize| {
        let own = (0..n).filter(|&i| problem.channels[i].converter == of);
        own.map(&derivative).sum::<f64>()
    };
    let converters = (0..bank.channel_count()).map(of_converter);
    let others = peaks_above(&plant.error_system(&block), peak.gain * (1.0 - EQUAL_PEAKS))?;
    let other = others.iter().any(|other| (other.frequency - peak.frequency).abs() > SAME_PEAK);
    let single = svd.s.get(1).is_none_or(|&second| second < peak.gain * (1.0 - EQUAL_PEAKS));
    Ok(DelayDerivatives {
        per_fast_period: converters.collect(),
        peak_hertz: RadiansPerSlowPeriod(peak.frequency).in_hertz(bank.slow_period()),
        simple: single && !other,
    })
}
