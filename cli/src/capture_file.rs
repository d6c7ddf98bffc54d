//! Recordings in memory, with what must be known about their format.

use super::capture_args::check_scale;
use super::file_kind::unreadable;
use super::print::{Failure, failed, failed_at, is_dash, name, warn};
use hybank::io::{MultiReader, OfflineError, OfflineSamples, ReadOptions};
use hybank::measure::{Spectrum, Window};
use hybank::messages::Quoted;
use hybank::units::Hertz;
use std::path::{Path, PathBuf};

/// Samples that a measurement reads at most: the spectra of more take several gigabytes.
pub(super) const MOST_MEASURED: usize = 1 << 26;

/// One channel of a recording.
#[derive(Debug, Clone)]
pub(super) struct CaptureFile {
    pub(super) samples: Vec<f64>,
    /// The imaginary parts of complex samples, as many; only of [`CaptureFile::read_any`].
    pub(super) imaginary: Option<Vec<f64>>,
    pub(super) rate: Hertz,
    /// Lowest and highest value of integers and codes; `None` for floats.
    pub(super) rails: Option<(f64, f64)>,
}

/// How a recording is read.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reading {
    /// Format and channel; a mono recording needs no channel.
    pub(super) options: ReadOptions<'static>,
    /// The rate, if the file states none.
    pub(super) rate: Option<Hertz>,
    /// Samples that are read at most.
    pub(super) most: usize,
}

impl Reading {
    /// Channel `channel` (from 1) of a file with a header and a full scale of its own.
    pub(super) fn channel(channel: Option<usize>, most: usize) -> Self {
        let only = channel.map(|channel| channel.saturating_sub(1));
        let options = ReadOptions { only, ..ReadOptions::files() };
        Self { options, rate: None, most }
    }
}

impl CaptureFile {
    /// Reads a recording of real samples; `-` is standard input.
    pub(super) fn read(path: &Path, reading: Reading) -> Result<Self, Failure> {
        Self::read_with(path, reading, OfflineSamples::read)
    }

    /// Reads a recording of real or complex samples; `-` is standard input.
    pub(super) fn read_any(path: &Path, reading: Reading) -> Result<Self, Failure> {
        Self::read_with(path, reading, OfflineSamples::read_parts)
    }

    fn read_with(
        path: &Path,
        reading: Reading,
        whole: fn(&mut MultiReader, usize) -> Result<OfflineSamples, OfflineError>,
    ) -> Result<Self, Failure> {
        let mut reader = start(&[path.to_owned()], reading.options)?;
        check_scale(reading.options.full_scale, &reader)?;
        let channels = reader.channels();
        if channels != 1 {
            let file = Quoted(name(path));
            return Err(Failure::Input(format!(
                "{file} has {channels} channels, and one is needed; give its number, --channel 1 to {channels}"
            )));
        }
        let header = reader.headers().next().map(|(_, header)| *header);
        let stated = header.and_then(|header| header.rate).filter(|rate| *rate > 0.0).map(Hertz);
        let rate = stated.or(reading.rate).ok_or_else(|| {
            let message = "it states no sample rate; `measure` takes it from --rate 48kHz, else give a recording that states it: \
                           WAV, or a table whose first column is `time`";
            failed_at(path, message)
        })?;
        let rails = header.and_then(|header| header.rails);
        let OfflineSamples { channels, is_cut } = whole(&mut reader, reading.most).map_err(unread)?;
        reader.warnings().iter().for_each(|warning| warn(&warning.to_string()));
        let mut parts = channels.into_iter();
        let (samples, imaginary) = (parts.next().unwrap_or_default(), parts.next());
        if samples.is_empty() {
            return Err(failed_at(path, "no samples (the length is zero)"));
        }
        if is_cut {
            warn(&format!("{}: only the first {} samples are used", Quoted(name(path)), samples.len()));
        }
        Ok(Self { samples, imaginary, rate, rails })
    }

    /// The spectrum; what is not finite counts as 0.
    pub(super) fn spectrum(&self, window: Window) -> Spectrum {
        let finite: Vec<f64> = self.samples.iter().map(|x| if x.is_finite() { *x } else { 0.0 }).collect();
        Spectrum::new(&finite, self.rate, window)
    }

    /// Refuses samples that are not finite.
    pub(super) fn finite(self, path: &Path) -> Result<Self, Failure> {
        match self.samples.iter().position(|x| !x.is_finite()) {
            Some(n) => {
                let value = self.samples[n];
                let problem =
                    format!("sample {n} is {value}; a source must be finite, repair the recording first");
                Err(failed_at(path, problem))
            }
            None => Ok(self),
        }
    }

    /// Leaves out `skip` samples at either end.
    pub(super) fn trimmed(mut self, path: &Path, skip: usize) -> Result<Self, Failure> {
        let count = self.samples.len();
        if 2 * skip >= count {
            return Err(Failure::Usage(format!(
                "--skip {skip} leaves nothing of {} with {count} samples; skip fewer than {}",
                Quoted(name(path)),
                count.div_ceil(2)
            )));
        }
        for part in [Some(&mut self.samples), self.imaginary.as_mut()].into_iter().flatten() {
            part.truncate(count - skip);
            part.drain(..skip);
        }
        Ok(self)
    }
}

/// A reader of the headers of all inputs.
pub(super) fn start(inputs: &[PathBuf], options: ReadOptions<'_>) -> Result<MultiReader, Failure> {
    MultiReader::start(inputs, options).map_err(unreadable)
}

/// Why samples could not be read.
pub(super) fn unread(error: OfflineError) -> Failure {
    match error {
        OfflineError::Io(error) => failed(error),
        error => failed(error),
    }
}

/// Refuses what cannot be read twice.
pub(super) fn check_files_on_disk(paths: &[PathBuf], option: &str) -> Result<(), Failure> {
    match paths.iter().find(|path| is_dash(path) || path.metadata().is_ok_and(|found| !found.is_file())) {
        None => Ok(()),
        Some(path) => Err(Failure::Usage(format!(
            "{option} reads inputs and output once more, which {} cannot give; use files",
            Quoted(name(path))
        ))),
    }
}
