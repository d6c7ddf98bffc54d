//! What jitter makes of a sample.
//!
//! The output of a front end for white noise of unit density at the analog input has the spectrum |Phi W|^2.
//! Over a Gaussian time of deviation s it changes by the mean square
//!
//! ```text
//! (2 / pi) int_0^inf |Phi(j w) W(j w)|^2 (1 - e^{-(w s)^2 / 2}) dw.
//! ```

use super::problem::Problem;
use super::quadrature::half_line;
use hybank_core::units::{FastPeriods, RadiansPerFastPeriod};
use hybank_linalg::Complex;
use std::f64::consts::PI;

/// The integral ends at this multiple of the largest pole and of 1 / s: a front end of one pole passes 6e-10
/// of its power above.
const BEYOND: f64 = 1e9;
/// Largest 1 / s, radians per fast period: shorter jitter is nothing beside the rounding of samples.
const LARGEST_RATE: f64 = 1e15;

impl Problem {
    /// The mean square of the output of a front end.
    pub(crate) fn output_power(&self, front_end: usize) -> f64 {
        self.weighted_power(front_end, &[], &|_| 1.0)
    }

    /// Mean square of the change of a front end's output over a Gaussian time of this deviation.
    pub(super) fn change(&self, front_end: usize, FastPeriods(deviation): FastPeriods) -> f64 {
        if deviation == 0.0 {
            return 0.0;
        }
        // The exponential is smooth over 1 / s, as far as a pole there would be.
        let limit = [Complex::new(-(1.0 / deviation).min(LARGEST_RATE), 0.0)];
        self.weighted_power(front_end, &limit, &|w| -2.0 * (-0.5 * (w * deviation).powi(2)).exp_m1())
    }

    /// `(1 / pi) int_0^inf weight |Phi W|^2 dw`, for a weight that is as smooth as poles at `limits` allow.
    fn weighted_power(&self, front_end: usize, limits: &[Complex<f64>], weight: &dyn Fn(f64) -> f64) -> f64 {
        let signal = self.signal.iter().flat_map(|filter| filter.poles());
        let own = self.front_ends[front_end].poles().iter().chain(signal);
        let poles: Vec<Complex<f64>> = own.chain(limits).copied().collect();
        let end = BEYOND * poles.iter().map(|pole| pole.norm()).fold(0.0, f64::max);
        let power = |w: f64| weight(w) * self.response(front_end, RadiansPerFastPeriod(w)).norm_sqr();
        half_line(end, &poles).iter().map(|node| node.share * power(node.theta)).sum::<f64>() / PI
    }
}

#[cfg(test)]
mod tests;
