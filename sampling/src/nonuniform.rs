//! Nonuniform samples with bounded errors of value and position (jitter).
//!
//! The model of the thesis (sections 3.2 and 3.4): a sample is taken at x + mu instead of x and has the
//! value f(x + mu) + e, with |e| <= E and |mu| <= B known.

/// One sample as a measurement: nominal position, value, and a bound on the error of each.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// Nominal position.
    pub x: f64,
    /// Measured value.
    pub value: f64,
    /// Bound of the error of the value, >= 0.
    pub error: f64,
    /// Bound of the jitter of the position, >= 0, in units of x.
    pub jitter: f64,
}

impl Measured {
    /// error^2 + slope^2 jitter^2: a displacement of the position has the effect of a value error of |f'|
    /// times the displacement.
    pub fn variance(&self, square_slope: f64) -> f64 {
        self.error * self.error + square_slope * self.jitter * self.jitter
    }

    /// Weight for a least-squares fit: 1 / (error^2 + (slope jitter)^2), `slope` a typical |f'|.
    ///
    /// The floor keeps the weight of a perfect sample finite: 1 / floor^2.
    pub fn weight(&self, slope: f64, floor: f64) -> f64 {
        1.0 / (self.variance(slope * slope) + floor.powi(2))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn exact(x: f64, value: f64) -> Measured {
        Measured { x, value, error: 0.0, jitter: 0.0 }
    }

    #[test]
    fn weights_fall_with_error_and_jitter() {
        let good = exact(0.0, 1.0).weight(10.0, 0.1);
        let noisy = Measured { error: 0.3, ..exact(0.0, 1.0) }.weight(10.0, 0.1);
        let shaky = Measured { jitter: 0.03, ..exact(0.0, 1.0) }.weight(10.0, 0.1);
        assert!((good - 100.0).abs() < 1e-9);
        assert!((noisy - 10.0).abs() < 1e-9 && (noisy - shaky).abs() < 1e-9);
    }
}
