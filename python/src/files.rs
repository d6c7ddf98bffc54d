//! Recordings from files, as `fuse` and `measure` of the command line read them.

use crate::bank::Bank;
use crate::errors::{refused, warn};
use crate::sources;
use hybank::bank::{self, FrameLayout};
use hybank::io::{
    Coding, LostSamples, MAX_LOST, MultiReader, OfflineSamples, ReadOptions, StreamHeader, TimeInterleaving,
    Until, is_same_rate,
};
use hybank::messages::{Number, Quoted};
use hybank::pipeline::matching::{self, InputMismatch};
use hybank::quantity::{self, FullScale};
use hybank::spec::Spec;
use hybank::units::FastPeriods;
use numpy::{Complex64, PyArray1};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;
use std::sync::Arc;

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

/// What recordings are for: a bank, or a spec.
struct Wanted {
    bank: Option<Arc<bank::Bank>>,
    /// Of anything but a bank.
    spec: Option<Spec>,
    delays: Vec<FastPeriods>,
    layout: FrameLayout,
}

impl Wanted {
    fn new(source: &Bound<'_, PyAny>) -> PyResult<Self> {
        if let Ok(bank) = source.cast::<Bank>() {
            let bank = Arc::clone(&bank.get().bank);
            let (delays, layout) = (bank.delays_in_fast_periods(), bank.layout());
            return Ok(Self { bank: Some(bank), spec: None, delays, layout });
        }
        let spec = sources::spec(source)?;
        let (delays, layout) = (spec.delays_in_fast_periods(), spec.layout());
        Ok(Self { bank: None, spec: Some(spec), delays, layout })
    }

    fn turns(&self, converters: usize) -> PyResult<TimeInterleaving> {
        let turns = matching::interleaving(converters, &self.delays, &self.layout);
        turns.map_err(|problem| refused(format!("interleaved: {problem}")))
    }

    fn full_scale(&self) -> Option<FullScale> {
        let of_bank = self.bank.as_ref().and_then(|bank| bank.spec.as_ref());
        of_bank.or(self.spec.as_ref()).and_then(|spec| spec.full_scale)
    }

    /// The rate of the output of a bank, in hertz, if the recordings fit.
    fn check(&self, reader: &MultiReader) -> Result<Option<f64>, InputMismatch> {
        if let Some(spec) = &self.spec {
            matching::check_rate(spec, reader)?;
        }
        let Some(bank) = &self.bank else { return Ok(None) };
        matching::check_channels(bank, "the bank", reader)?;
        matching::output_rate(bank, reader).map(Some)
    }
}

/// The channels of recordings, a list of arrays, with what the files say: the rate of the recordings in
/// hertz, and that of the output of a bank. They are for a bank or a spec if one is given.
#[pyfunction]
pub(crate) fn read<'py>(
    py: Python<'py>,
    files: Vec<PathBuf>,
    options: Options,
    source: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let wanted = source.map(Wanted::new).transpose()?;
    let turns = options.interleaved.zip(wanted.as_ref());
    let turns = turns.map(|(converters, wanted)| wanted.turns(converters)).transpose()?;
    let coding: Coding = options.format.parse().map_err(|error| refused(format!("format: {error}")))?;
    let lost = options.lost.as_deref().map(LostSamples::read).transpose().map_err(refused)?;
    let layout = wanted.as_ref().map(|wanted| &wanted.layout);
    let usual = layout.map_or(1, |layout| matching::channels_of_raw(layout, files.len()));
    let read_options = ReadOptions {
        coding,
        channels: options.channels.unwrap_or(usual),
        only: options.channel.map(|channel| channel.saturating_sub(1)),
        full_scale: full_scale(options.full_scale.as_deref())?
            .or(wanted.as_ref().and_then(Wanted::full_scale)),
        interleaving: turns.as_ref(),
        samples_per_frame: layout.map_or(&[], |of| matching::samples_per_frame(of, files.len())),
        lost: lost.as_ref(),
        max_lost: options.max_lost.unwrap_or(MAX_LOST),
        until: if options.longest { Until::Longest } else { Until::Shortest },
        ..ReadOptions::files()
    };
    let read = py.detach(|| -> Result<_, String> {
        let mut reader = MultiReader::start(&files, read_options).map_err(|error| error.to_string())?;
        let rate = reader.headers().find_map(|(_, header)| header.rate);
        let other = wanted.is_none().then(|| other_rate(&reader)).flatten();
        let output_rate = wanted.as_ref().map(|wanted| wanted.check(&reader)).transpose();
        let output_rate = output_rate.map_err(|error| error.to_string())?.flatten();
        let whole = OfflineSamples::read_parts(&mut reader, MOST).map_err(|error| error.to_string())?;
        Ok((whole, reader.is_complex(), rate, output_rate, reader.warnings(), other))
    });
    let (whole, is_complex, rate, output_rate, warnings, other) = read.map_err(refused)?;
    other.iter().try_for_each(|text| warn(py, text))?;
    warnings.iter().try_for_each(|warning| warn(py, warning))?;
    let found = PyDict::new(py);
    found.set_item("channels", arrays(py, whole.channels, is_complex))?;
    found.set_item("rate", rate)?;
    found.set_item("output_rate", output_rate)?;
    Ok(found)
}

/// Names the first input of another rate than that of the inputs before it; no bank is there to say whether
/// it takes both.
fn other_rate(reader: &MultiReader) -> Option<String> {
    let mut rated = reader.headers().filter_map(|(name, header)| Some((name, header, header.rate?)));
    let (first, of_first, wanted): (_, &StreamHeader, _) = rated.next()?;
    let error = |header: &StreamHeader| header.rate_error.max(of_first.rate_error);
    let (name, _, rate) = rated.find(|&(_, header, rate)| !is_same_rate(rate, wanted, error(header)))?;
    Some(format!(
        "{}: the sample rate is {} Hz, but {} has {} Hz; give bank=, which says whether the bank takes both",
        Quoted(name),
        Number(rate),
        Quoted(first),
        Number(wanted)
    ))
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
    Ok(Wanted::new(source)?.turns(interleaved)?.channels().to_vec())
}

/// The samples of a frame of a bank or a spec.
#[pyfunction]
pub(crate) fn frame_samples(source: &Bound<'_, PyAny>) -> PyResult<usize> {
    Wanted::new(source).map(|wanted| wanted.layout.count())
}
