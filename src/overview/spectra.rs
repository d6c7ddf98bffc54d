//! The spectra of recordings of one signal.

use crate::measure::{Spectrum, Window};
use crate::plot::{Chart, Series};
use crate::quantity::scale_of;
use crate::units::{Decibels, Hertz};

/// Points of a curve; of several bins the largest is drawn.
const COLUMNS: usize = 800;
/// Decibels below the largest bin at which the picture ends.
const DEPTH: f64 = 160.0;

/// The amplitude spectra of recordings of the rate `rate`, each with its name.
pub fn spectra(rate: Hertz, recordings: &[(&str, &[f64])]) -> Chart {
    let spectrum = |&(label, x): &(&str, &[f64])| (label.to_owned(), Spectrum::new(x, rate, Window::Bh7));
    let spectra: Vec<_> = recordings.iter().map(spectrum).collect();
    let largest = spectra.iter().flat_map(|(_, spectrum)| &spectrum.amplitudes);
    let floor = Decibels::of_amplitude(largest.fold(f64::MIN_POSITIVE, |most, a| most.max(*a))).0 - DEPTH;
    let (factor, unit) = scale_of(0.5 * rate.0, "Hz");
    let point = |(frequency, amplitude): (Hertz, f64)| {
        (frequency.0 * factor, Decibels::of_amplitude(amplitude).0.max(floor))
    };
    let series = |(label, spectrum): (String, Spectrum)| Series {
        label,
        points: spectrum.columns(COLUMNS).into_iter().map(point).collect(),
    };
    Chart {
        title: "Spectra of the captures".into(),
        x_label: format!("frequency, {unit}"),
        y_label: "amplitude, dBFS".into(),
        series: spectra.into_iter().map(series).collect(),
        ..Chart::default()
    }
}
