//! How long does a FIR design's inner problem take, along a ladder of sizes?
//!
//! Run with `cargo bench --bench inner_problem_time`. Data: sampled hybrid filter banks, the same on every
//! run.

use hybank::lmi::FINEST_GAP;
use hybank::lmi::sampled::{self, Point, Problem};

mod stopwatch;
#[path = "../tests/support/testbank.rs"]
mod testbank;

use testbank::TestBank;

fn problem(bank: &TestBank, taps: usize, points: usize) -> Problem {
    let samples = bank.samples(&testbank::grid(points));
    let points = samples.into_iter().map(|(omega, w, h)| Point { omega, w, h }).collect();
    Problem::new(points, bank.lags(taps))
}

fn main() {
    // `cargo test --benches` runs this too; it wants no figures.
    if std::env::args().any(|arg| arg == "--bench") {
        sampled_worst_case();
        mean_square_under_cap();
    }
}

/// Time to a proven gap of 1e-9.
fn sampled_worst_case() {
    let four = {
        let (a, b, c) = testbank::low_pass(&testbank::butterworth(4, 1.2));
        TestBank { a, b, c, delays: vec![0.0, 1.3, 2.1, 2.95], ratio: 4, latency: 12 }
    };
    for (name, bank, taps, points) in [
        ("N = M = 2, 22 taps, 65 points", testbank::thesis(), 22, 65),
        ("N = M = 2, 22 taps, 129 points", testbank::thesis(), 22, 129),
        ("N = M = 4, 24 taps, 129 points", four, 24, 129),
        ("N = M = 8, 32 taps, 129 points", testbank::eight_channels(12), 32, 129),
        ("N = M = 8, 128 taps, 257 points", testbank::eight_channels(40), 128, 257),
        ("N = M = 8, 128 taps, 513 points", testbank::eight_channels(40), 128, 513),
    ] {
        let problem = problem(&bank, taps, points);
        stopwatch::time(&format!("sampled worst case, {name}"), || {
            sampled::minimise(&problem, FINEST_GAP, &|| false)
        });
    }
}

/// Time for the least mean square under a cap of 1.001 gamma, after the worst case is known.
fn mean_square_under_cap() {
    for (name, bank, taps, points) in [
        ("N = M = 2, 10 taps, 129 points", testbank::thesis(), 10, 129),
        ("N = M = 8, 32 taps, 129 points", testbank::eight_channels(12), 32, 129),
    ] {
        let problem = problem(&bank, taps, points);
        let best = sampled::minimise(&problem, FINEST_GAP, &|| false).expect("the data are finite");
        let square = sampled::MeanSquareObjective::noiseless(vec![1.0; points], problem.channels());
        stopwatch::time(&format!("mean square under cap, {name}"), || {
            sampled::mean_square_under_cap(
                &problem,
                &square,
                1.001 * best.gamma,
                &best.taps,
                FINEST_GAP,
                &|| false,
            )
        });
    }
}
