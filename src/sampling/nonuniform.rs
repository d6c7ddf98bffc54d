//! Nonuniform samples with bounded errors of value and position (jitter).
//!
//! The model of the thesis (sections 3.2 and 3.4): a sample is taken at x + mu instead of x and has the
//! value f(x + mu) + e, with |e| <= E and |mu| <= B known.

use super::error::SamplingError;

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
    /// Weight for a least-squares fit: 1 / (error^2 + (slope jitter)^2), `slope` a typical |f'|.
    ///
    /// A displacement of the position has the effect of a value error of |f'| times the displacement. The
    /// floor keeps the weight of a perfect sample finite: 1 / floor^2.
    pub fn weight(&self, slope: f64, floor: f64) -> f64 {
        1.0 / (self.error.powi(2) + (slope * self.jitter).powi(2) + floor.powi(2))
    }
}

/// Bounds of the function that is sampled, on the hull of the samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Smoothness {
    /// sup |f'|.
    pub slope: f64,
    /// sup |f''|.
    pub curvature: f64,
}

/// Piecewise linear interpolation through measured samples, with its error bound (Prop. 3.1).
#[derive(Debug, Clone, PartialEq)]
pub struct PiecewiseLinear {
    samples: Vec<Measured>,
}

impl PiecewiseLinear {
    /// From samples in any order; samples at equal positions keep their order.
    ///
    /// # Errors
    /// [`SamplingError::NotFinite`] for a position or value that is not finite, and
    /// [`SamplingError::Setting`] when there is no sample.
    pub fn new(mut samples: Vec<Measured>) -> Result<Self, SamplingError> {
        for (index, s) in samples.iter().enumerate() {
            let broken = |name, value| Err(SamplingError::NotFinite { name, index, value });
            if !s.x.is_finite() {
                return broken("sample position", s.x);
            }
            if !s.value.is_finite() {
                return broken("sample value", s.value);
            }
        }
        if samples.is_empty() {
            let (name, rule) = ("number of samples", "at least one");
            return Err(SamplingError::Setting { name, value: 0.0, rule });
        }
        samples.sort_by(|a, b| a.x.total_cmp(&b.x));
        Ok(Self { samples })
    }

    /// The samples by increasing position.
    pub fn samples(&self) -> &[Measured] {
        &self.samples
    }

    /// The two samples around x, if x lies between the outermost ones.
    fn around(&self, x: f64) -> Option<(&Measured, &Measured)> {
        let right = self.samples.partition_point(|s| s.x < x);
        // The left neighbour lies strictly before x unless a sample sits exactly on x.
        let left = if self.samples.get(right)?.x == x { right } else { right.checked_sub(1)? };
        Some((&self.samples[left], &self.samples[right]))
    }

    /// The interpolated value; outside the samples the value of the outermost one.
    pub fn value(&self, x: f64) -> f64 {
        match self.around(x) {
            Some((a, b)) if b.x > a.x => a.value + (b.value - a.value) * (x - a.x) / (b.x - a.x),
            Some((a, _)) => a.value,
            None if x < self.samples[0].x => self.samples[0].value,
            None => self.samples[self.samples.len() - 1].value,
        }
    }

    /// Bound of |value(x) - f(x)| by Prop. 3.1 in its sharper form, `None` outside the samples:
    ///
    /// ```text
    /// (x - x1)(x2 - x) |f''| / 2 + max(E1, E2) + |f'| max(B1, B2)
    /// ```
    pub fn error_bound(&self, x: f64, f: Smoothness) -> Option<f64> {
        let (a, b) = self.around(x)?;
        let sampling = (x - a.x) * (b.x - x) * f.curvature / 2.0;
        Some(sampling + a.error.max(b.error) + f.slope * a.jitter.max(b.jitter))
    }

    /// Mean k-th power of the intervals between neighbouring samples; `None` with fewer than two.
    ///
    /// For a Poisson process of density lambda it is k! / lambda^k (thesis Prop. 3.2).
    pub fn interval_moment(&self, k: u32) -> Option<f64> {
        let count = self.samples.len().checked_sub(1).filter(|n| *n > 0)?;
        let power = |pair: &[Measured]| (pair[1].x - pair[0].x).powi(k as i32);
        Some(self.samples.windows(2).map(power).sum::<f64>() / count as f64)
    }
}

/// E\[interval^k\] lambda^k / k! for N superposed periodic sets of equal period and independent phases:
/// prod_{j<k} N / (N + j). It is 1 for the Poisson limit N to infinity (thesis Table 3.1).
pub fn superposed_interval_moment(sets: usize, k: u32) -> f64 {
    let n = sets as f64;
    (0..k).map(|j| n / (n + f64::from(j))).product()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    fn exact(x: f64, value: f64) -> Measured {
        Measured { x, value, error: 0.0, jitter: 0.0 }
    }

    #[test]
    fn lines_pass_through_their_samples() {
        let line = PiecewiseLinear::new(vec![exact(2.0, 5.0), exact(0.0, 1.0), exact(3.0, 4.0)]).unwrap();
        for (x, y) in [(-1.0, 1.0), (0.0, 1.0), (0.5, 2.0), (2.0, 5.0), (2.5, 4.5), (3.0, 4.0), (9.0, 4.0)] {
            assert_eq!(line.value(x), y, "at {x}");
        }
        let double = PiecewiseLinear::new(vec![exact(1.0, 5.0), exact(1.0, 7.0)]).unwrap();
        assert_eq!(double.value(1.0), 5.0);
    }

    #[test]
    fn the_bound_holds_and_is_nearly_reached() {
        let mut random = Random(7);
        let mut worst: f64 = 0.0;
        for _ in 0..4000 {
            let (scale, error, jitter) = (0.2 + random.part(), 0.1 * random.part(), 0.05 * random.part());
            let f = |x: f64| scale * x * x / 2.0;
            let mut take = |x: f64| {
                let e = if random.part() < 0.5 { -error } else { error };
                let mu = if random.part() < 0.5 { -jitter } else { jitter };
                Measured { x, value: f(x - mu) + e, error, jitter }
            };
            let (a, b) = (take(0.3), take(1.1));
            let line = PiecewiseLinear::new(vec![a, b]).unwrap();
            let x = 0.3 + 0.8 * random.part();
            let limits = Smoothness { slope: scale * (1.1 + jitter), curvature: scale };
            let bound = line.error_bound(x, limits).unwrap();
            let miss = (line.value(x) - f(x)).abs();
            assert!(miss <= bound * (1.0 + 1e-12) + 1e-15, "{miss} {bound}");
            worst = worst.max(miss / bound);
        }
        assert!(worst > 0.95, "the bound is loose: {worst}");
    }

    #[test]
    fn superposed_grids_have_the_moments_of_the_table() {
        // N = 10, divided by k!: 1, 0.9091, 0.7576, 0.5828.
        for (k, want) in [(1, 1.0), (2, 0.9091), (3, 0.7576), (4, 0.5828)] {
            assert!((superposed_interval_moment(10, k) - want).abs() < 5e-5);
        }
        let mut random = Random(3);
        let (mut sums, mut draws) = ([0.0; 4], 0.0);
        for _ in 0..8000 {
            let samples: Vec<Measured> = (0..10)
                .map(|_| random.part())
                .flat_map(|phase| (0..20).map(move |k| exact(k as f64 + phase, 0.0)))
                .collect();
            let line = PiecewiseLinear::new(samples).unwrap();
            for (k, sum) in sums.iter_mut().enumerate() {
                *sum += line.interval_moment(k as u32 + 1).unwrap();
            }
            draws += 1.0;
        }
        let factorial = [1.0, 2.0, 6.0, 24.0];
        for k in 0..4 {
            let got = sums[k] / draws * 10.0_f64.powi(k as i32 + 1) / factorial[k];
            let want = superposed_interval_moment(10, k as u32 + 1);
            // The two open ends of twenty periods bias the mean interval by about one part in two hundred.
            assert!((got / want - 1.0).abs() < 0.06, "k={} {got} {want}", k + 1);
        }
    }

    #[test]
    fn weights_fall_with_error_and_jitter() {
        let good = exact(0.0, 1.0).weight(10.0, 0.1);
        let noisy = Measured { error: 0.3, ..exact(0.0, 1.0) }.weight(10.0, 0.1);
        let shaky = Measured { jitter: 0.03, ..exact(0.0, 1.0) }.weight(10.0, 0.1);
        assert!((good - 100.0).abs() < 1e-9);
        assert!((noisy - 10.0).abs() < 1e-9 && (noisy - shaky).abs() < 1e-9);
    }

    #[test]
    fn what_is_no_sample_is_refused() {
        assert!(matches!(PiecewiseLinear::new(vec![]), Err(SamplingError::Setting { .. })));
        let broken = PiecewiseLinear::new(vec![exact(0.0, 1.0), exact(f64::NAN, 1.0)]);
        assert!(matches!(broken, Err(SamplingError::NotFinite { name: "sample position", index: 1, .. })));
        assert_eq!(PiecewiseLinear::new(vec![exact(0.0, 1.0)]).unwrap().interval_moment(2), None);
    }
}
