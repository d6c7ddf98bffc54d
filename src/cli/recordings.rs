//! Writes whole recordings of one channel.

use super::Failure;
use super::interrupt::remove_unfinished;
use crate::files::{AtomicFile, commit_all};
use crate::io::{Container, OutputHeader, PcmFormat, SampleWriter};
use std::path::Path;

/// Format of the numbers.
const FORMAT: PcmFormat = PcmFormat::F32Le;

/// A recording of one channel to be written with 32-bit floats.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mono<'a> {
    pub(super) samples: &'a [f64],
    /// The imaginary parts of complex samples, as many.
    pub(super) imaginary: Option<&'a [f64]>,
    /// Hertz.
    pub(super) rate: f64,
    /// SigMF recordings are so by their name.
    pub(super) container: Container,
}

/// Samples that are encoded at a time.
const CHUNK: usize = 1 << 16;

impl<'a> Mono<'a> {
    /// Real samples in a WAV file.
    pub(super) fn wav(samples: &'a [f64], rate: f64) -> Self {
        Self { samples, imaginary: None, rate, container: Container::Wav }
    }

    /// Numbers from `from` on, at most [`CHUNK`] samples of them.
    fn chunk(&self, from: usize, bytes: &mut Vec<u8>) {
        let to = (from + CHUNK).min(self.samples.len());
        bytes.resize((to - from) * self.parts() * FORMAT.bytes(), 0);
        let mut slots = bytes.chunks_exact_mut(FORMAT.bytes());
        for k in from..to {
            let parts = std::iter::once(self.samples[k]).chain(self.imaginary.map(|imaginary| imaginary[k]));
            for (x, slot) in parts.zip(&mut slots) {
                FORMAT.encode(x, slot);
            }
        }
    }

    fn parts(&self) -> usize {
        1 + usize::from(self.imaginary.is_some())
    }
}

/// Writes recordings, which appear together when they are whole.
pub(super) fn write_recordings(files: &[(&Path, Mono<'_>)], force: bool) -> Result<(), Failure> {
    let begin = |(path, mono): &(&Path, Mono<'_>)| begin_recording(path, *mono, force);
    let files = files.iter().map(begin).collect::<Result<Vec<_>, _>>()?;
    commit_all(files.into_iter().flatten().collect()).map_err(Failure::input)
}

/// The files of a recording, which are whole but have no names yet: two of a SigMF recording.
pub(super) fn begin_recording(path: &Path, mono: Mono<'_>, force: bool) -> Result<Vec<AtomicFile>, Failure> {
    remove_unfinished();
    let (container, is_complex, rate) = (mono.container, mono.imaginary.is_some(), mono.rate);
    let header = OutputHeader { container, format: FORMAT, is_complex, rate };
    let mut writer = SampleWriter::create(path, header, force).map_err(Failure::input)?;
    let mut bytes = Vec::new();
    for from in (0..mono.samples.len()).step_by(CHUNK) {
        mono.chunk(from, &mut bytes);
        writer.write(&bytes).map_err(Failure::input)?;
    }
    let mut files = writer.finish().map_err(Failure::input)?;
    // One open file at a time, however many there are.
    files.iter_mut().try_for_each(AtomicFile::seal).map_err(Failure::input)?;
    Ok(files)
}
