//! The form in which recursive banks are written: delay lines and parallel sections, which the runtime
//! recognises.

use crate::support::{block, designed};
use hybank::bank::{Bank, StateMatrices};
use hybank::design::analyze;
use hybank::runtime::{Options, Stream};
use hybank::spec::Spec;

fn spec(method: &str, delays: &[f64], latency: usize, target: &str) -> Spec {
    let channels: Vec<String> = delays.iter().map(|delay| format!("{{ delay = {delay} }}")).collect();
    let text = format!(
        "fast_period = 1.0\nratio = 2\nlatency = {latency}\nchannel = [{}]\ntarget = {{ filter = {target} }}\n\
         design = {{ method = \"{method}\" }}",
        channels.join(", ")
    );
    Spec::from_toml(&text, "spec.toml").unwrap()
}

const DOUBLE_POLE: &str = "{ num = [0.25], den = [1.0, 1.0, 0.25] }";
const BUTTERWORTH: &str = "{ family = \"butterworth\", order = 5, cutoff = 0.2 }";

/// The definition of a state-space bank, row by row.
fn slow_run(filter: &StateMatrices, input: &[f64]) -> Vec<f64> {
    let dot = |row: &[f64], v: &[f64]| row.iter().zip(v).map(|(a, b)| a * b).sum::<f64>();
    let mut x = vec![0.0; filter.a.len()];
    let mut out = Vec::new();
    for u in input.chunks_exact(filter.d[0].len()) {
        out.extend(filter.c.iter().zip(&filter.d).map(|(c, d)| dot(c, &x) + dot(d, u)));
        x = filter.a.iter().zip(&filter.b).map(|(a, b)| dot(a, &x) + dot(b, u)).collect();
    }
    out
}

fn samples(count: usize) -> Vec<f64> {
    (0..count).map(|i| ((i * i * 31 + 7 * i) % 1009) as f64 / 504.5 - 1.0).collect()
}

#[test]
fn designs_are_sections_behind_delay_lines() {
    for method in ["iir", "h2"] {
        for (filter, order, latency) in
            [(DOUBLE_POLE, 2, 0), (DOUBLE_POLE, 2, 10), (BUTTERWORTH, 5, 9), (BUTTERWORTH, 5, 60)]
        {
            let bank = designed(&spec(method, &[1.2, 0.6], latency, filter));
            let mut stream = Stream::new(&bank.plan(Options::default()).unwrap());
            assert_eq!(stream.plan().summary().algorithm, "parallel-form", "{method} {filter} {latency}");
            assert_eq!(stream.plan().summary().numbers, "f64");
            // Two inputs a frame of the line, and no more recursive states than the front end has.
            let states = block(&bank).a.len();
            assert!(states <= order + 2 * (latency / 2 + 1), "{method} {filter} {latency}: {states}");
            let input = samples(2 * 500);
            let mut fast = vec![0.0; input.len()];
            stream.process(&input, &mut fast).unwrap();
            let want = slow_run(block(&bank), &input);
            let worst = fast.iter().zip(&want).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(worst < 1e-12, "{method} {filter} {latency}: {worst:e}");
        }
    }
}

#[test]
fn the_gamma_written_is_that_of_the_sections() {
    for latency in [0, 3, 10, 41] {
        let bank = designed(&spec("iir", &[1.2, 0.6], latency, BUTTERWORTH));
        let read_back = Bank::from_json(&bank.to_json().unwrap(), "bank.json").unwrap();
        let gamma = analyze(&read_back, &[]).unwrap().gamma;
        assert!((gamma / bank.gamma.norm.unwrap() - 1.0).abs() < 1e-12);
        assert!(bank.gamma.lower <= bank.gamma.upper);
    }
}

#[test]
fn channels_that_cannot_be_told_apart_share_a_filter_in_sections_too() {
    let alone = designed(&spec("iir", &[1.2, 0.6], 8, DOUBLE_POLE));
    let twice = designed(&spec("iir", &[1.2, 0.6, 1.2], 8, DOUBLE_POLE));
    assert!((alone.gamma.norm.unwrap() / twice.gamma.norm.unwrap() - 1.0).abs() < 1e-9);
    let mut stream = Stream::new(&twice.plan(Options::default()).unwrap());
    assert_eq!(stream.plan().summary().algorithm, "parallel-form");
    // The same samples on both copies are the same samples on the one.
    let two = samples(2 * 200);
    let three: Vec<f64> = two.chunks_exact(2).flat_map(|u| [u[0], u[1], u[0]]).collect();
    let (mut a, mut b) = (vec![0.0; 400], vec![0.0; 400]);
    Stream::new(&alone.plan(Options::default()).unwrap()).process(&two, &mut a).unwrap();
    stream.process(&three, &mut b).unwrap();
    let worst = a.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(worst < 1e-9, "{worst:e}");
}
