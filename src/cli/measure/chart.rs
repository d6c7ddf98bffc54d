//! The spectrum of a recording with its spurs marked.

use super::super::capture_file::CaptureFile;
use super::Report;
use crate::measure::{Cause, Measurement, Settings, Spectrum, Spur};
use crate::plot::{Chart, Marks, Series};
use crate::units::{Decibels, Hertz};

/// Points of a curve; of several bins the largest is drawn.
const COLUMNS: usize = 1900;
/// Spurs that are marked.
const MOST_MARKS: usize = 24;
/// Decibels below the largest bin at which the picture ends.
const DEPTH: f64 = 180.0;

/// The chart of a report and its marks.
pub(super) fn chart(report: &Report, settings: &Settings, capture: &CaptureFile) -> (Chart, Vec<Marks>) {
    let own;
    let spectrum = match &report.measurement {
        Some(measured) => &measured.spectrum,
        None => {
            let finite: Vec<f64> =
                capture.samples.iter().map(|x| if x.is_finite() { *x } else { 0.0 }).collect();
            own = Spectrum::new(&finite, capture.rate, settings.window);
            &own
        }
    };
    let scale = Scale::of(spectrum, settings.full_scale);
    let mut series = vec![Series { label: report.file.clone(), points: scale.points(spectrum) }];
    if let Some(reference) = &report.reference {
        let points = scale.points(&reference.comparison.error_spectrum);
        series.push(Series { label: format!("error against {}", reference.file), points });
    }
    let marks = report.measurement.as_ref().map(|measured| scale.marks(measured)).unwrap_or_default();
    let chart = Chart {
        title: title(report),
        x_label: format!("frequency ({})", scale.unit),
        y_label: format!("dBFS (window: {:.2} bins of noise)", settings.window.noise_bandwidth()),
        series,
    };
    (chart, marks)
}

fn title(report: &Report) -> String {
    match (&report.measurement, &report.reference) {
        (Some(m), _) => {
            format!("SINAD {:.2} dB, ENOB {:.2} bits, SFDR {:.2} dBc", m.sinad.0, m.enob, m.sfdr.0)
        }
        (None, Some(reference)) => {
            format!("SNR {:.2} dB against {}", reference.comparison.snr.0, reference.file)
        }
        (None, None) => report.file.clone(),
    }
}

/// The axes of a picture.
struct Scale {
    unit: &'static str,
    /// Hertz per unit.
    hertz: f64,
    full_scale: f64,
    /// The lowest level that is drawn, dBFS.
    floor: f64,
}

impl Scale {
    fn of(spectrum: &Spectrum, full_scale: f64) -> Self {
        let end = spectrum.frequency(spectrum.amplitudes.len()).0;
        let units = [(1e9, "GHz"), (1e6, "MHz"), (1e3, "kHz")];
        let (hertz, unit) = units.into_iter().find(|(hertz, _)| end >= *hertz).unwrap_or((1.0, "Hz"));
        let largest = spectrum.amplitudes.iter().fold(0.0, |most: f64, a| most.max(*a));
        Self { unit, hertz, full_scale, floor: Decibels::of_amplitude(largest / full_scale).0 - DEPTH }
    }

    fn level(&self, amplitude: f64) -> f64 {
        Decibels::of_amplitude(amplitude / self.full_scale).0.max(self.floor)
    }

    /// The largest bin of each column.
    fn points(&self, spectrum: &Spectrum) -> Vec<(f64, f64)> {
        let point = |(frequency, amplitude): (Hertz, f64)| (frequency.0 / self.hertz, self.level(amplitude));
        spectrum.columns(COLUMNS).into_iter().map(point).collect()
    }

    /// The tones and the largest spurs above the noise, by cause.
    fn marks(&self, measured: &Measurement) -> Vec<Marks> {
        let tones = measured.tones.iter();
        let tones =
            tones.map(|tone| (tone.alias.0 / self.hertz, self.level(tone.amplitude.value), String::new()));
        let mut marks = vec![Marks { label: "tone".into(), points: tones.collect() }];
        for spur in measured.spurs.iter().filter(|spur| spur.above_noise).take(MOST_MARKS) {
            let point = (spur.frequency.0 / self.hertz, self.level(spur.amplitude), text(spur));
            let label = kind(spur);
            match marks.iter_mut().find(|marks| marks.label == label) {
                Some(marks) => marks.points.push(point),
                None => marks.push(Marks { label: label.into(), points: vec![point] }),
            }
        }
        marks
    }
}

fn kind(spur: &Spur) -> &'static str {
    match spur.causes.first() {
        Some(Cause::Offset { .. }) => "offset",
        Some(Cause::GainOrSkew { .. }) => "gain or skew",
        Some(Cause::Harmonic { .. }) => "harmonic",
        Some(Cause::HarmonicImage { .. }) => "harmonic, displaced",
        Some(Cause::Image { .. }) => "image",
        Some(Cause::Intermodulation { .. }) => "intermodulation",
        Some(Cause::Unknown) | None => "unknown",
    }
}

/// A short text beside a mark.
fn text(spur: &Spur) -> String {
    match spur.causes.first() {
        Some(Cause::Offset { k, of }) => format!("{k}/{of}"),
        Some(Cause::GainOrSkew { k, of, is_sum, .. }) => {
            format!("{k}/{of}{}f", if *is_sum { '+' } else { '-' })
        }
        Some(Cause::Harmonic { order, .. }) => format!("H{order}"),
        Some(Cause::HarmonicImage { order, k, of }) => format!("H{order} {k}/{of}"),
        Some(Cause::Image { order: 1, .. }) => "-f".into(),
        Some(Cause::Image { order, .. }) => format!("-H{order}"),
        _ => String::new(),
    }
}
