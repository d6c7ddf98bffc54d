//! proto
use hybank::bank::{Bank, Gamma, SynthesisFilters};
use hybank::runtime::{Form, Isa, Options, Reconstructor, multiply_add_chains};
use hybank::spec::Method;
use std::hint::black_box;
use std::time::{Duration, Instant};

fn fir(n: usize, m: usize, taps: usize) -> Bank {
    let f = |i: usize| (0..taps).map(|t| ((t * 7 + i * 3) % 11) as f64 / 11.0 - 0.5).collect();
    Bank { spec: None, fast_period: 1.0, ratio: m, latency: 0, method: Method::Fir, delays: vec![0.0; n],
        filters: SynthesisFilters::Fir((0..n).map(f).collect()), gamma: Gamma::default(), proof: None }
}
fn main() {
    let args: Vec<usize> = std::env::args().skip(1).filter_map(|a| a.parse().ok()).collect();
    let (n, m, k) = (args[0], args[1], args[2]);
    let ticks = 65536;
    let x: Vec<f32> = (0..n * ticks).map(|i| ((i * 7919) % 1000) as f32 / 1000.0 - 0.5).collect();
    let mut y = vec![0.0f32; m * ticks];
    let mut want = vec![0.0f32; m * ticks];
    let mut forms = vec![Form::Direct];
    let mut f = (2 * k).next_power_of_two().max(16);
    for _ in 0..5 { forms.push(Form::OverlapSave(Some(f))); f *= 2; }
    for form in forms {
        let mut s = Reconstructor::with_options(&fir(n, m, k * m), Options { form, ..Options::default() }).unwrap();
        let (mut best, mut peak) = (f64::MAX, 0f64);
        let begin = Instant::now();
        while begin.elapsed() < Duration::from_millis(300) {
            let t = Instant::now();
            for (x, y) in x.chunks(16384 * n).zip(y.chunks_mut(16384 * m)) { s.process(black_box(x), y).unwrap(); }
            best = best.min(t.elapsed().as_secs_f64());
            let t = Instant::now();
            let (c, sum) = multiply_add_chains(Isa::detect(), 10_000);
            black_box(sum);
            peak = peak.max(c as f64 / t.elapsed().as_secs_f64());
        }
        s.reset();
        let mut y2 = vec![0.0f32; m * ticks];
        s.process(&x, &mut y2).unwrap();
        if form == Form::Direct { want.copy_from_slice(&y2); }
        let lat = s.latency();
        let err = y2[lat..].iter().zip(&want).map(|(a, b)| (a - b).abs()).fold(0f32, f32::max);
        println!("{form:?} {:.2} ns/tick, {:.0} % of peak, late {} , err {err:e}", best / ticks as f64 * 1e9, (n * m * k * ticks) as f64 / best / peak * 100.0, lat);
    }
}
