//! How fast state-space banks run: one core, public `Stream`, beside the f32 multiply-add peak of the same
//! moment.
//!
//! `cargo bench --bench recursive_throughput`. A section is a pair of states. With N inputs and M outputs it
//! takes 4 + 2 N + 2 M multiply-adds, or 4 + 2 + 2 where it has one input and one output of its own; a
//! biquad of the usual kind takes 5. So three rates stand side by side: sections, multiply-adds by five
//! ("biquads"), and the share of the peak.

use hybank::bank::{Bank, StateMatrices, SynthesisFilters};
use hybank::runtime::{Isa, Options, Stream, multiply_add_chains};
use std::hint::black_box;
use std::time::Instant;

const FRAMES: usize = 16_384;
const REPEATS: usize = 60;

/// A bank and what it costs.
struct Case {
    name: String,
    filter: StateMatrices,
    sections: usize,
    /// Multiply-adds per frame that the matrices ask for, zeros and delay lines left out.
    work: usize,
}

fn matrix(rows: usize, cols: usize, entry: impl Fn(usize, usize) -> f64) -> Vec<Vec<f64>> {
    (0..rows).map(|i| (0..cols).map(|j| entry(i, j)).collect()).collect()
}

/// Poles 0.9 e^{+-jw} with w from section to section.
fn rotation(i: usize, j: usize) -> f64 {
    let (s, c) = (0.1 + 0.15 * (i / 2) as f64).sin_cos();
    match () {
        () if i == j => 0.9 * c,
        () if i / 2 == j / 2 => 0.9 * if i < j { s } else { -s },
        () => 0.0,
    }
}

fn entry(i: usize, j: usize) -> f64 {
    0.1 / (1 + i + 2 * j) as f64
}

/// Sections that all inputs feed and all outputs read.
fn parallel(sections: usize, n: usize, m: usize) -> Case {
    let states = 2 * sections;
    let (b, c, d) = (matrix(states, n, entry), matrix(m, states, entry), matrix(m, n, entry));
    Case {
        name: format!("{sections} sections, N = {n}, M = {m}"),
        filter: StateMatrices { a: matrix(states, states, rotation), b, c, d },
        sections,
        work: sections * (4 + 2 * n + 2 * m) + n * m,
    }
}

/// `each` sections for each of `n` channels, and no way from one channel to another.
fn apart(n: usize, each: usize) -> Case {
    let states = 2 * n * each;
    let own = |x: f64, same: bool| if same { x } else { 0.0 };
    let b = matrix(states, n, |i, j| own(entry(i, j), i / (2 * each) == j));
    let c = matrix(n, states, |i, j| own(entry(i, j), j / (2 * each) == i));
    Case {
        name: format!("{n} channels x {each} sections apart"),
        filter: StateMatrices {
            a: matrix(states, states, rotation),
            b,
            c,
            d: matrix(n, n, |i, j| own(0.5, i == j)),
        },
        sections: n * each,
        work: n * each * 8 + n,
    }
}

/// Any state matrix.
fn full(states: usize, n: usize, m: usize) -> Case {
    let a = matrix(states, states, |i, j| 0.9 / states as f64 * ((i * 7 + j * 3) as f64).cos());
    Case {
        name: format!("{states} states, full matrix, N = {n}, M = {m}"),
        filter: StateMatrices {
            a,
            b: matrix(states, n, entry),
            c: matrix(m, states, entry),
            d: matrix(m, n, entry),
        },
        sections: states / 2,
        work: states * (states + n + m) + n * m,
    }
}

/// As `design` writes them: a delay line of `line` frames with sections at its end.
fn designed(sections: usize, line: usize, n: usize, m: usize) -> Case {
    let (core, order) = (2 * sections, 2 * sections + line * n);
    let a = matrix(order, order, |i, j| match () {
        () if i < core && j < core => rotation(i, j),
        () if i < core && j < core + n => entry(i, j),
        () if i >= core && j == i + n => 1.0,
        () => 0.0,
    });
    let b = matrix(order, n, |i, j| f64::from(u8::from(i == order - n + j)));
    Case {
        name: format!("{sections} sections after {line} frames, N = {n}, M = {m}"),
        filter: StateMatrices { a, b, c: matrix(m, order, entry), d: matrix(m, n, entry) },
        sections,
        work: sections * (4 + 2 * n + 2 * m) + (line + 1) * n * m,
    }
}

fn bank(filter: StateMatrices) -> Bank {
    let ratio = filter.d.len();
    Bank::bare(SynthesisFilters::StateSpace(filter), ratio)
}

/// The least of some repeats: what the machine does when nothing else runs.
fn least_seconds(mut job: impl FnMut()) -> f64 {
    job();
    let timed = |_| {
        let start = Instant::now();
        job();
        start.elapsed().as_secs_f64()
    };
    (0..REPEATS).map(timed).fold(f64::INFINITY, f64::min)
}

/// f32 multiply-adds per second.
fn peak() -> f64 {
    let (count, _) = multiply_add_chains(Isa::detect(), 50_000);
    count as f64
        / least_seconds(|| {
            black_box(multiply_add_chains(Isa::detect(), black_box(50_000)));
        })
}

fn measure(case: &Case, call: usize) {
    let mut stream = Stream::new(&bank(case.filter.clone()).plan(Options::default()).expect("a sound bank"));
    let (n, m) = (stream.channels(), stream.ratio());
    let x: Vec<f32> = (0..n * FRAMES).map(|i| ((i * 7919) % 1000) as f32 / 1000.0 - 0.5).collect();
    let mut y = vec![0.0; m * FRAMES];
    let seconds = least_seconds(|| {
        for (x, y) in x.chunks(call * n).zip(y.chunks_mut(call * m)) {
            stream.process(black_box(x), y).expect("whole frames");
        }
    });
    let (rate, peak) = (FRAMES as f64 / seconds, peak());
    let (plan, work) = (stream.plan().summary(), rate * case.work as f64);
    println!(
        "| {} | {} {} | {call} | {:.1} | {:.1} | {:.2} | {:.2} | {:.1} | {:.0} % |",
        case.name,
        plan.algorithm,
        plan.numbers,
        1e-6 * rate,
        1e-6 * rate * m as f64,
        1e-9 * rate * case.sections as f64,
        1e-9 * work / 5.0,
        1e-9 * work,
        100.0 * work / peak
    );
}

fn main() {
    println!("{}, f32 peak {:.1} GMAC/s\n", Isa::detect(), 1e-9 * peak());
    println!(
        "| bank | algorithm | frames per call | M frames/s | M outputs/s | G sections/s | G biquads/s | GMAC/s | of f32 peak |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for case in [
        parallel(16, 4, 4),
        parallel(16, 2, 2),
        parallel(4, 2, 2),
        parallel(32, 8, 8),
        apart(4, 4),
        apart(8, 8),
    ] {
        measure(&case, FRAMES);
    }
    for case in [designed(1, 5, 2, 2), designed(2, 3, 4, 4), designed(3, 3, 8, 8)] {
        measure(&case, FRAMES);
    }
    measure(&parallel(16, 4, 4), 64);
    measure(&full(8, 2, 2), FRAMES);
    measure(&full(32, 4, 4), FRAMES);
}
