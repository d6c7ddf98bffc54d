//! Destinations of output samples.

use super::PipelineError;
use super::peak::peak;
use crate::files::{AtomicFile, commit_all};
use crate::io::{IoError, OutputNotes, PcmFormat, SampleWriter};
use std::io::Write;

/// Output samples with their mask.
#[derive(Debug, Clone, Copy)]
pub struct Block<'a> {
    /// Encoded samples.
    pub samples: &'a [u8],
    /// One byte per sample, 1 if a missing input affects it, else 0; `None` if gaps are not filled.
    pub mask: Option<&'a [u8]>,
}

/// Takes output samples.
pub trait Output {
    /// Takes the next samples.
    ///
    /// # Errors
    /// The errors of the destination.
    fn write(&mut self, block: Block<'_>) -> Result<(), IoError>;

    /// Takes a line for the log of a [`Retuner`](super::Retuner); by default it is dropped.
    ///
    /// # Errors
    /// The errors of the destination.
    fn log(&mut self, _line: &str) -> Result<(), IoError> {
        Ok(())
    }
}

/// Samples to a file or standard output, the mask to a file of its own. [`FileOutputs::finish`] makes all
/// files appear together; before it no file is visible.
pub struct FileOutputs {
    samples: SampleWriter,
    mask: Option<AtomicFile>,
    log: Option<AtomicFile>,
    /// The format of samples whose largest magnitude is wanted, and that magnitude.
    peak: Option<(PcmFormat, f64)>,
}

impl FileOutputs {
    /// Writes samples to `samples`, and the mask to `mask` if given.
    pub fn new(samples: SampleWriter, mask: Option<AtomicFile>) -> Self {
        Self { samples, mask, log: None, peak: None }
    }

    /// What is to accompany the samples.
    pub fn annotate(&mut self, notes: OutputNotes) {
        self.samples.annotate(notes);
    }

    /// The same outputs with a log beside them.
    pub fn with_log(self, log: Option<AtomicFile>) -> Self {
        Self { log, ..self }
    }

    /// The same outputs, which find the largest magnitude of their samples, encoded as `format`.
    pub fn with_peak(self, format: PcmFormat) -> Self {
        Self { peak: Some((format, 0.0)), ..self }
    }

    /// The largest magnitude so far, of full scale, if it is wanted.
    pub fn peak(&self) -> Option<f64> {
        self.peak.map(|(_, most)| most)
    }

    /// Completes the files and renames them to their final names.
    ///
    /// # Errors
    /// The system's refusal, or [`FileError::Exists`](crate::files::FileError::Exists) if one of the names
    /// was taken in the meantime; then no file remains.
    pub fn finish(self) -> Result<(), PipelineError> {
        let mut files = self.samples.finish()?;
        files.extend(self.mask);
        files.extend(self.log);
        Ok(commit_all(files)?)
    }
}

impl Output for FileOutputs {
    fn write(&mut self, block: Block<'_>) -> Result<(), IoError> {
        if let (Some(file), Some(mask)) = (&mut self.mask, block.mask) {
            file.write_all(mask).map_err(IoError::system(file.name(), "write it"))?;
        }
        if let Some((format, most)) = &mut self.peak {
            *most = most.max(peak(*format, block.samples));
        }
        self.samples.write(block.samples)
    }

    fn log(&mut self, line: &str) -> Result<(), IoError> {
        let Some(file) = &mut self.log else { return Ok(()) };
        writeln!(file, "{line}").map_err(IoError::system(file.name(), "write it"))
    }
}

#[cfg(test)]
impl Output for Vec<u8> {
    fn write(&mut self, block: Block<'_>) -> Result<(), IoError> {
        self.extend_from_slice(block.samples);
        Ok(())
    }
}
