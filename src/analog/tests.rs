//! Realisations against the formula, over forms, orders, spreads of poles and time units.

use proptest::prelude::*;

use super::section::Realisation;
use super::*;
use crate::linalg::{Complex, Mat, solve};
use crate::spec::{Family, FilterProblem, FilterSpec};

fn zpk(zeros: &[[f64; 2]], poles: &[[f64; 2]], gain: f64) -> FilterSpec {
    FilterSpec::ZeroPoleGain { zeros: zeros.to_vec(), poles: poles.to_vec(), gain }
}

fn tf(num: &[f64], den: &[f64]) -> FilterSpec {
    FilterSpec::TransferFunction { num: num.to_vec(), den: den.to_vec() }
}

fn family(family: Family, order: usize, cutoff: f64) -> FilterSpec {
    FilterSpec::Family {
        family,
        order: (family != Family::Rc).then_some(order),
        cutoff,
        ripple_db: family.has_ripple().then_some(0.5),
        attenuation_db: family.has_attenuation().then_some(60.0),
    }
}

/// The family member, behind the pole of a switch where it needs one.
fn sampled_family(kind: Family, order: usize, cutoff: f64) -> FilterSpec {
    let filter = family(kind, order, cutoff);
    if filter.check().is_ok() {
        return filter;
    }
    FilterSpec::Cascade { cascade: vec![filter, family(Family::Rc, 1, 30.0 * cutoff)] }
}

/// c (j w - a)^-1 b of the realisation, by linear algebra alone.
fn realised_response(phi: &StrictlyProper, w: f64) -> Complex<f64> {
    let state = Realisation { a: phi.a().clone(), b: phi.b().clone(), c: phi.c().clone(), d: 0.0 };
    super::realise::state_response(&state, Complex::new(0.0, w))
}

/// Frequencies around every pole and far beyond, eleven a decade and exactly on the resonances.
fn probes(phi: &StrictlyProper) -> Vec<f64> {
    let moduli: Vec<f64> = phi.poles().iter().map(|p| p.norm()).collect();
    let low = moduli.iter().copied().fold(f64::INFINITY, f64::min).log10() - 2.0;
    let high = moduli.iter().copied().fold(0.0, f64::max).log10() + 2.0;
    let steps = (11.0 * (high - low)) as usize;
    let sweep = (0..=steps).map(|i| 10f64.powf(low + (high - low) * i as f64 / steps as f64));
    sweep.chain(moduli.clone()).chain(phi.poles().iter().map(|p| p.im.abs())).chain([0.0]).collect()
}

/// Largest difference between realisation and formula, relative to the peak.
fn realisation_error(phi: &StrictlyProper) -> f64 {
    let probes = probes(phi);
    let peak = probes.iter().map(|&w| phi.response(w).norm()).fold(0.0, f64::max);
    probes.iter().map(|&w| (realised_response(phi, w) - phi.response(w)).norm() / peak).fold(0.0, f64::max)
}

/// Diagonal of the controllability Gramian, by the Kronecker form of the Lyapunov equation.
fn gramian_diagonal(phi: &StrictlyProper) -> Vec<f64> {
    let n = phi.order();
    let identity = Mat::identity(n, n);
    let lyapunov = phi.a().kronecker(&identity) + identity.kronecker(phi.a());
    let squared = phi.b() * phi.b().transpose();
    let p = solve(&lyapunov, &Mat::from_column_slice(n * n, 1, (-squared).as_slice()));
    (0..n).map(|i| p[(i * n + i, 0)]).collect()
}

#[test]
fn families_realise_to_the_last_digits() {
    for kind in Family::ALL {
        for order in 1..=(if kind == Family::Rc { 1 } else { 12 }) {
            for cutoff in [1e-3, 0.2, 20.0] {
                let phi = StrictlyProper::new(&sampled_family(kind, order, cutoff), 1.0).unwrap();
                let error = realisation_error(&phi);
                assert!(error < 1e-12, "{kind:?} {order} at {cutoff}: {error:e}");
            }
        }
    }
}

#[test]
fn high_orders_realise() {
    for (kind, order) in
        [(Family::Butterworth, 32), (Family::Bessel, 32), (Family::Chebyshev1, 21), (Family::Elliptic, 15)]
    {
        let phi = StrictlyProper::new(&family(kind, order, 0.3), 1.0).unwrap();
        let error = realisation_error(&phi);
        assert!(error < 1e-11, "{kind:?} {order}: {error:e}");
    }
}

#[test]
fn stop_bands_keep_their_relative_digits() {
    // A sum of partial fractions would be rounding noise at -300 dB; a cascade is a product.
    let phi = StrictlyProper::new(&family(Family::Butterworth, 6, 0.1), 1.0).unwrap();
    for w in [30.0, 300.0, 3e3] {
        let (found, expected) = (realised_response(&phi, w), phi.response(w));
        assert!((found - expected).norm() < 1e-12 * expected.norm(), "w = {w}: {found} {expected}");
    }
    let cb = phi.c() * phi.b();
    assert_eq!(cb[(0, 0)], 0.0, "the relative degree is exact");
}

#[test]
fn stiff_filters_realise_with_states_of_unit_energy() {
    let poles = [[-1e-3, 0.0], [-1.0, 0.0], [-2e3, 5e3], [-2e3, -5e3], [-1e6, 0.0]];
    let dc: f64 = 1e-3 * 1.0 * (4e6 + 25e6) * 1e6;
    let filters = [
        zpk(&[], &poles, dc),
        zpk(&[[-0.5, 0.0], [0.0, 3e3], [0.0, -3e3]], &poles, dc / (0.5 * 9e6)),
        zpk(&[[2.0, 0.0]], &[[-1e-3, 1e-3], [-1e-3, -1e-3], [-1e6, 0.0]], 1.0),
    ];
    for filter in &filters {
        let phi = StrictlyProper::new(filter, 1.0).unwrap();
        assert!(realisation_error(&phi) < 1e-12, "{:e} for {filter:?}", realisation_error(&phi));
        for energy in gramian_diagonal(&phi) {
            assert!((0.37..=1.6).contains(&energy), "{energy} for {filter:?}");
        }
    }
}

/// The upper pole of a realisation with two states, from trace and off-diagonal product.
fn realised_pole(phi: &StrictlyProper) -> Complex<f64> {
    let a = phi.a();
    assert_eq!(a[(0, 0)], a[(1, 1)]);
    Complex::new(a[(0, 0)], (-a[(0, 1)] * a[(1, 0)]).sqrt())
}

#[test]
fn high_quality_poles_keep_their_resonance() {
    for damping in [1e-2, 1e-5, 1e-8] {
        let phi = StrictlyProper::new(&zpk(&[], &[[-damping, 1.0], [-damping, -1.0]], 1.0), 1.0).unwrap();
        let exact = 1.0 / (Complex::new(damping, 0.0) * Complex::new(damping, 2.0));
        assert!((phi.response(1.0) - exact).norm() < 1e-14 * exact.norm());
        // The pencil j w - a is as nearly singular as the pole is near to the axis.
        let error = (realised_response(&phi, 1.0) - exact).norm() / exact.norm();
        assert!(error < 1e-15 / damping, "damping {damping}: {error:e}");
        let resonant = realised_pole(&phi);
        assert!((resonant - Complex::new(-damping, 1.0)).norm() < 1e-15, "{resonant}");
    }
}

fn binomial_power(root: f64, n: usize) -> Vec<f64> {
    (0..n).fold(vec![1.0], |p, _| {
        let shifted = p.iter().chain([&0.0]);
        let scaled = std::iter::once(&0.0).chain(&p).map(|c| c * root);
        shifted.zip(scaled).map(|(a, b)| a + b).collect()
    })
}

#[test]
fn repeated_poles_of_polynomials_keep_the_response() {
    // (0.5/(s + 0.5))^n from expanded coefficients, all of them exact doubles; n = 2 is the thesis filter.
    for n in 1..=16 {
        let phi = StrictlyProper::new(&tf(&[0.5f64.powi(n as i32)], &binomial_power(0.5, n)), 1.0).unwrap();
        assert_eq!(phi.order(), n);
        for w in [0.0, 0.01, 0.3, 0.5, 1.0, 4.0, 50.0] {
            let exact = (Complex::new(0.5, 0.0) / Complex::new(0.5, w)).powu(n as u32);
            let (formula, realised) =
                ((phi.response(w) - exact).norm(), (realised_response(&phi, w) - exact).norm());
            assert!(formula < 1e-12, "n = {n}, w = {w}: formula off by {formula:e}");
            assert!(realised < 1e-12, "n = {n}, w = {w}: realisation off by {realised:e}");
        }
    }
}

#[test]
fn stiff_polynomials_keep_the_response() {
    // Poles -1e-3, -1, -1e3, -1e6 and a zero at -10, multiplied out.
    let den = [1.0, 1001001.001, 1001002001.001, 1001001001.0, 1e6];
    let phi = StrictlyProper::new(&tf(&[1e5, 1e6], &den), 1.0).unwrap();
    for w in [0.0, 1e-3, 0.1, 1.0, 30.0, 1e3, 1e5, 1e7] {
        let s = Complex::new(0.0, w);
        let exact = (s * 1e5 + 1e6) / ((s + 1e-3) * (s + 1.0) * (s + 1e3) * (s + 1e6));
        assert!((phi.response(w) - exact).norm() < 1e-12 * exact.norm(), "w = {w}");
        assert!((realised_response(&phi, w) - exact).norm() < 1e-12, "w = {w}");
    }
}

#[test]
fn one_filter_in_every_form() {
    // 2 (s + 3) / ((s + 1) (s^2 + 2 s + 5)).
    let forms = [
        tf(&[0.0, 2.0, 6.0], &[0.0, 1.0, 3.0, 7.0, 5.0]),
        tf(&[-1.0, -3.0], &[-0.5, -1.5, -3.5, -2.5]),
        zpk(&[[-3.0, 0.0]], &[[-1.0, 2.0], [-1.0, 0.0], [-1.0, -2.0]], 2.0),
        FilterSpec::StateSpace {
            a: vec![vec![0.0, 1.0, 0.0], vec![0.0, 0.0, 1.0], vec![-5.0, -7.0, -3.0]],
            b: vec![vec![0.0], vec![0.0], vec![1.0]],
            c: vec![vec![6.0, 2.0, 0.0]],
        },
        FilterSpec::Cascade {
            cascade: vec![tf(&[2.0, 6.0], &[1.0, 2.0, 5.0]), zpk(&[], &[[-1.0, 0.0]], 1.0)],
        },
    ];
    for h in [1.0, 0.3] {
        for form in &forms {
            let phi = StrictlyProper::new(form, h).unwrap();
            for w in [0.0, 0.1, 0.7, 2.0, 9.0] {
                let s = Complex::new(0.0, w / h);
                let exact = (s + 3.0) * 2.0 / ((s + 1.0) * (s * s + s * 2.0 + 5.0));
                assert!((phi.response(w) - exact).norm() < 1e-13, "{form:?} at {w}");
                assert!((realised_response(&phi, w) - exact).norm() < 1e-13, "{form:?} at {w}");
            }
        }
    }
}

/// Relative to each entry, but not below 1e-3 of the largest one of its row.
fn largest_difference(x: &Mat, y: &Mat) -> f64 {
    let row = |i: usize| {
        let size = x.row(i).amax() * 1e-3;
        x.row(i)
            .iter()
            .zip(y.row(i).iter())
            .map(|(a, b)| (a - b).abs() / a.abs().max(size))
            .fold(0.0, f64::max)
    };
    (0..x.nrows()).map(row).fold(0.0, f64::max)
}

/// The filter with all frequencies multiplied by `factor`.
fn faster(filter: &FilterSpec, factor: f64) -> FilterSpec {
    let power = |n: usize| (0..n).fold(1.0, |p, _| p * factor);
    let scaled = |list: &[f64], n: usize| -> Vec<f64> {
        list.iter().enumerate().map(|(i, x)| x * power(n + 1 - list.len() + i)).collect()
    };
    let roots = |list: &[[f64; 2]]| list.iter().map(|r| r.map(|x| x * factor)).collect();
    let matrix = |m: &[Vec<f64>]| m.iter().map(|row| row.iter().map(|x| x * factor).collect()).collect();
    match filter.clone() {
        FilterSpec::TransferFunction { num, den } => {
            let n = den.len() - 1;
            FilterSpec::TransferFunction { num: scaled(&num, n), den: scaled(&den, n) }
        }
        FilterSpec::ZeroPoleGain { zeros, poles, gain } => FilterSpec::ZeroPoleGain {
            zeros: roots(&zeros),
            poles: roots(&poles),
            gain: gain * power(poles.len() - zeros.len()),
        },
        FilterSpec::StateSpace { a, b, c } => FilterSpec::StateSpace { a: matrix(&a), b: matrix(&b), c },
        FilterSpec::Family { family, order, cutoff, ripple_db, attenuation_db } => {
            FilterSpec::Family { family, order, cutoff: cutoff * factor, ripple_db, attenuation_db }
        }
        FilterSpec::Cascade { cascade } => {
            FilterSpec::Cascade { cascade: cascade.iter().map(|f| faster(f, factor)).collect() }
        }
    }
}

#[test]
fn seconds_and_nanoseconds_give_the_same_numbers() {
    let filters = [
        tf(&[0.25], &[1.0, 1.0, 0.25]),
        tf(&[1.0, 0.7], &[1.0, 2.6131, 3.4142, 2.6131, 1.0]),
        zpk(&[[0.0, 3.0], [0.0, -3.0]], &[[-1e-3, 0.0], [-0.4, 1.9], [-0.4, -1.9], [-70.0, 0.0]], 3.0),
        FilterSpec::StateSpace {
            a: vec![vec![-0.3, 2.0], vec![-1.0, -0.1]],
            b: vec![vec![1.0], vec![0.0]],
            c: vec![vec![0.0, 3.0]],
        },
        sampled_family(Family::Elliptic, 6, 0.21),
        family(Family::Butterworth, 12, 0.4),
        family(Family::Bessel, 9, 0.1),
    ];
    for filter in &filters {
        let seconds = StrictlyProper::new(filter, 1.0).unwrap();
        for factor in [1e-6, 1e3, 1e9, 1e12] {
            let other = StrictlyProper::new(&faster(filter, factor), 1.0 / factor).unwrap();
            for (x, y) in [(seconds.a(), other.a()), (seconds.b(), other.b()), (seconds.c(), other.c())] {
                let difference = largest_difference(x, y);
                assert!(difference < 1e-12, "{filter:?} x {factor:e}: {difference:e}");
            }
            for w in [0.0, 0.3, 2.0] {
                let (one, two) = (seconds.response(w), other.response(w));
                assert!((one - two).norm() < 1e-13 * one.norm(), "{filter:?} x {factor:e} at {w}");
            }
        }
    }
}

#[test]
fn equal_filters_are_equal_however_they_are_spelled() {
    let new = |filter: FilterSpec| StrictlyProper::new(&filter, 0.5).unwrap();
    let thesis = new(tf(&[0.25], &[1.0, 1.0, 0.25]));
    assert_eq!(thesis, new(zpk(&[], &[[-0.5, 0.0], [-0.5, 0.0]], 0.25)));
    assert_eq!(thesis, new(tf(&[0.5], &[2.0, 2.0, 0.5])));
    assert_ne!(thesis, new(tf(&[0.26], &[1.0, 1.0, 0.25])));
    let poles = [[-1.0, 2.0], [-3.0, 0.0], [-0.5, 0.25], [-1.0, -2.0], [-0.5, -0.25]];
    let mut turned = poles;
    turned.reverse();
    assert_eq!(new(zpk(&[], &poles, 1.0)), new(zpk(&[], &turned, 1.0)));
    let rc = new(family(Family::Rc, 1, 3.0));
    assert_eq!(rc, new(family(Family::Butterworth, 1, 3.0)));
}

#[test]
fn poles_come_back_in_rad_per_fast_period() {
    let phi = StrictlyProper::new(&zpk(&[], &[[-1e6, 2e6], [-1e6, -2e6], [-5e5, 0.0]], 1.0), 1e-6).unwrap();
    let mut poles = phi.poles().to_vec();
    poles.sort_by(|x, y| x.im.total_cmp(&y.im));
    for (found, expected) in poles.iter().zip([(-1.0, -2.0), (-0.5, 0.0), (-1.0, 2.0)]) {
        assert!((found - Complex::new(expected.0, expected.1)).norm() < 1e-14);
    }
}

fn refused(filter: &FilterSpec, h: f64) -> AnalogError {
    StrictlyProper::new(filter, h).unwrap_err()
}

#[test]
fn what_cannot_be_sampled_is_refused_with_reason_and_remedy() {
    assert_eq!(refused(&tf(&[1.0], &[1.0, 1.0]), 0.0), AnalogError::TimeUnit { value: 0.0 });
    assert!(matches!(refused(&tf(&[1.0], &[1.0, 1.0]), f64::NAN), AnalogError::TimeUnit { .. }));

    let unstable = refused(&zpk(&[], &[[1e3, 0.0]], 1.0), 1e-3);
    assert_eq!(unstable, AnalogError::Unstable { re: 1e3, im: 0.0 });
    assert!(unstable.to_string().contains("left half plane"), "{unstable}");
    // An integrator, an undamped resonator, one as good as undamped, and a negative coefficient.
    for filter in [
        tf(&[1.0], &[1.0, 0.0]),
        tf(&[1.0], &[1.0, 0.0, 1.0]),
        zpk(&[], &[[-1e-10, 1.0], [-1e-10, -1.0]], 1.0),
        tf(&[1.0], &[1.0, 2.0, -3.0, 1.0]),
    ] {
        assert!(matches!(refused(&filter, 1.0), AnalogError::Unstable { .. }), "{filter:?}");
    }
    let growing = FilterSpec::StateSpace {
        a: vec![vec![0.1, 1.0], vec![-1.0, 0.1]],
        b: vec![vec![1.0], vec![0.0]],
        c: vec![vec![1.0, 0.0]],
    };
    assert!(matches!(refused(&growing, 1.0), AnalogError::Unstable { .. }));

    let alone = refused(&zpk(&[], &[[-1.0, 2.0], [-1.0, -2.1]], 1.0), 1.0);
    assert_eq!(alone, AnalogError::NotConjugate { what: "pole", re: -1.0, im: 2.0 });
    assert!(matches!(
        refused(&zpk(&[[0.0, 1.0]], &[[-1.0, 0.0]; 3], 1.0), 1.0),
        AnalogError::NotConjugate { what: "zero", .. }
    ));

    // Hertz taken for a period: the pole is 1e12 rad a "period".
    assert!(matches!(refused(&family(Family::Rc, 1, 2e4), 96e3 * 1e3), AnalogError::PoleOutOfRange { .. }));
    assert!(matches!(refused(&tf(&[1e-12], &[1.0, 1e-12]), 1.0), AnalogError::PoleOutOfRange { .. }));

    let unread = FilterSpec::StateSpace {
        a: vec![vec![-1.0, 0.0], vec![0.0, -2.0]],
        b: vec![vec![1.0], vec![0.0]],
        c: vec![vec![0.0, 1.0]],
    };
    assert_eq!(refused(&unread, 1.0), AnalogError::NoTransmission);
    assert!(matches!(
        refused(&zpk(&[], &[[-1.0, 0.0]], 1e308), 1e300),
        AnalogError::GainOutOfRange { .. } | AnalogError::PoleOutOfRange { .. }
    ));
}

#[test]
fn an_edge_sharper_than_a_double_is_refused_by_its_order() {
    let filter = FilterSpec::Family {
        family: Family::Elliptic,
        order: Some(17),
        cutoff: 1.0,
        ripple_db: Some(11.0),
        attenuation_db: Some(11.05),
    };
    let text = refused(&filter, 1.0).to_string();
    assert!(text.contains("order = 17") && text.contains("lower the order"), "{text}");
}

#[test]
fn direct_terms_are_refused_with_the_way_out() {
    for (kind, order) in [(Family::Chebyshev2, 4), (Family::Elliptic, 6)] {
        let error = refused(&family(kind, order, 1.0), 1e-3);
        assert!(matches!(error, AnalogError::Spec(FilterProblem::NotStrictlyProper { .. })));
        let text = error.to_string();
        for part in ["even-order", "direct term", "add the pole of the sampling switch", "cascade"] {
            assert!(text.contains(part), "{text}");
        }
        let with_switch =
            FilterSpec::Cascade { cascade: vec![family(kind, order, 1.0), family(Family::Rc, 1, 50.0)] };
        assert_eq!(StrictlyProper::new(&with_switch, 1e-1).unwrap().order(), order + 1);
    }
    assert!(matches!(refused(&tf(&[1.0, 2.0], &[1.0, 3.0]), 1.0), AnalogError::Spec(_)));
}

/// A stable real root list: `pairs` conjugate pairs and `singles` real ones, spread over two decades. (Zeros
/// forced far below their poles make direct terms cancel: an error of rounding times the ratio squared.)
fn roots(pairs: usize, singles: usize) -> impl Strategy<Value = Vec<[f64; 2]>> {
    let pair = (-1.0..1.0f64, 0.01..1.5f64).prop_map(|(decade, angle)| {
        let r = 10f64.powf(decade);
        let (re, im) = (-r * angle.cos(), r * angle.sin());
        vec![[re, im], [re, -im]]
    });
    let single = (-1.0..1.0f64).prop_map(|decade| vec![[-10f64.powf(decade), 0.0]]);
    (prop::collection::vec(pair, 0..=pairs), prop::collection::vec(single, 1..=singles))
        .prop_map(|(pairs, singles)| pairs.into_iter().chain(singles).flatten().collect())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_zeros_and_poles_realise(poles in roots(4, 3), zeros in roots(3, 2), mirrored in any::<bool>()) {
        // Zeros in either half plane; the gain makes the response one at low frequencies.
        let mut zeros: Vec<[f64; 2]> = zeros.iter().map(|z| if mirrored { [-z[0], z[1]] } else { *z }).collect();
        // Real zeros come last, and their partners before them.
        while zeros.len() >= poles.len() {
            zeros.pop();
            if zeros.last().is_some_and(|z| z[1] > 0.0) {
                zeros.pop();
            }
        }
        let modulus = |list: &[[f64; 2]]| list.iter().map(|r| r[0].hypot(r[1])).product::<f64>();
        let phi = StrictlyProper::new(&zpk(&zeros, &poles, modulus(&poles) / modulus(&zeros)), 1.0).unwrap();
        prop_assert_eq!(phi.order(), poles.len());
        prop_assert!(realisation_error(&phi) < 1e-11, "{:e}", realisation_error(&phi));
    }

    #[test]
    fn any_coefficients_make_a_filter_or_a_message(
        num in prop::collection::vec(-1e3..1e3f64, 1..4),
        den in prop::collection::vec(prop_oneof![Just(0.0), -1e-9..1e9f64, 0.0..10.0f64], 1..9),
        h in prop_oneof![Just(1.0), 1e-12..1e3f64],
    ) {
        match StrictlyProper::new(&tf(&num, &den), h) {
            Ok(phi) => prop_assert!(phi.response(1.0).norm().is_finite()),
            Err(error) => prop_assert!(!error.to_string().is_empty()),
        }
    }
}
