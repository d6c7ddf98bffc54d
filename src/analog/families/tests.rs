//! Prototypes against stored digits and against the properties that define them.

use super::*;
use crate::units::{Hertz, Seconds};

/// One line of `reference.txt` (made by `tools/analog_reference.py`).
struct Reference {
    label: String,
    source: &'static str,
    family: &'static str,
    order: usize,
    ripple_db: f64,
    attenuation_db: f64,
    /// The edges of a band-pass in Hz.
    band: Option<[f64; 2]>,
    expected: Zpk<Cutoffs>,
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
        family: words[1],
        order: words[2].parse().unwrap(),
        ripple_db: number(3),
        attenuation_db: number(4),
        band: (words.get(6) == Some(&"e")).then(|| [number(7), number(8)]),
        expected: Zpk::new(roots("z"), roots("p"), number(5)),
    }
}

fn designed(r: &Reference) -> Zpk<Cutoffs> {
    match r.family {
        "butterworth" => butterworth(r.order),
        "chebyshev1" => chebyshev1(r.order, r.ripple_db),
        "chebyshev2" => chebyshev2(r.order, r.attenuation_db),
        "elliptic" => elliptic(r.order, r.ripple_db, r.attenuation_db),
        "bessel" => bessel(r.order).unwrap(),
        other => panic!("unknown family {other}"),
    }
}

/// Largest relative distance of a root to the nearest one of the other list.
fn distance(found: &[Complex<f64>], expected: &[Complex<f64>]) -> f64 {
    let nearest =
        |x: &Complex<f64>| found.iter().map(|y| (x - y).norm() / x.norm()).fold(f64::INFINITY, f64::min);
    expected.iter().map(nearest).fold(0.0, f64::max)
}

#[test]
fn zeros_poles_and_gains_agree_with_scipy_and_with_sixty_digits() {
    let references: Vec<Reference> = references().into_iter().filter(|r| r.band.is_none()).collect();
    assert_eq!(references.len(), 217);
    for r in &references {
        // scipy's own elliptic iteration stops near 1e-12; mpmath's digits are all good.
        let tolerance = if r.source == "scipy" { 1e-10 } else { 1e-13 };
        let found = designed(r);
        assert_eq!(found.poles.len(), r.expected.poles.len(), "{}", r.label);
        assert_eq!(found.zeros.len(), r.expected.zeros.len(), "{}", r.label);
        let poles = distance(&found.poles, &r.expected.poles);
        let zeros = distance(&found.zeros, &r.expected.zeros);
        let gain = (found.gain / r.expected.gain - 1.0).abs();
        assert!(poles <= tolerance, "{}: poles off by {poles:e}", r.label);
        assert!(zeros <= tolerance, "{}: zeros off by {zeros:e}", r.label);
        assert!(gain <= 20.0 * tolerance, "{}: gain off by {gain:e}", r.label);
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
        let found = designed(r).band_pass(Hertz(low), Hertz(high), Seconds(1.0));
        let label = format!("{} {low}..{high}", r.label);
        assert_eq!(found.poles.len(), 2 * r.order, "{label}");
        assert_eq!(found.zeros.len(), r.expected.zeros.len(), "{label}");
        // scipy's roots lose what cancels in a narrow or a wide band.
        let (tolerance, damping) = if r.source == "scipy" { (1e-9, 1e-3) } else { (1e-14, 1e-12) };
        let poles = distance(&found.poles, &r.expected.poles);
        let zeros = distance(&nonzero(&found.zeros), &nonzero(&r.expected.zeros));
        let gain = (found.gain / r.expected.gain - 1.0).abs();
        let damped = damping_error(&found.poles, &r.expected.poles);
        assert!(poles <= tolerance, "{label}: poles off by {poles:e}");
        assert!(zeros <= tolerance, "{label}: zeros off by {zeros:e}");
        assert!(damped <= damping, "{label}: damping off by {damped:e}");
        assert!(gain <= 100.0 * tolerance, "{label}: gain off by {gain:e}");
    }
}

fn nonzero(roots: &[Complex<f64>]) -> Vec<Complex<f64>> {
    roots.iter().copied().filter(|root| root.norm() > 0.0).collect()
}

fn decibels(zpk: &Zpk<Cutoffs>, w: f64) -> f64 {
    20.0 * zpk.response(Complex::new(0.0, w)).norm().log10()
}

#[test]
fn the_cutoff_means_what_it_says() {
    for order in 1..=32 {
        assert!(
            (decibels(&butterworth(order), 1.0) + 10.0 * 2f64.log10()).abs() < 1e-11,
            "butterworth {order}"
        );
        assert!((decibels(&chebyshev1(order, 0.7), 1.0) + 0.7).abs() < 1e-10, "chebyshev1 {order}");
        assert!((decibels(&chebyshev2(order, 35.0), 1.0) + 35.0).abs() < 1e-9, "chebyshev2 {order}");
    }
    for order in 1..=12 {
        assert!((decibels(&elliptic(order, 0.7, 60.0), 1.0) + 0.7).abs() < 1e-10, "elliptic {order}");
    }
}

#[test]
fn equal_ripple_stays_within_its_band() {
    for order in 2..=12 {
        let filter = elliptic(order, 0.5, 45.0);
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
    for s in bessel(3).unwrap().poles.iter().map(|p| p * scale) {
        let theta = ((s + 6.0) * s + 15.0) * s + 15.0;
        assert!(theta.norm() < 1e-13, "{theta}");
    }
}

#[test]
fn a_bessel_polynomial_beyond_double_precision_ends_in_an_error() {
    assert!(matches!(bessel(400), Err(crate::analog::AnalogError::Numerical(_))));
}

#[test]
fn bessel_delay_is_maximally_flat() {
    // The group delay of theta_n(0)/theta_n(s) is 1 + O(w^2n); the phase norm stretches it by
    // theta_n(0)^(1/n).
    for order in 3..=32 {
        let poles = bessel(order).unwrap().poles;
        let delay =
            |w: f64| poles.iter().map(|p| -p.re / (p.re * p.re + (w - p.im) * (w - p.im))).sum::<f64>();
        let dc = delay(0.0);
        assert!(
            (delay(0.2) / dc - 1.0).abs() < 1e-3 && (delay(1e-3) / dc - 1.0).abs() < 1e-9,
            "order {order}: {:e} {:e}",
            delay(0.2) / dc - 1.0,
            delay(1e-3) / dc - 1.0
        );
        let odd = (1..order).map(|k| (2.0 * k as f64 + 1.0).ln()).sum::<f64>();
        assert!((dc / (odd / order as f64).exp() - 1.0).abs() < 1e-12, "order {order}: {dc}");
    }
}

proptest::proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig {
        cases: 200, max_global_rejects: 4000, failure_persistence: None, ..Default::default()
    })]

    /// From ripples that are hardly there to 300 dB, and from nearly equal to far apart.
    #[test]
    fn any_legal_ripples_make_a_stable_filter(order in 1usize..=32, ripple in -6.0..1.5f64, excess in -3.0..2.4f64) {
        let ripple_db = 10f64.powf(ripple);
        let attenuation_db = (ripple_db + 10f64.powf(excess)).min(crate::spec::MAX_RIPPLE_DB);
        // With ripples alike and a high order, the stop band begins within rounding of the cutoff.
        let sharp = elliptic(order, ripple_db, attenuation_db);
        let first_zero = sharp.zeros.iter().map(|z| z.im.abs()).fold(f64::INFINITY, f64::min);
        proptest::prop_assume!(first_zero > 1.0 + 1e-5);
        for filter in [chebyshev1(order, ripple_db), chebyshev2(order, attenuation_db), sharp.clone()] {
            proptest::prop_assert_eq!(filter.poles.len(), order);
            proptest::prop_assert!(filter.gain.is_finite() && filter.gain > 0.0, "{:?}", filter);
            proptest::prop_assert!(filter.poles.iter().all(|p| p.re < 0.0 && p.im.is_finite()), "{:?}", filter);
            proptest::prop_assert!(filter.zeros.iter().all(|z| z.im.is_finite() && z.im.abs() > 0.0), "{:?}", filter);
        }
        let edge = decibels(&sharp, 1.0);
        proptest::prop_assert!((edge + ripple_db).abs() < 1e-6 * ripple_db.max(1e-3), "{} against {}", edge, ripple_db);
    }
}
