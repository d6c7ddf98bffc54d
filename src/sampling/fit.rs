//! Regularised least squares in the spline space spanned by beta(x - m), with banded normal equations.
//!
//! Given samples (x_s, f_s) at arbitrary places, minimise over the coefficients c_m of
//! J(x) = sum_m c_m beta(x - m)
//!
//! ```text
//! sum_s w_s (f_s - J(x_s))^2 + sum_s w_s mu_s J'(x_s)^2 + tau sum_m (c_m - c_{m-1})^2 + ridge sum_m c_m^2
//! ```
//!
//! (thesis eq. 2.4-2.5 with mu_s = lambda V_s; the tau term, which bridges places without samples, is
//! an addition). The normal equations have half bandwidth n = ORDER - 1 and are solved by an LDL^T
//! factorisation without fill-in: O(M n^2) for any number of right-hand sides.

use super::error::SamplingError;
use super::kernel::BSpline;

/// A pivot below this share of the largest diagonal entry is rounding, not information.
const SMALLEST_PIVOT: f64 = 1e-14;

/// Places beyond this have no knot index without loss.
const FARTHEST_PLACE: f64 = 1e15;

/// Samples whose weights are computed together.
const BATCH: usize = 8;

/// A sample of a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FitSample<const C: usize> {
    /// Place, in knots.
    pub x: f64,
    /// Values.
    pub values: [f64; C],
    /// Weight w >= 0.
    pub weight: f64,
    /// Slope weight mu >= 0.
    pub slope_weight: f64,
}

/// Accumulates samples into the normal equations of one spline space and solves them.
///
/// ORDER = degree + 1 >= 2; C values a sample, which share one factorisation. The value owns its
/// work memory: [`Fit::reset`] starts the next problem without allocating when it is no larger.
#[derive(Debug, Clone)]
pub struct Fit<const ORDER: usize, const C: usize> {
    first: i64,
    knots: usize,
    /// band\[m\]\[j\] = A\[m, m + j\]; after `solve` 1/d_m and the column of L below it.
    band: Vec<[f64; ORDER]>,
    /// Right-hand sides; after `solve` the coefficients.
    rhs: Vec<[f64; C]>,
}

impl<const ORDER: usize, const C: usize> Fit<ORDER, C> {
    /// An empty problem with the coefficients `first .. first + knots`.
    pub fn new(first: i64, knots: usize) -> Self {
        const { assert!(ORDER >= 2, "a fit needs splines of degree one or more") }
        let mut fit = Self { first, knots, band: Vec::new(), rhs: Vec::new() };
        fit.reset(first, knots);
        fit
    }

    /// An empty problem with the knots -n .. last + n, n the degree: it takes every sample in
    /// \[0, last\] and those up to one knot short of the kernel's reach outside.
    pub fn covering(last: usize) -> Self {
        let reach = ORDER - 1;
        Self::new(-(reach as i64), last + 1 + 2 * reach)
    }

    /// Forgets all samples and takes a new range of coefficients.
    pub fn reset(&mut self, first: i64, knots: usize) {
        (self.first, self.knots) = (first, knots);
        // ORDER - 1 rows of padding spare the elimination every test for the end of the band.
        let rows = knots + ORDER - 1;
        self.band.clear();
        self.band.resize(rows, [0.0; ORDER]);
        self.rhs.clear();
        self.rhs.resize(rows, [0.0; C]);
    }

    /// Empties the problem and keeps its range.
    pub fn clear(&mut self) {
        self.reset(self.first, self.knots);
    }

    /// The range of coefficient indices.
    pub fn range(&self) -> std::ops::Range<i64> {
        self.first..self.first + self.knots as i64
    }

    /// Adds one sample: place, values, weight w >= 0 and slope weight mu >= 0.
    ///
    /// Returns false, and adds nothing, when a spline that reaches `x` lies outside the range.
    #[inline]
    pub fn add(&mut self, x: f64, values: &[f64; C], weight: f64, slope_weight: f64) -> bool {
        let sample = FitSample { x, values: *values, weight, slope_weight };
        let (knot, w, d) = BSpline::<ORDER>::weights_and_slopes(x);
        self.accumulate(&sample, knot, &w, &d)
    }

    /// Adds many samples, in their order and with the bits of [`Fit::add`] one by one, but in less time.
    ///
    /// Returns how many were added: the others have a spline outside the range.
    pub fn add_all(&mut self, samples: impl IntoIterator<Item = FitSample<C>>) -> usize {
        let nowhere = FitSample { x: f64::NAN, values: [0.0; C], weight: 0.0, slope_weight: 0.0 };
        let mut samples = samples.into_iter();
        let mut added = 0;
        loop {
            let mut count = 0;
            let batch: [FitSample<C>; BATCH] =
                std::array::from_fn(|_| samples.next().inspect(|_| count += 1).unwrap_or(nowhere));
            let places: [f64; BATCH] = std::array::from_fn(|i| batch[i].x);
            let (knots, w, d) = BSpline::<ORDER>::weights_and_slopes_of(&places);
            for (i, sample) in batch.iter().take(count).enumerate() {
                let of_sample = |all: &[[f64; BATCH]; ORDER]| std::array::from_fn(|j| all[j][i]);
                added += usize::from(self.accumulate(sample, knots[i], &of_sample(&w), &of_sample(&d)));
            }
            if count < BATCH {
                return added;
            }
        }
    }

    /// Adds one sample with its weights w and slopes d at the knots from `knot`.
    #[inline]
    fn accumulate(&mut self, s: &FitSample<C>, knot: i64, w: &[f64; ORDER], d: &[f64; ORDER]) -> bool {
        // Also turns NaN away, whose knot would be 0.
        let sayable = s.x.abs() < FARTHEST_PLACE;
        if !sayable {
            return false;
        }
        let Some(row) = self.row_of(knot) else { return false };
        let penalty = s.weight * s.slope_weight;
        // Arrays instead of slices: no index is tested within the loops.
        let Some(band) = self.band[row..].first_chunk_mut::<ORDER>() else { return false };
        for k in 0..ORDER {
            let (wk, dk) = (s.weight * w[k], penalty * d[k]);
            for l in k..ORDER {
                band[k][l - k] += wk * w[l] + dk * d[l];
            }
        }
        let Some(rhs) = self.rhs[row..].first_chunk_mut::<ORDER>() else { return false };
        for k in 0..ORDER {
            let wk = s.weight * w[k];
            rhs[k].iter_mut().zip(&s.values).for_each(|(r, v)| *r += wk * v);
        }
        true
    }

    /// Row of the first of ORDER neighbouring knots, if all of them are in the range.
    #[inline]
    fn row_of(&self, knot: i64) -> Option<usize> {
        let row = usize::try_from(knot - self.first).ok()?;
        (row + ORDER <= self.knots).then_some(row)
    }

    /// Adds tau sum (c_m - c_{m-1})^2 + ridge sum c_m^2.
    pub fn regularise(&mut self, tau: f64, ridge: f64) {
        for m in 0..self.knots {
            self.band[m][0] += ridge;
            if m + 1 < self.knots {
                self.band[m][0] += tau;
                self.band[m][1] -= tau;
                self.band[m + 1][0] += tau;
            }
        }
    }

    /// Solves the normal equations; the coefficients are then in [`Fit::coefficients`].
    ///
    /// # Errors
    /// [`SamplingError::NotDefinite`] when a pivot falls below 1e-14 of the largest diagonal entry:
    /// a coefficient that no sample and no regularisation reaches.
    pub fn solve(&mut self) -> Result<(), SamplingError> {
        let largest = self.band.iter().fold(0.0, |max: f64, row| max.max(row[0]));
        for m in 0..self.knots {
            let column = self.band[m];
            let sound = column[0] > SMALLEST_PIVOT * largest;
            if !sound {
                return Err(SamplingError::NotDefinite { column: m, pivot: column[0] });
            }
            self.eliminate(m, column);
        }
        self.substitute_back();
        Ok(())
    }

    /// Subtracts multiples of row m from the rows below it, on both sides of the equations.
    #[inline]
    fn eliminate(&mut self, m: usize, column: [f64; ORDER]) {
        let inverse = 1.0 / column[0];
        let (Some(band), Some(rhs)) =
            (self.band[m..].first_chunk_mut::<ORDER>(), self.rhs[m..].first_chunk_mut::<ORDER>())
        else {
            return;
        };
        let here = rhs[0];
        band[0] = column.map(|a| a * inverse);
        band[0][0] = inverse;
        for i in 1..ORDER {
            let factor = column[i] * inverse;
            for k in i..ORDER {
                band[i][k - i] -= factor * column[k];
            }
            for c in 0..C {
                rhs[i][c] -= factor * here[c];
            }
        }
    }

    /// c_m = r_m / d_m - sum_i l_{m+i,m} c_{m+i}, from the last row up.
    fn substitute_back(&mut self) {
        self.rhs[self.knots..].fill([0.0; C]);
        for m in (0..self.knots).rev() {
            let column = self.band[m];
            let mut c = self.rhs[m].map(|r| r * column[0]);
            for (factor, later) in column[1..].iter().zip(&self.rhs[m + 1..]) {
                for (c, later) in c.iter_mut().zip(later) {
                    *c -= factor * later;
                }
            }
            self.rhs[m] = c;
        }
    }

    /// The coefficients c_m, first knot first; meaningful after [`Fit::solve`].
    pub fn coefficients(&self) -> &[[f64; C]] {
        &self.rhs[..self.knots]
    }

    /// J at the knots `from`, `from` + 1, ..; the kernel is evaluated once for all of them.
    pub fn knot_values(&self, from: i64) -> impl Iterator<Item = [f64; C]> + '_ {
        let (first, w) = BSpline::<ORDER>::weights(0.0);
        (from + first..).map_while(move |knot| {
            let row = self.row_of(knot)?;
            let mut sum = [0.0; C];
            for (c, w) in self.rhs[row..row + ORDER].iter().zip(w) {
                sum.iter_mut().zip(c).for_each(|(s, c)| *s += w * c);
            }
            Some(sum)
        })
    }

    /// J(x), with the coefficients outside the range taken as 0.
    #[inline]
    pub fn value(&self, x: f64) -> [f64; C] {
        let (knot, w) = BSpline::<ORDER>::weights(x);
        self.combine(knot, &w)
    }

    /// J'(x), with the coefficients outside the range taken as 0.
    pub fn slope(&self, x: f64) -> [f64; C] {
        let (knot, d) = BSpline::<ORDER>::slopes(x);
        self.combine(knot, &d)
    }

    #[inline]
    fn combine(&self, knot: i64, weights: &[f64; ORDER]) -> [f64; C] {
        let mut sum = [0.0; C];
        for (j, w) in weights.iter().enumerate() {
            let row = knot + j as i64 - self.first;
            if let Some(c) = usize::try_from(row).ok().filter(|r| *r < self.knots).map(|r| self.rhs[r]) {
                for (s, c) in sum.iter_mut().zip(c) {
                    *s += w * c;
                }
            }
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    struct Sample {
        x: f64,
        f: [f64; 2],
        w: f64,
        mu: f64,
    }

    /// Dense normal equations from the definition, Gaussian elimination with pivoting.
    fn dense<const ORDER: usize>(
        range: std::ops::Range<i64>,
        samples: &[Sample],
        tau: f64,
        ridge: f64,
    ) -> Vec<[f64; 2]> {
        let n = (range.end - range.start) as usize;
        let mut a = vec![vec![0.0; n + 2]; n];
        for s in samples {
            let (k0, w, d) = BSpline::<ORDER>::weights_and_slopes(s.x);
            for i in 0..ORDER {
                let row = (k0 + i as i64 - range.start) as usize;
                for j in 0..ORDER {
                    let col = (k0 + j as i64 - range.start) as usize;
                    a[row][col] += s.w * (w[i] * w[j] + s.mu * d[i] * d[j]);
                }
                for c in 0..2 {
                    a[row][n + c] += s.w * w[i] * s.f[c];
                }
            }
        }
        for m in 0..n {
            a[m][m] += ridge;
            if m + 1 < n {
                a[m][m] += tau;
                a[m + 1][m + 1] += tau;
                a[m][m + 1] -= tau;
                a[m + 1][m] -= tau;
            }
        }
        for col in 0..n {
            let pivot = (col..n).max_by(|i, j| a[*i][col].abs().total_cmp(&a[*j][col].abs())).unwrap();
            a.swap(col, pivot);
            let top = a[col].clone();
            for (r, row) in a.iter_mut().enumerate() {
                if r != col {
                    let factor = row[col] / top[col];
                    row.iter_mut().zip(&top).for_each(|(x, t)| *x -= factor * t);
                }
            }
        }
        (0..n).map(|m| [a[m][n] / a[m][m], a[m][n + 1] / a[m][m]]).collect()
    }

    fn check_dense<const ORDER: usize>(samples: &[Sample], tau: f64, ridge: f64) {
        let mut fit = Fit::<ORDER, 2>::covering(12);
        for s in samples {
            assert!(fit.add(s.x, &s.f, s.w, s.mu));
        }
        fit.regularise(tau, ridge);
        fit.solve().unwrap();
        let exact = dense::<ORDER>(fit.range(), samples, tau, ridge);
        for (got, want) in fit.coefficients().iter().zip(&exact) {
            for c in 0..2 {
                assert!((got[c] - want[c]).abs() < 1e-9 * (1.0 + want[c].abs()), "{got:?} {want:?}");
            }
        }
    }

    #[test]
    fn a_spline_in_the_space_is_found_again() {
        let truth = |x: f64| {
            (-3..16).map(move |m: i64| {
                let c = ((m * m * 7 + 3) % 11) as f64;
                let (k, w) = BSpline::<4>::weights(x);
                usize::try_from(m - k).ok().and_then(|j| w.get(j)).map_or(0.0, |w| c * w)
            })
        };
        let mut fit = Fit::<4, 1>::covering(12);
        for step in 0..=120 {
            let x = step as f64 * 0.1;
            assert!(fit.add(x, &[truth(x).sum()], 1.0, 0.0));
        }
        fit.regularise(0.0, 1e-12);
        fit.solve().unwrap();
        for step in 0..120 {
            let x = step as f64 * 0.1 + 0.05;
            let exact: f64 = truth(x).sum();
            assert!((fit.value(x)[0] - exact).abs() < 1e-8, "{x}");
        }
    }

    #[test]
    fn values_and_slopes_belong_together() {
        let mut fit = Fit::<4, 1>::covering(8);
        for step in 0..=16 {
            fit.add(step as f64 * 0.5, &[(step as f64).sin()], 1.0, 0.01);
        }
        fit.regularise(0.01, 0.0);
        fit.solve().unwrap();
        for x in [0.3, 2.0, 5.5, 7.9] {
            let numeric = (fit.value(x + 1e-6)[0] - fit.value(x - 1e-6)[0]) / 2e-6;
            assert!((fit.slope(x)[0] - numeric).abs() < 1e-8);
        }
        let knots: Vec<f64> = fit.knot_values(0).take(9).map(|v| v[0]).collect();
        assert_eq!(knots.len(), 9);
        assert!(knots.iter().enumerate().all(|(j, v)| (v - fit.value(j as f64)[0]).abs() < 1e-14));
    }

    #[test]
    fn empty_stretches_are_bridged_by_a_straight_line() {
        let mut fit = Fit::<2, 1>::covering(20);
        fit.add(0.0, &[0.0], 1e9, 0.0);
        fit.add(20.0, &[10.0], 1e9, 0.0);
        fit.regularise(0.05, 0.0);
        fit.solve().unwrap();
        for x in 0..=20 {
            assert!((fit.value(x as f64)[0] - 0.5 * x as f64).abs() < 1e-6);
        }
    }

    #[test]
    fn many_at_once_have_the_bits_of_one_by_one() {
        for count in [0, 1, 7, 8, 9, 40] {
            let place = |i: usize| if i % 11 == 5 { f64::NAN } else { (i * 7 % 40) as f64 * 0.37 - 1.9 };
            let samples: Vec<FitSample<2>> = (0..count)
                .map(|i| FitSample { x: place(i), values: [i as f64, 3.0], weight: 0.7, slope_weight: 0.2 })
                .collect();
            let (mut single, mut together) = (Fit::<4, 2>::covering(9), Fit::<4, 2>::covering(9));
            let added =
                samples.iter().filter(|s| single.add(s.x, &s.values, s.weight, s.slope_weight)).count();
            assert_eq!(together.add_all(samples.iter().copied()), added);
            assert_eq!((together.band, together.rhs), (single.band, single.rhs));
        }
    }

    #[test]
    fn a_coefficient_without_samples_is_an_error_not_a_guess() {
        let mut fit = Fit::<4, 1>::covering(9);
        fit.add(4.2, &[1.0], 1.0, 0.1);
        assert!(matches!(fit.solve(), Err(SamplingError::NotDefinite { column: 0, .. })));
        fit.clear();
        assert_eq!(fit.solve(), Err(SamplingError::NotDefinite { column: 0, pivot: 0.0 }));
    }

    #[test]
    fn samples_outside_are_refused_and_change_nothing() {
        let mut fit = Fit::<4, 1>::covering(9);
        let empty = fit.clone();
        for x in [-2.1, 11.1, 1e9, -1e9, 1e300, f64::NAN, f64::INFINITY] {
            assert!(!fit.add(x, &[1.0], 1.0, 0.0), "{x}");
        }
        assert_eq!(fit.band, empty.band);
        assert_eq!(fit.rhs, empty.rhs);
    }

    #[test]
    fn a_used_workspace_gives_the_bits_of_a_fresh_one() {
        let run = |fit: &mut Fit<4, 1>| {
            for step in 0..30 {
                fit.add(step as f64 * 0.31, &[(step as f64 * 1.7).cos()], 1.0, 0.1);
            }
            fit.regularise(0.05, 1e-9);
            fit.solve().unwrap();
            fit.coefficients().to_vec()
        };
        let mut fit = Fit::<4, 1>::covering(10);
        let fresh = run(&mut fit);
        fit.reset(-7, 40);
        fit.add(3.0, &[1e9], 1e9, 1e9);
        fit.reset(-3, 17);
        assert_eq!(run(&mut fit), fresh);
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn banded_equals_dense(
            raw in prop::collection::vec((0.0..12.0_f64, -255.0..255.0_f64, -1e3..1e3_f64, 0.01..2.0_f64, 0.0..1.0_f64), 1..40),
            tau in 1e-3..1.0_f64
        ) {
            let samples: Vec<Sample> =
                raw.iter().map(|r| Sample { x: r.0, f: [r.1, r.2], w: r.3, mu: r.4 }).collect();
            check_dense::<2>(&samples, tau, 1e-6);
            check_dense::<3>(&samples, tau, 1e-6);
            check_dense::<4>(&samples, tau, 1e-6);
        }
    }
}
