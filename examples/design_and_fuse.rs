//! From a spec to fused samples without any file: design a bank, let virtual converters capture a signal,
//! fuse the captures frame by frame, and compare with what an ideal fast converter gives.
//!
//! `cargo run --release --example design_and_fuse`

use hybank::design::{Problem, design};
use hybank::runtime::{Options, Stream};
use hybank::simulate::{Analog, Source, capture};
use hybank::spec::Spec;
use std::error::Error;

const SPEC: &str = r#"
fast_rate = 48000.0
ratio = 2
latency = 12
[target]
filter = { family = "butterworth", order = 4, cutoff = 9000.0 }
[[channel]]
delay_samples = 1.2
[[channel]]
delay_samples = 0.6
[design]
method = "fir"
taps = 24
"#;

const FRAMES: usize = 1000;
/// Frames a call, as if they came from a sound card.
const BLOCK: usize = 64;

fn main() -> Result<(), Box<dyn Error>> {
    let spec = Spec::from_toml(SPEC, "spec")?;
    let bank = design(&spec, &Default::default())?.bank;
    println!("gamma at most {:?}, of any such bank at least {:?}", bank.gamma.upper, bank.gamma.lower);

    let source: Source = "tones:440Hz,3kHz".parse()?;
    let signal = Analog::Known(source.normalised(spec.fast_period));
    let captured = capture(&Problem::new(&spec, bank.latency)?, &signal, FRAMES);
    let frames: Vec<f64> = (0..FRAMES).flat_map(|k| captured.channels.iter().map(move |x| x[k])).collect();

    let mut fuse = Stream::new(&bank.plan(Options::default())?);
    let mut fast = vec![0.0; FRAMES * fuse.ratio()];
    let mut written = 0;
    for block in frames.chunks(BLOCK * fuse.channels()) {
        written += fuse.process(block, &mut fast[written..])?;
    }

    // Until its memory is full the bank sees a signal that was zero before.
    let settled = 2 * bank.latency + 24;
    let power = |values: &mut dyn Iterator<Item = f64>| values.map(|x| x * x).sum::<f64>();
    let error = power(&mut (settled..written).map(|n| fast[n] - captured.target[n]));
    let signal = power(&mut captured.target[settled..].iter().copied());
    let snr = 10.0 * (signal / error).log10();
    println!("{written} fast samples, SNR {snr:.1} dB");
    assert!(snr > 60.0);
    Ok(())
}
