//! How long a design takes: the thesis example by all routes, a large IIR bank, speech.
//!
//! `cargo bench --bench design_time`

#[path = "../tests/support/specs.rs"]
mod specs;
mod stopwatch;

use hybank::bank::Bank;
use hybank::design::{Design, DesignError, DesignOptions, analyze, prove};
use hybank::spec::{DesignSpec, Method, Spec, WordLengths};
use hybank::verify::verify;
use specs::{alike, butterworth, thesis, with_taps};
use std::f64::consts::TAU;
use std::hint::black_box;
use stopwatch::time;

/// Designs without a search for proofs, which is timed apart.
fn design(spec: &Spec) -> Result<Design, DesignError> {
    hybank::design::design(spec, &DesignOptions::without_proof())
}

fn by(method: Method, taps: Option<usize>, spec: Spec) -> Spec {
    Spec { design: DesignSpec::new(method, taps), ..spec }
}

fn thesis_by(method: Method, taps: Option<usize>) -> Spec {
    by(method, taps, thesis(10, &[1.2, 0.6]))
}

/// N = M = 8.
fn eight(order: usize, omega: f64, latency: usize, method: Method, taps: Option<usize>) -> Spec {
    let delays = [0.0, 1.224, 1.703, 3.193, 4.178, 4.981, 5.882, 6.867];
    by(method, taps, alike(&butterworth(order, omega), 8, latency, &delays))
}

fn four() -> Spec {
    with_taps(alike(&butterworth(4, 1.2), 4, 12, &[0.0, 1.3, 2.1, 2.95]), 24)
}

/// N = M channels after Butterworth filters of order 6 at 0.2 of the fast rate, delays uneven, latency one
/// fast sample.
fn many(channels: usize, taps: usize) -> Spec {
    let delays: Vec<f64> = (0..channels).map(|i| 0.83 * i as f64 + 0.07 * ((i * i) % 5) as f64).collect();
    with_taps(alike(&butterworth(6, 0.2 * TAU), channels, channels, &delays), taps)
}

/// The same with integer taps; with it come studies of 2 bits more and fewer.
fn with_bits(mut spec: Spec, bits: u32) -> Spec {
    spec.design.bits = Some(WordLengths::Same(bits));
    spec
}

/// Once each, with the proven gap: too long for a statistic.
fn large() {
    let cases = [
        ("thesis example, 22 taps", thesis_by(Method::Fir, Some(22))),
        ("4 channels, Butterworth 4, 24 taps", four()),
        ("8 channels, Butterworth 6, 128 taps", many(8, 128)),
        ("8 channels, Butterworth 6, 128 taps of 12 bits", with_bits(many(8, 128), 12)),
        ("16 channels, Butterworth 6, 256 taps", many(16, 256)),
    ];
    for (name, spec) in cases {
        let begin = std::time::Instant::now();
        let gamma = design(&spec).unwrap().bank.gamma;
        let (upper, lower) = (gamma.upper.unwrap(), gamma.lower.unwrap());
        let (seconds, gap) = (begin.elapsed().as_secs_f64(), (upper - lower) / upper);
        println!("once: fir, {name}: {seconds:.4} s, gamma {upper:.9}, proven gap {gap:.1e}");
    }
}

fn main() {
    let one = |name: &str, spec: Spec| time(name, || design(black_box(&spec)).unwrap());
    one("iir, thesis example", thesis_by(Method::Iir, None));
    one("h2, thesis example", thesis_by(Method::H2, None));
    one("fir, thesis example, 22 taps", thesis_by(Method::Fir, Some(22)));
    one("iir, 8 channels, Butterworth 6", eight(6, 1.2, 20, Method::Iir, None));
    one("fir, 4 channels, Butterworth 4, 24 taps", four());
    one("fir, 8 channels, Butterworth 4, 32 taps", eight(4, 1.8, 12, Method::Fir, Some(32)));
    one("fir, 8 channels, Butterworth 6, 128 taps", many(8, 128));
    large();
    let bank = design(&thesis_by(Method::Fir, Some(22))).unwrap().bank;
    time("analyze, thesis example, 22 taps", || analyze(black_box(&bank), &[]).unwrap());
    time("prove, thesis example, 22 taps", || prove(black_box(&bank)).unwrap());
    let proof = Some(prove(&bank).unwrap().0);
    let bank = Bank { proof, ..bank };
    time("verify, thesis example, 22 taps", || verify(black_box(&bank)).unwrap());
}
