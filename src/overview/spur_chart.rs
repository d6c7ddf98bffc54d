//! The spectra of recordings, of measured ones with their spurs marked.

use crate::measure::{Cause, Comparison, Measurement, RecordSpectrum, Settings, Spur, Window};
use crate::plot::{Chart, Curves, Marks, Series};
use crate::quantity::scale_of;
use crate::units::{Decibels, Hertz};

/// Points of a curve; of several bins the largest is drawn.
const COLUMNS: usize = 1900;
/// Spurs of a recording that are marked.
const MOST_MARKS: usize = 24;
/// Decibels below the largest bin at which the picture ends.
const DEPTH_DB: f64 = 180.0;

/// A recording whose spectrum is drawn.
#[derive(Debug, Clone, Copy)]
pub struct DrawnRecording<'a> {
    /// Its name.
    pub label: &'a str,
    /// Its figures, if it was measured; their spectrum is drawn.
    pub measurement: Option<&'a Measurement>,
    /// A comparison, and the name of the reference; the spectrum of the error is drawn too.
    pub comparison: Option<(&'a str, &'a Comparison)>,
}

/// The chart of a recording, with marks at its spurs. `spectrum` is that of the recording, if it was not
/// measured.
pub fn spur_chart(
    drawn: DrawnRecording<'_>,
    settings: &Settings,
    spectrum: impl FnOnce() -> RecordSpectrum,
) -> Chart {
    let own;
    let spectrum = match drawn.measurement {
        Some(measured) => &measured.spectrum,
        None => {
            own = spectrum();
            &own
        }
    };
    let scale = Scale::of([spectrum], settings.full_scale);
    let mut series = vec![Series { label: drawn.label.to_owned(), points: scale.points(spectrum) }];
    if let Some((reference, comparison)) = drawn.comparison {
        let points = scale.points(&comparison.error_spectrum);
        series.push(Series { label: format!("error against {reference}"), points });
    }
    let marks = drawn.measurement.map(|measured| scale.marks(measured, false, &|_| true)).unwrap_or_default();
    Chart { marks, ..scale.chart(title(drawn), settings.window, series) }
}

fn title(drawn: DrawnRecording<'_>) -> String {
    match (drawn.measurement, drawn.comparison) {
        (Some(m), _) => {
            format!("SINAD {:.2} dB, ENOB {:.2} bits, SFDR {:.2} dBc", m.sinad.0, m.enob, m.sfdr.0)
        }
        (None, Some((reference, comparison))) => {
            format!("SNR {:.2} dB against {reference}", comparison.snr.0)
        }
        (None, None) => drawn.label.to_owned(),
    }
}

/// Two measurements of one signal over one axis: the spurs of the first one are rings, those of the second
/// one discs, and each cause has one colour. A spur that both have is named once.
pub fn before_after(before: &Measurement, after: &Measurement) -> Chart {
    let scale = Scale::of([&before.spectrum, &after.spectrum], after.full_scale);
    let series = [("interleaved (rings)", before), ("fused (discs)", after)];
    let series = series
        .map(|(label, measured)| Series { label: label.into(), points: scale.points(&measured.spectrum) });
    let named: Vec<&Spur> = marked(before).collect();
    let is_new = |spur: &Spur| !named.iter().any(|other| other.causes == spur.causes);
    let mut marks = scale.marks(before, true, &|_| true);
    marks.extend(scale.marks(after, false, &is_new));
    let title = format!(
        "SFDR {:.1} -> {:.1} dBc, SINAD {:.1} -> {:.1} dB",
        before.sfdr.0, after.sfdr.0, before.sinad.0, after.sinad.0
    );
    Chart { marks, ..scale.chart(title, after.window, series.into()) }
}

/// The spectra of recordings of the rate `rate`, each with its name.
pub fn spectra(rate: Hertz, recordings: &[(&str, &[f64])]) -> Chart {
    let window = Window::Bh7;
    let spectra: Vec<_> = recordings.iter().map(|(_, x)| RecordSpectrum::new(x, rate, window)).collect();
    let scale = Scale::of(&spectra, 1.0);
    let series = recordings.iter().zip(&spectra);
    let series = series.map(|(&(label, _), of)| Series { label: label.into(), points: scale.points(of) });
    scale.chart("Spectra of the captures".into(), window, series.collect())
}

/// The spurs of a recording that are marked: those above the noise, and the worst one of interleaving.
fn marked(measured: &Measurement) -> impl Iterator<Item = &Spur> {
    let worst = measured.worst_interleaving();
    let is_marked = move |spur: &&Spur| spur.above_noise || worst == Some(*spur);
    measured.spurs.iter().filter(is_marked).take(MOST_MARKS)
}

/// The axes of a picture.
struct Scale {
    unit: String,
    /// Units per hertz.
    factor: f64,
    full_scale: f64,
    /// The lowest level that is drawn, dBFS.
    floor: f64,
}

impl Scale {
    fn of<'a>(spectra: impl IntoIterator<Item = &'a RecordSpectrum> + Clone, full_scale: f64) -> Self {
        let ends = spectra.clone().into_iter().map(|of| of.frequency(of.amplitudes.len()).0);
        let end = ends.fold(0.0, f64::max);
        // Below 1 kHz the unit is hertz.
        let (factor, unit) = if end < 1e3 { (1.0, "Hz".to_owned()) } else { scale_of(end, "Hz") };
        let all = spectra.into_iter().flat_map(|spectrum| &spectrum.amplitudes);
        let largest = all.fold(0.0, |most: f64, a| most.max(*a));
        Self { unit, factor, full_scale, floor: Decibels::of_amplitude(largest / full_scale).0 - DEPTH_DB }
    }

    fn chart(&self, title: String, window: Window, series: Vec<Series>) -> Chart {
        let y_label = format!("dBFS (window: {:.2} bins of noise)", window.noise_bandwidth());
        let chart = Chart::lines(title, format!("frequency ({})", self.unit), y_label, series);
        Chart { curves: Curves::Overlaid, ..chart }
    }

    fn level(&self, amplitude: f64) -> f64 {
        Decibels::of_amplitude(amplitude / self.full_scale).0.max(self.floor)
    }

    /// The largest bin of each column.
    fn points(&self, spectrum: &RecordSpectrum) -> Vec<(f64, f64)> {
        let point = |(frequency, amplitude): (Hertz, f64)| (frequency.0 * self.factor, self.level(amplitude));
        spectrum.columns(COLUMNS).into_iter().map(point).collect()
    }

    /// The tones and the largest spurs, by cause; those that are `named` have a text.
    fn marks(&self, measured: &Measurement, are_rings: bool, named: &dyn Fn(&Spur) -> bool) -> Vec<Marks> {
        let marks = |(label, colour), points| Marks { label, colour: Some(colour), are_rings, points };
        let tones = measured.tones.iter();
        let tones =
            tones.map(|tone| (tone.alias.0 * self.factor, self.level(tone.amplitude.value), String::new()));
        let mut all = vec![marks(("tone".to_owned(), [0, 0, 0]), tones.collect())];
        for spur in marked(measured) {
            let text = if named(spur) { short(spur) } else { String::new() };
            let point = (spur.frequency.0 * self.factor, self.level(spur.amplitude), text);
            let (label, colour) = kind(spur);
            match all.iter_mut().find(|marks| marks.label == label) {
                Some(marks) => marks.points.push(point),
                None => all.push(marks((label.to_owned(), colour), vec![point])),
            }
        }
        all
    }
}

/// The cause in the legend, and its colour, which no curve has.
fn kind(spur: &Spur) -> (&'static str, [u8; 3]) {
    match spur.causes.first() {
        Some(Cause::Offset { .. }) => ("offset", [255, 127, 14]),
        Some(Cause::GainOrSkew { .. }) => ("gain or skew", [148, 103, 189]),
        Some(Cause::Harmonic { .. }) => ("harmonic", [44, 160, 44]),
        Some(Cause::HarmonicImage { .. }) => ("harmonic, displaced", [140, 86, 75]),
        Some(Cause::Image { .. }) => ("image", [227, 119, 194]),
        Some(Cause::Intermodulation { .. }) => ("intermodulation", [23, 190, 207]),
        Some(Cause::Unknown | Cause::Noise) | None => ("unknown", [127, 127, 127]),
    }
}

/// A short text beside a mark.
fn short(spur: &Spur) -> String {
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
