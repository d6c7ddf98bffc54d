//! Recordings in memory.

use super::{Arrival, IoError, MultiReader, RecordedFrames};
use crate::messages::Quoted;
use crate::runtime::FrameSource;
use std::collections::TryReserveError;

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
    /// The system does not have the memory.
    #[error(
        "{frames} frames of {channels} channels do not fit in memory; use a shorter part of the recording"
    )]
    Memory {
        /// Frames.
        frames: usize,
        /// Channels; of complex samples each part is one.
        channels: usize,
    },
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
        reserve(&mut channels, promised.unwrap_or_default().min(most))?;
        loop {
            match reader.wait(&mut |_| {})? {
                Arrival::Frames(count) => {
                    let known = channels.first().map_or(0, Vec::len);
                    let room = most - known;
                    reserve(&mut channels, count.min(room))?;
                    append(&reader.frames(), count.min(room), &mut channels);
                    reader.consume(count);
                    if room < count {
                        return Ok(Self { channels, is_cut: true });
                    }
                }
                arrival => return Ok(Self { channels, is_cut: arrival == Arrival::Stopped }),
            }
        }
    }

    /// From at most `most` frames in memory.
    ///
    /// # Errors
    /// [`OfflineError::Memory`].
    pub fn of_frames(frames: &[RecordedFrames<'_>], most: usize) -> Result<Self, OfflineError> {
        let numbers = frames.iter().flat_map(RecordedFrames::parts).map(|part| part.channels());
        let mut channels = vec![Vec::new(); numbers.sum()];
        let longest = frames.iter().map(RecordedFrames::frames).max().unwrap_or_default();
        reserve(&mut channels, longest.min(most))?;
        append(frames, most, &mut channels);
        Ok(Self { channels, is_cut: false })
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

/// Makes room for `more` frames.
fn reserve(channels: &mut [Vec<f64>], more: usize) -> Result<(), OfflineError> {
    let frames = channels.first().map_or(0, Vec::len) + more;
    let refused = OfflineError::Memory { frames, channels: channels.len() };
    let reserved = channels.iter_mut().try_for_each(|samples| samples.try_reserve(more));
    reserved.map_err(|_: TryReserveError| refused)
}

/// The first `count` frames of all recordings; the parts of a complex channel follow each other.
fn append(recordings: &[RecordedFrames<'_>], count: usize, channels: &mut [Vec<f64>]) {
    let mut next = channels.iter_mut();
    for recording in recordings {
        for channel in 0..recording.real.channels() {
            for (part, samples) in recording.parts().zip(&mut next) {
                samples.extend(part.channel(channel).take(count));
            }
        }
    }
}
