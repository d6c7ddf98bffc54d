//! Regularised least squares in the spline space spanned by beta(x - m), with banded normal equations.
//!
//! Given samples (x_s, f_s) at arbitrary positions, minimise over the coefficients c_m of
//! J(x) = sum_m c_m beta(x - m)
//!
//! ```text
//! sum_s w_s (f_s - J(x_s))^2 + sum_s w_s mu_s J'(x_s)^2 + tau sum_m (c_m - c_{m-1})^2 + ridge sum_m c_m^2
//! ```
//!
//! (thesis eq. 2.4-2.5 with mu_s = lambda V_s; the tau term, which bridges intervals without samples, is
//! an addition). The normal equations have half bandwidth n = ORDER - 1 and are solved by an LDL^T
//! factorisation without fill-in: O(M n^2) for any number of right-hand sides.

mod roughness;

pub use roughness::PosteriorCovariance;

use super::SamplingError;
use super::kernel::BSpline;

/// A pivot below this share of the largest diagonal entry is rounding error.
const SMALLEST_PIVOT: f64 = 1e-14;

/// Beyond this position doubles are too coarse for a knot index.
const LARGEST_POSITION: f64 = 1e15;

/// Samples whose weights are computed together; with more, the numbers do not fit the vector registers.
const BATCH: usize = 4;

/// A sample of a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FitSample<const C: usize> {
    /// Position, in knots.
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
/// ORDER = degree + 1, 2 or 4; C values per sample, which share one factorisation. The fit owns its
/// work memory: [`Fit::reset`] starts the next problem, without allocating if that is no larger.
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
        let mut fit = Self { first, knots, band: Vec::new(), rhs: Vec::new() };
        fit.reset(first, knots);
        fit
    }

    /// An empty problem with the knots -n .. last + n, n the degree. It accepts every sample in
    /// \[0, last\], and samples outside whose splines all have indices in the range.
    pub fn covering(last: usize) -> Self {
        let degree = ORDER - 1;
        Self::new(-(degree as i64), last + 1 + 2 * degree)
    }

    /// Forgets all samples and takes a new range of coefficients.
    pub fn reset(&mut self, first: i64, knots: usize) {
        (self.first, self.knots) = (first, knots);
        // With ORDER - 1 rows of padding the elimination needs no test for the end of the band.
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

    /// Adds one sample: position, values, weight w >= 0 and slope weight mu >= 0.
    ///
    /// Returns false, and adds nothing, when a spline that is nonzero at `x` lies outside the range.
    #[inline]
    pub fn add(&mut self, x: f64, values: &[f64; C], weight: f64, slope_weight: f64) -> bool {
        let sample = FitSample { x, values: *values, weight, slope_weight };
        let (knot, w, d) = BSpline::<ORDER>::weights_and_slopes(x);
        self.accumulate(&sample, knot, &w, &d)
    }

    /// Adds many samples in their order. The result has the same bits as [`Fit::add`] for each, in less
    /// time.
    ///
    /// Returns how many were added; the others have a spline outside the range.
    pub fn add_all(&mut self, samples: impl IntoIterator<Item = FitSample<C>>) -> usize {
        let padding = FitSample { x: f64::NAN, values: [0.0; C], weight: 0.0, slope_weight: 0.0 };
        let mut samples = samples.into_iter();
        let mut added = 0;
        loop {
            let (mut batch, mut positions, mut count) = ([padding; BATCH], [f64::NAN; BATCH], 0);
            while count < BATCH {
                let Some(sample) = samples.next() else { break };
                (batch[count], positions[count]) = (sample, sample.x);
                count += 1;
            }
            let (knots, all_w, all_d) = BSpline::<ORDER>::weights_and_slopes_of(&positions);
            for (i, sample) in batch[..count].iter().enumerate() {
                let (mut w, mut d) = ([0.0; ORDER], [0.0; ORDER]);
                for j in 0..ORDER {
                    (w[j], d[j]) = (all_w[j][i], all_d[j][i]);
                }
                added += usize::from(self.accumulate(sample, knots[i], &w, &d));
            }
            if count < BATCH {
                return added;
            }
        }
    }

    /// Adds one sample with its weights w and slopes d at the knots from `knot`.
    #[inline]
    fn accumulate(&mut self, s: &FitSample<C>, knot: i64, w: &[f64; ORDER], d: &[f64; ORDER]) -> bool {
        // Also false for NaN, whose knot would be 0.
        let representable = s.x.abs() < LARGEST_POSITION;
        if !representable {
            return false;
        }
        let Some(row) = self.row_of(knot) else { return false };
        let penalty = s.weight * s.slope_weight;
        // With arrays instead of slices the loops have no bounds checks.
        let Some(band) = self.band[row..].first_chunk_mut::<ORDER>() else { return false };
        for k in 0..ORDER {
            let (wk, dk) = (s.weight * w[k], penalty * d[k]);
            // An even number of entries, as vector registers hold; the last one may get a product with 0.
            for j in 0..(ORDER - k).next_multiple_of(2).min(ORDER) {
                let (wl, dl) = if k + j < ORDER { (w[k + j], d[k + j]) } else { (0.0, 0.0) };
                band[k][j] += wk * wl + dk * dl;
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
    /// a coefficient that neither a sample nor the regularisation determines.
    pub fn solve(&mut self) -> Result<(), SamplingError> {
        let largest = self.band.iter().fold(0.0, |max: f64, row| max.max(row[0]));
        for m in 0..self.knots {
            let column = self.band[m];
            // Written so that NaN is an error too.
            let positive = column[0] > SMALLEST_PIVOT * largest;
            if !positive {
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
            let Some(rows) = self.rhs[m..].first_chunk_mut::<ORDER>() else { return };
            let mut here = rows[0].map(|r| r * column[0]);
            for i in 1..ORDER {
                for c in 0..C {
                    here[c] -= column[i] * rows[i][c];
                }
            }
            rows[0] = here;
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
mod tests;
