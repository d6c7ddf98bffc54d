//! Prototypes against stored digits and against the properties that define them.

use super::*;
use crate::analog::AnalogError;
use crate::arithmetic::Real;
use hybank_core::spec::Passband;
use hybank_core::units::{Hertz, Seconds};
use hybank_linalg::Complex;
use proptest::prelude::*;

/// Zeros, poles and gain in doubles.
struct Rounded {
    zeros: Vec<Complex<f64>>,
    poles: Vec<Complex<f64>>,
    gain: f64,
}

impl From<Factors<LongBall>> for Rounded {
    fn from(factors: Factors<LongBall>) -> Self {
        let pair = |re: LongBall, im: LongBall| {
            let z = Complex::new(re.nearest(), im.nearest());
            [z, z.conj()]
        };
        let list = |roots: &RootSet<LongBall>| -> Vec<Complex<f64>> {
            let real = roots.real.iter().map(|r| r.nearest().into());
            real.chain(roots.upper.iter().flat_map(|&(re, im)| pair(re, im))).collect()
        };
        Self { zeros: list(&factors.zeros), poles: list(&factors.poles), gain: factors.gain.nearest() }
    }
}

fn member(family: &str, order: usize, ripple_db: f64, attenuation_db: f64) -> Member {
    let family = match family {
        "butterworth" => Family::Butterworth,
        "chebyshev1" => Family::Chebyshev1,
        "chebyshev2" => Family::Chebyshev2,
        "elliptic" => Family::Elliptic,
        "bessel" => Family::Bessel,
        other => panic!("unknown family {other}"),
    };
    Member { family, order, ripple_db, attenuation_db }
}

fn designed(family: &str, order: usize, ripple_db: f64, attenuation_db: f64) -> Rounded {
    prototype(&member(family, order, ripple_db, attenuation_db)).unwrap().into()
}

/// One line of `reference.txt` (made by `tools/analog_reference.py`).
struct Reference {
    label: String,
    source: &'static str,
    member: Member,
    /// The edges of a band-pass in Hz.
    band: Option<[f64; 2]>,
    expected: Rounded,
}

impl Reference {
    fn found(&self) -> Rounded {
        prototype(&self.member).unwrap().into()
    }
}

fn references() -> Vec<Reference> {
    include_str!("reference.txt").lines().map(reference).collect()
}

fn reference(line: &'static str) -> Reference {
    let words: Vec<&'static str> = line.split_whitespace().collect();
    let number = |i: usize| words[i].parse::<f64>().unwrap();
    let roots = |kind: &str| {
        let upper = words[6..].chunks_exact(3).filter(|w| w[0] == kind);
        let complex = upper.map(|w| Complex::new(w[1].parse().unwrap(), w[2].parse().unwrap()));
        complex.flat_map(|r: Complex<f64>| if r.im == 0.0 { vec![r] } else { vec![r, r.conj()] }).collect()
    };
    Reference {
        label: words[..5].join(" "),
        source: words[0],
        member: member(words[1], words[2].parse().unwrap(), number(3), number(4)),
        band: (words.get(6) == Some(&"e")).then(|| [number(7), number(8)]),
        expected: Rounded { zeros: roots("z"), poles: roots("p"), gain: number(5) },
    }
}

/// A decimal number with its digits, whose last one may be off by one.
fn decimal(text: &str) -> LongBall {
    let (digits, exponent) = text.split_once('e').unwrap_or((text, "0"));
    let (digits, sign) = digits.strip_prefix('-').map_or((digits, 1.0), |digits| (digits, -1.0));
    let ten = Ball::from(10.0);
    let whole = digits.bytes().filter(|c| *c != b'.');
    let whole = whole.fold(Ball::ZERO, |sum, c| sum * ten + Ball::from(f64::from(c - b'0')));
    let fraction = digits.split_once('.').map_or(0, |(_, fraction)| fraction.len() as i64);
    let value = whole.times_power(ten, exponent.parse::<i64>().unwrap() - fraction) * Ball::from(sign);
    value.widened(1e-48 * value.nearest().abs())
}

/// prod(1/2 - roots).
fn at_half(roots: &RootSet<LongBall>) -> LongBall {
    let (one, half) = (Ball::from(1.0), Ball::from(0.5));
    let real = roots.real.iter().fold(one, |product, &r| product * (half - r));
    let square = |re: LongBall, im: LongBall| (half - re) * (half - re) + im * im;
    roots.upper.iter().fold(real, |product, &(re, im)| product * square(re, im))
}

/// Every enclosure holds the digits of mpmath, to 48 of its 50, and is narrow.
#[test]
fn enclosures_hold_fifty_digits() {
    let lines: Vec<&str> = include_str!("digits.txt").lines().collect();
    assert_eq!(lines.len(), 256);
    for line in lines {
        let words: Vec<&str> = line.split_whitespace().collect();
        let [ripple, attenuation] = [words[2], words[3]].map(|word| word.parse::<f64>().unwrap());
        let found = prototype(&member(words[0], words[1].parse().unwrap(), ripple, attenuation)).unwrap();
        let top = found.poles.upper.iter().max_by(|a, b| a.1.nearest().total_cmp(&b.1.nearest()));
        let (re, im) = top.copied().unwrap_or_else(|| (found.poles.real[0], Ball::ZERO));
        let numbers = [found.gain, at_half(&found.zeros), at_half(&found.poles), re, im];
        for (number, digits) in numbers.into_iter().zip(&words[4..]) {
            let rest = number - decimal(digits);
            let (off, radius) = (rest.nearest(), number.radius());
            assert!(rest.lower() <= 0.0 && rest.upper() >= 0.0, "{line}: {digits} off by {off:e}");
            assert!(radius <= 1e-80 * number.nearest().abs(), "{line}: {digits} within {radius:e}");
        }
    }
}

/// Largest relative distance of a root to the nearest one of the other list.
fn distance(found: &[Complex<f64>], expected: &[Complex<f64>]) -> f64 {
    let nearest =
        |x: &Complex<f64>| found.iter().map(|y| (x - y).norm() / x.norm()).fold(f64::INFINITY, f64::min);
    expected.iter().map(nearest).fold(0.0, f64::max)
}

/// Zeros beside the origin, poles and gain agree: roots to the first tolerance, the gain to the second.
fn assert_close(label: &str, found: &Rounded, expected: &Rounded, [roots, gains]: [f64; 2]) {
    let poles = distance(&found.poles, &expected.poles);
    let zeros = distance(&nonzero(&found.zeros), &nonzero(&expected.zeros));
    let gain = (found.gain / expected.gain - 1.0).abs();
    assert!(poles <= roots, "{label}: poles off by {poles:e}");
    assert!(zeros <= roots, "{label}: zeros off by {zeros:e}");
    assert!(gain <= gains, "{label}: gain off by {gain:e}");
}

#[test]
fn zeros_poles_and_gains_agree_with_scipy_and_with_sixty_digits() {
    let references: Vec<Reference> = references().into_iter().filter(|r| r.band.is_none()).collect();
    assert_eq!(references.len(), 217);
    for r in &references {
        // scipy's own elliptic iteration stops near 1e-12; mpmath's digits are all good.
        let tolerance = if r.source == "scipy" { 1e-10 } else { 1e-13 };
        let found = r.found();
        assert_eq!(found.poles.len(), r.expected.poles.len(), "{}", r.label);
        assert_eq!(found.zeros.len(), r.expected.zeros.len(), "{}", r.label);
        assert_close(&r.label, &found, &r.expected, [tolerance, 20.0 * tolerance]);
    }
}

/// Largest distance of a pole's real part to that of the nearest pole, relative to it: the bandwidth of a
/// resonance, which is a small part of a pole's size in a narrow band.
fn damping_error(found: &[Complex<f64>], expected: &[Complex<f64>]) -> f64 {
    let error = |x: &Complex<f64>| {
        let nearest = found.iter().min_by(|a, b| (*a - x).norm().total_cmp(&(*b - x).norm())).unwrap();
        (nearest.re / x.re - 1.0).abs()
    };
    expected.iter().map(error).fold(0.0, f64::max)
}

#[test]
fn band_passes_agree_with_scipy_and_with_sixty_digits() {
    let references: Vec<Reference> = references().into_iter().filter(|r| r.band.is_some()).collect();
    assert_eq!(references.len(), 250);
    for r in &references {
        let [low, high] = r.band.unwrap();
        let band = Passband::BandPass { low: Hertz(low), high: Hertz(high) };
        let found = Rounded::from(passband::moved(&prototype(&r.member).unwrap(), band, Seconds(1.0)));
        let label = format!("{} {low}..{high}", r.label);
        assert_eq!(found.poles.len(), 2 * r.member.order, "{label}");
        assert_eq!(found.zeros.len(), r.expected.zeros.len(), "{label}");
        // scipy's roots lose what cancels in a narrow or a wide band.
        let (tolerance, damping) = if r.source == "scipy" { (1e-9, 1e-3) } else { (1e-14, 1e-12) };
        assert_close(&label, &found, &r.expected, [tolerance, 100.0 * tolerance]);
        let damped = damping_error(&found.poles, &r.expected.poles);
        assert!(damped <= damping, "{label}: damping off by {damped:e}");
    }
}

fn nonzero(roots: &[Complex<f64>]) -> Vec<Complex<f64>> {
    roots.iter().copied().filter(|root| root.norm() > 0.0).collect()
}

fn decibels(filter: &Rounded, w: f64) -> f64 {
    let s = Complex::new(0.0, w);
    let level = |roots: &[Complex<f64>]| -> f64 { roots.iter().map(|root| (s - root).norm().log10()).sum() };
    20.0 * (filter.gain.log10() + level(&filter.zeros) - level(&filter.poles))
}

#[test]
fn the_cutoff_means_what_it_says() {
    for (family, most, ripple, attenuation, level, tolerance) in [
        ("butterworth", 32, 0.0, 0.0, 10.0 * 2f64.log10(), 1e-11),
        ("chebyshev1", 32, 0.7, 0.0, 0.7, 1e-10),
        ("chebyshev2", 32, 0.0, 35.0, 35.0, 1e-9),
        ("elliptic", 12, 0.7, 60.0, 0.7, 1e-10),
    ] {
        for order in 1..=most {
            let edge = decibels(&designed(family, order, ripple, attenuation), 1.0);
            assert!((edge + level).abs() < tolerance, "{family} {order}: {edge}");
        }
    }
}

#[test]
fn equal_ripple_stays_within_its_band() {
    for order in 2..=12 {
        let filter = designed("elliptic", order, 0.5, 45.0);
        let zero = filter.zeros.iter().map(|z| z.im.abs()).fold(f64::INFINITY, f64::min);
        for i in 0..2000 {
            let w = f64::from(i) / 1999.0;
            let pass = decibels(&filter, w);
            assert!((-0.5 - 1e-9..=1e-9).contains(&pass), "order {order}: {pass} dB at {w}");
            let stop = decibels(&filter, zero / (1.0 - w * 0.999));
            assert!(stop <= -45.0 + 1e-8, "order {order}: {stop} dB in the stop band");
        }
    }
}

#[test]
fn bessel_polynomials_of_low_order_are_the_known_ones() {
    // theta_3 = s^3 + 6 s^2 + 15 s + 15, normalised by 15^(1/3).
    let scale = 15f64.cbrt();
    for s in designed("bessel", 3, 0.0, 0.0).poles.iter().map(|p| p * scale) {
        let theta = ((s + 6.0) * s + 15.0) * s + 15.0;
        assert!(theta.norm() < 1e-13, "{theta}");
    }
}

#[test]
fn a_bessel_polynomial_of_an_order_beyond_the_limit_ends_in_an_error() {
    let beyond = prototype(&member("bessel", hybank_core::spec::MAX_ORDER + 1, 0.0, 0.0));
    assert!(matches!(beyond, Err(AnalogError::RootsNotIsolated { .. })));
}

#[test]
fn bessel_delay_is_maximally_flat() {
    // The group delay of theta_n(0)/theta_n(s) is 1 + O(w^2n); the phase norm stretches it by
    // theta_n(0)^(1/n).
    for order in 3..=32 {
        let poles = designed("bessel", order, 0.0, 0.0).poles;
        let delay =
            |w: f64| poles.iter().map(|p| -p.re / (p.re * p.re + (w - p.im) * (w - p.im))).sum::<f64>();
        let dc = delay(0.0);
        let [far, near] = [0.2, 1e-3].map(|w| (delay(w) / dc - 1.0).abs());
        assert!(far < 1e-3 && near < 1e-9, "order {order}: {far:e} {near:e}");
        let odd = (1..order).map(|k| (2.0 * k as f64 + 1.0).ln()).sum::<f64>();
        assert!((dc / (odd / order as f64).exp() - 1.0).abs() < 1e-12, "order {order}: {dc}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 200, max_global_rejects: 4000, failure_persistence: None, ..Default::default()
    })]

    /// From ripples that are hardly there to 300 dB, and from nearly equal to far apart.
    #[test]
    fn any_legal_ripples_make_a_stable_filter(order in 1usize..=32, ripple in -6.0..1.5f64, excess in -3.0..2.4f64) {
        let ripple_db = 10f64.powf(ripple);
        let attenuation_db = (ripple_db + 10f64.powf(excess)).min(hybank_core::spec::MAX_RIPPLE_DB);
        // With ripples alike and a high order, the stop band begins within rounding of the cutoff.
        let sharp = designed("elliptic", order, ripple_db, attenuation_db);
        let first_zero = sharp.zeros.iter().map(|z| z.im.abs()).fold(f64::INFINITY, f64::min);
        prop_assume!(first_zero > 1.0 + 1e-5 && sharp.gain.is_finite());
        let others = ["chebyshev1", "chebyshev2"].map(|family| designed(family, order, ripple_db, attenuation_db));
        for filter in others.iter().chain([&sharp]) {
            prop_assert_eq!(filter.poles.len(), order);
            prop_assert!(filter.gain.is_finite() && filter.gain > 0.0, "{:?}", filter.poles);
            prop_assert!(filter.poles.iter().all(|p| p.re < 0.0 && p.im.is_finite()), "{:?}", filter.poles);
            prop_assert!(filter.zeros.iter().all(|z| z.im.is_finite() && z.im.abs() > 0.0), "{:?}", filter.poles);
        }
        let edge = decibels(&sharp, 1.0);
        prop_assert!((edge + ripple_db).abs() < 1e-6 * ripple_db.max(1e-3), "{} against {}", edge, ripple_db);
    }
}
