//! How much each sample of a fit counts at a position.

use super::Fit;
use crate::kernel::BSpline;

/// Knots after which the response to one knot has decayed below 1e-6 where samples or filled holes are
/// dense.
const INFLUENCE_KNOTS: usize = 24;

/// The row of A^{-1} that belongs to one position, cut off where it has decayed: J(x) = sum_k z_k r_k with
/// the right-hand sides r_k of the normal equations.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Response {
    first: i64,
    z: Vec<f64>,
}

impl Response {
    /// dJ(x) / dI of a sample of weight one at `position`; 0 beyond the cut.
    ///
    /// Multiplied by the sample's weight it is its influence h: J(x) is the sum of h I over all samples.
    #[inline]
    pub fn at<const ORDER: usize>(&self, position: f64) -> f64 {
        let (knot, w) = BSpline::<ORDER>::weights(position);
        let term = |(j, w): (usize, &f64)| {
            let index = usize::try_from(knot + j as i64 - self.first).ok()?;
            Some(w * self.z.get(index)?)
        };
        w.iter().enumerate().filter_map(term).sum()
    }
}

impl<const ORDER: usize, const C: usize> Fit<ORDER, C> {
    /// The response of J(x) to the right-hand sides; meaningful after [`Fit::solve`]. It solves A z = b(x)
    /// with the factors that `solve` left, within 24 knots of x: O(ORDER) per knot.
    pub fn respond(&self, x: f64, response: &mut Response) {
        self.respond_within(x, INFLUENCE_KNOTS, response);
    }

    /// The same within `reach` knots of x.
    pub fn respond_within(&self, x: f64, reach: usize, response: &mut Response) {
        let (knot, w) = BSpline::<ORDER>::weights(x);
        let center = (knot - self.first).clamp(0, self.knots as i64) as usize;
        let (start, end) = (center.saturating_sub(reach), (center + ORDER + reach).min(self.knots));
        response.first = self.first + start as i64;
        response.z.clear();
        response.z.resize(end.saturating_sub(start), 0.0);
        let z = &mut response.z;
        for (j, w) in w.iter().enumerate() {
            if let Some(slot) = z.get_mut(center + j - start) {
                *slot = *w;
            }
        }
        // L y = b, then D L' z = y; b is 0 before the center, and so is y.
        for m in center - start..z.len() {
            let here = z[m];
            for (i, factor) in self.band[start + m].iter().enumerate().skip(1) {
                if let Some(below) = z.get_mut(m + i) {
                    *below -= factor * here;
                }
            }
        }
        for m in (0..z.len()).rev() {
            let column = &self.band[start + m];
            let later: f64 = (1..ORDER).filter_map(|i| Some(column[i] * z.get(m + i)?)).sum();
            z[m] = z[m] * column[0] - later;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Changing one sample by one changes J(x) by its influence: the whole fit is solved again.
    #[test]
    fn the_influence_is_the_change_of_the_fit() {
        let positions: Vec<f64> = (0..90).map(|i| 0.45 * f64::from(i) + 0.2 * f64::from(i % 3)).collect();
        let fit = |changed: Option<usize>| {
            let mut fit = Fit::<4, 1>::covering(40);
            for (i, x) in positions.iter().enumerate() {
                let value = (0.3 * x).sin() + if changed == Some(i) { 1.0 } else { 0.0 };
                fit.add(*x, &[value], 1.0 + 0.1 * (i % 4) as f64, 0.1);
            }
            fit.regularise(0.05, 1e-9);
            fit.solve().unwrap();
            fit
        };
        let (before, mut response) = (fit(None), Response::default());
        for x in [0.0, 7.3, 20.0, 39.9] {
            before.respond(x, &mut response);
            let mut sum = 0.0;
            for (i, position) in positions.iter().enumerate() {
                let h = (1.0 + 0.1 * (i % 4) as f64) * response.at::<4>(*position);
                sum += h;
                if i % 7 == 0 {
                    let want = fit(Some(i)).value(x)[0] - before.value(x)[0];
                    assert!((h - want).abs() < 1e-6, "x = {x}, sample {i}: {h} {want}");
                }
            }
            // Constants are reproduced.
            assert!((sum - 1.0).abs() < 1e-6, "{x}: {sum}");
        }
    }
}
