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
//! samples coincide, and N of them say no more than one. [`super::piecewise_linear`] has the bound that
//! holds for them.

use super::quadrature::{gauss_legendre, integral};
use hybank_sampling::SamplingError;
use std::ops::Range;

/// Panels of the integral over a varying density.
const PANELS: usize = 64;

/// Periodic sample sets with independent phases, as one random sample set.
#[derive(Debug, Clone, PartialEq)]
pub struct PeriodicSets {
    periods: Vec<f64>,
}

impl PeriodicSets {
    /// From the period of each set.
    ///
    /// # Errors
    /// [`SamplingError::Setting`] without any period, and for a period that is not positive and finite.
    pub fn new(periods: Vec<f64>) -> Result<Self, SamplingError> {
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
    pub fn density(&self) -> f64 {
        self.periods.iter().map(|p| 1.0 / p).sum()
    }

    /// The shortest period, which no interval exceeds.
    pub(super) fn shortest(&self) -> f64 {
        self.periods.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// Q(t): probability that an interval of length t >= 0, put anywhere, contains no sample.
    pub fn void_probability(&self, t: f64) -> f64 {
        self.periods.iter().map(|p| (1.0 - t / p).max(0.0)).product()
    }

    /// P(D > t): share of the intervals between neighbouring samples that are longer than t >= 0.
    ///
    /// The distance from a given point to the next sample has the density lambda P(D > t).
    pub fn longer_than(&self, t: f64) -> f64 {
        if self.periods.iter().any(|p| *p <= t) {
            return 0.0;
        }
        // -Q' / lambda with Q' = -Q sum 1 / (p_i - t).
        let hazard: f64 = self.periods.iter().map(|p| 1.0 / (p - t)).sum();
        self.void_probability(t) * hazard / self.density()
    }

    /// E\[D^k\] of the interval D between neighbouring samples; exact up to rounding.
    pub fn moment(&self, k: u32) -> f64 {
        moment(&self.periods, k, &gauss_legendre(points(self.periods.len(), k)))
    }

    /// E\[D^k\] lambda^k / k!, which is 1 for a Poisson process. For N equal periods it is
    /// prod_{j<k} N / (N + j) (thesis Table 3.1).
    pub fn poisson_ratio(&self, k: u32) -> f64 {
        self.moment(k) * self.density().powi(k as i32) / factorial(k)
    }

    /// The samples in \[from, to), sorted: set i has samples at (n + phases\[i\]) p_i for all integers n.
    pub fn samples(&self, phases: &[f64], range: Range<f64>) -> Vec<f64> {
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

/// sum_m D_m^k over `range` for a Poisson process of density `density(y)`: k! integral lambda^{1-k} dy
/// (thesis Prop. 3.2).
pub fn poisson_power_sum(density: impl Fn(f64) -> f64, range: Range<f64>, k: u32) -> f64 {
    factorial(k) * integral(|y| density(y).powi(1 - k as i32), range, PANELS)
}

/// sum_m D_m^k over `range` for finitely many sets whose local densities are `densities(y)`, one per set;
/// sets of density 0 have no samples there.
///
/// Exact in the limit of densities that hardly change within one period.
pub fn superposed_power_sum(densities: impl Fn(f64) -> Vec<f64>, range: Range<f64>, k: u32) -> f64 {
    let sum = |y: f64| {
        let present = densities(y).into_iter().filter(|d| *d > 0.0);
        let periods: Vec<f64> = present.map(|d| 1.0 / d).collect();
        let density: f64 = periods.iter().map(|p| 1.0 / p).sum();
        density * moment(&periods, k, &gauss_legendre(points(periods.len(), k)))
    };
    integral(sum, range, PANELS)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    fn equal(n: usize, period: f64) -> PeriodicSets {
        PeriodicSets::new(vec![period; n]).unwrap()
    }

    /// Moments over every phase of a fine grid: no probability theory, only sorting and differences. The
    /// circle is as long as all periods fit, so there are no ends.
    fn brute_force(periods: &[f64], circle: f64, grid: usize, k: i32) -> f64 {
        let sets = PeriodicSets::new(periods.to_vec()).unwrap();
        let free = periods.len() - 1;
        let (mut sum, mut count) = (0.0, 0.0);
        for draw in 0..grid.pow(free as u32) {
            let phase = |i: usize| ((draw / grid.pow(i as u32)) % grid) as f64 + 0.5;
            let phases: Vec<f64> =
                std::iter::once(0.0).chain((0..free).map(|i| phase(i) / grid as f64)).collect();
            let mut x = sets.samples(&phases, 0.0..circle);
            x.push(x[0] + circle);
            sum += x.windows(2).map(|w| (w[1] - w[0]).powi(k)).sum::<f64>();
            count += x.len() as f64 - 1.0;
        }
        sum / count
    }

    #[test]
    fn moments_are_those_of_an_enumeration() {
        for (periods, circle, grid) in [
            (vec![1.0], 1.0, 1),
            (vec![1.0, 1.0], 1.0, 2000),
            (vec![2.0, 3.0], 6.0, 3000),
            (vec![1.0, 1.5, 0.75], 3.0, 120),
        ] {
            let sets = PeriodicSets::new(periods.clone()).unwrap();
            for k in 1..=4 {
                let (got, want) = (sets.moment(k as u32), brute_force(&periods, circle, grid, k));
                assert!((got / want - 1.0).abs() < 2e-4, "{periods:?} k = {k}: {got} {want}");
            }
        }
    }

    /// N = 10: 1, 0.9091, 0.7576, 0.5828 (thesis Table 3.1), and the product for any N.
    #[test]
    fn equal_periods_have_a_closed_form() {
        for n in [1, 2, 5, 10, 20, 50, 300] {
            for k in 0..=6 {
                let want: f64 = (0..k).map(|j| n as f64 / (n as f64 + f64::from(j))).product();
                let got = equal(n, 0.37).poisson_ratio(k);
                assert!((got / want - 1.0).abs() < 1e-12, "N = {n}, k = {k}: {got} {want}");
            }
        }
        let table = [1.0, 0.9091, 0.7576, 0.5828];
        let got: Vec<f64> = (1..=4).map(|k| equal(10, 2.0).poisson_ratio(k)).collect();
        assert!(got.iter().zip(table).all(|(g, t)| (g - t).abs() < 5e-5), "{got:?}");
    }

    #[test]
    fn many_sparse_sets_are_a_poisson_process() {
        let sets = PeriodicSets::new((0..200).map(|i| 1.0 + 0.01 * f64::from(i)).collect()).unwrap();
        let lambda = sets.density();
        for t in [0.0, 0.2, 1.0, 3.0] {
            let (t, poisson) = (t / lambda, (-t).exp());
            assert!((sets.void_probability(t) - poisson).abs() < 0.01, "{t}");
            assert!((sets.longer_than(t) - poisson).abs() < 0.01, "{t}");
        }
        assert!((sets.poisson_ratio(3) - 1.0).abs() < 0.03);
        assert_eq!(equal(3, 1.0).longer_than(1.0), 0.0);
    }

    /// P(D > t) integrates to the mean, and its density has the second moment.
    #[test]
    fn the_distribution_has_the_moments() {
        let sets = PeriodicSets::new(vec![1.0, 1.3, 0.8, 2.2]).unwrap();
        let range = 0.0..0.8;
        let mean = integral(|t| sets.longer_than(t), range.clone(), 8);
        let square = integral(|t| 2.0 * t * sets.longer_than(t), range, 8);
        assert!((mean - sets.moment(1)).abs() < 1e-12 && (square - sets.moment(2)).abs() < 1e-12);
    }

    /// What a relative error of a simulated sum of k-th powers may be: 2 %, and 4 % for k = 4.
    fn tolerance(k: i32) -> f64 {
        if k < 4 { 0.02 } else { 0.04 }
    }

    /// Ten sets seen through a curved map y = x + 0.3 sin x: densities vary by a factor of two.
    #[test]
    fn densities_may_vary() {
        let (sets, mut random) = (equal(10, 0.05), Random(11));
        let map = |x: f64| x + 0.3 * x.sin();
        let local = |y: f64| {
            let x = (0..60).fold(y, |x, _| y - 0.3 * x.sin());
            vec![1.0 / (0.05 * (1.0 + 0.3 * x.cos())); 10]
        };
        let (end, draws) = (5.0, 1000);
        let range = map(0.0)..map(end);
        for k in 2..=4 {
            let mut sum = 0.0;
            for _ in 0..draws {
                let phases: Vec<f64> = (0..10).map(|_| random.part()).collect();
                let samples: Vec<f64> = sets.samples(&phases, 0.0..end).into_iter().map(map).collect();
                sum += samples.windows(2).map(|w| (w[1] - w[0]).powi(k)).sum::<f64>();
            }
            let (sum, want) = (sum / f64::from(draws), superposed_power_sum(local, range.clone(), k as u32));
            assert!((sum / want - 1.0).abs() < tolerance(k), "k = {k}: {sum} {want}");
            let poisson = poisson_power_sum(|y| local(y).iter().sum(), range.clone(), k as u32);
            let ratio = equal(10, 1.0).poisson_ratio(k as u32);
            assert!((want / poisson / ratio - 1.0).abs() < 1e-9, "k = {k}: {want} {poisson}");
        }
    }

    /// Ten sets whose periods spread over a factor of eight: the sums of simulated intervals.
    #[test]
    fn periods_may_be_unequal() {
        let mut random = Random(23);
        let periods: Vec<f64> = (0..10).map(|i| 0.05 * (1.04 * (f64::from(i) * 2.7).sin()).exp()).collect();
        let sets = PeriodicSets::new(periods).unwrap();
        let (range, draws) = (0.0..5.0, 1000);
        for k in 1..=4 {
            let (mut sum, mut count) = (0.0, 0);
            for _ in 0..draws {
                let phases: Vec<f64> = (0..10).map(|_| random.part()).collect();
                let samples = sets.samples(&phases, range.clone());
                sum += samples.windows(2).map(|w| (w[1] - w[0]).powi(k)).sum::<f64>();
                count += samples.len() - 1;
            }
            let (mean, want) = (sum / count as f64, sets.moment(k as u32));
            assert!((mean / want - 1.0).abs() < tolerance(k), "k = {k}: {mean} {want}");
        }
        // Unequal periods are nearer to one large set than equal ones: shorter tails.
        assert!((2..=4).all(|k| sets.poisson_ratio(k) < equal(10, 1.0).poisson_ratio(k)));
    }

    #[test]
    fn what_is_no_period_is_refused() {
        assert!(PeriodicSets::new(vec![]).is_err());
        for period in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(PeriodicSets::new(vec![1.0, period]).is_err(), "{period}");
        }
    }
}
