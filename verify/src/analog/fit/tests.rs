//! Models of responses that are known in closed form, and texts as instruments write them.

use super::*;
use crate::analog::StrictlyProper;
use hybank_core::spec::{Family, FilterSpec, Passband};
use hybank_core::units::{Hertz, RadiansPerFastPeriod, Seconds};
use std::f64::consts::TAU;
use std::fmt::Write;

const CUTOFF: f64 = 80e6;
const PERIOD: Seconds = Seconds(1e-9);

fn family(family: Family, order: usize) -> FilterSpec {
    let ripple_db = family.has_ripple().then_some(0.5);
    let attenuation_db = family.has_attenuation().then_some(50.0);
    let passband = Passband::LowPass { cutoff: Hertz(CUTOFF) };
    FilterSpec::Family { family, order: Some(order), passband, ripple_db, attenuation_db }
}

fn response(filter: &FilterSpec, f: f64) -> hybank_linalg::Complex<f64> {
    StrictlyProper::new(filter, PERIOD).unwrap().response(RadiansPerFastPeriod(TAU * f * PERIOD.0))
}

/// A Bode table of a filter after a delay, with additive noise of the given size.
fn table(filter: &FilterSpec, points: usize, delay: f64, noise: f64) -> String {
    let mut text = "# swept by hand\nfrequency (MHz), gain (dB), phase (deg)\n".to_owned();
    let mut state = 1_u64;
    let mut dice = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    };
    for k in 1..=points {
        let f = 4.0 * CUTOFF * k as f64 / points as f64;
        let noise = hybank_linalg::Complex::new(dice(), dice()) * noise;
        let value = response(filter, f) * hybank_linalg::Complex::from_polar(1.0, -TAU * f * delay) + noise;
        writeln!(text, "{:e},{:e},{:e}", f / 1e6, 20.0 * value.norm().log10(), value.arg().to_degrees())
            .unwrap();
    }
    text
}

fn fit(text: &str, order: usize) -> Result<FittedModel, FitError> {
    vector_fit(&MeasuredResponse::from_csv(text).unwrap(), order)
}

/// Largest distance of two filters, also where nothing was measured.
fn distance(a: &FilterSpec, b: &FilterSpec) -> f64 {
    (0..900)
        .map(|k| f64::from(k) * 0.5e6)
        .map(|f| (response(a, f) - response(b, f)).norm())
        .fold(0.0, f64::max)
}

#[test]
fn known_filters_are_found() {
    for (name, order) in [
        (Family::Butterworth, 4),
        (Family::Butterworth, 7),
        (Family::Chebyshev1, 5),
        (Family::Chebyshev2, 5),
        (Family::Elliptic, 5),
        (Family::Bessel, 3),
        (Family::Rc, 1),
    ] {
        let filter = if name == Family::Rc {
            FilterSpec::TransferFunction { num: vec![TAU * CUTOFF], den: vec![1.0, TAU * CUTOFF] }
        } else {
            family(name, order)
        };
        let model = fit(&table(&filter, 150, 0.0, 0.0), order).unwrap();
        let apart = distance(&model.filter, &filter);
        assert!(apart < 1e-9 && model.error.0 < 1e-8, "{name:?} {order}: {apart:e}, {:?}", model.error);
    }
}

/// 2n numbers are estimated from twice as many as there are points.
#[test]
fn noise_is_averaged() {
    let (filter, noise, points) = (family(Family::Chebyshev1, 5), 1e-3, 400);
    let model = fit(&table(&filter, points, 0.0, noise), 5).unwrap();
    // Uniform noise of this size in both parts is at most sqrt 2 as large.
    assert!((noise..1.6 * noise).contains(&(10f64.powf(model.error.0 / 20.0) - 1.0)), "{:?}", model.error);
    let apart = distance(&model.filter, &filter);
    assert!(apart < noise, "{apart:e}");
}

#[test]
fn a_delay_is_named_and_can_be_taken_out() {
    let (filter, delay) = (family(Family::Butterworth, 4), 31e-9);
    let text = table(&filter, 200, delay, 0.0);
    let Err(FitError::Poor { delay: Some((found, left)), .. }) = fit(&text, 4) else { panic!("a model") };
    assert!((found.0 / delay - 1.0).abs() < 1e-3 && left.0 < 0.01, "{found:?} {left:?}");
    let turned = MeasuredResponse::from_csv(&text).unwrap().without_delay(Seconds(delay));
    assert!(distance(&vector_fit(&turned, 4).unwrap().filter, &filter) < 1e-9);
}

#[test]
fn what_cannot_be_modelled_is_refused() {
    let filter = family(Family::Butterworth, 8);
    assert!(matches!(
        fit(&table(&filter, 100, 0.0, 0.0), 2),
        Err(FitError::Poor { delay: None, .. }) | Err(FitError::Poor { .. })
    ));
    assert_eq!(fit(&table(&filter, 7, 0.0, 0.0), 4), Err(FitError::TooFew { points: 7, order: 4 }));
    assert!(matches!(fit(&table(&filter, 7, 0.0, 0.0), 33), Err(FitError::Order { order: 33, .. })));
    assert!(matches!(fit(&table(&filter, 7, 0.0, 0.0), 0), Err(FitError::Order { order: 0, .. })));
}

#[test]
fn touchstone_files_are_read_in_all_their_forms() {
    let value = |a: f64, b: f64| hybank_linalg::Complex::new(a, b);
    for (text, first) in [
        (
            "! by hand\n# MHz S RI R 50\n1 9 9 0.5 -0.5 9 9 9 9 ! end\n2 9 9 0.25 0 9 9 9 9\n",
            value(0.5, -0.5),
        ),
        ("# khz s ma r 75\n1e3 9 9 2 90 9 9 9 9\n2e3 9 9 0.25 0 9 9 9 9\n", value(0.0, 2.0)),
        ("# Hz S DB\n1e6 9 9 20 180 9 9 9 9\n2e6 9 9 -12.041199826559248 0 9 9 9 9\n", value(-10.0, 0.0)),
        ("0.001 9 9 1 0 9 9 9 9\n0.002 9 9 0.25 0 9 9 9 9\n", value(1.0, 0.0)),
    ] {
        let read = MeasuredResponse::from_touchstone(text, 2, None).unwrap();
        let [(f, one), (g, two)] = read.points() else { panic!("{text}") };
        assert!(
            (f.0 - 1e6).abs() < 1e-6 && (g.0 - 2e6).abs() < 1e-6 && (one - first).norm() < 1e-12,
            "{text}"
        );
        assert!((two - value(0.25, 0.0)).norm() < 1e-12, "{text}");
    }
    // The fourth pair is S22; noise parameters follow.
    let text = "# GHz S RI\n1 1 0 2 0 3 0 4 0\n2 1 0 2 0 3 0 5 0\n0.5 1 2 3 4\n";
    let s22 = MeasuredResponse::from_touchstone(text, 2, Some("s22")).unwrap();
    assert_eq!(s22.points().iter().map(|(_, v)| v.re).collect::<Vec<_>>(), [4.0, 5.0]);
    let one = MeasuredResponse::from_touchstone("# MHz S RI\n0 1 0\n1 0.5 0.5\n", 1, None).unwrap();
    assert_eq!(one.points(), [(Hertz(0.0), value(1.0, 0.0)), (Hertz(1e6), value(0.5, 0.5))]);
}

#[test]
fn damaged_measurements_are_refused_with_their_line() {
    let touchstone = |text: &str| MeasuredResponse::from_touchstone(text, 1, None).unwrap_err().to_string();
    for (text, part) in [
        ("", "no frequencies"),
        ("# MHz S RI\n1 1 x\n", "line 2: a frequency and 2 numbers"),
        ("# MHz S RI\n1 1 0\n1 1 0\n", "line 3: the frequency 1 MHz"),
        ("# MHz Z RI\n", "Z parameters"),
        ("# MHz S XY\n", "\"XY\""),
        ("[Version] 2.0\n", "version 2"),
        ("# MHz S RI\n-1 1 0\n", "line 2"),
        ("# MHz S RI\n1 inf 0\n", "line 2"),
    ] {
        let message = touchstone(text);
        assert!(message.contains(part), "{text:?}: {message}");
    }
    let parameter = MeasuredResponse::from_touchstone("1 1 1", 1, Some("S21")).unwrap_err().to_string();
    assert!(parameter.contains("\"S21\"") && parameter.contains("S11"), "{parameter}");
    let csv = |text: &str| MeasuredResponse::from_csv(text).unwrap_err().to_string();
    for (text, part) in [
        ("", "no frequencies"),
        ("1,2,3\n", "first line must name"),
        ("frequency,gain (dB),phase (deg)\n1,2,3\n", "first line must name"),
        ("f (Hz),dB\n", "first line must name"),
        ("f (Hz),dB,deg\n1,2\n", "line 2"),
        ("f (Hz);dB;degrees\n1;2;3\n0.5;2;3\n", "line 3"),
    ] {
        let message = csv(text);
        assert!(message.contains(part), "{text:?}: {message}");
    }
}
