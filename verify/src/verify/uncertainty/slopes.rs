//! Filters that stand for errors of a front end, and the largest norm of a row of samples.
//!
//! - An error d of the delay, |d| <= delta, multiplies a sample's filter by e^{-s d}. To first order that
//!   adds -d s / (1 + s delta / 2), the first Pade form, which is bounded for every frequency. On the
//!   imaginary axis, with y = |s| delta,
//!
//!   ```text
//!   |e^{-s d} - 1 + s d / (1 + s delta / 2)| <= C y^2 / (1 + y^2 / 4),
//!   ```
//!
//!   the square of the modulus of delta s / (1 + s delta / 2) times [`PADE_REMAINDER`], and
//!   |e^{-s d} - 1| <= min(2, y) is at most 2^(1/2) times that modulus.
//! - An error of the cut-off makes Phi(s (1 + x)) of Phi(s); to first order that adds x s Phi'(s) =
//!   -x s C (s - A)^-2 B.

use super::super::ball::{self, Ball, Matrix};
use super::super::front_ends::{Equations, FrontEnds};
use super::super::positive::SUM_OUTWARD;
use super::super::state_transition::{EnclosedTransition, state_transition};
use super::super::timeline::SamplingInstant;
use crate::arithmetic::{DoubleDouble, Float, Float512, LongBall};
use hybank_core::units::{FastPeriods, GridTime, Seconds};

/// C of the module's page. `the_pade_form_leaves_at_most_its_remainder` proves it.
pub(super) const PADE_REMAINDER: f64 = 1.26;
/// Smallest delta of a Pade form: smaller errors take that of this one, which holds for them too. Its
/// remainder is below 1e-17, and 106 bits resolve it.
const LEAST_HALF_WIDTH: FastPeriods = FastPeriods(1e-9);
/// Powers of the transition are small from this row sum on, so that the sum over all of them is known.
const SMALL_POWER: f64 = 1e-15;
/// Doublings of the number of slow periods until then.
const DOUBLINGS: usize = 20;
/// Remainder of the sum over the past, relative to the rounding error of an operation.
const NEGLIGIBLE_REMAINDER: f64 = 1e-9;
/// 2^64 slow periods bring any stable filter to its steady state.
const STEADY_DOUBLINGS: usize = 64;
/// Makes up for the roundings of the remainder's bound, sums of as many terms as there are states.
const REMAINDER_OUTWARD: f64 = 1.01;
/// Radii and the rest of a sum over it up to which it is resolved.
const RESOLVED: f64 = 1e-2;

/// The delta of the Pade form for an error of the delay.
pub(super) fn pade_width(half: FastPeriods) -> FastPeriods {
    FastPeriods(half.0.max(LEAST_HALF_WIDTH.0))
}

/// s / (1 + s delta / 2) times a strictly proper filter.
pub(super) fn delay_slope(filter: &Equations, delta: FastPeriods) -> Equations {
    let Equations { a, b, c, .. } = filter;
    let slope = Equations { c: ball::product(c, a), d: ball::product(c, b)[(0, 0)], ..filter.clone() };
    slope.then(&smoother(delta, [Ball::from(1.0), Ball::ZERO]))
}

/// s^2 / (1 + s delta / 2)^2 times a strictly proper filter.
pub(super) fn delay_curvature(filter: &Equations, delta: FastPeriods) -> Equations {
    let rate = rate(delta);
    delay_slope(filter, delta).then(&smoother(delta, [-rate, rate]))
}

/// c / (1 + s delta / 2) + d.
fn smoother(delta: FastPeriods, [c, d]: [LongBall; 2]) -> Equations {
    let scalar = |x| Matrix::from_element(1, 1, x);
    let rate = rate(delta);
    Equations { a: scalar(-rate), b: scalar(rate), c: scalar(c), d }
}

fn rate(delta: FastPeriods) -> LongBall {
    Ball::from(2.0) / Ball::from(delta.0)
}

/// s C (s - A)^-2 B.
pub(super) fn cutoff_slope(filter: &Equations) -> Equations {
    let Equations { a, b, c, .. } = filter;
    let n = filter.order();
    let mut twice = ball::zeros(2 * n, 2 * n);
    for (row, column, block) in [(0, 0, a), (n, n, a), (n, 0, &ball::identity(n))] {
        twice.view_mut((row, column), (n, n)).copy_from(block);
    }
    let slope = ball::product(c, a);
    Equations {
        a: twice,
        b: ball::above(b, &ball::zeros(n, 1)),
        c: Matrix::from_fn(1, 2 * n, |_, j| if j < n { c[j] } else { slope[j - n] }),
        d: Ball::ZERO,
    }
}

/// A bound on the norm of the row of one sample per slow period of `filter` after that of the signal: with
/// the autocorrelation r of its output for white noise, the square of the norm at an angle w is the sum over
/// n of r(n M) e^{-i w n}, at most that of |r(n M)|. Infinite if 512 bits do not show that the filters are
/// stable.
pub(super) fn row_norm(signal: Option<&Equations>, filter: Equations, ratio: usize) -> f64 {
    let mut front_ends = FrontEnds::driven_by(signal.cloned());
    let sample = SamplingInstant {
        filter: front_ends.push(filter),
        gain: Ball::from(1.0),
        time: GridTime::fast_sample(0.0, Seconds(1.0)),
    };
    let short = square_of_row::<DoubleDouble>(&front_ends, &sample, ratio);
    let square = short.or_else(|| square_of_row::<Float512>(&front_ends, &sample, ratio));
    square.map_or(f64::INFINITY, |square| square.sqrt() * SUM_OUTWARD)
}

/// A bound on the sum of |r(n M)|; `None` if the precision of F does not suffice.
fn square_of_row<F: Float>(front_ends: &FrontEnds, sample: &SamplingInstant, ratio: usize) -> Option<f64> {
    let (a, b) = front_ends.dynamics::<F>();
    let EnclosedTransition { transition, gramian } = state_transition(&a, &b, Ball::from(ratio as f64));
    let row = front_ends.output(sample);
    let state = steady_state(&transition, &gramian)?;
    absolute_sum(&row, &transition, &ball::product_transposed(&state, &row))
}

/// X = E X E' + G by doubling; the remainder after 2^k steps is at most ||E^(2^k)||^2 of the whole.
/// `None` if E is not seen to be stable.
fn steady_state<F: Float>(transition: &Matrix<F>, gramian: &Matrix<F>) -> Option<Matrix<F>> {
    let (mut state, mut power) = (gramian.clone(), transition.clone());
    for _ in 0..STEADY_DOUBLINGS {
        let size = ball::row_sum(&power) * ball::row_sum(&power.transpose());
        if size < F::ROUNDING * NEGLIGIBLE_REMAINDER {
            let rest = REMAINDER_OUTWARD * ball::row_sum(&state) * size;
            return Some(state.map(|x| x.widened(rest)));
        }
        state += ball::congruence(&power, &state);
        power = ball::product(&power, &power);
    }
    None
}

/// A bound on |c x| + 2 sum over n > 0 of |c E^n x|; `None` if that is not resolved.
///
/// The rows c E^n go on from their midpoints, since the radii of many products would grow without end. What
/// that leaves out of a row reaches the later ones through powers of E, whose row sums are bounded by those
/// of E, E^2, E^4, ..
fn absolute_sum<F: Float>(row: &Matrix<F>, transition: &Matrix<F>, x: &Matrix<F>) -> Option<f64> {
    let (mut power, mut periods, mut growth) = (transition.clone(), 1, 1.0f64);
    // Unknown numbers are not small.
    let is_small = |power: &Matrix<F>| ball::row_sum(power) < SMALL_POWER;
    while !is_small(&power) {
        if periods >> DOUBLINGS > 0 {
            return None;
        }
        growth *= ball::row_sum(&power).max(1.0);
        (power, periods) = (ball::product(&power, &power), 2 * periods);
    }
    let largest = x.iter().map(|x| x.magnitude()).fold(0.0, ball::nan_max);
    let value = |row: &Matrix<F>| ball::product(row, x)[(0, 0)];
    let first = value(row);
    let (mut sum, mut radii, mut rows) = (first.magnitude(), first.radius(), 0.0);
    let (mut later, mut left_out) = (row.clone(), 0.0);
    for _ in 0..periods {
        later = ball::product(&later, transition);
        left_out += growth * ball::row_radii(&later)[0];
        later = later.map(|x| Ball::exactly(x.mid()));
        let (next, error) = (value(&later), left_out * largest);
        (sum, radii) = (sum + 2.0 * (next.magnitude() + error), radii + 2.0 * (next.radius() + error));
        rows += ball::row_sum(&later) + left_out;
    }
    // What is left are the same rows times powers of E^periods.
    let rest = 4.0 * SMALL_POWER * rows * largest;
    (radii + rest <= RESOLVED * sum).then_some((sum + rest) * SUM_OUTWARD)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analog::{StrictlyProper, enclosed};
    use hybank_core::spec::{Family, FilterSpec, Passband};
    use hybank_core::units::{Hertz, RadiansPerFastPeriod};
    use hybank_linalg::Complex;
    use std::f64::consts::TAU;

    type C = Complex<f64>;

    /// The remainder over y^2 / (1 + y^2 / 4) for the share t of delta.
    fn ratio(y: f64, t: f64) -> f64 {
        let pade = C::new(0.0, y * t) / C::new(1.0, 0.5 * y);
        (C::from_polar(1.0, -y * t) - 1.0 + pade).norm() * (1.0 / (y * y) + 0.25)
    }

    /// With a = 1 + y^2 / 4 the remainder is y^2 |t / (2 + j y) - t^2 I|, |I| <= 1/2, so the ratio is at
    /// most (a^(1/2) + a) / 2: up to y = 1.19 that is below C. The remainder is also at most 2 + 2, so
    /// the ratio is at most 4 / y^2 + 1: from y = 3.93 on that is below C. Between them it changes by at
    /// most L per unit of y and t, with |d/dt| <= y + 2 and |d/dy| <= 2 of the remainder, and |d/dy| <= 2
    /// / y^3 of the factor.
    #[test]
    fn the_pade_form_leaves_at_most_its_remainder() {
        let (low, high, step) = (1.19f64, 3.93f64, 1e-3);
        let a = 1.0 + 0.25 * low * low;
        assert!(0.5 * (a.sqrt() + a) < PADE_REMAINDER && 4.0 / (high * high) + 1.0 < PADE_REMAINDER);
        let count = |length: f64| (length / step).ceil() as usize;
        let mut largest: f64 = 0.0;
        for y in (0..=count(high - low)).map(|k| low + step * k as f64) {
            let factor = 1.0 / (y * y) + 0.25;
            let slope = factor * (y + 2.0) + factor * 2.0 + 4.0 * 2.0 / y.powi(3);
            for t in (0..=count(2.0)).map(|k| step * k as f64 - 1.0) {
                let bound = ratio(y, t) + 0.5 * step * slope * 1.01;
                largest = largest.max(ratio(y, t));
                assert!(bound <= PADE_REMAINDER, "{y} {t}: {bound}");
            }
        }
        // It is attained at t = -1.
        assert!((largest - 1.2547).abs() < 1e-4, "{largest}");
    }

    fn filter(family: Family, order: usize, cutoff: f64) -> FilterSpec {
        FilterSpec::Family {
            family,
            order: Some(order),
            passband: Passband::LowPass { cutoff: Hertz(cutoff) },
            ripple_db: family.has_ripple().then_some(0.5),
            attenuation_db: family.has_attenuation().then_some(50.0),
        }
    }

    /// The largest norm of the row of samples of a filter times `factor`, by sums over aliases.
    fn alias_norm(written: &FilterSpec, ratio: usize, factor: impl Fn(&StrictlyProper, f64) -> C) -> f64 {
        let filter = StrictlyProper::new(written, Seconds(1.0)).unwrap();
        let square = |omega: f64| {
            let nu = |k: i32| (omega + TAU * f64::from(k)) / ratio as f64;
            (-1000..=1000).map(|k| factor(&filter, nu(k)).norm_sqr()).sum::<f64>() / ratio as f64
        };
        (0..=16).map(|k| square(std::f64::consts::PI * f64::from(k) / 16.0)).fold(0.0, f64::max).sqrt()
    }

    #[test]
    fn row_norms_are_at_most_a_little_above_the_sums_over_aliases() {
        let at = |filter: &StrictlyProper, nu: f64| filter.response(RadiansPerFastPeriod(nu));
        for (family, order, cutoff) in [
            (Family::Butterworth, 4, 0.3),
            (Family::Rc, 1, 0.2),
            (Family::Elliptic, 5, 0.1),
            (Family::Chebyshev1, 4, 0.4),
        ] {
            let written = filter(family, order, cutoff);
            let equations = enclosed(None, &written, Seconds(1.0)).unwrap();
            for delta in [0.2, 1e-3].map(FastPeriods) {
                let slope = |nu: f64| C::new(0.0, nu) / C::new(1.0, 0.5 * nu * delta.0);
                let derivative = |filter: &StrictlyProper, nu: f64| {
                    let h = 1e-4;
                    (at(filter, nu * (1.0 + h)) - at(filter, nu * (1.0 - h))) / (2.0 * h)
                };
                for (found, sum) in [
                    (equations.clone(), alias_norm(&written, 2, at)),
                    (delay_slope(&equations, delta), alias_norm(&written, 2, |f, nu| at(f, nu) * slope(nu))),
                    (
                        delay_curvature(&equations, delta),
                        alias_norm(&written, 2, |f, nu| at(f, nu) * slope(nu) * slope(nu)),
                    ),
                    (cutoff_slope(&equations), alias_norm(&written, 2, derivative)),
                ] {
                    let found = row_norm(None, found, 2);
                    assert!(found >= 0.98 * sum && found < 2.0 * sum, "{family:?} {delta:?}: {found} {sum}");
                }
            }
        }
    }

    /// Small errors after a smooth filter: poles apart by nine decades, and Gramians of twenty.
    #[test]
    fn small_errors_after_smooth_filters_are_resolved() {
        let equations = enclosed(None, &filter(Family::Chebyshev1, 8, 0.05), Seconds(1.0)).unwrap();
        let norm = |delta: f64| row_norm(None, delay_curvature(&equations, FastPeriods(delta)), 2);
        let largest = norm(1e-3);
        for delta in [1e-5, 1e-7, 1e-9] {
            assert!((norm(delta) / largest - 1.0).abs() < 1e-2, "{delta}: {} {largest}", norm(delta));
        }
    }

    /// A first-order low-pass: r(2 n) = e^{-2 n w} w / 2, and the sum is w / 2 coth(w).
    #[test]
    fn one_pole_has_its_closed_form() {
        let equations = enclosed(None, &filter(Family::Rc, 1, 0.2), Seconds(1.0)).unwrap();
        let w = TAU * 0.2;
        let exact = (0.5 * w / w.tanh()).sqrt();
        let found = row_norm(None, equations, 2);
        assert!(found >= exact && found < 1.003 * exact, "{found} {exact}");
    }
}
