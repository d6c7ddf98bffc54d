//! Writes files that appear when they are whole: texts, pictures, recordings, and folders of them.

use super::interrupt::remove_unfinished;
use super::print::{Failure, is_dash, name_leftovers, print_bytes};
use crate::files::{AtomicFile, commit_all, refuse_overlaps};
use crate::io::{Container, OutputHeader, PcmFormat, SampleWriter};
use std::io::Write;
use std::path::Path;

/// Refuses outputs that are also inputs or other outputs, and names what killed runs left beside them.
pub(super) fn check_outputs(outputs: &[&Path], inputs: &[&Path]) -> Result<(), Failure> {
    let outputs: Vec<&Path> = outputs.iter().copied().filter(|path| !is_dash(path)).collect();
    refuse_overlaps(&outputs, inputs).map_err(Failure::input)?;
    name_leftovers(&outputs);
    Ok(())
}

/// Writes a text file that appears when it is whole; `-` is standard output.
pub(super) fn write_text(path: &Path, text: &str, force: bool) -> Result<(), Failure> {
    write_bytes(path, text.as_bytes(), force)
}

/// As [`write_text`], for any bytes.
pub(super) fn write_bytes(path: &Path, bytes: &[u8], force: bool) -> Result<(), Failure> {
    if is_dash(path) {
        return print_bytes(bytes);
    }
    begin_file(path, bytes, force)?.commit().map_err(Failure::input)
}

/// A file that is whole but has no name yet.
pub(super) fn begin_file(path: &Path, bytes: &[u8], force: bool) -> Result<AtomicFile, Failure> {
    remove_unfinished();
    let mut file = AtomicFile::create(path, force).map_err(Failure::input)?;
    file.write_all(bytes).map_err(|error| Failure::of(path, format!("cannot write it: {error}")))?;
    Ok(file)
}

/// Writes the files of each item to `folder` as soon as the item is known; all files appear together. A
/// folder that was made for them is removed if they do not.
pub(super) fn write_together<T>(
    folder: &Path,
    items: impl Iterator<Item = Result<T, Failure>>,
    begin: impl Fn(T) -> Result<Vec<AtomicFile>, Failure>,
) -> Result<(), Failure> {
    let is_new = !folder.exists();
    let begin = |item: Result<T, Failure>| {
        let item = item?;
        create_folder(folder)?;
        begin(item)
    };
    let begun = items.map(begin).collect::<Result<Vec<_>, _>>();
    let written =
        begun.and_then(|files| commit_all(files.into_iter().flatten().collect()).map_err(Failure::input));
    if written.is_err() && is_new {
        // It is empty, or another program has put files there.
        let _ = std::fs::remove_dir(folder);
    }
    written
}

/// Makes a folder, if it is not there.
pub(super) fn create_folder(folder: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(folder)
        .map_err(|error| Failure::of(folder, format!("cannot create the folder: {error}")))
}

/// Format of the numbers of recordings.
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
