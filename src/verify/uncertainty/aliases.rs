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

use super::super::ball::{self, Ball};
use super::angle::{outward, pi};
use super::transfer::{Transfer, product};
use std::f64::consts::TAU;

/// K to begin with, and the most.
const ALIASES: [usize; 2] = [24, 1 << 14];

/// Length of the pieces of a range of cut-offs, and the most pieces.
const PIECE: f64 = 5e-4;
const MAX_PIECES: f64 = 256.0;

/// 9 sqrt 3, from below.
const PARABOLA: f64 = 15.588457268119893;

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
    /// min(|nu|^3 d^3 / (9 sqrt 3), 9/4): the distance of e^{-j nu t}, |t| <= d, from the parabola through
    /// its values at -d, 0 and d. (The error is the third derivative over 6 times |t (t^2 - d^2)|, which is
    /// at most 2 d^3 / (3 sqrt 3); and the parabola is at most 5/4.)
    Parabola(f64),
    /// min(|nu| s, 2): the distance of e^{-j nu t} from e^{-j nu (t + s)}.
    Shift(f64),
}

/// The moduli of a channel's response at the aliases of a frequency.
#[derive(Debug, Clone)]
pub(super) struct Aliases {
    ratio: f64,
    /// Upper bounds of |nu_k| and |Phi(j nu_k / x)|^2, for all factors x of the cut-off.
    near: Vec<(f64, f64)>,
    /// All other aliases have |nu| of at least this.
    far: f64,
    /// Coefficients of |nu|^-p, from p = 0 on.
    decay: Vec<f64>,
}

/// A front end Phi after the signal's filter W.
#[derive(Debug, Clone, Copy)]
pub(super) struct FrontEnd<'a> {
    pub(super) transfer: &'a Transfer,
    /// `None` stands for W = 1.
    pub(super) signal: Option<&'a Transfer>,
}

impl Aliases {
    /// Of Phi(s / x) W(s) for all x in `speeds`, at the frequency `angle` in [0, pi]. `None` if the poles
    /// lie beyond all aliases that are summed.
    pub(super) fn new(front_end: &FrontEnd<'_>, angle: Ball, ratio: usize, speeds: [f64; 2]) -> Option<Self> {
        let FrontEnd { transfer, signal } = front_end;
        let inverses = reciprocals(speeds);
        let period = Ball::from(ratio as f64);
        let begin =
            |count: usize| std::f64::consts::PI * (2 * count + 1) as f64 / ratio as f64 * (1.0 - 1e-12);
        let mut count = ALIASES[0];
        let (own, shaped) = loop {
            let own = transfer.decay(begin(count) / speeds[1] * (1.0 - 1e-12));
            let shaped = signal.map_or(Some(vec![1.0]), |signal| signal.decay(begin(count)));
            match own.zip(shaped) {
                Some((own, shaped)) => break (own, shaped),
                None if count < ALIASES[1] => count *= 4,
                None => return None,
            }
        };
        let scaled = |(p, a): (usize, &f64)| a * (speeds[1] * (1.0 + 1e-12)).powi(p as i32);
        let own: Vec<f64> = own.iter().enumerate().map(scaled).collect();
        let decay = if signal.is_some() { product(&own, &shaped) } else { own };
        let turn = pi() + pi();
        let near = (-(count as i64)..=count as i64).map(|k| {
            let nu = (angle + turn * Ball::from(k as f64)) / period;
            let squares = inverses.iter().map(|&inverse| transfer.square(nu * inverse));
            let square = squares.fold(0.0, ball::nan_max);
            (nu.magnitude(), signal.map_or(square, |signal| outward(square * signal.square(nu))))
        });
        Some(Self { ratio: ratio as f64, near: near.collect(), far: begin(count), decay })
    }

    /// An upper bound of the norm of the row with `weight`; infinite if its sum diverges.
    pub(super) fn norm(&self, weight: Weight) -> f64 {
        let term = |&(nu, square): &(f64, f64)| {
            let m = weight.at(nu);
            square * m * m
        };
        let near: f64 = self.near.iter().map(term).sum();
        // Minkowski, for the sum over p.
        let far: f64 = self.decay.iter().enumerate().map(|(p, a)| self.far_term(weight, p as i32, *a)).sum();
        outward((near / self.ratio + far * far).sqrt())
    }

    /// a [ (1/M) sum |nu|^-2p m^2 ]^(1/2) over the far aliases of both signs.
    fn far_term(&self, weight: Weight, p: i32, a: f64) -> f64 {
        if a == 0.0 {
            return 0.0;
        }
        let (largest, integral) = weight.far(p, self.far);
        a * (2.0 * (largest / self.ratio + integral / TAU)).sqrt()
    }
}

/// The reciprocals of all factors between `speeds`, in short pieces: an enclosure over a long piece would
/// contain the poles.
fn reciprocals(speeds: [f64; 2]) -> Vec<Ball> {
    if speeds == [1.0, 1.0] {
        return vec![Ball::from(1.0)];
    }
    let [largest, least] = speeds.map(f64::recip);
    let count = ((largest - least) / PIECE).ceil().clamp(1.0, MAX_PIECES);
    let step = (largest - least) / count;
    let centre = |k: usize| least + (k as f64 + 0.5) * step;
    let piece = |k: usize| Ball::from(centre(k)).widened(0.5 * step * (1.0 + 1e-9) + 1e-14);
    (0..count as usize).map(piece).collect()
}

impl Weight {
    fn at(self, nu: f64) -> f64 {
        match self {
            Self::One => 1.0,
            Self::Slope => nu,
            Self::Chord(d) => (0.5 * nu * nu * d * d).min(2.0),
            Self::Parabola(d) => ((nu * d).powi(3) / PARABOLA).min(2.25),
            Self::Shift(s) => (nu * s).min(2.0),
        }
    }

    /// The largest value of nu^-2p m(nu)^2 from `far` on, and its integral.
    fn far(self, p: i32, far: f64) -> (f64, f64) {
        let odd = f64::from(2 * p - 1);
        match self {
            Self::One => plain(p, far),
            Self::Slope if p == 1 => (f64::INFINITY, f64::INFINITY),
            Self::Slope => (far.powi(2 - 2 * p), far.powi(3 - 2 * p) / (odd - 2.0)),
            Self::Chord(d) => Bent { power: 2, bend: 2.0 / d, limit: 2.0 }.far(p, far),
            Self::Parabola(d) => {
                Bent { power: 3, bend: (2.25 * PARABOLA).cbrt() / d, limit: 2.25 }.far(p, far)
            }
            Self::Shift(s) => Bent { power: 1, bend: 2.0 / s, limit: 2.0 }.far(p, far),
        }
    }
}

/// nu^-2p from `from` on: the largest value and the integral.
fn plain(p: i32, from: f64) -> (f64, f64) {
    (from.powi(-2 * p), from.powi(1 - 2 * p) / f64::from(2 * p - 1))
}

/// The weight `limit` min(nu / `bend`, 1)^`power`.
struct Bent {
    power: i32,
    bend: f64,
    limit: f64,
}

impl Bent {
    /// As [`Weight::far`].
    fn far(&self, p: i32, far: f64) -> (f64, f64) {
        let square = self.limit * self.limit;
        if self.bend.is_infinite() {
            return (0.0, 0.0);
        }
        if far >= self.bend {
            let (largest, integral) = plain(p, far);
            return (square * largest, square * integral);
        }
        // limit^2 (nu / bend)^(2 power) nu^-2p up to the bend, then limit^2 nu^-2p. The power of the
        // integral is odd, so never zero.
        let factor = square * self.bend.powi(-2 * self.power);
        let (rise, power) = (2 * (self.power - p), 2 * (self.power - p) + 1);
        let below = factor * (self.bend.powi(power) - far.powi(power)) / f64::from(power);
        let largest = factor * if rise > 0 { self.bend } else { far }.powi(rise);
        (largest, below + square * plain(p, self.bend).1)
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
        FrontEnd { transfer, signal: None }
    }

    /// A signal's filter with a direct term, against plain sums.
    #[test]
    fn a_signal_shapes_the_sums() {
        let front_end = transfer(&[1.0], &[1.0, 0.7]);
        let filter = FilterSpec::TransferFunction { num: vec![0.1, 0.2, 1.0], den: vec![1.0, 0.9, 1.0] };
        let signal = Transfer::new(&enclosed(None, &filter, Seconds(1.0)).unwrap(), Ball::from(1.0));
        let shaped = FrontEnd { transfer: &front_end, signal: Some(&signal) };
        for weight in [Weight::One, Weight::Chord(0.1), Weight::Shift(1e-3)] {
            let bound = Aliases::new(&shaped, Ball::from(2.0), 3, [1.0, 1.0]).unwrap().norm(weight);
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
            let weights = [
                Weight::One,
                Weight::Slope,
                Weight::Chord(0.1),
                Weight::Chord(1e-3),
                Weight::Chord(0.0),
                Weight::Parabola(0.1),
                Weight::Parabola(0.01),
                Weight::Shift(1e-3),
            ];
            for weight in weights {
                if weight == Weight::Slope && den.len() == 2 {
                    continue;
                }
                let omega = 2.0;
                let bound =
                    Aliases::new(&alone(&transfer), Ball::from(omega), 3, [1.0, 1.0]).unwrap().norm(weight);
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

    #[test]
    fn a_range_of_cutoffs_bounds_each_of_them() {
        let whole =
            Aliases::new(&alone(&transfer(&[1.0], &[1.0, 2.0, 2.0, 1.0])), Ball::from(1.0), 2, [0.98, 1.02])
                .unwrap();
        for x in [0.98, 1.0, 1.02f64] {
            let den = [1.0, 2.0 * x, 2.0 * x * x, x.powi(3)];
            let one = transfer(&[x.powi(3)], &den);
            let one = Aliases::new(&alone(&one), Ball::from(1.0), 2, [1.0, 1.0]).unwrap();
            for weight in [Weight::One, Weight::Slope, Weight::Chord(0.1)] {
                assert!(
                    one.norm(weight) <= whole.norm(weight) && whole.norm(weight) <= 1.3 * one.norm(weight)
                );
            }
        }
    }
}
