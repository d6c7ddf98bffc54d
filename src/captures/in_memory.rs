//! All channels of captures.

use super::{CaptureError, ChannelSamples};
use crate::calibrate::Record;
use crate::io::{DecodedFrames, MultiReader, OfflineSamples};
use crate::runtime::FrameSource;
use crate::units::Hertz;

/// Captures that were taken together.
#[derive(Debug, Clone, PartialEq)]
pub struct Captures {
    /// The names of their files.
    pub name: String,
    /// The channels of all inputs; samples of one index belong to one frame.
    pub channels: Vec<ChannelSamples>,
    /// Samples per second, as the first input that states it does.
    pub rate: Option<Hertz>,
    /// There are more samples, which were not read.
    pub is_cut: bool,
}

impl Captures {
    /// At most `most` samples of each channel. What was tolerated the reader knows.
    ///
    /// # Errors
    /// [`CaptureError::Samples`].
    pub fn read(reader: &mut MultiReader, most: usize) -> Result<Self, CaptureError> {
        let name = reader.headers().map(|(name, _)| name).collect::<Vec<_>>().join(", ");
        let rate = reader.headers().find_map(|(_, header)| header.rate).filter(|rate| *rate > 0.0);
        let headers = reader.headers().zip(reader.samples_per_frame());
        let rails = headers
            .flat_map(|((_, header), samples)| std::iter::repeat_n(header.rails, header.channels * samples));
        let (rails, is_complex): (Vec<_>, _) = (rails.collect(), reader.is_complex());
        let OfflineSamples { channels, is_cut } = OfflineSamples::read(reader, most)?;
        let channels = with_rails(channels, is_complex, rails);
        Ok(Self { name, channels, rate: rate.map(Hertz), is_cut })
    }

    /// From samples in memory.
    ///
    /// # Errors
    /// [`CaptureError::Samples`] if there is no memory for the numbers.
    pub fn of_frames(decoded: &[DecodedFrames]) -> Result<Self, CaptureError> {
        let frames: Vec<_> = decoded.iter().map(DecodedFrames::frames).collect();
        let rails = decoded.iter().zip(&frames);
        let rails = rails.flat_map(|(one, frames)| std::iter::repeat_n(one.rails(), frames.real.channels()));
        let is_complex = frames.iter().any(|frames| frames.imaginary.is_some());
        let channels = OfflineSamples::of_frames(&frames, usize::MAX)?.channels;
        let channels = with_rails(channels, is_complex, rails);
        Ok(Self { name: "the captures".into(), channels, rate: None, is_cut: false })
    }

    /// Refuses all but one channel, before it is read.
    ///
    /// # Errors
    /// [`CaptureError::NotMono`].
    pub fn check_mono(reader: &MultiReader) -> Result<(), CaptureError> {
        match (reader.channels(), reader.headers().next()) {
            (1, _) | (_, None) => Ok(()),
            (channels, Some((name, _))) => Err(CaptureError::NotMono { name: name.to_owned(), channels }),
        }
    }

    /// A record for each channel, some of whose samples are [clipped](ChannelSamples::record).
    pub fn records(&self, clip: Option<f64>) -> Vec<Record> {
        self.channels.iter().map(|channel| channel.record(clip)).collect()
    }
}

/// The channels with their rails; of complex samples the parts follow each other.
fn with_rails(
    parts: Vec<Vec<f64>>,
    is_complex: bool,
    rails: impl IntoIterator<Item = Option<(f64, f64)>>,
) -> Vec<ChannelSamples> {
    let mut parts = parts.into_iter();
    let mut channels = Vec::new();
    for rails in rails {
        let Some(samples) = parts.next() else { break };
        let imaginary = if is_complex { parts.next() } else { None };
        channels.push(ChannelSamples { samples, imaginary, rails });
    }
    channels
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::{Decoder, PcmFormat, PcmFrames, SampleLayout, StatedScale};

    #[test]
    fn the_parts_of_complex_frames_are_one_channel() {
        let bytes: Vec<u8> = (1..=8u8).collect();
        let stored = PcmFrames { layout: SampleLayout::packed(PcmFormat::S8), channels: 4, bytes: &bytes };
        let mut decoder = Decoder::new(&stored, true, StatedScale::default()).unwrap();
        let frames = decoder.decode(&stored).unwrap();
        let captures = Captures::of_frames(&[frames]).unwrap();
        let of = |numbers: [f64; 2]| numbers.map(|x| x / 128.0).to_vec();
        let rails = Some((-1.0, 127.0 / 128.0));
        let first = ChannelSamples { samples: of([1.0, 5.0]), imaginary: Some(of([2.0, 6.0])), rails };
        let second = ChannelSamples { samples: of([3.0, 7.0]), imaginary: Some(of([4.0, 8.0])), rails };
        assert_eq!(captures.channels, [first, second]);
    }
}
