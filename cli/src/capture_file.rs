//! Recordings in memory, with what must be known about their format.

use super::file_kind::unreadable;
use super::print::{Failure, failed, failed_at, is_dash, name, warn};
use hybank::captures::{CaptureError, Captures, ChannelSamples};
use hybank::io::{MultiReader, ReadOptions, check_real};
use hybank::messages::Quoted;
use hybank::units::Hertz;
use std::path::{Path, PathBuf};

/// Samples that a measurement reads at most: the spectra of more take several gigabytes.
pub(super) const MOST_MEASURED: usize = 1 << 26;

/// A recording of one channel, whose rate is known.
#[derive(Debug, Clone)]
pub(super) struct CaptureFile {
    pub(super) channel: ChannelSamples,
    pub(super) rate: Hertz,
}

/// How a recording is read.
#[derive(Debug, Clone)]
pub(super) struct ReadingRules {
    /// Format and channel; a mono recording needs no channel.
    pub(super) options: ReadOptions<'static>,
    /// The rate, if the file states none.
    pub(super) rate: Option<Hertz>,
    /// Samples that are read at most.
    pub(super) most: usize,
    pub(super) takes_complex: bool,
}

impl ReadingRules {
    /// Channel `channel` (from 1) of a file with a header and a full scale of its own.
    pub(super) fn channel(channel: Option<usize>, most: usize) -> Self {
        let only = channel.map(|channel| channel.saturating_sub(1));
        let options = ReadOptions { only, ..ReadOptions::files() };
        Self { options, rate: None, most, takes_complex: false }
    }
}

impl CaptureFile {
    /// Reads a recording; `-` is standard input.
    pub(super) fn read(path: &Path, reading: ReadingRules) -> Result<Self, Failure> {
        let mut reader = start(&[path.to_owned()], reading.options)?;
        Captures::check_mono(&reader).map_err(unread)?;
        if !reading.takes_complex {
            check_real(&reader).map_err(failed)?;
        }
        let Captures { channels, rate, is_cut, .. } =
            Captures::read(&mut reader, reading.most).map_err(unread)?;
        let rate = rate.or(reading.rate).ok_or_else(|| {
            let message = "it states no sample rate; `measure` takes it from --rate 48kHz, else give a recording that states it: \
                           WAV, or a table whose first column is `time`";
            failed_at(path, message)
        })?;
        reader.warnings().iter().for_each(|warning| warn(&warning.to_string()));
        let channel = channels.into_iter().next().unwrap_or_default();
        let count = channel.samples.len();
        if count == 0 {
            return Err(failed_at(path, "no samples (the length is zero)"));
        }
        if is_cut {
            warn(&format!("{}: only the first {count} samples are used", Quoted(name(path))));
        }
        Ok(Self { channel, rate })
    }

    /// The real samples, which are finite, for a signal of a simulation or a calibration.
    pub(super) fn finite(self, path: &Path) -> Result<Vec<f64>, Failure> {
        let finite = self.channel.finite().map_err(|error| failed_at(path, error))?;
        Ok(finite.samples)
    }

    /// Leaves out `skip` samples at either end.
    pub(super) fn trimmed(self, path: &Path, skip: usize) -> Result<Self, Failure> {
        let trimmed = self.channel.trimmed(skip);
        let channel =
            trimmed.map_err(|error| Failure::Usage(format!("--skip: {}: {error}", Quoted(name(path)))))?;
        Ok(Self { channel, ..self })
    }
}

/// A reader of the headers of all inputs.
pub(super) fn start(inputs: &[PathBuf], options: ReadOptions<'_>) -> Result<MultiReader, Failure> {
    MultiReader::start(inputs, options, &mut |_| {}).map_err(unreadable)
}

/// Why samples could not be read.
pub(super) fn unread(error: CaptureError) -> Failure {
    match error {
        CaptureError::NotMono { channels, .. } => {
            Failure::Input(format!("{error}: --channel 1 to {channels}"))
        }
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
