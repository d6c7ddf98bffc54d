//! The identities of block diagrams, on systems with structure: delay lines, Jordan blocks, entries from
//! 1e-9 to 1e9.

use super::*;
use crate::lti::FirMatrix;
use hybank_linalg::{CMat, Complex};
use nalgebra::DVector;

/// Points on the unit circle and off it.
fn points() -> impl Iterator<Item = Complex<f64>> {
    [(1.0, 0.0), (1.0, 0.7), (1.0, 2.1), (1.0, std::f64::consts::PI), (1.3, 1.1)]
        .into_iter()
        .map(|(r, w)| Complex::from_polar(r, w))
}

/// The response is `want` to rounding: relative to the size of what it is made of, `scale`.
fn check(system: &StateSpace, want: impl Fn(Complex<f64>) -> CMat, scale: f64) {
    for z in points() {
        let (got, want) = (system.response_at(z), want(z));
        assert_eq!(got.shape(), want.shape());
        assert!((&got - &want).norm() <= 1e-12 * scale.max(want.norm()), "at {z}: {got} {want}");
    }
}

fn with_inputs_and_outputs(a: Mat, m: usize, p: usize) -> StateSpace {
    let n = a.nrows();
    let b = Mat::from_fn(n, m, |i, j| (1.0 + (i + 3 * j) as f64).sin());
    let c = Mat::from_fn(p, n, |i, j| (2.0 + (5 * i + j) as f64).cos());
    StateSpace::new(a, b, c, Mat::from_fn(p, m, |i, j| 0.5 + (i as f64) - (j as f64)))
}

/// Systems of p outputs and m inputs: none, a delay line, a Jordan block, states in units from 1e-9 to 1e9.
fn systems(m: usize, p: usize) -> Vec<StateSpace> {
    let line = Mat::from_fn(5, 5, |i, j| f64::from(u8::from(i == j + 1)));
    let jordan = Mat::from_fn(4, 4, |i, j| if i == j { 0.6 } else { f64::from(u8::from(j == i + 1)) });
    let unit = |i: usize| 10f64.powi(9 - 9 * i as i32);
    let plain = Mat::from_fn(3, 3, |i, j| 0.3 * (1.0 + (i * 3 + j) as f64).sin());
    let scaled = Mat::from_fn(3, 3, |i, j| plain[(i, j)] * unit(i) / unit(j));
    let units = with_inputs_and_outputs(scaled, m, p);
    let units = StateSpace::new(
        units.a().clone(),
        Mat::from_fn(3, m, |i, j| units.b()[(i, j)] * unit(i)),
        Mat::from_fn(p, 3, |i, j| units.c()[(i, j)] / unit(j)),
        units.d().clone(),
    );
    let mut all: Vec<StateSpace> =
        [Mat::zeros(0, 0), line, jordan].map(|a| with_inputs_and_outputs(a, m, p)).into();
    all.push(units);
    all
}

fn pairs((m1, p1): (usize, usize), (m2, p2): (usize, usize)) -> Vec<(StateSpace, StateSpace)> {
    let second = systems(m2, p2);
    systems(m1, p1).into_iter().flat_map(|g| second.iter().map(move |h| (g.clone(), h.clone()))).collect()
}

#[test]
fn series_is_the_product() {
    for (g, h) in pairs((2, 3), (3, 1)) {
        let want = |z| h.response_at(z) * g.response_at(z);
        let scale = points().map(|z| h.response_at(z).norm() * g.response_at(z).norm()).fold(0.0, f64::max);
        check(&g.series(&h), want, scale);
    }
}

#[test]
fn a_cascade_keeps_the_outputs_that_drive_it() {
    for (g, h) in pairs((2, 4), (2, 3)) {
        let made = g.cascade(1..3, &h);
        assert_eq!(made.order(), g.order() + h.order());
        let scale = points().map(|z| h.response_at(z).norm() * g.response_at(z).norm()).fold(0.0, f64::max);
        check(&made.select_outputs(0..4), |z| g.response_at(z), scale);
        check(&made.select_outputs(4..7), |z| h.response_at(z) * g.response_at(z).rows(1, 2), scale);
    }
}

#[test]
fn gains_multiply_from_their_side() {
    let t = Mat::from_row_slice(2, 3, &[1.0, -2.0, 0.5, 0.0, 3.0, 1e3]);
    for g in systems(2, 3) {
        let c = |m: &Mat| hybank_linalg::to_complex(m);
        check(&g.map_outputs(&t), |z| c(&t) * g.response_at(z), 1e4);
        check(&g.map_inputs(&t), |z| g.response_at(z) * c(&t), 1e4);
        assert_eq!(g.map_outputs(&t), g.series(&StateSpace::gain(t.clone())));
        let diagonal = Mat::from_diagonal(&DVector::from_vec(vec![2.0, -4.0]));
        assert_eq!(g.scale_inputs(&[2.0, -4.0]), g.map_inputs(&diagonal));
        let diagonal = Mat::from_diagonal(&DVector::from_vec(vec![2.0, -4.0, 0.0]));
        assert_eq!(g.scale_outputs(&[2.0, -4.0, 0.0]), g.map_outputs(&diagonal));
    }
}

#[test]
fn selecting_twice_is_selecting_once() {
    for g in systems(3, 4) {
        let (once, twice) = (g.select_outputs([3, 1]), g.select_outputs([3, 0, 1]).select_outputs([0, 2]));
        assert_eq!(once, twice);
        let shuffled = g.select_states((0..g.order()).rev());
        check(&shuffled, |z| g.response_at(z), 1.0);
        assert_eq!(shuffled.select_states((0..g.order()).rev()), g);
    }
}

#[test]
fn delays_are_powers_of_z() {
    for steps in [vec![], vec![0], vec![3], vec![0, 2, 0, 7, 1], vec![4, 4]] {
        let made = StateSpace::delays(&steps);
        assert_eq!(made.order(), steps.iter().sum::<usize>());
        let n = steps.len();
        let power = |z: Complex<f64>, i: usize| z.powi(-(steps[i] as i32));
        let want = |z| CMat::from_fn(n, n, |i, j| if i == j { power(z, i) } else { Complex::ZERO });
        check(&made, want, 1.0);
    }
}

#[test]
fn a_delay_line_shows_all_of_its_past() {
    for (width, steps) in [(1, 0), (1, 5), (3, 0), (3, 1), (2, 4), (0, 2)] {
        let made = StateSpace::delay_line(width, steps);
        let entry = |z: Complex<f64>, i: usize, j: usize| {
            if i % width == j { z.powi(-((steps - i / width) as i32)) } else { Complex::ZERO }
        };
        check(&made, |z| CMat::from_fn(width * (steps + 1), width, |i, j| entry(z, i, j)), 1.0);
    }
}

#[test]
fn fir_filters_are_their_polynomial() {
    for (p, m, lags) in [(2, 3, 1), (2, 3, 5), (1, 1, 2), (4, 1, 3), (1, 4, 3)] {
        let tap = |j: usize| Mat::from_fn(p, m, |r, c| ((r + 3 * c + 7 * j) as f64).sin());
        let taps: Vec<Mat> = (0..lags).map(tap).collect();
        let made = FirMatrix::new(taps.clone()).state_space();
        assert_eq!(made.order(), m * (lags - 1));
        let term = |z: Complex<f64>, j: usize| hybank_linalg::to_complex(&taps[j]) * z.powi(-(j as i32));
        check(&made, |z| (0..lags).map(|j| term(z, j)).sum(), 1.0);
        // A delay line that all taps read is the same.
        let mut newest_last: Vec<&Mat> = taps.iter().collect();
        newest_last.reverse();
        let line = StateSpace::delay_line(m, lags - 1);
        let line = line.map_outputs(&hybank_linalg::hstack(&newest_last));
        check(&line, |z| made.response_at(z), 1.0);
    }
}
