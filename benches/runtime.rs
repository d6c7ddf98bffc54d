//! How many fast samples a second one core makes, and what share of its multiply-add peak that is.
//!
//! `cargo bench --bench runtime` prints criterion's throughput (elements are fast samples); the peak
//! of the same run is its own group. Each fast sample takes N K multiply-adds, K = taps / M.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use hybank::bank::{Bank, BlockFilter, Gamma, SynthesisFilters};
use hybank::io::{PcmFormat, PcmFrames, SampleLayout};
use hybank::runtime::{Isa, Options, PcmOutput, Precision, Reconstructor, multiply_add_chains};
use hybank::spec::Method;
use std::hint::black_box;

const TICKS: usize = 16_384;
const CASES: [(&str, usize, usize, usize); 3] = [("A", 2, 2, 24), ("B", 4, 4, 64), ("C", 8, 8, 128)];

fn bank(channels: usize, ratio: usize, filters: SynthesisFilters) -> Bank {
    Bank {
        spec: None,
        fast_period: 1.0,
        ratio,
        latency: 0,
        method: Method::Fir,
        delays: vec![0.0; channels],
        filters,
        gamma: Gamma::default(),
        proof: None,
    }
}

fn fir(n: usize, m: usize, taps: usize) -> Bank {
    let f = |i: usize| (0..taps).map(|t| ((t * 7 + i * 3) % 11) as f64 / 11.0 - 0.5).collect();
    bank(n, m, SynthesisFilters::Fir((0..n).map(f).collect()))
}

/// 16 pairs of states in modal form, four channels.
fn recursion() -> Bank {
    let n = 32;
    let entry = |i: usize, j: usize| match () {
        () if i == j => 0.9,
        () if i / 2 == j / 2 => {
            if i < j {
                -0.3
            } else {
                0.3
            }
        }
        () => 0.0,
    };
    let matrix = |rows: usize, cols: usize| (0..rows).map(|i| vec![0.1 / (1 + i) as f64; cols]).collect();
    let a = (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect();
    bank(
        4,
        4,
        SynthesisFilters::StateSpace(BlockFilter { a, b: matrix(n, 4), c: matrix(4, n), d: matrix(4, 4) }),
    )
}

fn input(n: usize) -> Vec<f32> {
    (0..n * TICKS).map(|i| ((i * 7919) % 1000) as f32 / 1000.0 - 0.5).collect()
}

fn throughput(c: &mut Criterion, group: &str, name: &str, bank: &Bank, precision: Precision, call: usize) {
    let options = Options { precision, ..Options::default() };
    let mut stream = Reconstructor::with_options(bank, options).unwrap();
    let (n, m) = (stream.channels(), stream.ratio());
    let x = input(n);
    let mut y = vec![0.0; m * TICKS];
    let mut group = c.benchmark_group(group);
    group.throughput(Throughput::Elements((m * TICKS) as u64));
    group.bench_function(BenchmarkId::from_parameter(name), |b| {
        b.iter(|| {
            for (x, y) in x.chunks(call * n).zip(y.chunks_mut(call * m)) {
                stream.process(black_box(x), y).unwrap();
            }
        })
    });
}

/// What the processor can do at most, f32.
fn peak(c: &mut Criterion) {
    const TURNS: u64 = 100_000;
    let isa = Isa::detect();
    let (count, _) = multiply_add_chains(isa, TURNS);
    let mut group = c.benchmark_group("peak, elements are multiply-adds");
    group.throughput(Throughput::Elements(count));
    group.bench_function(isa.to_string(), |b| b.iter(|| multiply_add_chains(isa, black_box(TURNS))));
}

fn cases(c: &mut Criterion) {
    for (name, n, m, taps) in CASES {
        throughput(c, "f32", name, &fir(n, m, taps), Precision::Single, TICKS);
        throughput(c, "f32, 64 ticks a call", name, &fir(n, m, taps), Precision::Single, 64);
        throughput(c, "f64", name, &fir(n, m, taps), Precision::Double, TICKS);
    }
    throughput(c, "state space", "32 states, N = M = 4", &recursion(), Precision::Double, TICKS);
}

fn ladder(c: &mut Criterion) {
    for n in [1, 2, 3, 4, 8, 16] {
        for m in [1, 2, 3, 4, 8, 16] {
            throughput(
                c,
                "16 taps a phase",
                &format!("N {n} M {m}"),
                &fir(n, m, 16 * m),
                Precision::Single,
                TICKS,
            );
        }
    }
    for taps in [2, 8, 32, 128, 512, 2048] {
        throughput(c, "taps, N = M = 2", &taps.to_string(), &fir(2, 2, taps), Precision::Single, TICKS);
    }
}

fn integers(c: &mut Criterion) {
    let mut stream = Reconstructor::new(&fir(2, 2, 24)).unwrap();
    let bytes: Vec<u8> = (0..4 * TICKS).map(|i| (i * 31) as u8).collect();
    let mut out = vec![0; 4 * TICKS];
    let mut group = c.benchmark_group("s16le in and out");
    group.throughput(Throughput::Elements((2 * TICKS) as u64));
    group.bench_function("A", |b| {
        b.iter(|| {
            let layout = SampleLayout::packed(PcmFormat::S16Le);
            let frames = PcmFrames { layout, channels: 2, bytes: black_box(&bytes) };
            let mut output = PcmOutput { format: PcmFormat::S16Le, bytes: &mut out, clipped: 0 };
            stream.process_pcm(&[frames], &mut output).unwrap()
        })
    });
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .sample_size(20)
        .warm_up_time(std::time::Duration::from_millis(200))
        .measurement_time(std::time::Duration::from_millis(600));
    targets = peak, cases, ladder, integers
}
criterion_main!(benches);
