use super::*;
use crate::linalg::{CMat, Complex};
use crate::lmi::Stop;
use crate::lmi::testbank::{self, TestBank};

fn bank_problem(bank: &TestBank, omegas: &[f64], taps: usize) -> Problem {
    let points = bank.samples(omegas).into_iter().map(|(omega, w, h)| Point { omega, w, h }).collect();
    Problem::new(points, bank.lags(taps)).unwrap()
}

fn report(name: &str, problem: &Problem, s: &Solution, seconds: f64) {
    println!(
        "{name}: {:?} gamma {:.10} lower {:.10} gap {:.1e} steps {} residual {:.1e} {} unknowns {} points {:.3} s",
        s.stop,
        s.gamma,
        s.lower.value,
        s.relative_gap(),
        s.steps.len(),
        s.lower.residual,
        problem.lags().iter().sum::<usize>() * problem.channels(),
        problem.points().len(),
        seconds
    );
}

fn solve(name: &str, problem: &Problem) -> Solution {
    let start = std::time::Instant::now();
    let s = minimise(problem, &Settings::default()).unwrap();
    report(name, problem, &s, start.elapsed().as_secs_f64());
    for (i, step) in s.steps.iter().enumerate() {
        println!("   {i:3} {step:?}");
    }
    s
}

#[test]
fn thesis_bank() {
    let problem = bank_problem(&testbank::thesis(), &testbank::grid(96), 22);
    let s = solve("thesis 22", &problem);
    assert!((s.gamma - 0.03993204).abs() < 1e-8);
    let problem = bank_problem(&testbank::thesis(), &testbank::grid(96), 10);
    let s = solve("thesis 10", &problem);
    assert!((s.gamma - 0.0934525).abs() < 1e-6);
}

#[test]
fn eight_channel_bank() {
    let problem = bank_problem(&testbank::eight_channels(12), &testbank::grid(65), 32);
    let s = solve("eight 32", &problem);
    assert!((s.gamma - 0.0900756).abs() < 2e-7);
    let weights = vec![1.0; 65];
    let start = std::time::Instant::now();
    let ms =
        mean_square_under_cap(&problem, &weights, s.gamma * 1.001, &s.taps, &Settings::default()).unwrap();
    println!(
        "{:?} ms {} lower {} gamma {} of {} start {} {:?}",
        ms.stop,
        ms.mean_square,
        ms.lower,
        ms.gamma,
        s.gamma * 1.001,
        problem.mean_square(&s.taps, &weights),
        start.elapsed()
    );
    for (i, step) in ms.steps.iter().enumerate() {
        println!("   {i:3} {step:?}");
    }
}

#[test]
fn eight_channel_bank_with_128_taps() {
    let problem = bank_problem(&testbank::eight_channels(40), &testbank::grid(257), 128);
    let s = solve("eight 128", &problem);
    assert!((s.gamma - 0.0900756).abs() < 2e-7);
}
