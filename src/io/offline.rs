//! Recordings in memory.

use super::{Arrival, IoError, MultiReader, PcmFrames};
use crate::memory::{MemoryShortage, check_memory};
use crate::messages::Quoted;

/// Bytes of work memory for each sample of a recording: the sample, its spectrum and a copy of both.
const WORK_BYTES: f64 = 64.0;

/// Recordings that are not read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OfflineError {
    /// An input cannot be read.
    #[error(transparent)]
    Io(#[from] IoError),
    /// Complex samples where real ones are needed.
    #[error(
        "{}: complex samples, which `fuse`, `stream`, `measure` and `calibrate` take; extract the real or the imaginary part",
        Quoted(.input)
    )]
    Complex {
        /// The input.
        input: String,
    },
    /// The system does not have the work memory.
    #[error("{frames} frames of {channels} channels take {shortage}; use a shorter part of the recording")]
    Memory {
        /// Frames.
        frames: usize,
        /// Channels; of complex samples each part is one.
        channels: usize,
        /// Memory that they take, and what the process may use.
        shortage: MemoryShortage,
    },
    /// The reading was stopped.
    #[error("interrupted")]
    Stopped,
}

/// All channels of a reader; of complex samples each part is a channel.
#[derive(Debug)]
pub struct OfflineSamples {
    /// Lost samples are NaN.
    pub channels: Vec<Vec<f64>>,
    /// There are more samples, which were not read.
    pub is_cut: bool,
}

impl OfflineSamples {
    /// At most `most` samples of each channel.
    ///
    /// # Errors
    /// [`OfflineError`].
    pub fn read(reader: &mut MultiReader, most: usize) -> Result<Self, OfflineError> {
        let parts = if reader.is_complex() { 2 } else { 1 };
        let mut channels = vec![Vec::new(); parts * reader.channels()];
        let promised = reader.promised_frames().and_then(|frames| usize::try_from(frames).ok());
        let mut checked = promised.unwrap_or_default().min(most);
        check_work(checked, channels.len())?;
        loop {
            match reader.wait()? {
                Arrival::Frames(count) => {
                    let known = channels.first().map_or(0, Vec::len);
                    let room = most - known;
                    if known + count > checked {
                        checked = (checked + checked / 4).max(known + count).min(most);
                        check_work(checked, channels.len())?;
                    }
                    append(&reader.frames(), count.min(room), &mut channels);
                    reader.consume(count);
                    if room < count {
                        return Ok(Self { channels, is_cut: true });
                    }
                }
                Arrival::End => return Ok(Self { channels, is_cut: false }),
                Arrival::Stopped => return Err(OfflineError::Stopped),
            }
        }
    }

    /// From frames in memory.
    pub fn of_frames(frames: &[PcmFrames<'_>]) -> Self {
        let mut channels = vec![Vec::new(); frames.iter().map(|part| part.channels).sum()];
        append(frames, usize::MAX, &mut channels);
        Self { channels, is_cut: false }
    }
}

/// Refuses complex samples before they are read.
///
/// # Errors
/// [`OfflineError::Complex`].
pub fn check_real(reader: &MultiReader) -> Result<(), OfflineError> {
    match reader.headers().find(|(_, header)| header.is_complex) {
        Some((input, _)) => Err(OfflineError::Complex { input: input.to_owned() }),
        None => Ok(()),
    }
}

/// Refuses recordings whose work memory the system does not have.
fn check_work(frames: usize, channels: usize) -> Result<(), OfflineError> {
    let bytes = WORK_BYTES * frames as f64 * channels as f64;
    check_memory(bytes).map_err(|shortage| OfflineError::Memory { frames, channels, shortage })
}

/// The first `count` frames of all parts.
fn append(parts: &[PcmFrames<'_>], count: usize, channels: &mut [Vec<f64>]) {
    let mut next = channels.iter_mut();
    for part in parts {
        let (format, container) = (part.layout.format, part.layout.container);
        for (c, samples) in next.by_ref().take(part.channels).enumerate() {
            let frames = part.bytes.chunks_exact(part.frame_bytes()).take(count);
            samples.extend(frames.map(|frame| format.decode(&frame[c * container..])));
        }
    }
}
