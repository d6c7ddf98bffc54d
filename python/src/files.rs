//! Recordings from files, as `fuse` and `measure` of the command line read them.

use crate::arrays::{ArrayShape, Held};
use crate::bank::Bank;
use crate::errors::{capture_error, io_error, refused, warn};
use crate::formats;
use crate::sources;
use hybank::captures::{CaptureError, Captures, ChannelSamples, Converters, FileFormat};
use hybank::io::table::{TableOptions, TimeColumn};
use hybank::io::{LostSamples, MAX_LOST, MultiReader, ReadOptions, TimeInterleaving, Until};
use hybank::pipeline::matching;
use numpy::{Complex64, PyArray1};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;
use std::str::FromStr;

/// Samples of a channel that are read at most: an array of more is 32 GiB.
const MOST: usize = 1 << 32;

/// How files are read, by the names of the command line.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct CaptureOptions<'py> {
    format: String,
    channels: Option<usize>,
    channel: Option<usize>,
    iq: bool,
    full_scale: Option<Bound<'py, PyAny>>,
    interleaved: Option<usize>,
    lost: Option<PathBuf>,
    max_lost: Option<u64>,
    longest: bool,
    skip_lines: u64,
    columns: Vec<String>,
    time_column: Option<String>,
    delimiter: Option<String>,
    decimal: Option<String>,
}

/// What `work` makes of the converters of a bank, or of a spec.
fn with_converters<T>(
    source: &Bound<'_, PyAny>,
    work: impl FnOnce(&Converters<'_>) -> PyResult<T>,
) -> PyResult<T> {
    match source.cast::<Bank>() {
        Ok(bank) => work(&Converters::from(&*bank.get().bank)),
        Err(_) => work(&Converters::from(&sources::spec(source)?)),
    }
}

fn in_turn(of: &Converters<'_>, converters: usize) -> PyResult<TimeInterleaving> {
    of.interleaving(converters).map_err(|problem| refused(format!("interleaved: {problem}")))
}

/// The channels of recordings, a list of arrays, with what the files say: the rate of the recordings in
/// hertz, and that of the output of a bank. They are for a bank or a spec if one is given.
#[pyfunction]
pub(crate) fn read<'py>(
    py: Python<'py>,
    files: Vec<PathBuf>,
    options: CaptureOptions<'py>,
    source: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    match source {
        Some(source) => {
            with_converters(source, |converters| read_for(py, &files, &options, Some(converters)))
        }
        None => read_for(py, &files, &options, None),
    }
}

fn read_for<'py>(
    py: Python<'py>,
    files: &[PathBuf],
    options: &CaptureOptions,
    converters: Option<&Converters<'_>>,
) -> PyResult<Bound<'py, PyDict>> {
    let turns = options.interleaved.zip(converters);
    let turns = turns.map(|(count, converters)| in_turn(converters, count)).transpose()?;
    let lost = options.lost.as_deref().map(LostSamples::read).transpose().map_err(io_error)?;
    let format = options.format()?;
    let own = match converters {
        Some(converters) => converters.options(format, files.len(), turns.as_ref()),
        None => format.options(files.len(), 1),
    };
    let read_options = ReadOptions {
        lost: lost.as_ref(),
        max_lost: options.max_lost.unwrap_or(MAX_LOST),
        until: if options.longest { Until::Longest } else { Until::Shortest },
        ..own
    };
    let read = py.detach(|| -> Result<_, CaptureError> {
        let mut reader = MultiReader::start(files, read_options, &mut |_| {})?;
        let output_rate = converters.map(|converters| converters.check("the bank", &reader));
        let output_rate = output_rate.transpose()?.flatten();
        // No bank is there to say whether it takes all rates.
        let other = if converters.is_none() { matching::common_rate(reader.headers()).err() } else { None };
        Ok((Captures::read(&mut reader, MOST)?, output_rate, reader.warnings(), other))
    });
    let (captures, output_rate, warnings, other) = read.map_err(capture_error)?;
    let unequal = other.map(|mismatch| format!("{mismatch}; give bank=, which says whether it takes both"));
    unequal.iter().try_for_each(|text| warn(py, text))?;
    warnings.iter().try_for_each(|warning| warn(py, warning))?;
    let found = PyDict::new(py);
    found.set_item("rate", captures.rate.map(|rate| rate.0))?;
    found.set_item("output_rate", output_rate)?;
    let arrays: Vec<_> = captures.channels.into_iter().map(|channel| array(py, channel)).collect();
    found.set_item("channels", arrays)?;
    Ok(found)
}

impl CaptureOptions<'_> {
    fn format(&self) -> PyResult<FileFormat> {
        Ok(FileFormat {
            coding: self.format.parse().map_err(|error| refused(format!("format: {error}")))?,
            channels: self.channels,
            only: self.channel.map(|channel| channel.saturating_sub(1)),
            is_iq: self.iq,
            full_scale: formats::full_scale(self.full_scale.as_ref())?,
            table: self.table()?,
        })
    }
}

impl CaptureOptions<'_> {
    fn table(&self) -> PyResult<TableOptions> {
        let columns = self.columns.iter().map(|column| parsed("columns", column));
        let time = self.time_column.as_deref().map(|column| parsed("time_column", column)).transpose()?;
        Ok(TableOptions {
            skip_lines: self.skip_lines,
            columns: columns.collect::<PyResult<_>>()?,
            time: time.unwrap_or(TimeColumn::Found),
            delimiter: self.delimiter.as_deref().map(|text| parsed("delimiter", text)).transpose()?,
            decimal: self.decimal.as_deref().map(|text| parsed("decimal", text)).transpose()?,
            ..TableOptions::default()
        })
    }
}

/// What the text given as `name` means.
fn parsed<T: FromStr<Err = String>>(name: &str, text: &str) -> PyResult<T> {
    text.parse().map_err(|problem| refused(format!("{name}: {text:?}: {problem}")))
}

/// Of complex samples both parts are one.
fn array(py: Python<'_>, channel: ChannelSamples) -> Bound<'_, PyAny> {
    let Some(imaginary) = channel.imaginary else {
        return PyArray1::from_vec(py, channel.samples).into_any();
    };
    let pairs = channel.samples.iter().zip(&imaginary);
    PyArray1::from_iter(py, pairs.map(|(&re, &im)| Complex64::new(re, im))).into_any()
}

/// For one recording in which the converters of a bank or a spec take turns: the channel, from 0, of each
/// converter in turn.
#[pyfunction]
pub(crate) fn turns(source: &Bound<'_, PyAny>, interleaved: usize) -> PyResult<Vec<usize>> {
    with_converters(source, |converters| Ok(in_turn(converters, interleaved)?.channels().to_vec()))
}

/// The samples of each channel of an array as numbers of full scale 1.
#[pyfunction]
pub(crate) fn numbers<'py>(
    x: &Bound<'py, PyAny>,
    source: &Bound<'py, PyAny>,
    axis: isize,
    full_scale: Option<&Bound<'py, PyAny>>,
) -> PyResult<Vec<Vec<f64>>> {
    let given = formats::full_scale(full_scale)?;
    let (scale, channels) = with_converters(source, |all| Ok((all.scale(given), all.layout().count())))?;
    let captures = Held::new(x, ArrayShape { axis, channels, scale })?.captures()?;
    if captures.channels.iter().any(|channel| channel.imaginary.is_some()) {
        return Err(refused("complex samples; give the real or the imaginary parts for a page"));
    }
    Ok(captures.channels.into_iter().map(|channel| channel.samples).collect())
}

/// The samples of a frame of a bank or a spec.
#[pyfunction]
pub(crate) fn frame_samples(source: &Bound<'_, PyAny>) -> PyResult<usize> {
    with_converters(source, |converters| Ok(converters.layout().count()))
}
