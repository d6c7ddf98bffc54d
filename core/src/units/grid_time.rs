//! Times on the grid of fast periods, exact.

use super::{FastPeriods, Seconds};
use std::cmp::Ordering;

/// A time t = (n + p / q) h + r with the fast period h, a whole n, a fraction p / q in [0, 1) and
/// |r| <= h / 2: a delay, or the instant of a sample. All terms are exact for any two doubles t and h of a
/// spec, because the remainder of a division of doubles is a double; the fraction is that of a converter
/// that takes several samples in a frame. So times are compared without rounding, and the time between two
/// of them is rounded relative to itself: instants 1e-12 fast periods apart are that far apart.
///
/// A spec in seconds writes n fast periods as the double nearest to n h, which need not be n times h:
/// three periods of 0.1 s are 0.30000000000000004 s. Exactly this one double means n fast periods.
#[derive(Debug, Clone, Copy)]
pub struct GridTime {
    /// n; exact below 2^53.
    whole: f64,
    part: Fraction,
    /// r, in (-h/2, h/2].
    rest: Seconds,
    fast_period: Seconds,
}

/// A fraction in [0, 1).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fraction {
    /// Below the denominator.
    pub numerator: u32,
    /// Not zero.
    pub denominator: u32,
}

impl Fraction {
    const ZERO: Self = Self { numerator: 0, denominator: 1 };

    /// The nearest double.
    pub fn value(self) -> f64 {
        f64::from(self.numerator) / f64::from(self.denominator)
    }
}

impl PartialEq for GridTime {
    fn eq(&self, other: &Self) -> bool {
        self.compare(*other).is_eq()
    }
}

impl GridTime {
    /// The time t on the grid of the fast period h.
    pub fn new(time: Seconds, fast_period: Seconds) -> Self {
        let nearest = (time / fast_period).round();
        if fast_period * nearest == time {
            return Self::fast_sample(nearest, fast_period);
        }
        let rest = Seconds(time.0 % fast_period.0);
        Self::balanced(((time - rest) / fast_period).round(), rest, fast_period)
    }

    /// The instant of the fast sample n, a whole number.
    pub fn fast_sample(n: f64, fast_period: Seconds) -> Self {
        Self { whole: n, part: Fraction::ZERO, rest: Seconds(0.0), fast_period }
    }

    /// n h + r for |r| <= h. The change of r is exact, since r lies within a factor of two of h.
    fn balanced(whole: f64, rest: Seconds, fast_period: Seconds) -> Self {
        let half = fast_period * 0.5;
        let carry = f64::from(u8::from(rest > half)) - f64::from(u8::from(rest <= -half));
        Self { whole: whole + carry, part: Fraction::ZERO, rest: rest - fast_period * carry, fast_period }
    }

    /// p / q.
    pub fn part(self) -> Fraction {
        self.part
    }

    /// n.
    pub fn whole(self) -> f64 {
        self.whole
    }

    /// r.
    pub fn rest(self) -> Seconds {
        self.rest
    }

    /// h.
    pub fn fast_period(self) -> Seconds {
        self.fast_period
    }

    /// t / h.
    pub fn in_fast_periods(self) -> FastPeriods {
        FastPeriods(self.whole + self.part.value() + self.rest / self.fast_period)
    }

    /// -t.
    pub fn negative(self) -> Self {
        let Fraction { numerator, denominator } = self.part;
        let borrow = u32::from(numerator > 0);
        let part = Fraction { numerator: borrow * denominator - numerator, denominator };
        Self { part, ..Self::balanced(-self.whole - f64::from(borrow), -self.rest, self.fast_period) }
    }

    /// The time earlier by a fraction of a fast period, exact. Times with a fraction of their own have the
    /// same denominator.
    pub fn earlier_by(self, by: Fraction) -> Self {
        debug_assert!(self.part == Fraction::ZERO || self.part.denominator == by.denominator);
        let borrow = u32::from(self.part.numerator < by.numerator);
        let numerator = self.part.numerator + borrow * by.denominator - by.numerator;
        let part = if numerator == 0 { Fraction::ZERO } else { Fraction { numerator, ..by } };
        Self { whole: self.whole - f64::from(borrow), part, ..self }
    }

    /// The time n whole fast periods later.
    pub fn later_by(self, n: f64) -> Self {
        Self { whole: self.whole + n, ..self }
    }

    /// The time later by the error `by` of a delay, rounded to the precision of r.
    pub fn moved_by(self, by: FastPeriods) -> Self {
        let whole = by.0.round();
        let rest = (by - FastPeriods(whole)).in_seconds(self.fast_period);
        Self { part: self.part, ..Self::balanced(self.whole + whole, self.rest + rest, self.fast_period) }
    }

    /// Compares two times on one grid.
    pub fn compare(self, other: Self) -> Ordering {
        if self.part == other.part {
            let key = |time: Self| (time.whole, time.rest.0);
            return key(self).partial_cmp(&key(other)).unwrap_or(Ordering::Equal);
        }
        self.scaled_distance(other).0.partial_cmp(&0.0).unwrap_or(Ordering::Equal)
    }

    /// The time from `earlier` to this one times the product of the denominators, with a relative error of a
    /// few roundings, and that product.
    fn scaled_distance(self, earlier: Self) -> (f64, f64) {
        let [p, q] = [self.part.numerator, self.part.denominator].map(f64::from);
        let [s, t] = [earlier.part.numerator, earlier.part.denominator].map(f64::from);
        let steps = q * t * (self.whole - earlier.whole) + (p * t - s * q);
        let rests = [(q * t, self.rest), (-q * t, earlier.rest), (steps, self.fast_period)];
        (exact_sum(rests.map(|(count, time)| product(count, time.0)).concat()), q * t)
    }

    /// The time from `earlier` to this one, with a relative error of a few roundings.
    pub fn since(self, earlier: Self) -> FastPeriods {
        if self.part != earlier.part {
            let (distance, scale) = self.scaled_distance(earlier);
            return FastPeriods(distance / (scale * self.fast_period.0));
        }
        let whole = self.whole - earlier.whole;
        if whole == -1.0 {
            return -earlier.since(self);
        }
        let h = self.fast_period;
        // The halves cancel without rounding where the two times lie on both sides of the border of a cell.
        let half = h * (if whole == 1.0 { 0.5 } else { 0.0 });
        let rest = ((half + self.rest) + (half - earlier.rest)) / h;
        FastPeriods(if whole == 1.0 { rest } else { whole + rest })
    }

    /// The slow periods of `ratio` fast ones before the one that holds this time, and the time from its
    /// beginning, in [0, M).
    pub fn in_slow_period(self, ratio: usize) -> (f64, Self) {
        let period = ratio as f64;
        let periods = self.whole_periods_since(Self::fast_sample(0.0, self.fast_period), ratio);
        (periods, self.later_by(-periods * period))
    }

    /// The most slow periods of `ratio` fast ones by which this time is not before `earlier`.
    pub fn whole_periods_since(self, earlier: Self, ratio: usize) -> f64 {
        let period = ratio as f64;
        // Fractions and rests add less than two fast periods.
        let most = ((self.whole - earlier.whole + 2.0) / period).floor();
        let is_before = |periods: &f64| !earlier.later_by(periods * period).compare(self).is_gt();
        (0..5).map(|fewer| most - f64::from(fewer)).find(is_before).unwrap_or(most)
    }

    /// How far this time lies from the nearest one that is whole slow periods of `ratio` fast ones later
    /// than `other`, and how many.
    pub fn from_whole_periods(self, other: Self, ratio: usize) -> (f64, FastPeriods) {
        let period = ratio as f64;
        let periods = (self.since(other).0 / period).round();
        (periods, self.since(other.later_by(periods * period)))
    }

    /// How many slow periods of `ratio` fast ones this time is later than another, if the rounding of the
    /// numbers in a spec can make the difference to a whole number; zero for times that are one. Two
    /// channels with such delays and one filter carry one measurement: only coefficients as large as the
    /// reciprocal of the rounding would tell them apart.
    ///
    /// The rounding is 4 eps (1 + |t_1| + |t_2|). One eps is that of the times, of h and of the quotients;
    /// the others leave room for the few operations by which a spec was made, as in 0.1 + 0.2.
    pub fn periods_since(self, other: Self, ratio: usize) -> Option<f64> {
        let (periods, rest) = self.from_whole_periods(other, ratio);
        let [a, b] = [self, other].map(|time| time.in_fast_periods().0.abs());
        (rest.0.abs() <= 4.0 * f64::EPSILON * (1.0 + a + b)).then_some(periods)
    }
}

/// x y as the sum of two doubles, exact.
fn product(x: f64, y: f64) -> [f64; 2] {
    let high = x * y;
    [x.mul_add(y, -high), high]
}

/// The sum of some doubles with a relative error of a few roundings, by an expansion whose terms do not
/// overlap (J. R. Shewchuk, *Adaptive precision floating-point arithmetic*, 1997).
fn exact_sum(terms: impl IntoIterator<Item = f64>) -> f64 {
    let mut parts: Vec<f64> = Vec::new();
    for term in terms {
        let mut carry = term;
        for part in &mut parts {
            let sum = carry + *part;
            let rounded = sum - carry;
            *part = (carry - (sum - rounded)) + (*part - rounded);
            carry = sum;
        }
        parts.push(carry);
    }
    parts.into_iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig { cases: 512, failure_persistence: None, ..ProptestConfig::default() })]

        /// Against integers: t = m 2^-60 with h = a 2^-60, where t / h compares with n as m with n a.
        #[test]
        fn whole_numbers_are_told_from_their_neighbours(a in 1i64 << 40..1 << 43, n in -1000i64..1000, off in -2i64..3) {
            let unit = 2f64.powi(-60);
            let h = Seconds(a as f64 * unit);
            let m = i128::from(n) * i128::from(a) + i128::from(off);
            prop_assume!((m as f64) as i128 == m);
            let time = GridTime::new(Seconds(m as f64 * unit), h);
            let whole = GridTime::fast_sample(n as f64, h);
            prop_assert_eq!(time.compare(whole), off.cmp(&0));
            let apart = off as f64 / a as f64;
            prop_assert!((time.since(whole).0 - apart).abs() <= 1e-15 * apart.abs());
        }

        /// The difference of two times whose integers are exact.
        #[test]
        fn differences_are_relatively_exact(a in 1i64 << 40..1 << 43, m in -1i64 << 50..1 << 50, off in -9i64..10) {
            let unit = 2f64.powi(-60);
            let [first, second] = [m, m + off].map(|m| GridTime::new(Seconds(m as f64 * unit), Seconds(a as f64 * unit)));
            prop_assert_eq!(second.compare(first), off.cmp(&0));
            let apart = off as f64 / a as f64;
            prop_assert!((second.since(first).0 - apart).abs() <= 1e-15 * apart.abs());
            prop_assert_eq!(first.negative().since(second.negative()), second.since(first));
        }

        /// A spec may give the delay k h as the rounded product: it must come back as k.
        #[test]
        fn whole_delays_are_whole_in_any_unit(periods in 0u32..65_536, decade in -99.0..99.0f64) {
            let h = Seconds(10f64.powf(decade));
            let delay = GridTime::new(FastPeriods(periods.into()).in_seconds(h), h);
            prop_assert_eq!(delay, GridTime::fast_sample(periods.into(), h));
        }

        /// Any other number keeps its fraction.
        #[test]
        fn fractions_stay(periods in 1u32..1000, fraction in 1e-9..0.5f64, decade in -9.0..9.0f64) {
            let h = Seconds(10f64.powf(decade));
            let delay = FastPeriods(f64::from(periods) + fraction);
            let back = GridTime::new(delay.in_seconds(h), h);
            prop_assert!((back.in_fast_periods() / delay - 1.0).abs() < 1e-15 && back.rest().0 != 0.0);
        }
    }

    /// Against integers: t = m 2^-60 h less j / q of h = a 2^-60.
    #[test]
    fn fractions_of_a_period_are_exact() {
        let (unit, a) = (2f64.powi(-60), (1i64 << 42) + 12_345);
        let at = |m: i64, j: u32, q: u32| {
            let time = GridTime::new(Seconds(m as f64 * unit), Seconds(a as f64 * unit));
            time.earlier_by(Fraction { numerator: j, denominator: q })
        };
        let exact = |m: i64, j: u32, q: u32, t: u32| {
            i128::from(t) * (i128::from(q) * i128::from(m) - i128::from(j) * i128::from(a))
        };
        for q in [3, 7, 1023] {
            for (t, j, k) in [(5, 1, 2), (q, 2, 1), (1024, q - 1, 1023)] {
                let near = i64::from(j) * a / i64::from(q) - i64::from(k) * a / i64::from(t);
                for m in [-a, 5, near - 1, near, near + 1, 3 * a + 7] {
                    let (first, second) = (at(m, j, q), at(0, k, t));
                    let apart = exact(m, j, q, t) - exact(0, k, t, q);
                    assert_eq!(first.compare(second), apart.cmp(&0), "{m} {j}/{q} {k}/{t}");
                    let apart = apart as f64 / (f64::from(q) * f64::from(t) * a as f64);
                    assert!((first.since(second).0 - apart).abs() <= 1e-15 * apart.abs());
                    assert_eq!(first.negative().compare(second.negative()), second.compare(first));
                }
            }
        }
        // Three thirds are one.
        let third = Fraction { numerator: 1, denominator: 3 };
        assert_eq!(at(0, 2, 3).earlier_by(third), GridTime::fast_sample(-1.0, Seconds(a as f64 * unit)));
    }

    #[test]
    fn neighbours_of_whole_numbers_are_not_whole() {
        let time = |t| GridTime::new(Seconds(t), Seconds(1.0));
        assert_eq!(time(1.0 + f64::EPSILON).since(time(1.0)), FastPeriods(f64::EPSILON));
        assert_eq!(time(60_000.000000005).since(time(60_000.0)), FastPeriods(60_000.000000005 - 60_000.0));
        assert_eq!(GridTime::new(Seconds(0.1) * 3.0, Seconds(0.1)).in_fast_periods(), FastPeriods(3.0));
        assert!(GridTime::new(Seconds(0.3), Seconds(0.1)).compare(time(3.0)).is_lt());
    }

    #[test]
    fn slow_periods_begin_with_their_first_instant() {
        let found = |t| {
            let (periods, phase) = GridTime::new(Seconds(t), Seconds(1.0)).in_slow_period(2);
            (periods, phase.in_fast_periods().0)
        };
        assert_eq!([found(0.0), found(3.5), found(-0.25)], [(0.0, 0.0), (1.0, 1.5), (-1.0, 1.75)]);
        assert_eq!(found(-1e-20), (-1.0, 2.0));
    }

    /// At any length and in any unit; a difference that is meant stays one.
    #[test]
    fn times_are_one_up_to_rounding_only() {
        for h in [1.0, 0.1, 1.0 / 48_000.0, 1e-9, 7.3e-12].map(Seconds) {
            for whole in [0.0, 1.0, 999.0, 65_000.0] {
                let written = |fraction: f64| GridTime::new(FastPeriods(whole + fraction).in_seconds(h), h);
                let (first, later) = (written(0.3), written(6.3));
                assert_eq!(first.periods_since(first, 3), Some(0.0));
                assert_eq!(later.periods_since(first, 3), Some(2.0), "{whole} {h}");
                assert_eq!(written(0.3 + 1e-9).periods_since(first, 3), None, "{whole} {h}");
                assert_eq!(written(7.3).periods_since(first, 3), None);
            }
        }
    }
}
