//! Whole recordings of one channel in memory, for the commands that work on short ones.

use super::Failure;
use super::interrupt::remove_unfinished;
use crate::files::{AtomicFile, commit_all};
use crate::io::wav::WavFile;
use crate::io::{Arrival, MultiReader, PcmFormat, ReadOptions, SampleLayout};
use std::io;
use std::path::Path;

/// The samples and the rate (hertz) of one channel, counted from 1, of a WAV file or SigMF recording; a mono
/// recording needs no number.
pub(super) fn read_channel(path: &Path, channel: Option<usize>) -> Result<(Vec<f64>, u32), Failure> {
    let reader = MultiReader::start(&[path.to_owned()], ReadOptions::files(), crossbeam_channel::never());
    let mut reader = reader.map_err(Failure::input)?.ok_or_else(|| Failure::input("interrupted"))?;
    let channels = reader.channels();
    let index = match channel {
        None if channels == 1 => 0,
        Some(channel) if (1..=channels).contains(&channel) => channel - 1,
        None => {
            return Err(Failure::Input(format!(
                "{}: {channels} channels, but a source is one of them; give its number, --channel 1 to {channels}",
                path.display()
            )));
        }
        Some(channel) => {
            return Err(Failure::Input(format!(
                "--channel {channel}: {} has {channels} channels, counted from 1",
                path.display()
            )));
        }
    };
    let rate = reader.headers().find_map(|(_, header)| header.rate).unwrap_or(0.0).round() as u32;
    let mut samples = Vec::new();
    while let Arrival::Frames(count) = reader.wait().map_err(Failure::input)? {
        for frames in reader.frames() {
            let SampleLayout { format, container } = frames.layout;
            let sample = |frame: &[u8]| format.decode(&frame[index * container..][..container]);
            samples.extend(frames.bytes.chunks_exact(frames.frame_bytes()).map(sample));
        }
        reader.consume(count);
    }
    reader.warnings().iter().for_each(|warning| super::warn(&warning.to_string()));
    refuse_useless(path, &samples)?;
    Ok((samples, rate))
}

fn refuse_useless(path: &Path, samples: &[f64]) -> Result<(), Failure> {
    if samples.is_empty() {
        return Err(Failure::Input(format!("{}: no samples (the length is zero)", path.display())));
    }
    match samples.iter().position(|x| !x.is_finite()) {
        Some(n) => Err(Failure::Input(format!(
            "{}: sample {n} is {}; a source must be finite, repair the recording first",
            path.display(),
            samples[n]
        ))),
        None => Ok(()),
    }
}

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
