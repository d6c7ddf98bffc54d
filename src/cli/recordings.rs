//! Whole mono recordings in memory, for the verbs that work on short ones.

use super::Failure;
use crate::io::wav::WavFile;
use crate::io::{AtomicFile, Capture, PcmFormat};
use std::io;
use std::path::Path;

const BLOCK_TICKS: usize = 1 << 14;

/// The samples and the rate (hertz) of a mono WAV file.
pub(super) fn read_mono(path: &Path) -> Result<(Vec<f64>, u32), Failure> {
    let mut capture = Capture::open(&[path]).map_err(Failure::input)?;
    let rate = capture.headers().next().map_or(0, |(_, header)| header.rate);
    if capture.channels() != 1 {
        return Err(Failure::Input(format!(
            "{}: {} channels, but a source is mono; extract one channel first",
            path.display(),
            capture.channels()
        )));
    }
    let mut samples = Vec::new();
    loop {
        let ticks = capture.read(BLOCK_TICKS).map_err(Failure::input)?;
        for frames in capture.frames() {
            let layout = frames.layout;
            samples.extend(
                frames.bytes.chunks_exact(frames.frame_bytes()).map(|bytes| layout.format.decode(bytes)),
            );
        }
        if ticks < BLOCK_TICKS {
            break;
        }
    }
    for note in capture.notes() {
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
