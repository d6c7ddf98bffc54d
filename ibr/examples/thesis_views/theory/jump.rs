//! The error of linear interpolation across a jump, for random samples (thesis 4.3).
//!
//! The interval that contains a jump reaches a to its left and b to its right. The line across it errs by
//! |J| (a^2 + b^2) / (2 (a + b)) in the mean (L1 norm), |J| the height of the jump. The interval around a
//! given point is longer than the typical one: 2 / lambda for a Poisson process, not 1 / lambda.

use super::periodic::PeriodicSets;
use super::quadrature::{gauss_legendre, integral};

/// Expected L1 error beside a jump of height one, samples of the Poisson densities `left` and `right` (per
/// unit length) on its sides, both positive:
///
/// ```text
/// E[(a^2 + b^2) / (2 (a + b))] = l r integral_0^1 (w^2 + (1 - w)^2) / (l w + r (1 - w))^3 dw
/// ```
///
/// It is 2 / (3 lambda) for equal densities, and at most (1 / l + 1 / r) / 2.
pub fn poisson_jump_error(left: f64, right: f64) -> f64 {
    let (l, r) = (left.max(right), left.min(right));
    let ratio = l / r;
    if ratio < 2.0 {
        let term = |w: f64| (w * w + (1.0 - w) * (1.0 - w)) / (l * w + r * (1.0 - w)).powi(3);
        return l * r * integral(term, 0.0..1.0, 4);
    }
    // The same integral in closed form, which cancels for equal densities; q = w + (1 - w) / ratio.
    let logarithm = 2.0 * ratio.ln();
    let linear = 2.0 * (ratio + 1.0) * (1.0 / ratio - 1.0);
    let square = (ratio * ratio + 1.0) / 2.0 * (1.0 - 1.0 / (ratio * ratio));
    ratio / (ratio - 1.0).powi(3) * (logarithm + linear + square) / r
}

/// The same for superposed periodic sets, the phases on both sides independent: a and b have the densities
/// lambda P(D > a) of the distance from a given point to the next sample.
pub fn jump_error(left: &PeriodicSets, right: &PeriodicSets) -> f64 {
    let rule = gauss_legendre(24);
    let distances = |sets: &PeriodicSets| -> Vec<(f64, f64)> {
        let (reach, density) = (sets.shortest(), sets.density());
        rule.iter().map(|(t, w)| (t * reach, w * reach * density * sets.longer_than(t * reach))).collect()
    };
    let (left, right) = (distances(left), distances(right));
    let pairs = left.iter().flat_map(|p| right.iter().map(move |q| (p, q)));
    pairs.map(|((a, v), (b, w))| v * w * (a * a + b * b) / (2.0 * (a + b))).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// Densities in the ratios of the thesis's table, and far apart.
    #[test]
    fn the_table_and_its_limit() {
        for (ratio, want) in [(1.0, 0.667), (0.6, 0.912), (0.4, 1.255), (0.2, 2.380)] {
            let got = poisson_jump_error(3.0, 3.0 * ratio) * 3.0;
            assert!((got - want).abs() < 3e-3, "{ratio}: {got}");
            assert_eq!(got, poisson_jump_error(3.0 * ratio, 3.0) * 3.0);
            assert!(got <= (1.0 + 1.0 / ratio) / 2.0);
        }
        let (low, high) = (poisson_jump_error(1.0, 2.0 - 1e-9), poisson_jump_error(1.0, 2.0));
        assert!((low / high - 1.0).abs() < 1e-8, "{low} {high}");
        assert!((poisson_jump_error(1e6, 1.0) - 0.5).abs() < 1e-4);
    }

    /// One set on each side: a and b are uniform, and the mean is a sum over a grid.
    #[test]
    fn single_sets_have_a_closed_form() {
        let one = PeriodicSets::new(vec![0.8]).unwrap();
        let grid = 800;
        let at = |k: usize| 0.8 * (k as f64 + 0.5) / grid as f64;
        let terms = (0..grid * grid).map(|k| (at(k / grid), at(k % grid)));
        let mean = terms.map(|(a, b)| (a * a + b * b) / (2.0 * (a + b))).sum::<f64>() / (grid * grid) as f64;
        let got = jump_error(&one, &one);
        assert!((got / mean - 1.0).abs() < 1e-4, "{got} {mean}");
    }

    /// Ten cameras on one side and four on the other, phases drawn: only sorting and the triangle areas.
    #[test]
    fn superposed_sets_are_those_of_an_experiment() {
        let sets = |n: usize, p: f64| PeriodicSets::new(vec![p; n]).unwrap();
        let (left, right) = (sets(10, 1.0), sets(4, 1.3));
        let (mut random, mut sum) = (Random(9), 0.0);
        let draws = 40_000;
        for _ in 0..draws {
            let mut nearest = |n: usize, p: f64| (0..n).map(|_| p * random.part()).fold(f64::MAX, f64::min);
            let (a, b) = (nearest(10, 1.0), nearest(4, 1.3));
            sum += (a * a + b * b) / (2.0 * (a + b));
        }
        let (got, want) = (jump_error(&left, &right), sum / f64::from(draws));
        assert!((got / want - 1.0).abs() < 0.02, "{got} {want}");
        let many = jump_error(&sets(60, 20.0), &sets(60, 50.0));
        assert!((many / poisson_jump_error(3.0, 1.2) - 1.0).abs() < 0.03, "{many}");
    }
}
