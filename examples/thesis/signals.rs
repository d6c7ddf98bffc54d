//! Figures 5.16 and 5.17 and table 5.1: the methods on a step and on two cosines.

use crate::filters::chart;
use crate::page::Row;
use crate::{Banks, Figure, Outcome, spec};
use hybank::bank::Bank;
use hybank::design::{Problem, Sizing};
use hybank::pipeline::{DroppedLatency, Settings, fuse};
use hybank::runtime::{Options, Planar, Precision};
use hybank::simulate::{Analog, Captured, Source, capture};
use hybank::units::Seconds;

/// f(t) = 1 from t = 0.3 (thesis 5.42).
pub(super) const STEP: &str = "step@0.3";
/// f(t) = cos(0.3 t) + cos(0.8 t) (thesis 5.43).
const COSINES: &str = "tones:0.3,0.8";
/// Slow samples: 200 fast ones.
const FRAMES: usize = 100;
/// Fast samples that are not judged: the cosines were always there, but the filters begin at rest.
const SETTLING: usize = 41;

/// What the slow converters and the ideal fast one capture.
pub(super) struct Signal {
    captured: Captured,
}

impl Signal {
    pub(super) fn capture(source: &str) -> Outcome<Self> {
        let spec = spec()?;
        let source: Source = source.parse()?;
        let signal = Analog::Known(source.normalised(Seconds(1.0)));
        Ok(Self { captured: capture(&Problem::new(&spec, Sizing::of(&spec)?.latency)?, &signal, FRAMES) })
    }

    /// y_0.
    pub(super) fn target(&self) -> &[f64] {
        &self.captured.target
    }

    /// e = y_0 - y.
    pub(super) fn error(&self, bank: &Bank) -> Outcome<Vec<f64>> {
        let plan = bank.plan(Options { precision: Precision::Double, ..Options::default() })?;
        let channels: Vec<&[f64]> = self.captured.channels.iter().map(Vec::as_slice).collect();
        let mut fused = vec![0.0; self.target().len()];
        let causal = Settings { dropped: DroppedLatency::Added, ..Settings::default() };
        fuse(bank, &plan, &[&Planar::new(&channels)?], &mut fused.as_mut_slice(), causal, &|| false)?;
        Ok(self.target().iter().zip(fused).map(|(wanted, y)| wanted - y).collect())
    }
}

/// Both figures and the rows of the table.
pub(super) fn compare(banks: &Banks) -> Outcome<(Vec<Figure>, Vec<Row>)> {
    let methods = [
        ("hybank, FIR 22 taps", &banks.fir),
        ("hybank, IIR", &banks.iir),
        ("sinc, 22 taps", &banks.sinc),
        ("separation, 22 taps", &banks.separation),
    ];
    let mut rows: Vec<Row> =
        methods.iter().map(|(name, _)| Row { method: name, errors: Vec::new() }).collect();
    let mut figures = Vec::new();
    for (number, title, source) in [
        ("5.16", "Errors of the methods: step at 0.3", STEP),
        ("5.17", "Errors of the methods: cos(0.3 t) + cos(0.8 t)", COSINES),
    ] {
        let signal = Signal::capture(source)?;
        let mut curves = Vec::new();
        for ((name, bank), row) in methods.iter().zip(&mut rows) {
            let error = signal.error(bank)?;
            row.errors.push(judge(&error));
            let decibels = |(n, e): (usize, &f64)| (n as f64, 20.0 * e.abs().max(1e-9).log10());
            curves.push(((*name).to_owned(), error.iter().enumerate().map(decibels).collect()));
        }
        figures.push(Figure {
            number,
            title,
            charts: vec![chart(title, "fast sample", "error, dB re 1", curves)],
            thesis: "The H-infinity design against sinc (23 taps) and separation, 200 fast samples.",
            found: "See table 5.1.".into(),
        });
    }
    Ok((figures, rows))
}

/// RMSE and largest error.
fn judge(error: &[f64]) -> (f64, f64) {
    let judged = &error[SETTLING..];
    let power = judged.iter().map(|e| e * e).sum::<f64>() / judged.len() as f64;
    (power.sqrt(), judged.iter().fold(0.0, |most, e| e.abs().max(most)))
}
