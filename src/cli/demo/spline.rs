//! The cubic spline through all slow samples, in the order of their instants.

use crate::units::FastPeriods;

/// Samples at increasing instants.
pub(super) struct Samples {
    instants: Vec<f64>,
    values: Vec<f64>,
}

impl Samples {
    /// Of channels with the delays D_i: sample k of channel i is taken at k M - D_i.
    pub(super) fn merged(delays: &[FastPeriods], ratio: usize, channels: &[Vec<f64>]) -> Self {
        let of_channel = |(delay, samples): (&FastPeriods, &Vec<f64>)| {
            let instant = |k: usize| (k * ratio) as f64 - delay.0;
            samples.iter().enumerate().map(|(k, x)| (instant(k), *x)).collect::<Vec<_>>()
        };
        let mut all: Vec<(f64, f64)> = delays.iter().zip(channels).flat_map(of_channel).collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        all.dedup_by_key(|sample| sample.0);
        let (instants, values) = all.into_iter().unzip();
        Self { instants, values }
    }

    /// The natural cubic spline at `count` instants, `first` and every fast period after it; before the
    /// first and after the last sample its outer pieces go on.
    pub(super) fn spline(&self, first: FastPeriods, count: usize) -> Vec<f64> {
        let (t, y) = (&self.instants, &self.values);
        if t.len() < 2 {
            return vec![y.first().copied().unwrap_or(0.0); count];
        }
        let curvatures = self.curvatures();
        let mut piece = 0;
        let at = |n: usize| {
            let x = first.0 + n as f64;
            while piece + 2 < t.len() && t[piece + 1] <= x {
                piece += 1;
            }
            let (width, below, above) = (t[piece + 1] - t[piece], x - t[piece], t[piece + 1] - x);
            let (m, next) = (curvatures[piece], curvatures[piece + 1]);
            let cubic = |m: f64, d: f64| m * (d * d * d / width - width * d) / 6.0;
            (y[piece] * above + y[piece + 1] * below) / width + cubic(m, above) + cubic(next, below)
        };
        (0..count).map(at).collect()
    }

    /// Second derivatives at the samples: h_i m_i-1 + 2 (h_i + h_i+1) m_i + h_i+1 m_i+1 = 6 times the change
    /// of slope, with zeros at the ends. The system is diagonally dominant and needs no pivots.
    fn curvatures(&self) -> Vec<f64> {
        let (t, y) = (&self.instants, &self.values);
        let count = t.len();
        let width = |i: usize| t[i + 1] - t[i];
        let slope = |i: usize| (y[i + 1] - y[i]) / width(i);
        // After elimination m_i = value_i - factor_i m_i+1.
        let (mut factors, mut values) = (vec![0.0; count], vec![0.0; count]);
        for i in 1..count - 1 {
            let pivot = 2.0 * (width(i - 1) + width(i)) - width(i - 1) * factors[i - 1];
            factors[i] = width(i) / pivot;
            values[i] = (6.0 * (slope(i) - slope(i - 1)) - width(i - 1) * values[i - 1]) / pivot;
        }
        for i in (1..count - 1).rev() {
            values[i] -= factors[i] * values[i + 1];
        }
        values
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples(f: impl Fn(f64) -> f64) -> Samples {
        let delays = [FastPeriods(1.2), FastPeriods(0.6)];
        let channel = |delay: &FastPeriods| (0..60).map(|k| f(f64::from(2 * k) - delay.0)).collect();
        let channels: Vec<Vec<f64>> = delays.iter().map(channel).collect();
        Samples::merged(&delays, 2, &channels)
    }

    /// The influence of the ends falls by 2 + sqrt 3 per sample or so.
    #[test]
    fn a_cubic_is_its_own_spline_away_from_the_ends() {
        let cubic = |t: f64| 1.0 + t * (0.5 - t * (0.01 - 1e-4 * t));
        let (first, values) = (FastPeriods(40.25), samples(cubic).spline(FastPeriods(40.25), 40));
        for (n, value) in values.iter().enumerate() {
            let want = cubic(first.0 + n as f64);
            assert!((value - want).abs() < 1e-9 * want.abs(), "{n}: {value} instead of {want}");
        }
    }

    #[test]
    fn a_spline_goes_through_its_samples() {
        let wild = |t: f64| (1.7 * t).sin() + (0.3 * t * t).cos();
        let own = samples(wild).spline(FastPeriods(0.8), 50);
        for k in 0..25 {
            let instant = 2.0 * f64::from(k) + 0.8;
            assert!((own[2 * k as usize] - wild(instant)).abs() < 1e-12, "{instant}");
        }
    }

    #[test]
    fn few_samples_are_a_line_or_a_constant() {
        let two = Samples { instants: vec![0.0, 2.0], values: vec![1.0, 2.0] };
        assert_eq!(two.spline(FastPeriods(0.0), 4), [1.0, 1.5, 2.0, 2.5]);
        let one = Samples { instants: vec![0.0], values: vec![3.0] };
        assert_eq!(one.spline(FastPeriods(0.0), 2), [3.0, 3.0]);
    }
}
