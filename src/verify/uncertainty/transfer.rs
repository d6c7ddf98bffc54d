//! The transfer function of a front end as a quotient of enclosed polynomials, for bounds of its modulus on
//! the imaginary axis.

use super::super::ball::{self, Ball, Matrix};
use super::super::front_ends::Equations;
use crate::arithmetic::{ComplexBall, DoubleDouble, Float512, Number};

/// Relative error of the denominator up to which 106 bits suffice.
const SHARP_DENOMINATOR: f64 = 1e-6;
/// Relative change of the denominator over a piece of a range: what is made of it errs by a few times that.
const PIECE_CHANGE: f64 = 0.03;
/// Halvings of a range. Pieces are short near the poles only, so there are never many of them.
const MAX_HALVINGS: u32 = 24;

/// N(s) / D(s), s in rad per fast period; D is monic.
#[derive(Debug, Clone)]
pub(super) struct Transfer {
    short: Quotient<DoubleDouble>,
    /// With more digits, for frequencies near the poles of narrow filters.
    long: Quotient<Float512>,
}

/// Two polynomials, coefficients in ascending powers.
#[derive(Debug, Clone)]
struct Quotient<F> {
    num: Vec<Ball<F>>,
    den: Vec<Ball<F>>,
}

/// Upper bounds over a range of frequencies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Moduli {
    /// Of |Phi|.
    pub(super) value: f64,
    /// Of |s^2 Phi'' + 2 s Phi'|. For Phi(s / x), the second derivative with respect to x is this at s / x
    /// over x^2.
    pub(super) curvature: f64,
}

impl Transfer {
    /// `gain` (c (s I - a)^-1 b + d), by the recursion of Faddeev and Le Verrier: M_0 = I,
    /// M_k = a M_{k-1} + d_k I, d_k = -tr(a M_{k-1}) / k; then D = s^n + sum_k d_k s^(n-k) and
    /// N = sum_k c M_k b s^(n-1-k) + d D. It loses many digits, so it runs with 512 bits.
    pub(super) fn new(filter: &Equations, gain: Ball<Float512>) -> Self {
        let Equations { a, b, c, d } = filter;
        let c = ball::scaled(c, gain);
        let n = a.nrows();
        let (mut num, mut den) = (vec![Ball::ZERO; n], vec![Ball::from(1.0); n + 1]);
        let mut power: Matrix<Float512> = ball::identity(n);
        for k in 1..=n {
            num[n - k] = ball::product(&c, &ball::product(&power, b))[(0, 0)];
            let next = ball::product(a, &power);
            let trace = (0..n).fold(Ball::ZERO, |sum, i| sum + next[(i, i)]);
            let coefficient = -(trace / Ball::from(k as f64));
            den[n - k] = coefficient;
            power = next + ball::scaled(&ball::identity(n), coefficient);
        }
        if !d.is_zero() {
            let direct = *d * gain;
            num.push(Ball::ZERO);
            num.iter_mut().zip(&den).for_each(|(num, &den)| *num += den * direct);
        }
        let short = |list: &[Ball<Float512>]| list.iter().map(|x| x.shortened()).collect();
        let short = Quotient { num: short(&num), den: short(&den) };
        Self { short, long: Quotient { num, den } }
    }

    /// An upper bound of |Phi(j u)|^2.
    pub(super) fn square(&self, u: Ball) -> f64 {
        let [num, den] = [square(&self.short.num, u), square(&self.short.den, u)];
        if den.radius() <= SHARP_DENOMINATOR * den.nearest() {
            return (num / den).upper();
        }
        // Near the poles a ball of frequencies is no small one.
        let centre = u.nearest();
        let off = (u - Ball::from(centre)).magnitude();
        self.moduli(centre, off).value.powi(2) * (1.0 + 1e-15)
    }

    /// Bounds over all s = j u with |u - `centre`| <= `half`.
    pub(super) fn moduli(&self, centre: f64, half: f64) -> Moduli {
        self.pieces(centre, half, MAX_HALVINGS)
    }

    fn pieces(&self, centre: f64, half: f64, halvings: u32) -> Moduli {
        let expanded = self.expanded(centre);
        if !is_sharp(expanded.den_over(0, half), PIECE_CHANGE) {
            if halvings == 0 || !is_sharp(expanded.den[0], SHARP_DENOMINATOR) {
                return Moduli { value: f64::INFINITY, curvature: f64::INFINITY };
            }
            let step = 0.5 * half;
            // The two pieces overlap by more than the rounding of their centres.
            let wide = step + 4.0 * f64::EPSILON * (centre.abs() + half);
            let [low, high] = [-step, step].map(|step| self.pieces(centre + step, wide, halvings - 1));
            return Moduli {
                value: ball::nan_max(low.value, high.value),
                curvature: ball::nan_max(low.curvature, high.curvature),
            };
        }
        expanded.moduli(centre, half)
    }

    fn expanded(&self, u: f64) -> Expansion {
        let short = self.short.expanded(u, |x| x);
        if is_sharp(short.den[0], SHARP_DENOMINATOR) { short } else { self.long.expanded(u, Ball::shortened) }
    }

    /// a_0, a_1, .. with |Phi(s)| <= sum_p a_p |s|^-p for all |s| >= `from`; `None` where that is too close
    /// to the poles.
    pub(super) fn decay(&self, from: f64) -> Option<Vec<f64>> {
        let Quotient { num, den } = &self.short;
        let n = den.len() - 1;
        let lower = |(k, d): (usize, &Ball)| d.magnitude() * from.powi(k as i32 - n as i32);
        let rest: f64 = den[..n].iter().enumerate().map(lower).sum();
        let share = 1.0 - rest * (1.0 + 1e-10);
        let enough = share > 0.5;
        if !enough {
            return None;
        }
        let coefficient = |p: usize| num.get(n - p).map_or(0.0, |x| x.magnitude() / share * (1.0 + 1e-10));
        Some((0..=n).map(coefficient).collect())
    }

    /// The same for s^2 Phi'' + 2 s Phi'. On a circle of half the radius |s| / 2 around s, Phi is bounded by
    /// its decay at |s| / 2, so |Phi'| is at most 2 / |s| times that and |Phi''| at most 8 / |s|^2 times.
    pub(super) fn decay_of_curvature(&self, from: f64) -> Option<Vec<f64>> {
        let of_value = self.decay(0.5 * from)?;
        let bound = |(p, a): (usize, &f64)| 12.0 * a * 2f64.powi(p as i32) * (1.0 + 1e-10);
        Some(of_value.iter().enumerate().map(bound).collect())
    }
}

impl<F: Number> Quotient<F> {
    /// Both polynomials in powers of s - j u; `short` gives their coefficients in 106 bits.
    fn expanded(&self, u: f64, short: impl Fn(Ball<F>) -> Ball) -> Expansion {
        let short = |x: ComplexBall<F>| ComplexBall::new(short(x.re), short(x.im));
        let expanded = |p: &[Ball<F>]| shifted(p, u).into_iter().map(short).collect();
        Expansion { num: expanded(&self.num), den: expanded(&self.den) }
    }
}

/// p(s) in powers of s - j u, by repeated division.
fn shifted<F: Number>(p: &[Ball<F>], u: f64) -> Vec<ComplexBall<F>> {
    let u = Ball::from(u);
    let mut terms: Vec<ComplexBall<F>> = p.iter().map(|&x| x.into()).collect();
    for m in 0..terms.len().saturating_sub(1) {
        for k in (m..terms.len() - 1).rev() {
            let next = terms[k + 1];
            terms[k] += ComplexBall::new(-(u * next.im), u * next.re);
        }
    }
    terms
}

/// N and D in powers of s - j u.
struct Expansion {
    num: Vec<ComplexBall<DoubleDouble>>,
    den: Vec<ComplexBall<DoubleDouble>>,
}

impl Expansion {
    /// The derivative of D of this order over all |s - j u| <= `half`.
    fn den_over(&self, order: usize, half: f64) -> ComplexBall<DoubleDouble> {
        derivative_over(&self.den, order, half)
    }

    fn moduli(&self, centre: f64, half: f64) -> Moduli {
        let [num, num1, num2] = [0, 1, 2].map(|order| derivative_over(&self.num, order, half));
        let [den, den1, den2] = [0, 1, 2].map(|order| self.den_over(order, half));
        let twice = |x: ComplexBall<DoubleDouble>| x + x;
        // The derivatives of N = Phi D.
        let value = num / den;
        let slope = (num1 - value * den1) / den;
        let second = (num2 - twice(slope * den1) - value * den2) / den;
        let s = ComplexBall::new(Ball::ZERO.widened(half), Ball::from(centre).widened(half));
        let curvature = s * (s * second + twice(slope));
        let [value, curvature] = [value, curvature].map(modulus);
        Moduli { value, curvature }
    }
}

/// The derivative of this order of a polynomial over all |s - j u| <= `half`, from its powers of s - j u.
fn derivative_over(
    terms: &[ComplexBall<DoubleDouble>],
    order: usize,
    half: f64,
) -> ComplexBall<DoubleDouble> {
    let factor = |m: usize| (m + 1 - order..=m).map(|k| k as f64).product::<f64>();
    let Some(&first) = terms.get(order) else { return ComplexBall::default() };
    let higher = terms.iter().enumerate().skip(order + 1);
    let change = higher.map(|(m, &x)| factor(m) * modulus(x) * half.powi((m - order) as i32)).sum::<f64>()
        * (1.0 + 1e-12);
    let ComplexBall { re, im } = first.scaled(Ball::from(factor(order)));
    ComplexBall::new(re.widened(change), im.widened(change))
}

/// An upper bound of the modulus.
fn modulus(x: ComplexBall<DoubleDouble>) -> f64 {
    x.re.magnitude().hypot(x.im.magnitude()) * (1.0 + 1e-15)
}

/// Whether the radii are at most `share` of the modulus of the midpoint.
fn is_sharp(x: ComplexBall<DoubleDouble>, share: f64) -> bool {
    x.re.radius().max(x.im.radius()) <= share * x.re.nearest().hypot(x.im.nearest())
}

/// The product of two polynomials with bounds as coefficients, rounded up.
pub(super) fn product(p: &[f64], q: &[f64]) -> Vec<f64> {
    let mut product = vec![0.0; (p.len() + q.len()).saturating_sub(1)];
    for (i, x) in p.iter().enumerate() {
        for (j, y) in q.iter().enumerate() {
            product[i + j] += x * y;
        }
    }
    product.iter().map(|x| x * (1.0 + 1e-12)).collect()
}

/// |p(j u)|^2: the even coefficients make the real part, the odd ones the imaginary part.
fn square(p: &[Ball], u: Ball) -> Ball {
    let v = -(u * u);
    let part = |first: usize| {
        p.iter().skip(first).step_by(2).rev().fold(Ball::ZERO, |sum, &coefficient| sum * v + coefficient)
    };
    let (re, im) = (part(0), u * part(1));
    re * re + im * im
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analog::{StrictlyProper, enclosed};
    use crate::spec::FilterSpec;
    use crate::units::{RadiansPerFastPeriod, Seconds};

    /// A filter in doubles, and enclosed with a gain.
    fn filter(filter: &FilterSpec, gain: f64) -> (StrictlyProper, Transfer) {
        let equations = enclosed(None, filter, Seconds(1.0)).unwrap();
        let doubles = StrictlyProper::new(filter, Seconds(1.0)).unwrap();
        (doubles, Transfer::new(&equations, Ball::from(gain)))
    }

    fn quotient(num: &[f64], den: &[f64]) -> FilterSpec {
        FilterSpec::TransferFunction { num: num.to_vec(), den: den.to_vec() }
    }

    #[test]
    fn moduli_are_those_of_the_response() {
        let (filter, transfer) = filter(&quotient(&[0.5, 2.0], &[1.0, 1.3, 2.0, 0.7, 0.1]), -1.5);
        for u in [-40.0, -1.0, 0.0, 0.3, 1.4, 20.0] {
            let modulus = 1.5 * filter.response(RadiansPerFastPeriod(u)).norm();
            let square = transfer.square(Ball::from(u));
            assert!((square.sqrt() / modulus - 1.0).abs() < 1e-12, "{u}");
        }
        let decay = transfer.decay(30.0).unwrap();
        for u in [30.0, 100.0, 1e4] {
            let bound: f64 = decay.iter().enumerate().map(|(p, a)| a * f64::powi(u, -(p as i32))).sum();
            let modulus = 1.5 * filter.response(RadiansPerFastPeriod(u)).norm();
            assert!(modulus <= bound && bound <= 1.3 * modulus, "{u}: {modulus} {bound}");
        }
        // Relative degree 3: the terms of slower decay are exactly zero.
        assert!(decay[..3].iter().all(|a| *a == 0.0) && decay[3] > 0.0);
        assert!(transfer.decay(0.5).is_none());
    }

    /// Against second differences of Phi(j u / x) in x.
    #[test]
    fn the_curvature_is_the_second_derivative_in_the_cutoff() {
        let (filter, transfer) = filter(&quotient(&[0.5, 2.0], &[1.0, 1.3, 2.0, 0.7, 0.1]), 1.0);
        for u in [0.2, 0.9, 1.5, 6.0, 40.0] {
            let at = |x: f64| filter.response(RadiansPerFastPeriod(u / x));
            let step = 1e-4;
            let second = (at(1.0 + step) - at(1.0) * 2.0 + at(1.0 - step)) / (step * step);
            let found = transfer.moduli(u, 0.0);
            assert!((found.curvature - second.norm()).abs() < 1e-5 * (1.0 + second.norm()), "{u}: {second}");
            assert!((found.value / at(1.0).norm() - 1.0).abs() < 1e-12);
        }
        let decay = transfer.decay_of_curvature(30.0).unwrap();
        for u in [30.0, 100.0, 1e4] {
            let bound: f64 = decay.iter().enumerate().map(|(p, a)| a * f64::powi(u, -(p as i32))).sum();
            assert!(transfer.moduli(u, 0.0).curvature <= bound, "{u}");
        }
    }

    /// Over ranges that hold the poles of resonances: never below any point, and not far above the largest.
    #[test]
    fn moduli_over_ranges_bound_all_their_points() {
        // Pairs of poles with damping 1e-2 and 3e-4, so the second one is hardly resolved by 106 bits times
        // the width of a piece.
        let (_, transfer) = filter(&quotient(&[0.3], &[1.0, 0.0206, 2.000012, 0.0206, 1.0]), 1.0);
        for (centre, half) in [(1.0, 0.3), (1.0, 1e-3), (0.7, 1e-2), (3.0, 1.0), (1.01, 1e-15)] {
            let found = transfer.moduli(centre, half);
            let points = (0..=4000).map(|k| centre + half * (f64::from(k) / 2000.0 - 1.0));
            let (mut value, mut curvature) = (0.0f64, 0.0f64);
            for point in points.map(|u| transfer.moduli(u, 0.0)) {
                (value, curvature) = (value.max(point.value), curvature.max(point.curvature));
            }
            assert!(value <= found.value && found.value <= 1.2 * value, "{centre} {half}: {found:?} {value}");
            let most = 2.0 * curvature;
            assert!(curvature <= found.curvature && found.curvature <= most, "{centre} {half}: {found:?}");
        }
    }

    /// A band-pass of 12 poles, 0.1 % wide: at its poles 106 bits of the coefficients are not enough.
    #[test]
    fn narrow_filters_have_moduli() {
        let text = "fast_period = 1.0\nratio = 1\nlatency = 1\nchannel = [{ delay = 0 }]\ndesign = { method = \"iir\" }\n\
                    target = { filter = { family = \"butterworth\", order = 6, band = [0.25, 0.25025] } }";
        let spec = crate::spec::Spec::from_toml(text, "spec.toml").unwrap();
        let (_, transfer) = filter(&spec.target, 1.0);
        let centre = std::f64::consts::TAU * (0.25f64 * 0.25025).sqrt();
        let found = transfer.moduli(centre, 1e-7);
        assert!((found.value - 1.0).abs() < 1e-2 && found.curvature.is_finite(), "{found:?}");
        let square = transfer.square(Ball::from(centre).widened(1e-15));
        assert!((square - 1.0).abs() < 1e-6, "{square}");
    }
}
