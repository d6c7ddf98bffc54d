//! Superposed periodic sets: the samples that several cameras or converters, each with a period and a phase
//! of its own, take of one signal (thesis 3.3, the generalised Poisson process of Prop. 3.2 and 3.4).
//!
//! With periods p_i and independent, uniformly distributed phases, an interval of length t that is put
//! anywhere contains no sample with probability
//!
//! ```text
//! Q(t) = prod_i max(0, 1 - t / p_i),   lambda = sum_i 1 / p_i   (samples per unit length)
//! ```
//!
//! The set is stationary, so the interval D between neighbouring samples has P(D > t) = -Q'(t) / lambda
//! (Palm), and integration by parts gives its moments, exactly for every number of sets:
//!
//! ```text
//! E[D^k] = k (k - 1) / lambda  integral_0^{min p} t^{k-2} Q(t) dt   (k >= 2),    E[D] = 1 / lambda
//! ```
//!
//! For many sparse sets Q(t) tends to exp(-lambda t): the samples look like a Poisson process, with
//! E\[D^k\] = k! / lambda^k. A density that varies along the axis gives the sums of powers of all intervals:
//!
//! ```text
//! sum_m D_m^k ~= integral lambda(y) E[D^k](y) dy,   for Poisson  k! integral lambda(y)^{1-k} dy
//! ```
//!
//! Sets that share a phase, for example several cameras at one position, are not superposed sets: their
//! samples coincide, and N of them say no more than one.

use super::quadrature::gauss_legendre;
use hybank_sampling::SamplingError;
use std::ops::Range;

/// Periodic sample sets with independent phases, as one random sample set.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PeriodicSets {
    periods: Vec<f64>,
}

impl PeriodicSets {
    /// From the period of each set.
    ///
    /// # Errors
    /// [`SamplingError::Setting`] without any period, and for a period that is not positive and finite.
    pub(crate) fn new(periods: Vec<f64>) -> Result<Self, SamplingError> {
        let refuse = |name, value, rule| Err(SamplingError::Setting { name, value, rule });
        if periods.is_empty() {
            return refuse("number of periods", 0.0, "at least one");
        }
        match periods.iter().find(|p| !(p.is_finite() && **p > 0.0)) {
            Some(period) => refuse("period", *period, "a positive finite number"),
            None => Ok(Self { periods }),
        }
    }

    /// lambda, samples per unit length.
    pub(crate) fn density(&self) -> f64 {
        self.periods.iter().map(|p| 1.0 / p).sum()
    }

    /// E\[D^k\] of the interval D between neighbouring samples; exact up to rounding.
    pub(crate) fn moment(&self, k: u32) -> f64 {
        moment(&self.periods, k, &gauss_legendre(points(self.periods.len(), k)))
    }

    /// E\[D^k\] lambda^k / k!, which is 1 for a Poisson process. For N equal periods it is
    /// prod_{j<k} N / (N + j) (thesis Table 3.1).
    pub(crate) fn poisson_ratio(&self, k: u32) -> f64 {
        self.moment(k) * self.density().powi(k as i32) / factorial(k)
    }

    /// The samples in \[from, to), sorted: set i has samples at (n + phases\[i\]) p_i for all integers n.
    pub(crate) fn samples(&self, phases: &[f64], range: Range<f64>) -> Vec<f64> {
        let of_set = |(p, phase): (&f64, &f64)| {
            let (p, phase) = (*p, *phase);
            let first = (range.start / p - phase).ceil();
            (0..).map(move |n| (first + f64::from(n) + phase) * p).take_while(move |x| *x < range.end)
        };
        let mut samples: Vec<f64> = self.periods.iter().zip(phases).flat_map(of_set).collect();
        samples.sort_by(f64::total_cmp);
        samples
    }
}

/// Points with which the quadrature is exact: t^{k-2} Q(t) has degree N + k - 2.
fn points(sets: usize, k: u32) -> usize {
    (sets + k as usize) / 2 + 1
}

fn moment(periods: &[f64], k: u32, rule: &[(f64, f64)]) -> f64 {
    let density: f64 = periods.iter().map(|p| 1.0 / p).sum();
    match k {
        0 => 1.0,
        1 => 1.0 / density,
        _ => {
            let shortest = periods.iter().copied().fold(f64::INFINITY, f64::min);
            let void = |t: f64| periods.iter().map(|p| 1.0 - t / p).product::<f64>();
            let value = |t: f64| t.powi(k as i32 - 2) * void(t);
            let sum: f64 = rule.iter().map(|(t, w)| w * shortest * value(t * shortest)).sum();
            f64::from(k) * f64::from(k - 1) / density * sum
        }
    }
}

fn factorial(k: u32) -> f64 {
    (1..=k).map(f64::from).product()
}
