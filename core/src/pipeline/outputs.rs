//! Files that take output samples.

use super::{Block, PipelineError};
use crate::files::{AtomicFile, commit_all};
use crate::io::{IoError, OutputNotes, PcmFormat, SampleWriter};
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
/// let mut outputs = FileOutputs::new(SampleWriter::create(&path, header, false)?, None, format);
/// outputs.write(Block { samples: &[32, 0xC0], mask: None })?;
/// assert!(outputs.peak() == 0.5 && !path.exists());
/// outputs.finish()?;
/// assert_eq!(std::fs::read(&path)?, [32, 0xC0]);
/// # std::fs::remove_file(path)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct FileOutputs {
    samples: SampleWriter,
    mask: Option<AtomicFile>,
    format: PcmFormat,
    /// The largest magnitude so far, of full scale.
    peak: f64,
}

impl FileOutputs {
    /// Writes samples, encoded as `format`, to `samples`, and the mask to `mask` if given.
    pub fn new(samples: SampleWriter, mask: Option<AtomicFile>, format: PcmFormat) -> Self {
        Self { samples, mask, format, peak: 0.0 }
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
        self.peak = self.peak.max(peak(self.format, block.samples));
        self.samples.write(block.samples)
    }

    /// The largest magnitude so far, of full scale.
    pub fn peak(&self) -> f64 {
        self.peak
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

/// Magnitude bits of floats: those of all but NaN are in the order of the magnitudes.
const MAGNITUDE_32: u32 = u32::MAX >> 1;
const MAGNITUDE_64: u64 = u64::MAX >> 1;

/// The largest magnitude in `samples`, of full scale; 0 for none. The usual formats take one pass of whole
/// vectors.
pub fn peak(format: PcmFormat, samples: &[u8]) -> f64 {
    match format {
        PcmFormat::F32Le => {
            let (values, _) = samples.as_chunks();
            f32::from_bits(values.iter().map(|x| u32::from_le_bytes(*x) & MAGNITUDE_32).max().unwrap_or(0))
                .into()
        }
        PcmFormat::F64Le => {
            let (values, _) = samples.as_chunks();
            f64::from_bits(values.iter().map(|x| u64::from_le_bytes(*x) & MAGNITUDE_64).max().unwrap_or(0))
        }
        PcmFormat::S16Le => {
            let (values, _) = samples.as_chunks();
            let most = values.iter().map(|x| i16::from_le_bytes(*x).unsigned_abs()).max().unwrap_or(0);
            f64::from(most) / f64::from(1u16 << 15)
        }
        _ => {
            let values = samples.chunks_exact(format.bytes());
            values.map(|sample| format.decode(sample).abs()).fold(0.0, f64::max)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_peak_of_every_format_is_that_of_its_samples() {
        let values = [0.0, 0.25, -0.75, 0.5, -0.125];
        for format in [
            PcmFormat::F32Le,
            PcmFormat::F64Le,
            PcmFormat::S16Le,
            PcmFormat::S24Le,
            PcmFormat::S32Le,
            PcmFormat::U8,
            PcmFormat::F32Be,
        ] {
            let mut bytes = vec![0; values.len() * format.bytes()];
            for (slot, value) in bytes.chunks_exact_mut(format.bytes()).zip(values) {
                format.encode(value, slot);
            }
            assert_eq!(peak(format, &bytes), 0.75, "{format:?}");
            assert_eq!(peak(format, &[]), 0.0);
        }
        assert_eq!(peak(PcmFormat::S16Le, &i16::MIN.to_le_bytes()), 1.0);
    }
}
