//! Writes whole recordings of one channel.

use super::Failure;
use super::interrupt::remove_unfinished;
use crate::files::{AtomicFile, commit_all};
use crate::io::PcmFormat;
use crate::io::wav::WavFile;
use std::io;
use std::path::Path;

/// A mono recording to be written.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mono<'a> {
    pub(super) samples: &'a [f64],
    /// Hertz.
    pub(super) rate: u32,
}

/// Samples that are encoded at a time.
const CHUNK: usize = 1 << 16;

/// Writes mono WAV files with 32-bit floats, which appear together when they are whole.
pub(super) fn write_recordings(files: &[(&Path, Mono<'_>)], force: bool) -> Result<(), Failure> {
    let begin = |(path, mono): &(&Path, Mono<'_>)| begin_recording(path, *mono, force);
    let files = files.iter().map(begin).collect::<Result<Vec<_>, _>>()?;
    commit_all(files).map_err(Failure::input)
}

/// A mono WAV file with 32-bit floats that is whole but has no name yet.
pub(super) fn begin_recording(path: &Path, mono: Mono<'_>, force: bool) -> Result<AtomicFile, Failure> {
    remove_unfinished();
    let file = AtomicFile::create(path, force).map_err(Failure::input)?;
    let written =
        WavFile::new(file, PcmFormat::F32Le, 1, mono.rate).and_then(|wav| encode(wav, mono.samples));
    let cannot = |error: io::Error| Failure::Input(format!("{}: cannot write it: {error}", path.display()));
    let mut file = written.map_err(cannot)?;
    // One open file at a time, however many there are.
    file.seal().map_err(Failure::input)?;
    Ok(file)
}

fn encode(mut wav: WavFile<AtomicFile>, samples: &[f64]) -> io::Result<AtomicFile> {
    let format = PcmFormat::F32Le;
    let mut bytes = vec![0; samples.len().min(CHUNK) * format.bytes()];
    for chunk in samples.chunks(CHUNK) {
        let bytes = &mut bytes[..chunk.len() * format.bytes()];
        for (slot, &x) in bytes.chunks_exact_mut(format.bytes()).zip(chunk) {
            format.encode(x, slot);
        }
        wav.write_bytes(bytes)?;
    }
    wav.finish()
}
