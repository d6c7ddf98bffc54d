//! Recordings from files, as `fuse` and `measure` of the command line read them.

use crate::bank::Bank;
use crate::errors::{refused, warn};
use crate::sources;
use hybank::io::{Coding, LostSamples, MAX_LOST, MultiReader, OfflineSamples, ReadOptions, Until};
use hybank::pipeline::matching;
use hybank::quantity::{self, FullScale};
use numpy::{Complex64, PyArray1};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;

/// Samples of a channel that are read at most: an array of more is 32 GiB.
const MOST: usize = 1 << 32;

/// How files are read, by the names of the command line.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Options {
    format: String,
    channels: Option<usize>,
    channel: Option<usize>,
    full_scale: Option<String>,
    interleaved: Option<usize>,
    lost: Option<PathBuf>,
    max_lost: Option<u64>,
    longest: bool,
}

/// The channels of recordings, a list of arrays, with what the files say: the rate of the recordings in
/// hertz, or with a bank that of its output; lowest and highest value of each file.
#[pyfunction]
pub(crate) fn read<'py>(
    py: Python<'py>,
    files: Vec<PathBuf>,
    options: Options,
    bank: Option<&Bound<'py, Bank>>,
) -> PyResult<Bound<'py, PyDict>> {
    let bank = bank.map(|bank| &*bank.get().bank);
    let layout = bank.map(hybank::bank::Bank::layout);
    let turns = match (options.interleaved, bank, &layout) {
        (Some(converters), Some(bank), Some(layout)) => {
            let turns = matching::interleaving(converters, &bank.delays_in_fast_periods(), layout);
            Some(turns.map_err(|problem| refused(format!("interleaved: {problem}")))?)
        }
        _ => None,
    };
    let coding: Coding = options.format.parse().map_err(|error| refused(format!("format: {error}")))?;
    let lost = options.lost.as_deref().map(LostSamples::read).transpose().map_err(refused)?;
    let usual = layout.as_ref().map_or(1, |layout| matching::channels_of_raw(layout, files.len()));
    let stated = bank.and_then(|bank| bank.spec.as_ref()).and_then(|spec| spec.full_scale);
    let read_options = ReadOptions {
        coding,
        channels: options.channels.unwrap_or(usual),
        only: options.channel.map(|channel| channel.saturating_sub(1)),
        full_scale: full_scale(options.full_scale.as_deref())?.or(stated),
        interleaving: turns.as_ref(),
        samples_per_frame: layout.as_ref().map_or(&[], |of| matching::samples_per_frame(of, files.len())),
        lost: lost.as_ref(),
        max_lost: options.max_lost.unwrap_or(MAX_LOST),
        until: if options.longest { Until::Longest } else { Until::Shortest },
        ..ReadOptions::files()
    };
    let read = py.detach(|| -> Result<_, String> {
        let started = MultiReader::start(&files, read_options, crossbeam_channel::never());
        let mut reader = started.map_err(|error| error.to_string())?.ok_or("interrupted")?;
        let rate = match bank {
            None => reader.headers().find_map(|(_, header)| header.rate),
            Some(bank) => {
                let fits = matching::check_channels(bank, "the bank", &reader);
                let rate = fits.and_then(|()| matching::output_rate(bank, &reader));
                Some(rate.map_err(|error| error.to_string())?)
            }
        };
        let rails: Vec<_> = reader.headers().map(|(_, header)| header.rails).collect();
        let whole = OfflineSamples::read_parts(&mut reader, MOST).map_err(|error| error.to_string())?;
        Ok((whole, reader.is_complex(), rate, rails, reader.warnings()))
    });
    let (whole, is_complex, rate, rails, warnings) = read.map_err(refused)?;
    warnings.iter().try_for_each(|warning| warn(py, warning, 3))?;
    let found = PyDict::new(py);
    found.set_item("channels", arrays(py, whole.channels, is_complex))?;
    found.set_item("rate", rate)?;
    found.set_item("rails", rails)?;
    Ok(found)
}

fn full_scale(given: Option<&str>) -> PyResult<Option<FullScale>> {
    let scale = given.map(quantity::full_scale).transpose();
    scale.map_err(|error| refused(format!("full_scale: {error}")))
}

/// An array for each channel; of complex samples both parts are one.
fn arrays(py: Python<'_>, channels: Vec<Vec<f64>>, is_complex: bool) -> Vec<Bound<'_, PyAny>> {
    if !is_complex {
        return channels.into_iter().map(|channel| PyArray1::from_vec(py, channel).into_any()).collect();
    }
    let both = |parts: &[Vec<f64>]| {
        let pairs = parts[0].iter().zip(&parts[1]);
        PyArray1::from_iter(py, pairs.map(|(&re, &im)| Complex64::new(re, im))).into_any()
    };
    channels.chunks_exact(2).map(both).collect()
}

/// For one recording in which the converters of a bank or a spec take turns: the channel, from 0, of each
/// converter in turn.
#[pyfunction]
pub(crate) fn turns(source: &Bound<'_, PyAny>, interleaved: usize) -> PyResult<Vec<usize>> {
    let (delays, layout) = match source.cast::<Bank>() {
        Ok(bank) => (bank.get().bank.delays_in_fast_periods(), bank.get().bank.layout()),
        Err(_) => sources::spec(source).map(|spec| (spec.delays_in_fast_periods(), spec.layout()))?,
    };
    let turns = matching::interleaving(interleaved, &delays, &layout);
    let turns = turns.map_err(|problem| refused(format!("interleaved: {problem}")))?;
    Ok(turns.channels().to_vec())
}
