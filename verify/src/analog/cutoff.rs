//! What first order leaves of a filter whose cut-off is off.
//!
//! Phi(s (1 + x)) is Phi with its cut-off divided by 1 + x. On the imaginary axis a pole p changes the
//! filter by the factor 1 / (1 + x a) with a = s / (s - p), |a| <= |p| / |Re p|, and a zero z makes of
//! (s - z) the sum (s - z) + x s. With m >= |z|, |s - z| <= |s| + m <= 2^(1/2) |s + m|, without the root for
//! a real z, and |s| <= |s + m|. So relative to the same filter with the zeros at -m, each coefficient of
//! the power series in x is at most that of
//!
//! ```text
//! G(x) = product over the zeros of (c + x)  times  product over the poles of 1 / (1 - x |p| / |Re p|),
//! ```
//!
//! c = 1 for real zeros and 2^(1/2) for others, and what the terms beyond the first order add is at most
//! G(x) - G(0) - x G'(0).

use super::AnalogError;
use super::realise::{Chain, SeriesBlock};
use super::roots::Roots;
use super::section::{Biquad, Realisation};
use crate::arithmetic::{Ball, LongBall};
use hybank_core::spec::FilterSpec;
use hybank_core::units::Seconds;

/// A filter, and the share of its modulus that the terms beyond first order do not exceed.
pub struct CutoffRemainder {
    /// The filter that bounds what is beyond first order.
    pub filter: Realisation<LongBall>,
    /// The largest share of its modulus.
    pub share: f64,
}

impl CutoffRemainder {
    /// Of a written filter for all x up to `error`. `None` where `error` exceeds the damping of a pole, and
    /// for a filter that is written as matrices.
    ///
    /// # Errors
    /// As [`super::enclosed`].
    pub fn new(filter: &FilterSpec, h: Seconds, error: f64) -> Result<Option<Self>, AnalogError> {
        let Chain { gain, blocks } = Chain::<LongBall>::new(filter, h)?;
        let sections = blocks.into_iter().map(|block| match block {
            SeriesBlock::Section(section) => Some(section),
            SeriesBlock::State(_) => None,
        });
        let Some(sections) = sections.collect::<Option<Vec<Biquad<LongBall>>>>() else {
            return Ok(None);
        };
        let share = beyond_first_order(&sections, Ball::from(error));
        let damped = |section: Biquad<LongBall>| Biquad { zeros: damped(section.zeros), ..section };
        let blocks = sections.into_iter().map(damped).map(SeriesBlock::Section).collect();
        Ok(share.map(|share| Self { filter: Chain { gain, blocks }.realise(), share }))
    }
}

/// The zeros moved to -m.
fn damped(zeros: Roots<LongBall>) -> Roots<LongBall> {
    let real = |z: LongBall| Ball::from(-z.magnitude());
    match zeros {
        Roots::None => Roots::None,
        Roots::One(z) => Roots::One(real(z)),
        Roots::Two(y, z) => Roots::Two(real(y), real(z)),
        Roots::Conjugate { re, im } => {
            let both = real((re * re + im * im).sqrt());
            Roots::Two(both, both)
        }
    }
}

/// An upper bound of G(x) - G(0) - x G'(0).
fn beyond_first_order(sections: &[Biquad<LongBall>], x: LongBall) -> Option<f64> {
    let one = Ball::from(1.0);
    let (mut value, mut constant, mut slope) = (one, one, Ball::ZERO);
    for Biquad { poles, zeros } in sections {
        for c in moduli(*zeros, one, |_, _| Ball::from(2.0).sqrt()) {
            (value, constant, slope) = (value * (c + x), constant * c, slope + one / c);
        }
        for quality in moduli(*poles, one, |re, im| (re * re + im * im).sqrt() / -re) {
            let factor = one - x * quality;
            if factor.lower().is_nan() || factor.lower() <= 0.0 {
                return None;
            }
            (value, slope) = (value / factor, slope + quality);
        }
    }
    Some((value - constant - x * constant * slope).upper())
}

/// `real` for each real root, and what `pair` makes of both roots of a pair.
fn moduli(
    roots: Roots<LongBall>,
    real: LongBall,
    pair: impl Fn(LongBall, LongBall) -> LongBall,
) -> Vec<LongBall> {
    match roots {
        Roots::None => Vec::new(),
        Roots::One(_) => vec![real],
        Roots::Two(..) => vec![real; 2],
        Roots::Conjugate { re, im } => vec![pair(re, im); 2],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analog::StrictlyProper;
    use hybank_core::spec::{Family, Passband};
    use hybank_core::units::{Hertz, RadiansPerFastPeriod};
    use hybank_linalg::Complex;

    fn elliptic() -> FilterSpec {
        FilterSpec::Family {
            family: Family::Elliptic,
            order: Some(5),
            passband: Passband::LowPass { cutoff: Hertz(0.2) },
            ripple_db: Some(0.5),
            attenuation_db: Some(50.0),
        }
    }

    /// Phi(j w (1 + x)) less its first-order expansion, by the responses alone.
    fn rest(filter: &StrictlyProper, w: f64, x: f64) -> Complex<f64> {
        let at = |x: f64| filter.response(RadiansPerFastPeriod(w * (1.0 + x)));
        let h = 1e-4;
        let slope = ((at(h) - at(-h)) * 8.0 - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h);
        at(x) - at(0.0) - slope * x
    }

    #[test]
    fn the_remainder_is_never_exceeded_and_of_second_order() {
        let quotient =
            FilterSpec::TransferFunction { num: vec![0.5, 2.0], den: vec![1.0, 1.3, 2.0, 0.7, 0.1] };
        for written in [elliptic(), quotient] {
            let filter = StrictlyProper::new(&written, Seconds(1.0)).unwrap();
            let share = |x: f64| CutoffRemainder::new(&written, Seconds(1.0), x).unwrap().unwrap().share;
            let bound = CutoffRemainder::new(&written, Seconds(1.0), 0.02).unwrap().unwrap();
            let base = bound.filter.rounded();
            let mut closest: f64 = 0.0;
            for (k, x) in (0..400).flat_map(|k| [-0.02, 0.01, 0.02].map(|x| (k, x))) {
                let w = 10f64.powf(f64::from(k) * 0.01 - 2.0);
                let most =
                    bound.share * crate::analog::realise::state_response(&base, Complex::new(0.0, w)).norm();
                let rest = rest(&filter, w, x).norm();
                assert!(rest <= most * (1.0 + 1e-6) + 1e-11, "{w} {x}: {rest} {most}");
                closest = closest.max(rest / most);
            }
            assert!(closest > 0.005, "{closest}");
            assert!((share(2e-4) / share(1e-4) - 4.0).abs() < 0.02);
        }
    }

    #[test]
    fn errors_beyond_the_damping_have_no_remainder() {
        let resonant = FilterSpec::TransferFunction { num: vec![1.0], den: vec![1.0, 0.02, 1.0] };
        let found = |x: f64| CutoffRemainder::new(&resonant, Seconds(1.0), x).unwrap().is_some();
        assert!(found(0.0099) && !found(0.0101));
        let matrices = FilterSpec::StateSpace { a: vec![vec![-1.0]], b: vec![vec![1.0]], c: vec![vec![1.0]] };
        assert!(CutoffRemainder::new(&matrices, Seconds(1.0), 0.01).unwrap().is_none());
    }
}
