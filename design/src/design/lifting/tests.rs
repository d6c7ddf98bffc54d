//! The lifted system against a closed form: white noise through one pole a has the autocorrelation (a/2)
//! e^{-a |t|}, so all covariances of samples are known from their times alone.

use super::*;
use crate::lti::gramian::controllability_root;
use crate::tests::front_ends::bank;
use hybank_core::spec::FilterSpec;

fn one_pole(poles: &[f64], ratio: usize, latency: usize, channels: &[(usize, f64)]) -> Problem {
    let filter = |a: f64| FilterSpec::TransferFunction { num: vec![a], den: vec![1.0, a] };
    let (own, delays): (Vec<FilterSpec>, Vec<f64>) =
        channels.iter().map(|&(front_end, delay)| (filter(poles[front_end]), delay)).unzip();
    Problem::of_bank(&bank(filter(poles[0]), own, &delays, ratio, latency, 1)).unwrap()
}

fn problems() -> Vec<Problem> {
    vec![
        one_pole(&[0.5], 1, 0, &[(0, 0.0)]),
        one_pole(&[0.5], 2, 3, &[(0, 1.2), (0, 0.6)]),
        one_pole(&[0.3, 2.0], 3, 7, &[(1, 0.0), (0, 2.0), (1, 2.999)]),
        // Delayed by whole periods, at the border of a period, and longer than the latency.
        one_pole(&[0.1, 4.0], 2, 0, &[(0, 0.0), (1, 4.0), (0, 7.3)]),
        one_pole(&[0.7], 4, 13, &[(0, 0.25), (0, 0.25), (0, 9.0)]),
        // One rounding apart.
        one_pole(&[1.0], 2, 5, &[(0, 0.1 + 0.2), (0, 0.3)]),
    ]
}

/// (front end, time in fast periods) of the measurements, then the references, of one period.
fn instants(problem: &Problem) -> Vec<(usize, f64)> {
    let measurements =
        problem.channels.iter().map(|channel| (channel.front_end, -channel.delay.in_fast_periods().0));
    let references = (0..problem.ratio).map(|p| (problem.target, p as f64 - problem.latency as f64));
    measurements.chain(references).collect()
}

/// E[(phi_a * f)(0) (phi_b * f)(t)] for phi_a of pole a, phi_b of pole b.
fn covariance(a: f64, b: f64, t: f64) -> f64 {
    a * b / (a + b) * (-(if t >= 0.0 { b } else { a }) * t.abs()).exp()
}

#[test]
fn covariances_of_samples_are_those_of_their_times() {
    for problem in problems() {
        let poles: Vec<f64> = problem.front_ends.iter().map(|filter| -filter.poles()[0].re).collect();
        let system = lift(&problem).system;
        let root = controllability_root(system.a(), system.b()).unwrap();
        let p = &root * root.transpose();
        let (c, d) = (system.c(), system.d());
        let mut lagged = system.a() * &p * c.transpose() + system.b() * d.transpose();
        let now = c * &p * c.transpose() + d * d.transpose();
        let mut at_lag = vec![now];
        for _ in 1..4 {
            at_lag.push(c * &lagged);
            lagged = system.a() * lagged;
        }
        let instants = instants(&problem);
        for (lag, found) in at_lag.iter().enumerate() {
            for (i, &(later, t_i)) in instants.iter().enumerate() {
                for (j, &(earlier, t_j)) in instants.iter().enumerate() {
                    let t = t_i - t_j + (lag * problem.ratio) as f64;
                    let want = covariance(poles[earlier], poles[later], t);
                    let got = found[(i, j)];
                    assert!((got - want).abs() < 1e-12 * (1.0 + want), "lag {lag}, {i}, {j}: {got} {want}");
                }
            }
        }
    }
}

#[test]
fn chains_are_read_at_their_ends() {
    let problem = one_pole(&[0.1, 4.0], 2, 0, &[(0, 0.0), (1, 4.0), (0, 7.3)]);
    let Lifted { system, chains, .. } = lift(&problem);
    let lengths: Vec<usize> = chains.iter().map(ExactSizeIterator::len).collect();
    // The latest sample is the reference at time 1; the channels are 1, 5 and 8.3 fast periods older.
    assert_eq!(lengths, [0, 2, 4]);
    for (channel, chain) in chains.iter().enumerate().filter(|(_, chain)| !chain.is_empty()) {
        let mut last_link = Mat::zeros(1, system.order());
        last_link[chain.end - 1] = 1.0;
        assert_eq!(system.c().rows(channel, 1), last_link);
        assert_eq!(system.d().rows(channel, 1).norm(), 0.0);
    }
}

/// E[(y_1 - y_2)^2] = a (1 - e^{-a t}) for one pole a sampled at two instants so short a time t apart.
#[test]
fn instants_one_rounding_apart_are_two() {
    for (pole, latency, late, near) in [(1.0, 2, 0.1 + 0.2, 0.3), (1e6, 60_001, 60_000.000000005, 60_000.0)] {
        let system = lift(&one_pole(&[pole], 2, latency, &[(0, late), (0, near)])).system;
        let root = controllability_root(system.a(), system.b()).unwrap();
        let state = (system.c().row(0) - system.c().row(1)) * root;
        let input = system.d().row(0) - system.d().row(1);
        let found = state.norm_squared() + input.norm_squared();
        let want = -pole * (-pole * (late - near)).exp_m1();
        assert!((found / want - 1.0).abs() < 1e-9, "{found} {want}");
    }
}
