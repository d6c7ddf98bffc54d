//! The figures of `measure` beside those of two public tools, on records that the tools made.
//!
//! `tools/adc_tools.py` wrote the records and `figures.json` with adctoolbox 0.9.1 and python-adc-eval
//! 0.4.0; docs/measure.md says where the definitions differ.

use crate::support::{number, wav_file};
use hybank::measure::{Measurement, Settings, Window, measure};
use hybank::units::Hertz;
use serde_json::Value;
use std::path::{Path, PathBuf};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/numerics/adc_records")
}

fn figures() -> Value {
    serde_json::from_str(&std::fs::read_to_string(folder().join("figures.json")).unwrap()).unwrap()
}

fn measured(name: &str, converters: usize) -> Measurement {
    let (spec, samples) = wav_file::read(&folder().join(format!("{name}.wav")));
    let samples: Vec<f64> = samples.into_iter().map(f64::from).collect();
    let settings = Settings { converters, window: Window::None, ..Settings::default() };
    measure(&samples, Hertz(f64::from(spec.sample_rate)), &settings).unwrap()
}

#[test]
fn coherent_records_have_the_figures_of_the_tools() {
    let figures = figures();
    for name in ["interleaved", "distorted", "converter"] {
        let record = &figures[name];
        let measured = measured(name, record["converters"].as_u64().unwrap() as usize);
        let close = |tool: &str, figure: &str, got: f64, tolerance: f64| {
            let want = number(&record[tool], &format!("/{figure}"));
            assert!((got - want).abs() <= tolerance, "{name}, {tool}, {figure}: {got} instead of {want}");
        };
        let toolbox = "adctoolbox, no window";
        close(toolbox, "sinad", measured.sinad.0, 0.02);
        close(toolbox, "enob", measured.enob, 0.01);
        close(toolbox, "level", measured.tones[0].level.0, 0.001);
        close(toolbox, "sfdr", measured.sfdr.0, 0.1);
        // Rounded to 0.1 dB by the tool.
        let eval = "python-adc-eval, no window";
        close(eval, "sinad", measured.sinad.0, 0.06);
        close(eval, "sfdr", measured.sfdr.0, 0.15);
        close(eval, "enob_full_scale", measured.enob_full_scale, 0.06);
    }
    // Only here are the harmonics above the noise, so that their sum does not hang on single bins of it.
    let thd = number(&figures, "/distorted/adctoolbox, no window/thd");
    assert!((measured("distorted", 1).thd.0 - thd).abs() < 0.1);
}

#[test]
fn a_record_off_a_bin_has_the_figures_of_the_coherent_one() {
    let (off, coherent) = (measured("off-bin", 1), measured("converter", 1));
    // The quantisation errors of two records of 4096 samples differ by as much: their own ENOB are 12.010
    // and 11.984.
    assert!((off.enob - coherent.enob).abs() < 0.03, "{} {}", off.enob, coherent.enob);
    // The tools without a window lose ten bits there.
    assert!(number(&figures(), "/off-bin/adctoolbox, no window/enob") < coherent.enob - 9.0);
}
