//! Sums over the aliases of a frequency, with a bound of the infinite rest.
//!
//! A channel sampled every M fast periods responds at the frequency omega (radians per slow period) to the
//! inputs at nu_k = (omega + 2 pi k) / M. The norm of a row with the entries m(nu_k) Phi(j nu_k) is
//!
//! ```text
//! [ (1/M) sum_k |Phi(j nu_k)|^2 m(nu_k)^2 ]^(1/2).
//! ```
//!
//! The aliases |k| <= K are summed in balls. Beyond them |Phi| <= sum_p a_p |nu|^-p, and each term is a
//! function of |nu| that rises at most once and then falls, so its sum over the aliases of one sign is at
//! most its largest value plus M / (2 pi) times its integral.

use super::super::ball::Ball;
use super::angle::{outward, pi};
use super::transfer::{Moduli, Transfer, product};
use std::f64::consts::{PI, TAU};

/// K to begin with, and the most.
const ALIASES: [usize; 2] = [24, 1 << 14];

/// The weight m(nu) of an alias.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Weight {
    /// 1.
    One,
    /// |nu|: the derivative with respect to the delay.
    Slope,
    /// min(nu^2 d^2 / 2, 2): the distance of e^{-j nu t}, |t| <= d, from the chord between its ends. (A
    /// function with second derivative at most nu^2 lies within (2 d)^2 nu^2 / 8 of its chord.)
    Chord(f64),
}

/// The moduli of a channel's response at the aliases of a frequency, those of the least |k| first.
#[derive(Debug, Clone)]
pub(super) struct Aliases {
    ratio: f64,
    /// Upper bounds of |nu_k|.
    pub(super) frequencies: Vec<f64>,
    /// Upper bounds of |Phi W| and of its second derivative in the factor of the cut-off, over all factors.
    pub(super) near: Vec<Moduli>,
    /// The aliases that are left out.
    pub(super) far: FarAliases,
}

/// All aliases from some frequency on.
#[derive(Debug, Clone)]
pub(super) struct FarAliases {
    pub(super) ratio: f64,
    /// Their |nu| is at least this.
    from: f64,
    /// |Phi W| is at most the sum of these coefficients times |nu|^-p, from p = 0 on.
    pub(super) decay: Vec<f64>,
    /// The same for the second derivative.
    pub(super) curvature: Vec<f64>,
}

/// A front end Phi after the signal's filter W.
#[derive(Debug, Clone, Copy)]
pub(super) struct FrontEnd<'a> {
    pub(super) transfer: &'a Transfer,
    /// `None` stands for W = 1.
    pub(super) signal: Option<&'a Transfer>,
    /// Largest relative error of the cut-off: Phi(s / x) for all |x - 1| up to it.
    pub(super) cutoff: f64,
}

impl FrontEnd<'_> {
    /// K: how many aliases on each side must be summed, so that the poles lie before the others. `None` if
    /// they are too many.
    pub(super) fn aliases(&self, ratio: usize) -> Option<usize> {
        let counts = std::iter::successors(Some(ALIASES[0]), |count| Some(4 * count));
        counts.take_while(|&count| count <= ALIASES[1]).find(|&count| self.far(ratio, count).is_some())
    }

    fn far(&self, ratio: usize, count: usize) -> Option<FarAliases> {
        let from = PI * (2 * count + 1) as f64 / ratio as f64 * (1.0 - 1e-12);
        let (fastest, slowest) = ((1.0 + self.cutoff) * (1.0 + 1e-12), 1.0 - self.cutoff);
        let inner = from / fastest * (1.0 - 1e-12);
        // Phi(nu / x) and its second derivative, which is its curvature at nu / x over x^2. Zero stays zero:
        // the sum of slow terms is infinite.
        let scaled = |own: Vec<f64>, factor: f64| -> Vec<f64> {
            own.iter().enumerate().map(|(p, a)| a * factor * fastest.powi(p as i32) * (1.0 + 1e-11)).collect()
        };
        let decay = scaled(self.transfer.decay(inner)?, 1.0);
        let curvature = scaled(self.transfer.decay_of_curvature(inner)?, slowest.powi(-2));
        let signal = self.signal.map_or(Some(vec![1.0]), |signal| signal.decay(from))?;
        let (decay, curvature) = (product(&decay, &signal), product(&curvature, &signal));
        Some(FarAliases { ratio: ratio as f64, from, decay, curvature })
    }

    /// At nu / x for all factors x of the cut-off.
    fn moduli(&self, nu: Ball) -> Moduli {
        let shape = self.signal.map_or(1.0, |signal| signal.square(nu).sqrt() * (1.0 + 1e-15));
        if self.cutoff == 0.0 {
            let value = self.transfer.square(nu).sqrt() * (1.0 + 1e-15);
            return Moduli { value: outward(value * shape), curvature: 0.0 };
        }
        let [low, high] = [1.0 + self.cutoff, 1.0 - self.cutoff].map(|x| nu.nearest() / x);
        let off = (nu - Ball::from(nu.nearest())).magnitude() / (1.0 - self.cutoff);
        let half = 0.5 * (high - low).abs() + 2.0 * off + 8.0 * f64::EPSILON * (low.abs() + high.abs());
        let Moduli { value, curvature } = self.transfer.moduli(0.5 * (low + high), half);
        let square = (1.0 - self.cutoff) * (1.0 - self.cutoff);
        Moduli { value: outward(value * shape), curvature: outward(curvature / square * shape) }
    }
}

impl Aliases {
    /// Of Phi(s / x) W(s) for all factors x, at the frequency `angle` in [0, pi], with `count` aliases on
    /// each side (see [`FrontEnd::aliases`]); `None` if these are too few.
    pub(super) fn new(front_end: &FrontEnd<'_>, angle: Ball, ratio: usize, count: usize) -> Option<Self> {
        let (period, turn) = (Ball::from(ratio as f64), pi() + pi());
        let at = |k: i64| (angle + turn * Ball::from(k as f64)) / period;
        let pairs = (1..=count as i64).flat_map(|k| [-k, k]);
        let frequencies: Vec<Ball> = std::iter::once(0).chain(pairs).map(at).collect();
        Some(Self {
            ratio: ratio as f64,
            near: frequencies.iter().map(|&nu| front_end.moduli(nu)).collect(),
            frequencies: frequencies.into_iter().map(Ball::magnitude).collect(),
            far: front_end.far(ratio, count)?,
        })
    }

    /// An upper bound of the norm of the row with `weight`; infinite if its sum diverges.
    pub(super) fn norm(&self, weight: Weight) -> f64 {
        let term = |(nu, moduli): (&f64, &Moduli)| (moduli.value * weight.at(*nu)).powi(2);
        let near: f64 = self.frequencies.iter().zip(&self.near).map(term).sum();
        let far = self.far.norm(&self.far.decay, weight);
        outward((near / self.ratio + far * far).sqrt())
    }
}

impl FarAliases {
    /// A bound of [ (1/M) sum over the far aliases (sum_p a_p |nu|^-p m(nu))^2 ]^(1/2), by Minkowski.
    pub(super) fn norm(&self, decay: &[f64], weight: Weight) -> f64 {
        let term = |(p, a): (usize, &f64)| match *a {
            0.0 => 0.0,
            a => a * self.sum(weight, 2 * p as i32, 2).sqrt(),
        };
        outward(decay.iter().enumerate().map(term).sum())
    }

    /// A bound of (1/M) sum over the far aliases of sum_p a_p |nu|^-p times sum_q b_q |nu|^-q m(nu).
    pub(super) fn inner(&self, a: &[f64], b: &[f64], weight: Weight) -> f64 {
        let term = |(e, factor): (usize, &f64)| match *factor {
            0.0 => 0.0,
            factor => factor * self.sum(weight, e as i32, 1),
        };
        outward(product(a, b).iter().enumerate().map(term).sum())
    }

    /// A bound of (1/M) sum |nu|^-e m^power over the far aliases of both signs.
    fn sum(&self, weight: Weight, e: i32, power: i32) -> f64 {
        let (largest, integral) = weight.far(e, power, self.from);
        2.0 * (largest / self.ratio + integral / TAU)
    }
}

impl Weight {
    pub(super) fn at(self, nu: f64) -> f64 {
        match self {
            Self::One => 1.0,
            Self::Slope => nu,
            Self::Chord(d) => (0.5 * nu * nu * d * d).min(2.0),
        }
    }

    /// The largest value of nu^-e m(nu)^power from `far` on, and its integral.
    fn far(self, e: i32, power: i32, far: f64) -> (f64, f64) {
        let bent = match self {
            Self::One => return plain(e, far),
            Self::Slope => return plain(e - power, far),
            Self::Chord(d) => Bent { power: 2, bend: 2.0 / d, limit: 2.0 },
        };
        bent.far(e, power, far)
    }
}

/// nu^-e from `from` on: the largest value and the integral.
fn plain(e: i32, from: f64) -> (f64, f64) {
    if e < 2 {
        return (f64::INFINITY, f64::INFINITY);
    }
    (from.powi(-e), from.powi(1 - e) / f64::from(e - 1))
}

/// The weight `limit` min(nu / `bend`, 1)^`power`.
struct Bent {
    power: i32,
    bend: f64,
    limit: f64,
}

impl Bent {
    /// As [`Weight::far`].
    fn far(&self, e: i32, power: i32, far: f64) -> (f64, f64) {
        let limit = self.limit.powi(power);
        if self.bend.is_infinite() {
            return (0.0, 0.0);
        }
        if far >= self.bend {
            let (largest, integral) = plain(e, far);
            return (limit * largest, limit * integral);
        }
        // limit nu^rise / bend^own up to the bend, then limit nu^-e.
        let own = power * self.power;
        let (factor, rise) = (limit * self.bend.powi(-own), own - e);
        let below = match rise {
            -1 => (self.bend / far).ln(),
            _ => (self.bend.powi(rise + 1) - far.powi(rise + 1)) / f64::from(rise + 1),
        };
        let largest = factor * if rise > 0 { self.bend } else { far }.powi(rise);
        (largest, factor * below + limit * plain(e, self.bend).1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analog::enclosed;
    use crate::spec::FilterSpec;
    use crate::units::Seconds;

    fn transfer(num: &[f64], den: &[f64]) -> Transfer {
        let spec = FilterSpec::TransferFunction { num: num.to_vec(), den: den.to_vec() };
        Transfer::new(&enclosed(None, &spec, Seconds(1.0)).unwrap(), Ball::from(1.0))
    }

    fn alone(transfer: &Transfer) -> FrontEnd<'_> {
        FrontEnd { transfer, signal: None, cutoff: 0.0 }
    }

    fn aliases(front_end: FrontEnd<'_>, omega: f64, ratio: usize) -> Aliases {
        Aliases::new(&front_end, Ball::from(omega), ratio, front_end.aliases(ratio).unwrap()).unwrap()
    }

    /// A signal's filter with a direct term, against plain sums.
    #[test]
    fn a_signal_shapes_the_sums() {
        let front_end = transfer(&[1.0], &[1.0, 0.7]);
        let filter = FilterSpec::TransferFunction { num: vec![0.1, 0.2, 1.0], den: vec![1.0, 0.9, 1.0] };
        let signal = Transfer::new(&enclosed(None, &filter, Seconds(1.0)).unwrap(), Ball::from(1.0));
        let shaped = FrontEnd { signal: Some(&signal), ..alone(&front_end) };
        for weight in [Weight::One, Weight::Chord(0.1)] {
            let bound = aliases(shaped, 2.0, 3).norm(weight);
            let value = |k: i32| {
                let nu = (2.0 + TAU * f64::from(k)) / 3.0;
                front_end.square(Ball::from(nu)) * signal.square(Ball::from(nu)) * weight.at(nu.abs()).powi(2)
            };
            let plain = ((-200_000..=200_000).map(value).sum::<f64>() / 3.0).sqrt();
            assert!(plain <= bound && bound <= 1.15 * plain, "{weight:?}: {plain} {bound}");
        }
    }

    /// Against plain sums over 200,000 aliases, for relative degrees 1, 2 and 3.
    #[test]
    fn sums_are_bounded_and_nearly_exact() {
        for (num, den) in
            [(&[1.0][..], &[1.0, 0.7][..]), (&[0.25], &[1.0, 1.0, 0.25]), (&[1.0], &[1.0, 2.0, 2.0, 1.0])]
        {
            let transfer = transfer(num, den);
            let weights =
                [Weight::One, Weight::Slope, Weight::Chord(0.1), Weight::Chord(1e-3), Weight::Chord(0.0)];
            for weight in weights {
                if weight == Weight::Slope && den.len() == 2 {
                    continue;
                }
                let omega = 2.0;
                let bound = aliases(alone(&transfer), omega, 3).norm(weight);
                let value = |k: i32| {
                    let nu = (omega + TAU * f64::from(k)) / 3.0;
                    transfer.square(Ball::from(nu)) * weight.at(nu.abs()).powi(2)
                };
                let plain = ((-200_000..=200_000).map(value).sum::<f64>() / 3.0).sqrt();
                assert!(
                    plain <= bound && bound <= 1.15 * plain + 1e-300,
                    "{weight:?} {}: {plain} {bound}",
                    den.len()
                );
            }
        }
    }

    /// The far sums of products, against plain sums of the same decays.
    #[test]
    fn far_products_are_bounded_and_nearly_exact() {
        let far = FarAliases { ratio: 3.0, from: TAU * 24.5 / 3.0, decay: vec![], curvature: vec![] };
        let (a, b) = ([0.0, 0.3, 1.0], [0.0, 2.0, 0.0, 5.0]);
        let of = |list: &[f64], nu: f64| -> f64 {
            list.iter().enumerate().map(|(p, a)| a * nu.powi(-(p as i32))).sum()
        };
        for weight in [Weight::One, Weight::Chord(0.1), Weight::Chord(1e-3)] {
            let value = |k: i32| {
                let nu = far.from + TAU * f64::from(k) / 3.0;
                2.0 * of(&a, nu) * of(&b, nu) * weight.at(nu) / 3.0
            };
            let (plain, bound) = ((0..400_000).map(value).sum::<f64>(), far.inner(&a, &b, weight));
            assert!(plain <= bound && bound <= 1.15 * plain, "{weight:?}: {plain} {bound}");
        }
    }

    #[test]
    fn a_range_of_cutoffs_bounds_each_of_them() {
        let nominal = transfer(&[1.0], &[1.0, 2.0, 2.0, 1.0]);
        let whole = aliases(FrontEnd { cutoff: 0.02, ..alone(&nominal) }, 1.0, 2);
        for x in [0.98, 1.0, 1.02f64] {
            let one = transfer(&[x.powi(3)], &[1.0, 2.0 * x, 2.0 * x * x, x.powi(3)]);
            let one = aliases(alone(&one), 1.0, 2);
            for weight in [Weight::One, Weight::Slope, Weight::Chord(0.1)] {
                let (one, whole) = (one.norm(weight), whole.norm(weight));
                assert!(one <= whole && whole <= 1.3 * one, "{x} {weight:?}");
            }
        }
    }
}
