//! From captures to a bank for the converters as they are, all in memory: calibrate delays by two tones,
//! design and prove, fuse a capture in which samples are lost, measure the output, export the taps.
//!
//! `cargo run --release --example from_captures`

use hybank::calibrate::{self, CalibrationSignal, Record, applied, calibrate};
use hybank::design::uncertainty::BoxStudy;
use hybank::design::{MissingSamples, Problem, design};
use hybank::measure::{self, measure};
use hybank::pipeline::{self, fuse};
use hybank::runtime::{Algorithm, Options, Planar};
use hybank::simulate::{Analog, Source, capture};
use hybank::spec::{ErrorBox, Spec};
use hybank::units::{Hertz, Seconds};
use hybank::verify::verify;
use std::error::Error;
use std::sync::Arc;

/// As drawn: the delays, the front ends, and where the signal ends.
const SPEC: &str = r#"
fast_rate = "48 kS/s"
ratio = 2
latency = 12
target = { filter = { family = "butterworth", order = 4, cutoff = "9 kHz" } }
channel = [{ delay = "25 us" }, { delay = "12.5 us" }]
signal = { band = "14 kHz" }
design = { method = "fir", taps = 24 }
"#;

const FRAMES: usize = 16_384;
const TONES: [Hertz; 2] = [Hertz(3100.0), Hertz(5300.0)];

/// What converters of a spec deliver of a source.
fn captured(spec: &Spec, source: &str) -> Result<Vec<Vec<f64>>, Box<dyn Error>> {
    let source: Source = source.parse()?;
    let signal = Analog::Known(source.normalised(spec.fast_period));
    Ok(capture(&Problem::new(spec, 12)?, &signal, FRAMES).channels)
}

fn main() -> Result<(), Box<dyn Error>> {
    let drawn = Spec::from_toml(SPEC, "spec.toml")?;
    // As built: the first channel is 300 ns later than drawn. Nobody knows that.
    let mut built = drawn.clone();
    built.channels[0].delay = Seconds(25.3e-6);

    let records: Vec<Record> =
        captured(&built, "tones:3.1kHz,5.3kHz")?.into_iter().map(Record::new).collect();
    let settings =
        calibrate::CalibrationSettings { reference: 1, ..calibrate::CalibrationSettings::default() };
    let found = calibrate(&drawn, &records, &CalibrationSignal::Tones(TONES.to_vec()), settings)?;
    let (measured, _) = applied(&drawn, &found);
    println!("delay of channel 1: {}", measured.channels[0].delay);
    assert!((measured.channels[0].delay - Seconds(25.3e-6)).0.abs() < 1e-10);

    let bank = design(&measured, &Default::default())?.bank;
    let proven = verify(&bank)?;
    let late = Seconds(1e-9).in_fast_periods(bank.fast_period);
    let errors = ErrorBox { delays: vec![late; 2], ..ErrorBox::none(2) };
    let worst = BoxStudy::new(&bank, &errors)?;
    println!("gamma at most {:.4e}, with delays 1 ns off {:.4e}", proven.upper, worst.upper);

    let mut tone = captured(&built, "tones:3.1kHz")?;
    tone[0][9000..9004].fill(f64::NAN);
    let estimator = Arc::new(MissingSamples::of_bank(&bank)?);
    let settings = pipeline::Settings { gaps: Some(estimator), ..Default::default() };
    let plan = bank.plan(Options { algorithm: Algorithm::Direct, ..Options::default() })?;
    let channels: Vec<&[f64]> = tone.iter().map(Vec::as_slice).collect();
    let mut output = vec![0.0f64; FRAMES * bank.ratio];
    let outcome =
        fuse(&bank, &plan, &[&Planar::new(&channels)?], &mut output.as_mut_slice(), settings, &|| false)?;
    let affected = outcome.mask.iter().flatten().filter(|&&mark| mark > 0).count();
    println!("{} samples, {affected} of them affected by the gap", outcome.samples);

    let whole = measure(&output[1000..17_000], Hertz(48e3), &measure::Settings::default())?;
    println!("before the gap: SINAD {:.1}, SFDR {:.1}", whole.sinad, whole.sfdr);
    assert!(whole.sinad.0 > 60.0 && affected > 0);
    Ok(())
}
