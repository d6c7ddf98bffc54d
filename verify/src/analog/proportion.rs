//! Filters that are exactly proportional, as far as their written forms show it.

use crate::arithmetic::{Ball, Float512, LongBall};
use hybank_core::spec::FilterSpec;

/// g with `a` = g `b`, if both are written in one form that shows it without rounding: with proportional
/// coefficients, with the same zeros and poles, or equal. Filters that only agree up to rounding have none.
pub fn proportion(a: &FilterSpec, b: &FilterSpec) -> Option<LongBall> {
    use FilterSpec::{Cascade, TransferFunction, ZeroPoleGain};
    match (a, b) {
        _ if a == b => Some(Ball::from(1.0)),
        (TransferFunction { num, den }, TransferFunction { num: other_num, den: other_den }) => {
            Some(common_factor(num, other_num)? * common_factor(other_den, den)?)
        }
        (
            ZeroPoleGain { zeros, poles, gain },
            ZeroPoleGain { zeros: other_zeros, poles: other_poles, gain: other },
        ) => {
            let same = sorted(zeros) == sorted(other_zeros) && sorted(poles) == sorted(other_poles);
            same.then(|| quotient(*gain, *other))
        }
        (Cascade { cascade }, Cascade { cascade: other }) if cascade.len() == other.len() => {
            let stages = cascade.iter().zip(other);
            stages.map(|(a, b)| proportion(a, b)).try_fold(Ball::from(1.0), |all, one| Some(all * one?))
        }
        _ => None,
    }
}

/// g with x = g y, leading zeros apart.
fn common_factor(x: &[f64], y: &[f64]) -> Option<LongBall> {
    let significant = |list: &[f64]| -> Vec<f64> { list.iter().copied().skip_while(|&x| x == 0.0).collect() };
    let (x, y) = (significant(x), significant(y));
    let (&first, &other) = x.first().zip(y.first())?;
    // Products of two doubles are exact.
    let product = |a: f64, b: f64| Float512::from(a) * Float512::from(b);
    let agree = x.iter().zip(&y).all(|(&a, &b)| product(a, other) == product(b, first));
    (x.len() == y.len() && agree).then(|| quotient(first, other))
}

/// x / y, exactly where that is a double.
fn quotient(x: f64, y: f64) -> LongBall {
    let rounded = x / y;
    let is_exact = Float512::from(rounded) * Float512::from(y) == Float512::from(x);
    if is_exact { Ball::from(rounded) } else { Ball::from(x) / Ball::from(y) }
}

fn sorted(roots: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut roots = roots.to_vec();
    roots.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    roots
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tf(num: &[f64], den: &[f64]) -> FilterSpec {
        FilterSpec::TransferFunction { num: num.to_vec(), den: den.to_vec() }
    }

    fn zpk(poles: &[[f64; 2]], gain: f64) -> FilterSpec {
        FilterSpec::ZeroPoleGain { zeros: Vec::new(), poles: poles.to_vec(), gain }
    }

    /// What the midpoint is, and whether it is exact.
    fn found(a: &FilterSpec, b: &FilterSpec) -> Option<(f64, bool)> {
        proportion(a, b).map(|g| (g.nearest(), g.radius() == 0.0))
    }

    #[test]
    fn only_what_is_exactly_proportional_counts() {
        let rc = tf(&[1.0], &[1.0, 1.0]);
        assert_eq!(found(&rc, &rc), Some((1.0, true)));
        assert!(found(&tf(&[0.0, 3.0], &[2.0, 2.0]), &rc).is_some_and(|(g, _)| g == 1.5));
        assert_eq!(found(&tf(&[1.0], &[1.0, 1.0 + f64::EPSILON]), &rc), None);
        // 0.1 * 3 is not 0.3 in doubles.
        assert_eq!(found(&tf(&[0.1], &[0.1, 0.1]), &tf(&[0.3], &[0.3, 0.1 * 3.0])), None);
        let pair = [[-1.0, 2.0], [-1.0, -2.0]];
        assert_eq!(found(&zpk(&pair, 6.0), &zpk(&[pair[1], pair[0]], 3.0)), Some((2.0, true)));
        assert_eq!(found(&zpk(&pair, 1.0), &zpk(&pair, 3.0)), Some((1.0 / 3.0, false)));
        assert_eq!(found(&zpk(&[[-1.0, 0.0]], 1.0), &rc), None);
        let cascade = |gain: f64| FilterSpec::Cascade { cascade: vec![rc.clone(), zpk(&pair, gain)] };
        assert!(found(&cascade(4.0), &cascade(2.0)).is_some_and(|(g, _)| g == 2.0));
    }
}
