//! Writes files that appear when they are whole: texts, pictures, recordings, and folders of them.

use super::print::{Failure, failed, failed_at, is_dash, print_bytes};
use hybank::files::{self, AtomicFile, FileError, commit_all, refuse_overlaps};
use hybank::io::{Container, OutputHeader, PcmFormat, SampleWriter};
use hybank::pipeline::Warning;
use std::io::Write;
use std::path::Path;

/// Refuses outputs that are also inputs or other outputs.
pub(super) fn check_outputs(outputs: &[&Path], inputs: &[&Path]) -> Result<(), Failure> {
    let outputs: Vec<&Path> = outputs.iter().copied().filter(|path| !is_dash(path)).collect();
    refuse_overlaps(&outputs, inputs).map_err(failed)
}

/// As [`check_outputs`], for one file that may be begun when the work is done.
pub(super) fn check_output(output: &Path, inputs: &[&Path], force: bool) -> Result<(), Failure> {
    check_outputs(&[output], inputs)?;
    if is_dash(output) { Ok(()) } else { files::check_output(output, force).map_err(failed) }
}

/// As [`check_output`], for files that appear together, in a folder that may not be there yet.
pub(super) fn check_together(outputs: &[&Path], inputs: &[&Path], force: bool) -> Result<(), Failure> {
    check_outputs(outputs, inputs)?;
    let mut there = outputs.iter().filter(|path| !is_dash(path) && path.exists());
    there.try_for_each(|path| files::check_output(path, force).map_err(failed))
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
    begin_file(path, bytes, force)?.commit().map_err(failed)
}

/// A file that is whole but has no name yet.
pub(super) fn begin_file(path: &Path, bytes: &[u8], force: bool) -> Result<AtomicFile, Failure> {
    let mut file = AtomicFile::create(path, force).map_err(failed)?;
    file.write_all(bytes).map_err(|error| failed_at(path, format!("cannot write it: {error}")))?;
    Ok(file)
}

/// Begins a file beside the output, which cannot go to standard output.
pub(super) fn begin_beside(path: &Path, force: bool) -> Result<AtomicFile, Failure> {
    AtomicFile::create(path, force).map_err(|error| match error {
        FileError::Special { .. } => Failure::Input(error.to_string()),
        other => failed(other),
    })
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
    let written = begun.and_then(|files| commit_all(files.into_iter().flatten().collect()).map_err(failed));
    if written.is_err() && is_new {
        // It is empty, or another program has put files there.
        let _ = std::fs::remove_dir(folder);
    }
    written
}

/// Makes a folder, if it is not there.
pub(super) fn create_folder(folder: &Path) -> Result<(), Failure> {
    check_folder(folder)?;
    let refused = |error| failed_at(folder, format!("cannot create the folder: {error}"));
    std::fs::create_dir_all(folder).map_err(refused)
}

/// Refuses a folder that no run can make, before the work is done.
pub(super) fn check_folder(folder: &Path) -> Result<(), Failure> {
    if folder.ancestors().any(|part| part.symlink_metadata().is_ok() && !part.is_dir()) {
        let problem = "a file has this name, or that of a folder above; give the name of a folder";
        return Err(failed_at(folder, problem));
    }
    Ok(())
}

/// A recording of one channel to be written.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mono<'a> {
    pub(super) samples: &'a [f64],
    /// The imaginary parts of complex samples, as many.
    pub(super) imaginary: Option<&'a [f64]>,
    /// Hertz.
    pub(super) rate: f64,
    /// Floats or integers.
    pub(super) format: PcmFormat,
    /// SigMF recordings are so by their name.
    pub(super) container: Container,
}

/// Samples that are encoded at a time.
const CHUNK: usize = 1 << 16;

impl<'a> Mono<'a> {
    /// Real samples in a WAV file of floats.
    pub(super) fn wav(samples: &'a [f64], rate: f64) -> Self {
        Self { samples, imaginary: None, rate, format: PcmFormat::F32Le, container: Container::Wav }
    }

    /// A warning of samples beyond full scale, which integers cannot hold.
    pub(super) fn clipped(&self) -> Option<String> {
        let numbers = [Some(self.samples), self.imaginary].into_iter().flatten().flatten();
        let count = numbers.filter(|x| x.abs() > 1.0).count() as u64;
        (count > 0 && !self.format.is_float())
            .then(|| format!("{}; --bits 32f keeps them", Warning::Clipped(count)))
    }

    /// Writes its files, which have no names yet.
    fn write(&self, path: &Path, force: bool) -> Result<Vec<AtomicFile>, Failure> {
        let Self { container, format, rate, imaginary, .. } = *self;
        let header = OutputHeader { container, format, is_complex: imaginary.is_some(), rate };
        let mut writer = SampleWriter::create(path, header, force).map_err(failed)?;
        for from in (0..self.samples.len()).step_by(CHUNK) {
            let to = (from + CHUNK).min(self.samples.len());
            let parts = |k: usize| [Some(self.samples[k]), imaginary.map(|imaginary| imaginary[k])];
            let numbers: Vec<f64> = (from..to).flat_map(parts).flatten().collect();
            let mut bytes = vec![0; numbers.len() * format.bytes()];
            for (slot, x) in bytes.chunks_exact_mut(format.bytes()).zip(numbers) {
                format.encode(x, slot);
            }
            writer.write(&bytes).map_err(failed)?;
        }
        writer.finish().map_err(failed)
    }
}

/// Writes recordings, which appear together when they are whole.
pub(super) fn write_recordings(files: &[(&Path, Mono<'_>)], force: bool) -> Result<(), Failure> {
    let begin = |(path, mono): &(&Path, Mono<'_>)| begin_recording(path, *mono, force);
    let files = files.iter().map(begin).collect::<Result<Vec<_>, _>>()?;
    commit_all(files.into_iter().flatten().collect()).map_err(failed)
}

/// The files of a recording, which are whole but have no names yet: two of a SigMF recording.
pub(super) fn begin_recording(path: &Path, mono: Mono<'_>, force: bool) -> Result<Vec<AtomicFile>, Failure> {
    let mut files = mono.write(path, force)?;
    // One open file at a time, however many there are.
    files.iter_mut().try_for_each(AtomicFile::seal).map_err(failed)?;
    Ok(files)
}
