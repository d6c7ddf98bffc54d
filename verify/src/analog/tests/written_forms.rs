//! The same filter in different forms, spellings and units of time.

use super::*;
use hybank_linalg::Mat;

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
            let phi = realise(form, h).unwrap();
            for w in [0.0, 0.1, 0.7, 2.0, 9.0] {
                let s = Complex::new(0.0, w / h);
                let exact = (s + 3.0) * 2.0 / ((s + 1.0) * (s * s + s * 2.0 + 5.0));
                assert!((response(&phi, w) - exact).norm() < 1e-13, "{form:?} at {w}");
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
        FilterSpec::Family { family, order, passband, ripple_db, attenuation_db } => {
            FilterSpec::Family { family, order, passband: passband.scaled(factor), ripple_db, attenuation_db }
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
        band_pass(Family::Bessel, 4, [0.1, 0.103]),
    ];
    for filter in &filters {
        let seconds = realise(filter, 1.0).unwrap();
        for factor in [1e-6, 1e3, 1e9, 1e12] {
            let other = realise(&faster(filter, factor), 1.0 / factor).unwrap();
            for (x, y) in [(seconds.a(), other.a()), (seconds.b(), other.b()), (seconds.c(), other.c())] {
                let difference = largest_difference(x, y);
                assert!(difference < 1e-12, "{filter:?} x {factor:e}: {difference:e}");
            }
            for w in [0.0, 0.3, 2.0] {
                let (one, two) = (response(&seconds, w), response(&other, w));
                assert!((one - two).norm() <= 1e-13 * one.norm(), "{filter:?} x {factor:e} at {w}");
            }
        }
    }
}

#[test]
fn equal_filters_are_equal_however_they_are_spelled() {
    let new = |filter: FilterSpec| realise(&filter, 0.5).unwrap();
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
    let phi = realise(&zpk(&[], &[[-1e6, 2e6], [-1e6, -2e6], [-5e5, 0.0]], 1.0), 1e-6).unwrap();
    let mut poles = phi.poles().to_vec();
    poles.sort_by(|x, y| x.im.total_cmp(&y.im));
    for (found, expected) in poles.iter().zip([(-1.0, -2.0), (-0.5, 0.0), (-1.0, 2.0)]) {
        assert!((found - Complex::new(expected.0, expected.1)).norm() < 1e-14);
    }
}

#[test]
fn a_scaled_cutoff_is_the_same_in_every_form() {
    let forms = [
        tf(&[0.25], &[1.0, 1.0, 0.25]),
        zpk(&[[0.0, 3.0], [0.0, -3.0]], &[[-0.5, 0.0], [-0.5, 1.0], [-0.5, -1.0]], 0.25),
        FilterSpec::StateSpace {
            a: vec![vec![-1.0, 0.5], vec![0.0, -2.0]],
            b: vec![vec![1.0], vec![1.0]],
            c: vec![vec![1.0, 1.0]],
        },
        family(Family::Elliptic, 3, 0.1),
        band_pass(Family::Elliptic, 3, [0.1, 0.11]),
        FilterSpec::Cascade { cascade: vec![family(Family::Rc, 1, 0.2), tf(&[1.0, 2.0], &[1.0, 1.0])] },
    ];
    for form in &forms {
        let (filter, faster) =
            (realise(form, 1.0).unwrap(), realise(&form.with_cutoff_scaled(1.3), 1.0).unwrap());
        for w in [0.0, 0.3, 1.7] {
            let (scaled, same) = (response(&faster, 1.3 * w), response(&filter, w));
            assert!((scaled - same).norm() <= 1e-12 * same.norm(), "{form:?}: {scaled} {same}");
        }
    }
}
