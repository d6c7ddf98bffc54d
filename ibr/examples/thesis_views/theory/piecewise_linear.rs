//! Linear interpolation between samples with errors and jitter, and its bounds (thesis Prop. 3.1).

use hybank_sampling::SamplingError;
use hybank_sampling::nonuniform::Measured;

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

    /// Bound of the mean of |value(x) - f(x)| from the first sample to the last: the mean of
    /// [`Self::error_bound`],
    ///
    /// ```text
    /// ( |f''| sum D^3 / 12 + sum D (max(E1, E2) + |f'| max(B1, B2)) ) / sum D.
    /// ```
    ///
    /// It holds for the samples at hand, however they lie. The bounds of the thesis, such as that of its
    /// Theorem 3.1, are expectations over random phases, and fail for samples that coincide. `None` if all
    /// samples lie at one position.
    pub fn mean_error_bound(&self, f: Smoothness) -> Option<f64> {
        let length = self.samples[self.samples.len() - 1].x - self.samples[0].x;
        let of_interval = |pair: &[Measured]| {
            let (a, b) = (&pair[0], &pair[1]);
            let interval = b.x - a.x;
            let data = a.error.max(b.error) + f.slope * a.jitter.max(b.jitter);
            interval * (interval * interval * f.curvature / 12.0 + data)
        };
        let sum: f64 = self.samples.windows(2).map(of_interval).sum();
        (length > 0.0).then(|| sum / length)
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

    /// Sums of waves of known amplitudes, samples anywhere, errors and jitter anywhere within their bounds:
    /// 10,000 trials of Prop. 3.1, at one position each, and of its mean.
    #[test]
    fn no_trial_exceeds_the_bounds() {
        let mut random = Random(31);
        let (mut worst, mut worst_mean) = (0.0_f64, 0.0_f64);
        for trial in 0..10_000 {
            let waves: [(f64, f64, f64); 3] =
                std::array::from_fn(|_| (random.sample(), 6.0 * random.part(), 6.3 * random.part()));
            let f = |x: f64| waves.iter().map(|(a, q, p)| a * (q * x + p).sin()).sum::<f64>();
            let sum = |power: i32| waves.iter().map(|(a, q, _)| a.abs() * q.powi(power)).sum::<f64>();
            let limits = Smoothness { slope: sum(1), curvature: sum(2) };
            let (error, jitter) = (0.1 * random.part(), 0.05 * random.part());
            let samples = (0..random.count(2, 6)).map(|_| {
                let (x, mu, e) = (random.part(), jitter * random.sample(), error * random.sample());
                Measured { x, value: f(x + mu) + e, error, jitter }
            });
            let line = PiecewiseLinear::new(samples.collect()).unwrap();
            let (first, last) = (line.samples()[0].x, line.samples()[line.samples().len() - 1].x);
            let x = first + (last - first) * random.part();
            let miss = (line.value(x) - f(x)).abs();
            let bound = line.error_bound(x, limits).unwrap();
            assert!(miss <= bound * (1.0 + 1e-12), "trial {trial}: {miss} {bound}");
            worst = worst.max(miss / bound);
            if trial % 20 == 0 {
                let at = |k: usize| first + (last - first) * (k as f64 + 0.5) / 500.0;
                let mean = (0..500).map(|k| (line.value(at(k)) - f(at(k))).abs()).sum::<f64>() / 500.0;
                let bound = line.mean_error_bound(limits).unwrap();
                // The mean over 500 points is not quite the integral.
                assert!(mean <= bound * 1.001 + 1e-6, "trial {trial}: {mean} {bound}");
                worst_mean = worst_mean.max(mean / bound);
            }
        }
        assert!(worst > 0.8 && worst_mean > 0.4, "{worst} {worst_mean}");
    }

    /// A parabola has the largest error of its curvature everywhere: the mean bound is its mean error.
    #[test]
    fn a_parabola_attains_the_mean_bound() {
        let line =
            PiecewiseLinear::new([0.0, 0.3, 1.5, 1.6, 4.0].map(|x| exact(x, 2.0 * x * x)).to_vec()).unwrap();
        let bound = line.mean_error_bound(Smoothness { slope: 16.0, curvature: 4.0 }).unwrap();
        let n = 40_000;
        let miss = |k: i32| {
            let x = 4.0 * (f64::from(k) + 0.5) / f64::from(n);
            line.value(x) - 2.0 * x * x
        };
        let mean = (0..n).map(miss).sum::<f64>() / f64::from(n);
        assert!((mean / bound - 1.0).abs() < 1e-6, "{mean} {bound}");
        let point = PiecewiseLinear::new(vec![exact(1.0, 2.0); 2]).unwrap();
        assert_eq!(point.mean_error_bound(Smoothness { slope: 1.0, curvature: 1.0 }), None);
    }

    #[test]
    fn what_is_no_sample_is_refused() {
        assert!(matches!(PiecewiseLinear::new(vec![]), Err(SamplingError::Setting { .. })));
        let broken = PiecewiseLinear::new(vec![exact(0.0, 1.0), exact(f64::NAN, 1.0)]);
        assert!(matches!(broken, Err(SamplingError::NotFinite { name: "sample position", index: 1, .. })));
        assert_eq!(PiecewiseLinear::new(vec![exact(0.0, 1.0)]).unwrap().interval_moment(2), None);
    }
}
