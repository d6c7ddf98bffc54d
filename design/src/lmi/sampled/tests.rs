//! Problems that the tests share.

mod edges;
mod invariance;
mod known_optima;
mod mean_square;

use super::*;
use crate::lmi::FINEST_GAP;
use crate::lmi::testbank::{self, TestBank};
use hybank_linalg::{CMat, Complex};
use trials::random::Random;

fn bank_problem(bank: &TestBank, omegas: &[f64], taps: usize) -> SampledProblem {
    let points =
        bank.samples(omegas).into_iter().map(|(omega, w, h)| FrequencyPoint { omega, w, h }).collect();
    SampledProblem::new(points, bank.lags(taps))
}

/// `(gamma - lower) / gamma`, 0 when gamma is 0.
fn relative_gap(s: &Solution) -> f64 {
    if s.gamma > 0.0 { (s.gamma - s.lower).max(0.0) / s.gamma } else { 0.0 }
}

/// What every result promises, whatever the problem.
fn check(problem: &SampledProblem, s: &Solution) {
    assert_eq!(problem.worst(&s.taps).unwrap(), s.gamma);
    assert!(s.lower <= s.gamma);
}

fn report(name: &str, problem: &SampledProblem, s: &Solution, seconds: f64) {
    println!(
        "{name}: solved {} gamma {:.10} lower {:.10} gap {:.1e} steps {} {} unknowns {} points {:.3} s",
        s.is_solved,
        s.gamma,
        s.lower,
        relative_gap(s),
        s.iterations,
        problem.lags().iter().sum::<usize>() * problem.channels(),
        problem.points().len(),
        seconds
    );
}

fn solve(name: &str, problem: &SampledProblem) -> Solution {
    let start = std::time::Instant::now();
    let s = minimise(problem, FINEST_GAP, &|| false).unwrap();
    report(name, problem, &s, start.elapsed().as_secs_f64());
    check(problem, &s);
    s
}

/// Entries by formula, the same in Rust and in Python.
fn wavy(rows: usize, cols: usize, seed: f64) -> CMat {
    CMat::from_fn(rows, cols, |i, j| {
        let t = seed + 1.7 * i as f64 + 0.9 * j as f64;
        Complex::new(t.sin(), (1.3 * t).cos())
    })
}

fn wavy_problem((m, n, q): (usize, usize, usize), omegas: &[f64], lags: &[usize]) -> SampledProblem {
    let point = |(l, omega): (usize, &f64)| {
        let l = l as f64;
        FrequencyPoint { omega: *omega, w: wavy(m, q, 0.3 + 0.77 * l), h: wavy(n, q, 1.9 + 1.23 * l) }
    };
    SampledProblem::new(omegas.iter().enumerate().map(point).collect(), lags.to_vec())
}

fn random_matrix(random: &mut Random, rows: usize, cols: usize) -> CMat {
    CMat::from_fn(rows, cols, |_, _| Complex::new(random.sample(), random.sample()))
}

fn random_problem(
    seed: u64,
    (m, n, q): (usize, usize, usize),
    points: usize,
    lags: &[usize],
) -> SampledProblem {
    let mut r = Random(seed);
    let mut point = || FrequencyPoint {
        omega: std::f64::consts::FRAC_PI_2 * (1.0 + r.sample()),
        w: random_matrix(&mut r, m, q),
        h: random_matrix(&mut r, n, q),
    };
    SampledProblem::new((0..points).map(|_| point()).collect(), lags.to_vec())
}

fn changed(problem: &SampledProblem, change: impl Fn(usize, &mut FrequencyPoint)) -> SampledProblem {
    let mut points = problem.points().to_vec();
    points.iter_mut().enumerate().for_each(|(l, p)| change(l, p));
    SampledProblem::new(points, problem.lags().to_vec())
}

/// (M, N, q), points, lags.
type Shape = ((usize, usize, usize), usize, &'static [usize]);

const SHAPES: [Shape; 12] = [
    ((1, 1, 1), 1, &[1]),
    ((1, 1, 1), 40, &[3]),
    ((2, 2, 4), 1, &[3, 3]),
    ((2, 2, 4), 30, &[5, 4]),
    ((3, 2, 5), 20, &[4, 4, 3]),
    ((2, 3, 5), 20, &[4, 0]),
    ((2, 3, 2), 20, &[4, 4]),
    ((2, 3, 1), 20, &[4, 2]),
    ((3, 1, 1), 20, &[4, 1, 4]),
    ((3, 3, 6), 3, &[10, 10, 10]),
    ((1, 5, 6), 10, &[3]),
    ((4, 4, 9), 40, &[2, 2, 1, 1]),
];
