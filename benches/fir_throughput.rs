//! How many fast samples per second one core makes, and what share of its multiply-add peak that is.
//!
//! `cargo bench --bench fir_throughput` prints a table of the public [`Stream`]; a word after `--` picks the
//! rows that contain it, the name of an instruction set (`portable`, `avx2`, `avx512`) that set instead of
//! the widest one. Each fast sample takes N K multiply-adds, K = taps / M. Every row is the best of many
//! repeats, and so is the peak, which is measured again beside each row.

use hybank::bank::{Bank, SynthesisFilters};
use hybank::io::{PcmFormat, PcmFrames, SampleLayout};
use hybank::runtime::{
    Algorithm, Interleaved, Isa, Options, PcmOutput, Precision, Stream, ThreadPool, multiply_add_chains,
};
use std::hint::black_box;
use std::time::{Duration, Instant};

const FRAMES: usize = 16_384;
const CASES: [(&str, usize, usize, usize); 3] = [("A", 2, 2, 24), ("B", 4, 4, 64), ("C", 8, 8, 128)];
/// Time for the repeats of a row.
const ROW: Duration = Duration::from_millis(100);

fn fir(n: usize, m: usize, taps: usize) -> Bank {
    let f = |i: usize| (0..taps).map(|t| ((t * 7 + i * 3) % 11) as f64 / 11.0 - 0.5).collect();
    Bank::bare(SynthesisFilters::Fir((0..n).map(f).collect()), m)
}

fn input(n: usize, frames: usize) -> Vec<f32> {
    (0..n * frames).map(|i| ((i * 7919) % 1000) as f32 / 1000.0 - 0.5).collect()
}

/// Least seconds of one iteration, and the peak of one core in multiply-adds per second of the same while.
fn measure(isa: Isa, mut iteration: impl FnMut()) -> (f64, f64) {
    let (mut best, mut peak) = (f64::MAX, 0f64);
    let begin = Instant::now();
    while begin.elapsed() < ROW {
        let start = Instant::now();
        iteration();
        best = best.min(start.elapsed().as_secs_f64());
        let start = Instant::now();
        let (count, sum) = multiply_add_chains(isa, 10_000);
        black_box(sum);
        peak = peak.max(count as f64 / start.elapsed().as_secs_f64());
    }
    (best, peak)
}

/// The rows that were asked for.
struct Table {
    wanted: Option<String>,
    isa: Isa,
}

impl Table {
    fn options(&self) -> Options {
        Options { isa: self.isa, ..Options::default() }
    }

    fn direct(&self) -> Options {
        Options { algorithm: Algorithm::Direct, ..self.options() }
    }

    fn wants(&self, name: &str) -> bool {
        self.wanted.as_ref().is_none_or(|word| name.contains(word))
    }

    /// One row: `samples` fast samples per iteration of `products` multiply-adds each.
    fn row(&self, name: &str, samples: usize, products: f64, iteration: impl FnMut()) {
        if !self.wants(name) {
            return;
        }
        let (seconds, peak) = measure(self.isa, iteration);
        let rate = samples as f64 / seconds;
        let macs = rate * products;
        println!(
            "| {name:<34} | {:>8.1} | {:>6.2} | {:>5.1} % |",
            rate / 1e6,
            macs / 1e9,
            100.0 * macs / peak
        );
    }

    /// The products are those of the direct algorithm, so that the share of the peak may pass 100 % in
    /// others.
    fn fir(&self, name: &str, n: usize, m: usize, taps: usize, algorithm: Algorithm, call: usize) {
        let options = Options { algorithm, ..self.options() };
        let mut stream = Stream::new(&fir(n, m, taps).plan(options).unwrap());
        let x = input(n, FRAMES);
        let mut y = vec![0.0; m * FRAMES];
        self.row(name, m * FRAMES, (n * taps) as f64 / m as f64, || {
            for (x, y) in x.chunks(call * n).zip(y.chunks_mut(call * m)) {
                stream.process(black_box(x), y).unwrap();
            }
        });
    }

    fn cases(&self) {
        for (name, n, m, taps) in CASES {
            self.fir(&format!("{name}: f32"), n, m, taps, Algorithm::Direct, FRAMES);
            self.fir(&format!("{name}: f32, 64 frames per call"), n, m, taps, Algorithm::Direct, 64);
            self.doubles(&format!("{name}: f64"), n, m, taps);
            self.pcm(&format!("{name}: s16le in and out"), n, m, taps);
            self.threads(&format!("{name}: f32, two threads"), n, m, taps);
            self.fir(&format!("{name}: f32, overlap-save"), n, m, taps, Algorithm::OverlapSave, FRAMES);
            self.worst(name, n, m, taps);
        }
    }

    /// Input that may cost time: NaN in all samples, NaN in one of a thousand frames, denormals.
    fn worst(&self, name: &str, n: usize, m: usize, taps: usize) {
        let numbers = input(n, FRAMES);
        let with = |every: usize, value: fn(f32) -> f32| {
            let value = |(i, &x): (usize, &f32)| if i % every == 0 { value(x) } else { x };
            numbers.iter().enumerate().map(value).collect::<Vec<f32>>()
        };
        let inputs = [
            ("NaN", with(1, |_| f32::NAN)),
            ("NaN, 1 in 1000 frames", with(1000 * n, |_| f32::NAN)),
            ("denormals", with(1, |x| 1e-38 * x)),
        ];
        for (what, x) in inputs {
            let mut stream = Stream::new(&fir(n, m, taps).plan(self.options()).unwrap());
            let mut y = vec![0.0; m * FRAMES];
            self.row(&format!("{name}: f32, {what}"), m * FRAMES, (n * taps) as f64 / m as f64, || {
                stream.process(black_box(&x), &mut y).unwrap();
            });
        }
    }

    /// In and out as f64; the peak in f64 is half the one printed.
    fn doubles(&self, name: &str, n: usize, m: usize, taps: usize) {
        let options = Options { precision: Precision::Double, ..self.direct() };
        let mut stream = Stream::new(&fir(n, m, taps).plan(options).unwrap());
        let x: Vec<f64> = input(n, FRAMES).into_iter().map(f64::from).collect();
        let mut y = vec![0.0; m * FRAMES];
        self.row(name, m * FRAMES, (n * taps) as f64 / m as f64, || {
            stream.process(black_box(&x), &mut y).unwrap();
        });
    }

    fn pcm(&self, name: &str, n: usize, m: usize, taps: usize) {
        let mut stream = Stream::new(&fir(n, m, taps).plan(self.options()).unwrap());
        let bytes: Vec<u8> = (0..2 * n * FRAMES).map(|i| (i * 31) as u8).collect();
        let mut out = vec![0; 2 * m * FRAMES];
        let layout = SampleLayout::packed(PcmFormat::S16Le);
        self.row(name, m * FRAMES, (n * taps) as f64 / m as f64, || {
            let frames = PcmFrames { layout, channels: n, bytes: black_box(&bytes) };
            let mut output = PcmOutput::packed(PcmFormat::S16Le, &mut out);
            stream.run(&frames, &mut output).unwrap();
        });
    }

    /// Longer calls, as for files, by two threads; how many times one thread's speed that is, from alternate
    /// iterations.
    fn threads(&self, name: &str, n: usize, m: usize, taps: usize) {
        if !self.wants(name) {
            return;
        }
        let mut stream = Stream::new(&fir(n, m, taps).plan(self.direct()).unwrap());
        let pool = ThreadPool::new(2).unwrap();
        let frames = 16 * FRAMES;
        let x = input(n, frames);
        let mut y = vec![0.0; m * frames];
        let (mut one, mut two) = (Duration::MAX, Duration::MAX);
        let begin = Instant::now();
        while begin.elapsed() < 5 * ROW {
            let start = Instant::now();
            stream.process(black_box(&x), &mut y).unwrap();
            one = one.min(start.elapsed());
            let start = Instant::now();
            let frames = Interleaved::new(black_box(&x), n).unwrap();
            stream.run_parallel(&frames, &mut y.as_mut_slice(), &pool).unwrap();
            two = two.min(start.elapsed());
        }
        let (one, two) = (one.as_secs_f64(), two.as_secs_f64());
        let (rate, products) = ((m * frames) as f64 / two, (n * taps) as f64 / m as f64);
        println!(
            "| {name:<34} | {:>8.1} | {:>6.2} | {:.2} x 1 |",
            rate / 1e6,
            rate * products / 1e9,
            one / two
        );
    }

    /// 16 taps per phase for every small N and M, then more and more taps.
    fn ladder(&self) {
        for n in 1..=16 {
            for m in 1..=16 {
                let name = format!("ladder: N {n} M {m}, 16 taps per phase");
                self.fir(&name, n, m, 16 * m, Algorithm::Direct, FRAMES);
            }
        }
        let few = [2, 8, 32, 128, 512, 2048].map(|taps| (2, taps));
        for (n, taps) in few.into_iter().chain([256, 512, 1024].map(|taps| (8, taps))) {
            self.fir(&format!("taps: N {n} M {n}, {taps} taps"), n, n, taps, Algorithm::Direct, FRAMES);
        }
    }
}

fn main() {
    // The words that are no options of cargo's.
    let (sets, words): (Vec<_>, Vec<_>) = std::env::args()
        .skip(1)
        .filter(|word| !word.starts_with('-'))
        .partition(|word| Isa::available().any(|isa| isa.name() == word));
    let isa = Isa::available().find(|isa| sets.iter().any(|set| isa.name() == set));
    let table = Table { wanted: words.into_iter().next(), isa: isa.unwrap_or_else(Isa::detect) };
    println!("{}, one core unless said otherwise", table.isa);
    println!("| {:<34} | M outs/s | GMAC/s | of peak |", "case");
    println!("|{:-<36}|----------|--------|---------|", "");
    table.cases();
    table.ladder();
}
