//! From how many taps per phase on does overlap-save take less time than the direct algorithm?
//!
//! `cargo bench --bench algorithm_crossover` measures both along a ladder of K for several N and M, in
//! nanoseconds per frame (best of many repeats), and sets beside them what the plan chooses. Words after
//! `--`: `f64` for double precision, and the name of an instruction set (`portable`, `avx2`, `avx512`) for
//! that set instead of the widest one.

use hybank::bank::{Bank, SynthesisFilters};
use hybank::runtime::{Algorithm, Isa, Options, Precision, Stream};
use std::hint::black_box;
use std::time::{Duration, Instant};

const FRAMES: usize = 16_384;
/// Batches of overlap-save that one figure takes at least.
const BATCHES: usize = 4;
/// Time for the repeats of one figure.
const EACH: Duration = Duration::from_millis(40);
const SHAPES: [(usize, usize); 11] =
    [(1, 1), (1, 4), (2, 2), (3, 3), (4, 1), (4, 4), (8, 2), (2, 8), (6, 6), (8, 8), (16, 16)];
const LAGS: [usize; 8] = [4, 8, 16, 32, 64, 128, 256, 512];

fn fir(n: usize, m: usize, taps: usize) -> Bank {
    let f = |i: usize| (0..taps).map(|t| ((t * 7 + i * 3) % 11) as f64 / 11.0 - 0.5).collect();
    Bank::bare(SynthesisFilters::Fir((0..n).map(f).collect()), m)
}

/// Nanoseconds per frame, in numbers of the kernels' own type.
fn measure(bank: &Bank, options: Options) -> f64 {
    let mut stream = Stream::new(&bank.plan(options).unwrap());
    let (n, m) = (stream.channels(), stream.ratio());
    let x: Vec<f64> = (0..n * FRAMES).map(|i| ((i * 7919) % 1000) as f64 / 1000.0 - 0.5).collect();
    let narrow: Vec<f32> = x.iter().map(|&x| x as f32).collect();
    let (mut y, mut narrow_y) = (vec![0.0; m * FRAMES], vec![0.0; m * FRAMES]);
    // A batch is made by the call that completes it, and may be longer than a call.
    let calls = (BATCHES * stream.plan().extra_latency() / m).div_ceil(FRAMES).max(1);
    let mut best = f64::MAX;
    let begin = Instant::now();
    while begin.elapsed() < EACH {
        let start = Instant::now();
        for _ in 0..calls {
            match options.precision {
                Precision::Single => stream.process(black_box(&narrow), &mut narrow_y),
                Precision::Double => stream.process(black_box(&x), &mut y),
            }
            .unwrap();
        }
        best = best.min(start.elapsed().as_secs_f64());
    }
    best / (calls * FRAMES) as f64 * 1e9
}

fn main() {
    let asked = |wanted: &str| std::env::args().any(|word| word == wanted);
    let isa = Isa::available().find(|isa| asked(isa.name())).unwrap_or_else(Isa::detect);
    let precision = if asked("f64") { Precision::Double } else { Precision::Single };
    println!("| N | M | K | direct, ns per frame | overlap-save, ns per frame | the plan |");
    println!("|---|---|---|---|---|---|");
    for (n, m) in SHAPES {
        for k in LAGS {
            let bank = fir(n, m, k * m);
            let options = |algorithm| Options { precision, algorithm, isa };
            let [direct, transforms] = [Algorithm::Direct, Algorithm::OverlapSave]
                .map(|algorithm| measure(&bank, options(algorithm)));
            let plan = bank.plan(options(Algorithm::Auto)).unwrap().summary();
            let length = plan.transform.map_or(String::new(), |len| format!(" {len}"));
            println!("| {n} | {m} | {k} | {direct:.2} | {transforms:.2} | {}{length} |", plan.algorithm);
        }
    }
}
