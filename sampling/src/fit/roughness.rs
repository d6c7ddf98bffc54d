//! Fits with a penalty on roughness (cubic smoothing splines), and the posterior covariance of their values.

use super::Fit;
use crate::kernel::BSpline;

/// Share of a variance below which what is left of it does not count.
const NEGLIGIBLE_VARIANCE: f64 = 1e-14;

/// Posterior covariance of a value and the slope there, for weights that are inverse variances.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PosteriorCovariance {
    /// Variance of J(x).
    pub variance: f64,
    /// Covariance of J(x) and J'(x).
    pub covariance: f64,
    /// Variance of J'(x).
    pub slope_variance: f64,
}

impl<const C: usize> Fit<4, C> {
    /// Adds stiffness times the integral of J''(x)^2 over the range of the knots, exactly.
    ///
    /// J'' is linear between knots, with the values g_m = c_{m-1} - 2 c_m + c_{m+1} there, so the integral
    /// over one interval is (g_m^2 + g_m g_{m+1} + g_{m+1}^2) / 3. With the weights 1 / sigma_s^2 and the
    /// stiffness 1 / q the fit is the most probable function whose slope walks at random with the variance q
    /// per unit (G. Wahba, *Improper priors, spline smoothing and the problem of guarding against model
    /// errors in regression*, J. R. Statist. Soc. B 40, 1978). Lines have no roughness, so two samples
    /// determine all coefficients.
    pub fn add_roughness_penalty(&mut self, stiffness: f64) {
        const LEFT: [f64; 4] = [1.0, -2.0, 1.0, 0.0];
        const RIGHT: [f64; 4] = [0.0, 1.0, -2.0, 1.0];
        for m in 0..self.knots.saturating_sub(3) {
            for (i, row) in self.band[m..].iter_mut().take(4).enumerate() {
                for (j, entry) in row.iter_mut().take(4 - i).enumerate() {
                    let k = i + j;
                    let crossed = 0.5 * (LEFT[i] * RIGHT[k] + RIGHT[i] * LEFT[k]);
                    *entry += stiffness / 3.0 * (LEFT[i] * LEFT[k] + crossed + RIGHT[i] * RIGHT[k]);
                }
            }
        }
    }

    /// The posterior covariance at x for weights that are inverse variances; meaningful after
    /// [`Fit::solve`], for an x whose splines lie in the range. With A = L D L' the variance b' A^{-1} b is
    /// the sum of the squares of L^{-1} b over D, and L^{-1} b begins at x.
    pub fn posterior_covariance(&self, x: f64) -> PosteriorCovariance {
        let (knot, w, d) = BSpline::<4>::weights_and_slopes(x);
        let mut known = PosteriorCovariance { variance: 0.0, covariance: 0.0, slope_variance: 0.0 };
        let Some(row) = self.row_of(knot) else { return known };
        // The next four entries of L^{-1} b, from the current row on.
        let (mut w, mut d) = (w, d);
        for column in &self.band[row..self.knots] {
            let (value, slope) = (w[0], d[0]);
            let terms = [value * value, value * slope, slope * slope].map(|product| product * column[0]);
            known.variance += terms[0];
            known.covariance += terms[1];
            known.slope_variance += terms[2];
            for i in 1..4 {
                (w[i - 1], d[i - 1]) = (w[i] - column[i] * value, d[i] - column[i] * slope);
            }
            (w[3], d[3]) = (0.0, 0.0);
            let rest = |next: &[f64; 4]| next.iter().map(|v| v * v * column[0]).sum::<f64>();
            if rest(&w) < NEGLIGIBLE_VARIANCE * known.variance
                && rest(&d) < NEGLIGIBLE_VARIANCE * known.slope_variance
            {
                break;
            }
        }
        known
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against the integral of J''^2 by differences of J', for the coefficients of some fit.
    #[test]
    fn the_roughness_penalty_is_the_integral_of_the_squared_second_derivative() {
        let mut fit = Fit::<4, 1>::new(-1, 9);
        for (x, y) in [(0.2, 1.0), (1.7, -2.0), (3.1, 0.5), (4.4, 3.0), (5.9, -1.0)] {
            fit.add(x, &[y], 1.0, 0.0);
        }
        fit.regularise(0.0, 0.01);
        fit.solve().unwrap();
        let c: Vec<f64> = fit.coefficients().iter().map(|c| c[0]).collect();
        let mut penalty = Fit::<4, 1>::new(-1, 9);
        penalty.add_roughness_penalty(2.0);
        let form: f64 = (0..9)
            .flat_map(|m| (0..4).filter(move |j| m + j < 9).map(move |j| (m, j)))
            .map(|(m, j)| penalty.band[m][j] * c[m] * c[m + j] * if j == 0 { 1.0 } else { 2.0 })
            .sum();
        // From the second knot of the range to the last but one.
        let n = 6000;
        let h = 6.0 / f64::from(n);
        let second = |k: i32| {
            let x = h * (f64::from(k) + 0.5);
            (fit.slope(x + 1e-4)[0] - fit.slope(x - 1e-4)[0]) / 2e-4
        };
        let integral: f64 = (0..n).map(|k| second(k).powi(2) * h).sum();
        assert!((form / (2.0 * integral) - 1.0).abs() < 1e-3, "{form} {integral}");
    }

    /// The variance of the value is that of the influences of the samples, of which each changes the fit.
    #[test]
    fn the_posterior_covariance_is_the_inverse_of_the_normal_equations() {
        let solved = |changed: f64, at: f64, slope: bool| {
            let mut fit = Fit::<4, 1>::new(-1, 14);
            for k in 0..12 {
                let x = 0.9 * f64::from(k) + 0.3 * f64::from(k % 2);
                fit.add(x, &[0.0], 2.0 + f64::from(k % 3), 0.0);
            }
            fit.add_roughness_penalty(3.0);
            // A right-hand side b gives A^{-1} b.
            let (knot, w, d) = BSpline::<4>::weights_and_slopes(at);
            let row = fit.row_of(knot).unwrap();
            for i in 0..4 {
                fit.rhs[row + i][0] += changed * if slope { d[i] } else { w[i] };
            }
            fit.solve().unwrap();
            fit
        };
        for x in [0.0, 4.3, 7.5, 10.2] {
            let known = solved(0.0, x, false).posterior_covariance(x);
            let (by_value, by_slope) = (solved(1.0, x, false), solved(1.0, x, true));
            for (found, want) in [
                (known.variance, by_value.value(x)[0]),
                (known.covariance, by_value.slope(x)[0]),
                (known.slope_variance, by_slope.slope(x)[0]),
            ] {
                assert!((found - want).abs() < 1e-10 * want.abs().max(0.1), "{x}: {found} {want}");
            }
        }
    }

    #[test]
    fn lines_have_no_roughness() {
        let mut fit = Fit::<4, 1>::new(-1, 40);
        for x in [1.0, 2.5, 30.0] {
            fit.add(x, &[3.0 - 0.5 * x], 1.0, 0.0);
        }
        fit.add_roughness_penalty(1e3);
        fit.solve().unwrap();
        for x in [0.0, 12.3, 36.0] {
            assert!((fit.value(x)[0] - (3.0 - 0.5 * x)).abs() < 1e-6, "{x}: {:?}", fit.value(x));
        }
    }
}
