//! Whole mono recordings in memory, for the verbs that work on short ones.

use super::Failure;
use crate::io::wav::WavFile;
use crate::io::{Arrival, AtomicFile, Feed, FeedOptions, PcmFormat};
use std::io;
use std::path::Path;

/// The samples and the rate (hertz) of a mono WAV file or SigMF recording.
pub(super) fn read_mono(path: &Path) -> Result<(Vec<f64>, u32), Failure> {
    let feed = Feed::start(&[path.to_owned()], FeedOptions::files(), crossbeam_channel::never());
    let mut feed = feed.map_err(Failure::input)?.ok_or_else(|| Failure::input("interrupted"))?;
    if feed.channels() != 1 {
        return Err(Failure::Input(format!(
            "{}: {} channels, but a source is mono; extract one channel first",
            path.display(),
            feed.channels()
        )));
    }
    let rate = feed.headers().find_map(|(_, _, rate)| rate).unwrap_or(0.0).round() as u32;
    let mut samples = Vec::new();
    while let Arrival::Ticks(ticks) = feed.wait().map_err(Failure::input)? {
        for frames in feed.frames() {
            let format = frames.layout.format;
            samples.extend(frames.bytes.chunks_exact(frames.frame_bytes()).map(|b| format.decode(b)));
        }
        feed.consume(ticks);
    }
    for note in feed.notes() {
        eprintln!("hybank: warning: {note}");
    }
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

/// Writes a mono WAV file that appears when it is whole.
pub(super) fn write_mono(
    path: &Path,
    samples: &[f64],
    rate: u32,
    format: PcmFormat,
    force: bool,
) -> Result<(), Failure> {
    let file = AtomicFile::create(path, force).map_err(Failure::input)?;
    let size = format.bytes();
    let mut bytes = vec![0; samples.len() * size];
    for (slot, &x) in bytes.chunks_exact_mut(size).zip(samples) {
        format.encode(x, slot);
    }
    let written = WavFile::new(file, format, 1, rate).and_then(|mut wav| {
        wav.write_bytes(&bytes)?;
        wav.finish()
    });
    let cannot = |error: io::Error| Failure::Input(format!("{}: cannot write it: {error}", path.display()));
    written.map_err(cannot)?.commit().map_err(Failure::input)
}
