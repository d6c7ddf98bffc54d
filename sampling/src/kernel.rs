//! Interpolation kernels: centred B-splines of odd degree, with their slopes.
//!
//! M. Unser, "Splines: a perfect fit for signal and image processing", IEEE Signal Processing
//! Magazine 16(6), 1999. Unit spacing throughout: x is counted in knots.

/// The largest integer not above x, saturating. On baseline x86-64 `f64::floor` would be a library call.
#[inline]
fn floor(x: f64) -> i64 {
    let toward_zero = x as i64;
    toward_zero - i64::from(toward_zero as f64 > x)
}

/// Added to a smaller number, it leaves no bits for a fraction: the sum is rounded to an integer.
const ROUNDING_SUMMAND: f64 = 1.5 * (1_u64 << 52) as f64;

/// Positions below it are rounded so; a quarter of what the sum can hold.
const LARGEST_ROUNDED: f64 = (1_u64 << 50) as f64;

/// The centred B-spline of the odd degree ORDER - 1, as the weights at x of the ORDER splines that are
/// nonzero there: `BSpline::<2>` is the hat, `BSpline::<4>` the cubic.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct BSpline<const ORDER: usize>;

impl<const ORDER: usize> BSpline<ORDER> {
    /// The degree n = ORDER - 1.
    pub(super) const DEGREE: usize = ORDER - 1;

    /// First knot k with beta(x - k) possibly nonzero, and the position of x within the knot span, in \[0,
    /// 1).
    #[inline]
    pub(super) fn locate(x: f64) -> (i64, f64) {
        // Even degrees have their breaks half-way between the knots.
        const { assert!(ORDER >= 2 && ORDER.is_multiple_of(2), "splines of odd degree") }
        let floor = floor(x);
        (floor - (Self::DEGREE / 2) as i64, x - floor as f64)
    }

    /// [`BSpline::locate`] at N positions at once. Positions of usual size are rounded by a sum: casts to
    /// integers test for their range and go one by one.
    #[inline(always)]
    fn locate_all<const N: usize>(x: &[f64; N]) -> ([i64; N], [f64; N]) {
        let (mut knots, mut t) = ([0; N], [0.0; N]);
        let usual = x.iter().fold(true, |all, x| all & (x.abs() < LARGEST_ROUNDED));
        for i in 0..N {
            let sum = x[i] + ROUNDING_SUMMAND;
            let nearest = sum - ROUNDING_SUMMAND;
            // The nearest integer may lie above.
            let above = nearest > x[i];
            let floor = nearest - if above { 1.0 } else { 0.0 };
            let integer =
                (sum.to_bits() as i64).wrapping_sub(ROUNDING_SUMMAND.to_bits() as i64) - i64::from(above);
            (knots[i], t[i]) = (integer - (Self::DEGREE / 2) as i64, x[i] - floor);
        }
        if !usual {
            for i in 0..N {
                (knots[i], t[i]) = Self::locate(x[i]);
            }
        }
        (knots, t)
    }

    /// First knot k0 and beta(x - k0 - j), j = 0..ORDER; the weights are >= 0 and sum to one.
    #[inline]
    pub(super) fn weights(x: f64) -> (i64, [f64; ORDER]) {
        let (first, t) = Self::locate(x);
        (first, raise::<ORDER, 1>(&[t], ORDER).map(|[w]| w))
    }

    /// First knot k0 and the slopes beta'(x - k0 - j), j = 0..ORDER; they sum to zero.
    ///
    /// At a break of a hat the slope to the right is taken.
    #[inline]
    pub(super) fn slopes(x: f64) -> (i64, [f64; ORDER]) {
        let (first, t) = Self::locate(x);
        (first, differences(&raise::<ORDER, 1>(&[t], Self::DEGREE)).map(|[d]| d))
    }

    /// First knot, weights and slopes in one call.
    #[inline]
    pub(super) fn weights_and_slopes(x: f64) -> (i64, [f64; ORDER], [f64; ORDER]) {
        let ([first], w, d) = Self::weights_and_slopes_of(&[x]);
        (first, w.map(|[w]| w), d.map(|[d]| d))
    }

    /// Weights at a position t of a knot span, 0 <= t <= 1.
    #[inline(always)]
    pub(super) fn in_span(t: f64) -> [f64; ORDER] {
        raise::<ORDER, 1>(&[t], ORDER).map(|[w]| w)
    }

    /// [`Self::weights_and_slopes`] at N positions at once, with the positions innermost. They are
    /// independent of each other, so the processor need not wait for each step of the recursion. The bits
    /// are those of single calls.
    // Not inlined, the arrays would pass through memory, which takes half of a fit's time.
    #[inline(always)]
    pub(super) fn weights_and_slopes_of<const N: usize>(
        x: &[f64; N],
    ) -> ([i64; N], [[f64; N]; ORDER], [[f64; N]; ORDER]) {
        let (knots, t) = Self::locate_all(x);
        let lower = raise::<ORDER, N>(&t, Self::DEGREE);
        (knots, raise_once(&lower, &t, ORDER), differences(&lower))
    }
}

/// Weights of the `order` B-splines of degree `order` - 1 that are nonzero at the positions t of a knot
/// span (Cox-de Boor recursion), for N positions at once.
#[inline(always)]
fn raise<const ORDER: usize, const N: usize>(t: &[f64; N], order: usize) -> [[f64; N]; ORDER] {
    let mut w = [[0.0; N]; ORDER];
    w[0] = [1.0; N];
    // The first steps are written out: the weights of a loop over all would lie in memory, which takes a
    // third of the time of a fit's samples.
    if order >= 2 {
        w = raise_once(&w, t, 2);
    }
    if order >= 3 {
        w = raise_once(&w, t, 3);
    }
    if order >= 4 {
        w = raise_once(&w, t, 4);
    }
    for step in 5..=order {
        w = raise_once(&w, t, step);
    }
    w
}

/// One step of the recursion: `order` - 1 weights become `order`.
#[inline(always)]
fn raise_once<const ORDER: usize, const N: usize>(
    lower: &[[f64; N]; ORDER],
    t: &[f64; N],
    order: usize,
) -> [[f64; N]; ORDER] {
    let mut w = [[0.0; N]; ORDER];
    let degree = (order - 1) as f64;
    let share = 1.0 / degree;
    for j in 0..order {
        for i in 0..N {
            let right = lower[j][i];
            let left = if j > 0 { lower[j - 1][i] } else { 0.0 };
            // Knot j of the span: the spline to its left rises with t + degree - j, the other falls.
            w[j][i] = ((t[i] + degree - j as f64) * left + (1.0 + j as f64 - t[i]) * right) * share;
        }
    }
    w
}

/// beta_n'(x) = beta_{n-1}(x + 1/2) - beta_{n-1}(x - 1/2), written for the weights of one span.
#[inline(always)]
fn differences<const ORDER: usize, const N: usize>(lower: &[[f64; N]; ORDER]) -> [[f64; N]; ORDER] {
    let mut d = [[0.0; N]; ORDER];
    for j in 0..ORDER {
        for i in 0..N {
            let left = if j > 0 { lower[j - 1][i] } else { 0.0 };
            let right = if j + 1 < ORDER { lower[j][i] } else { 0.0 };
            d[j][i] = left - right;
        }
    }
    d
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// beta_n by its definition: n+1 truncated powers, for n >= 1.
    fn truncated_powers(n: usize, x: f64) -> f64 {
        let half = (n + 1) as f64 / 2.0;
        let mut binomial = 1.0;
        let mut factorial = 1.0;
        let mut sum = 0.0;
        for k in 0..=n + 1 {
            let base: f64 = x + half - k as f64;
            let power = if base > 0.0 { base.powi(n as i32) } else { 0.0 };
            sum += if k % 2 == 0 { binomial } else { -binomial } * power;
            binomial *= (n + 1 - k) as f64 / (k + 1) as f64;
        }
        for k in 1..=n {
            factorial *= k as f64;
        }
        sum / factorial
    }

    fn cubic(t: f64) -> f64 {
        let a = t.abs();
        if a < 1.0 {
            2.0 / 3.0 - a * a + a * a * a / 2.0
        } else if a < 2.0 {
            (2.0 - a).powi(3) / 6.0
        } else {
            0.0
        }
    }

    fn check_order<const ORDER: usize>(x: f64) {
        let (first, w, slope) = BSpline::<ORDER>::weights_and_slopes(x);
        assert_eq!((first, w), BSpline::<ORDER>::weights(x));
        assert_eq!((first, slope), BSpline::<ORDER>::slopes(x));
        assert!((w.iter().sum::<f64>() - 1.0).abs() < 1e-14);
        assert!(slope.iter().sum::<f64>().abs() < 1e-14);
        for j in 0..ORDER {
            let t = x - (first + j as i64) as f64;
            let exact = truncated_powers(ORDER - 1, t);
            assert!((w[j] - exact).abs() < 1e-12, "order {ORDER} x={x} j={j}: {} {exact}", w[j]);
            let h = 1e-6;
            let numeric =
                (truncated_powers(ORDER - 1, t + h) - truncated_powers(ORDER - 1, t - h)) / (2.0 * h);
            assert!((slope[j] - numeric).abs() < 1e-5, "order {ORDER} x={x} j={j}");
        }
    }

    #[test]
    fn splines_are_the_truncated_powers() {
        for step in -40..40 {
            let x = step as f64 * 0.173 + 0.0313;
            check_order::<2>(x);
            check_order::<4>(x);
            check_order::<6>(x);
        }
    }

    #[test]
    fn the_closed_forms() {
        assert_eq!(BSpline::<2>::weights(2.25), (2, [0.75, 0.25]));
        assert_eq!(BSpline::<2>::slopes(2.25), (2, [-1.0, 1.0]));
        let (first, w) = BSpline::<4>::weights(-3.4);
        assert_eq!(first, -5);
        for (j, w) in w.iter().enumerate() {
            assert!((w - cubic(-3.4 - (first + j as i64) as f64)).abs() < 1e-15);
        }
    }

    #[test]
    fn floors_are_floors() {
        for x in [-2.0, -1.5, -1e-300, 0.0, 0.5, 1.0, 1e15 + 0.5, -1e15 - 0.5] {
            assert_eq!(floor(x) as f64, x.floor());
        }
    }

    /// Positions are located together as they are alone, also beside one that is too large or not a number.
    #[test]
    fn many_positions_are_located_as_one() {
        let usual = [-2.5, -2.0, -1e-300, -0.0, 0.0, 0.5, 0.999_999_999, 7.0, 1e15 + 0.5, -1e15 - 0.5];
        let mut strange = usual;
        (strange[3], strange[4], strange[5], strange[6]) = (f64::NAN, 1e300, f64::INFINITY, -3e18);
        for x in [usual, strange] {
            let bits = |(knot, t): (i64, f64)| (knot, t.to_bits());
            let (knots, t) = BSpline::<4>::locate_all(&x);
            assert!(
                (0..x.len()).all(|i| bits((knots[i], t[i])) == bits(BSpline::<4>::locate(x[i]))),
                "{x:?}"
            );
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn weights_shift_with_the_knots(x in -100.0..100.0_f64, k in -50_i64..50) {
            let (first, w) = BSpline::<4>::weights(x);
            let (moved, v) = BSpline::<4>::weights(x + k as f64);
            // Rounding of x + k may carry a position of 1 - eps into the next span; then compare values.
            let at = |first: i64, w: &[f64; 4], knot: i64| {
                usize::try_from(knot - first).ok().and_then(|j| w.get(j).copied()).unwrap_or(0.0)
            };
            for knot in first - 1..first + 5 {
                prop_assert!((at(first, &w, knot) - at(moved, &v, knot + k)).abs() < 1e-12);
            }
        }
    }
}
