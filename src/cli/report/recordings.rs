//! The spectra of captures, plainly interleaved and fused.

use super::super::capture_file::Whole;
use super::super::match_bank::{check_channels, output_rate};
use super::Failure;
use super::page::Figure;
use crate::bank::Bank;
use crate::io::{MultiReader, ReadOptions};
use crate::measure::{Spectrum, Window};
use crate::plot::{Chart, Series};
use crate::quantity::scale_of;
use crate::runtime::{Options, Precision, Stream};
use crate::simulate::interleaved;
use crate::units::{Decibels, Hertz};
use std::path::{Path, PathBuf};

/// Frames that are shown; more would only make the lines denser.
const MOST_FRAMES: usize = 1 << 20;
/// Frames that the spectra need.
const LEAST_FRAMES: usize = 16;
/// Points of a curve; of several bins the largest is drawn.
const COLUMNS: usize = 800;
/// Decibels below the largest bin at which the picture ends.
const DEPTH: f64 = 160.0;

/// Both recordings at the fast rate.
pub(super) struct Spectra {
    rate: Hertz,
    interleaved: Vec<f64>,
    fused: Vec<f64>,
}

impl Spectra {
    /// Reads the captures and fuses them.
    pub(super) fn read(bank: &Bank, path: &Path, inputs: &[PathBuf]) -> Result<Self, Failure> {
        let stop = crossbeam_channel::never();
        let reader = MultiReader::start(inputs, ReadOptions::files(), stop).map_err(Failure::input)?;
        let mut reader = reader.ok_or_else(|| Failure::input("interrupted; nothing was written"))?;
        check_channels(bank, path, &reader)?;
        let rate = Hertz(output_rate(bank, &reader)?);
        let mut channels = Whole::read(&mut reader, MOST_FRAMES)?.channels;
        let frames = channels.iter().map(Vec::len).min().unwrap_or(0);
        if frames < LEAST_FRAMES {
            let message = format!("the captures have {frames} frames; a spectrum needs {LEAST_FRAMES}");
            return Err(Failure::Input(message));
        }
        // What was lost is a zero, as `fuse` has it without --gaps.
        channels.iter_mut().flatten().filter(|x| !x.is_finite()).for_each(|x| *x = 0.0);
        let fused = fuse(bank, &channels, frames)?;
        let interleaved = interleaved(&bank.delays_in_fast_periods(), bank.ratio, 0, &channels);
        Ok(Self { rate, interleaved, fused })
    }

    /// Both spectra in one chart.
    pub(super) fn figure(&self) -> Result<Figure, Failure> {
        let spectra = [&self.interleaved, &self.fused].map(|x| Spectrum::new(x, self.rate, Window::Bh7));
        let all = spectra.iter().flat_map(|spectrum| &spectrum.amplitudes);
        let floor = Decibels::of_amplitude(all.fold(f64::MIN_POSITIVE, |most, a| most.max(*a))).0 - DEPTH;
        let (factor, unit) = scale_of(0.5 * self.rate.0, "Hz");
        let series = |(label, spectrum): (&str, &Spectrum)| Series {
            label: label.to_owned(),
            points: points(spectrum, factor, floor),
        };
        let chart = Chart {
            title: "The captures".into(),
            x_label: format!("frequency, {unit}"),
            y_label: "amplitude, dB of full scale".into(),
            series: ["plain interleaving", "fused"].into_iter().zip(&spectra).map(series).collect(),
        };
        let caption = "The same captures, interleaved as if they were taken in turn, and fused by the bank. Lines that \
                       only the first has are images of the signal: errors of the converters' instants and filters.";
        Figure::new(&chart, caption).map_err(Failure::input)
    }
}

/// The output of the bank without its latency.
fn fuse(bank: &Bank, channels: &[Vec<f64>], frames: usize) -> Result<Vec<f64>, Failure> {
    let options = Options { precision: Precision::Double, ..Options::default() };
    let mut stream = Stream::new(&bank.plan(options).map_err(Failure::input)?);
    let samples: Vec<f64> =
        (0..frames).flat_map(|k| channels.iter().map(move |channel| channel[k])).collect();
    let mut fast = vec![0.0; frames * bank.ratio];
    stream.process(&samples, &mut fast).map_err(Failure::input)?;
    fast.drain(..bank.latency.min(fast.len() / 2));
    Ok(fast)
}

/// The largest bin of each column.
fn points(spectrum: &Spectrum, factor: f64, floor: f64) -> Vec<(f64, f64)> {
    let width = spectrum.amplitudes.len().div_ceil(COLUMNS).max(1);
    let point = |(column, bins): (usize, &[f64])| {
        let largest = bins.iter().fold(0.0, |most: f64, a| most.max(*a));
        let level = Decibels::of_amplitude(largest).0.max(floor);
        (spectrum.frequency(column * width).0 * factor, level)
    };
    spectrum.amplitudes.chunks(width).enumerate().map(point).collect()
}
