//! A value with its standard deviation.

use std::ops::{Add, Mul, Sub};

/// The half-width of a 95 % interval of a Gaussian in standard deviations.
const GAUSSIAN_95: f64 = 1.959_963_984_540_054;

/// An estimate with its standard deviation, in one unit.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Estimate<Q> {
    /// The value.
    pub value: Q,
    /// The standard deviation.
    pub sigma: Q,
}

impl<Q: Copy + Add<Output = Q> + Sub<Output = Q> + Mul<f64, Output = Q>> Estimate<Q> {
    /// The interval of 95 %, for Gaussian errors: value - 1.96 sigma, value + 1.96 sigma.
    pub fn interval_95(self) -> (Q, Q) {
        let half = self.sigma * GAUSSIAN_95;
        (self.value - half, self.value + half)
    }
}
