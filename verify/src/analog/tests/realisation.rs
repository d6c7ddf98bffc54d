//! Realisations against the formula, over families, orders and spreads of poles.

use proptest::prelude::*;

use super::*;
use hybank_linalg::{Mat, solve};

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
                let phi = realise(&sampled_family(kind, order, cutoff), 1.0).unwrap();
                let error = realisation_error(&phi);
                assert!(error < 1e-12, "{kind:?} {order} at {cutoff}: {error:e}");
            }
        }
    }
}

#[test]
fn band_passes_realise_narrow_and_wide() {
    for kind in Family::ALL {
        for order in 1..=(if kind == Family::Rc { 1 } else { 8 }) {
            for band in [[0.2, 0.25], [0.2, 0.202], [20.0, 20.2], [1e-3, 10.0], [0.775, 0.975]] {
                let phi = realise(&band_pass(kind, order, band), 1.0).unwrap();
                let error = realisation_error(&phi);
                // The pencil j w - a is as nearly singular as the poles are near to the axis.
                let damping = phi.poles().iter().map(|p| -p.re / p.norm()).fold(1.0, f64::min);
                let rounding = 1e-15 * phi.order() as f64;
                assert!(error < (rounding / damping).max(1e-11), "{kind:?} {order} at {band:?}: {error:e}");
            }
        }
    }
}

#[test]
fn a_band_too_narrow_for_double_precision_is_refused_by_its_width() {
    let refused =
        realise(&band_pass(Family::Butterworth, 4, [1.0, 1.0 + 1e-9]), 1.0).unwrap_err().to_string();
    assert!(refused.contains("Hz wide: a band this narrow"), "{refused}");
}

#[test]
fn high_orders_realise() {
    for (kind, order) in
        [(Family::Butterworth, 32), (Family::Bessel, 32), (Family::Chebyshev1, 21), (Family::Elliptic, 15)]
    {
        let phi = realise(&family(kind, order, 0.3), 1.0).unwrap();
        let error = realisation_error(&phi);
        assert!(error < 1e-11, "{kind:?} {order}: {error:e}");
    }
}

#[test]
fn stop_bands_keep_their_relative_digits() {
    // A sum of partial fractions would be rounding noise at -300 dB; a cascade is a product.
    let phi = realise(&family(Family::Butterworth, 6, 0.1), 1.0).unwrap();
    for w in [30.0, 300.0, 3e3] {
        let (found, expected) = (realised_response(&phi, w), response(&phi, w));
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
        let phi = realise(filter, 1.0).unwrap();
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
        let phi = realise(&zpk(&[], &[[-damping, 1.0], [-damping, -1.0]], 1.0), 1.0).unwrap();
        let exact = 1.0 / (Complex::new(damping, 0.0) * Complex::new(damping, 2.0));
        assert!((response(&phi, 1.0) - exact).norm() < 1e-14 * exact.norm());
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
        let phi = realise(&tf(&[0.5f64.powi(n as i32)], &binomial_power(0.5, n)), 1.0).unwrap();
        assert_eq!(phi.order(), n);
        for w in [0.0, 0.01, 0.3, 0.5, 1.0, 4.0, 50.0] {
            let exact = (Complex::new(0.5, 0.0) / Complex::new(0.5, w)).powu(n as u32);
            let (formula, realised) =
                ((response(&phi, w) - exact).norm(), (realised_response(&phi, w) - exact).norm());
            assert!(formula < 1e-12, "n = {n}, w = {w}: formula off by {formula:e}");
            assert!(realised < 1e-12, "n = {n}, w = {w}: realisation off by {realised:e}");
        }
    }
}

#[test]
fn stiff_polynomials_keep_the_response() {
    // Poles -1e-3, -1, -1e3, -1e6 and a zero at -10, multiplied out.
    let den = [1.0, 1001001.001, 1001002001.001, 1001001001.0, 1e6];
    let phi = realise(&tf(&[1e5, 1e6], &den), 1.0).unwrap();
    for w in [0.0, 1e-3, 0.1, 1.0, 30.0, 1e3, 1e5, 1e7] {
        let s = Complex::new(0.0, w);
        let exact = (s * 1e5 + 1e6) / ((s + 1e-3) * (s + 1.0) * (s + 1e3) * (s + 1e6));
        assert!((response(&phi, w) - exact).norm() < 1e-12 * exact.norm(), "w = {w}");
        assert!((realised_response(&phi, w) - exact).norm() < 1e-12, "w = {w}");
    }
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
        let phi = realise(&zpk(&zeros, &poles, modulus(&poles) / modulus(&zeros)), 1.0).unwrap();
        prop_assert_eq!(phi.order(), poles.len());
        prop_assert!(realisation_error(&phi) < 1e-11, "{:e}", realisation_error(&phi));
    }
}
