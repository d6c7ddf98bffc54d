//! One channel of a recording in memory, with what a measurement must know about its format.

use super::Failure;
use super::bank_file::{is_dash, name};
use crate::io::{Arrival, MultiReader, PcmFormat, ReadOptions, SampleLayout};
use crate::units::Hertz;
use std::path::{Path, PathBuf};

/// Samples that are read at most: the spectra of more take several gigabytes.
const MOST_SAMPLES: usize = 1 << 26;

/// One channel of a recording.
#[derive(Debug, Clone)]
pub(super) struct CaptureFile {
    pub(super) samples: Vec<f64>,
    pub(super) rate: Hertz,
    /// Lowest and highest value of an integer format; `None` for floats.
    pub(super) rails: Option<(f64, f64)>,
}

impl CaptureFile {
    /// Reads channel `channel` (from 1) of a WAV file or SigMF recording; a mono recording needs no number.
    /// `-` is standard input.
    pub(super) fn read(path: &Path, channel: Option<usize>) -> Result<Self, Failure> {
        let stop = crossbeam_channel::never();
        let reader =
            MultiReader::start(&[path.to_owned()], ReadOptions::files(), stop).map_err(Failure::input)?;
        let mut reader = reader.ok_or_else(|| Failure::input("interrupted"))?;
        let index = chosen(path, channel, reader.channels())?;
        let header = reader.headers().next().map(|(_, header)| *header);
        let rate = header.and_then(|header| header.rate).filter(|rate| *rate > 0.0).ok_or_else(|| {
            let message = "the header states no sample rate; record or convert it with its rate";
            Failure::Input(format!("{}: {message}", name(path)))
        })?;
        let rails = header.and_then(|header| rails(header.layout.format));
        let mut columns = read_channels(&mut reader, Some(index))?;
        reader.warnings().iter().for_each(|warning| super::warn(&warning.to_string()));
        let samples = columns.pop().unwrap_or_default();
        if samples.is_empty() {
            return Err(Failure::Input(format!("{}: no samples (the length is zero)", name(path))));
        }
        if samples.len() == MOST_SAMPLES {
            super::warn(&format!("{}: only the first {MOST_SAMPLES} samples are measured", name(path)));
        }
        Ok(Self { samples, rate: Hertz(rate), rails })
    }

    /// Leaves out `skip` samples at either end.
    pub(super) fn trimmed(mut self, path: &Path, skip: usize) -> Result<Self, Failure> {
        let count = self.samples.len();
        if 2 * skip >= count {
            return Err(Failure::Usage(format!(
                "--skip {skip} leaves nothing of {} with {count} samples; skip fewer than {}",
                name(path),
                count.div_ceil(2)
            )));
        }
        self.samples.truncate(count - skip);
        self.samples.drain(..skip);
        Ok(self)
    }
}

/// The index of the channel to read.
fn chosen(path: &Path, channel: Option<usize>, channels: usize) -> Result<usize, Failure> {
    match channel {
        None if channels == 1 => Ok(0),
        Some(channel) if (1..=channels).contains(&channel) => Ok(channel - 1),
        None => Err(Failure::Usage(format!(
            "{} has {channels} channels, and one is measured at a time; give its number, --channel 1 to {channels}",
            name(path)
        ))),
        Some(channel) => Err(Failure::Usage(format!(
            "--channel {channel}: {} has {channels} channels, counted from 1",
            name(path)
        ))),
    }
}

/// All samples of one channel of the inputs (from 0), or of all. Lost samples are NaN.
pub(super) fn read_channels(reader: &mut MultiReader, only: Option<usize>) -> Result<Vec<Vec<f64>>, Failure> {
    let wanted = only.map_or(0..reader.channels(), |index| index..index + 1);
    let mut channels = vec![Vec::new(); wanted.len()];
    while channels[0].len() < MOST_SAMPLES {
        let Arrival::Frames(count) = reader.wait().map_err(Failure::input)? else { break };
        let mut number = 0;
        for frames in reader.frames() {
            let SampleLayout { format, container } = frames.layout;
            for within in 0..frames.frame_bytes() / container {
                if wanted.contains(&number) {
                    let sample = |frame: &[u8]| format.decode(&frame[within * container..][..format.bytes()]);
                    channels[number - wanted.start]
                        .extend(frames.bytes.chunks_exact(frames.frame_bytes()).map(sample));
                }
                number += 1;
            }
        }
        reader.consume(count);
    }
    channels.iter_mut().for_each(|samples| samples.truncate(MOST_SAMPLES));
    Ok(channels)
}

/// The lowest and highest value of an integer format.
fn rails(format: PcmFormat) -> Option<(f64, f64)> {
    use PcmFormat::{F32Be, F32Le, F64Be, F64Le};
    if matches!(format, F32Le | F32Be | F64Le | F64Be) {
        return None;
    }
    // Encoding saturates.
    let mut bytes = vec![0; format.bytes()];
    let mut nearest = |value: f64| {
        format.encode(value, &mut bytes);
        format.decode(&bytes)
    };
    Some((nearest(-2.0), nearest(2.0)))
}

/// Refuses what cannot be read twice.
pub(super) fn check_files_on_disk(paths: &[PathBuf], option: &str) -> Result<(), Failure> {
    match paths.iter().find(|path| is_dash(path) || path.metadata().is_ok_and(|found| !found.is_file())) {
        None => Ok(()),
        Some(path) => Err(Failure::Usage(format!(
            "{option} reads inputs and output once more, which {} cannot give; use files",
            name(path)
        ))),
    }
}
