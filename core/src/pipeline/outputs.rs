//! Files that take output samples.

use super::{Block, PipelineError};
use crate::files::{AtomicFile, commit_all};
use crate::io::{IoError, OutputNotes, SampleWriter};
use std::io::Write;
use std::path::PathBuf;

/// Samples to a file or standard output, the mask to a file of its own. [`FileOutputs::finish`] makes all
/// files appear together; before it no file is visible.
///
/// ```
/// use hybank_core::io::{Container, OutputHeader, PcmFormat, SampleWriter};
/// use hybank_core::pipeline::{Block, FileOutputs};
/// let path = std::env::temp_dir().join(format!("hybank-outputs-{}.raw", std::process::id()));
/// let (container, format) = (Container::Raw, PcmFormat::S8);
/// let header = OutputHeader { container, format, is_complex: false, rate: 1.0 };
/// let mut outputs = FileOutputs::new(SampleWriter::create(&path, header, false)?, None);
/// outputs.write(Block { samples: &[32, 0xC0], mask: None })?;
/// assert!(!path.exists());
/// outputs.finish()?;
/// assert_eq!(std::fs::read(&path)?, [32, 0xC0]);
/// # std::fs::remove_file(path)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct FileOutputs {
    samples: SampleWriter,
    mask: Option<AtomicFile>,
}

impl FileOutputs {
    /// Writes encoded samples to `samples`, and the mask to `mask` if given.
    pub fn new(samples: SampleWriter, mask: Option<AtomicFile>) -> Self {
        Self { samples, mask }
    }

    /// From now on what was written stays, under the hidden names that this gives, if the files get no
    /// others.
    pub fn keep(&mut self) -> Vec<PathBuf> {
        let files = self.samples.unfinished().chain(&mut self.mask);
        let keep = |file: &mut AtomicFile| {
            file.keep();
            file.hidden_name().to_owned()
        };
        files.map(keep).collect()
    }

    /// What is to accompany the samples.
    pub fn annotate(&mut self, notes: OutputNotes) {
        self.samples.annotate(notes);
    }

    /// Takes the next samples.
    ///
    /// # Errors
    /// The errors of the destination.
    pub fn write(&mut self, block: Block<'_>) -> Result<(), IoError> {
        if let (Some(file), Some(mask)) = (&mut self.mask, block.mask) {
            file.write_all(mask).map_err(IoError::system(file.name(), "write it"))?;
        }
        self.samples.write(block.samples)
    }

    /// Completes the files and renames them to their final names.
    ///
    /// # Errors
    /// The system's refusal, or [`FileError::Exists`](crate::files::FileError::Exists) if one of the names
    /// was taken in the meantime; then no file remains.
    pub fn finish(self) -> Result<(), PipelineError> {
        let mut files = self.samples.finish()?;
        files.extend(self.mask);
        Ok(commit_all(files)?)
    }
}
