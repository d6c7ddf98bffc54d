//! Settings of the reading of several inputs.

use super::table::TableOptions;
use super::timestamps::MAX_LOST;
use super::{Coding, LostSamples, StatedScale};
use crate::runtime::Sample;

/// Bytes of a block that suit one thread.
pub const BLOCK_BYTES: usize = 128 << 10;

/// Which input decides where the reading ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Until {
    /// The first one to end; the remaining frames of the others are not used.
    #[default]
    Shortest,
    /// The last one to end; samples of the others are lost from their end on.
    Longest,
}

/// Settings of the reading.
#[derive(Debug, Clone)]
pub struct ReadOptions<'a> {
    /// Coding of all inputs except [those that state it](super::is_self_describing).
    pub coding: Coding,
    /// Channels of each raw input.
    pub channels: usize,
    /// The only channel to read of each input, from 0.
    pub only: Option<usize>,
    /// Pairs of channels are the real and the imaginary parts of complex samples (I and Q).
    pub is_iq: bool,
    /// What is said of their full scale.
    pub scale: StatedScale,
    /// How tables are read.
    pub table: TableOptions,
    /// The time-interleaved converters of the only input, which has one channel then. Its frames are those
    /// of an input of M channels, at an M-th of its rate.
    pub interleaving: Option<&'a TimeInterleaving>,
    /// Samples of each input in a row that are a frame, where converters sample more often than there are
    /// frames; empty for one of each.
    pub samples_per_frame: &'a [usize],
    /// The lost samples, if a file lists them.
    pub lost: Option<&'a LostSamples>,
    /// Maximum number of lost frames of one input, by default [`MAX_LOST`]. Without a limit a wrong number
    /// would lead to endless output.
    pub max_lost: u64,
    /// Which input decides where the reading ends.
    pub until: Until,
    /// The most bytes of an input that are read at a time; less if there are many inputs.
    pub block_bytes: usize,
}

impl ReadOptions<'_> {
    /// Files with headers, nothing lost.
    pub fn files() -> Self {
        Self {
            coding: Coding::Wav,
            channels: 1,
            only: None,
            is_iq: false,
            scale: StatedScale::default(),
            table: TableOptions::default(),
            interleaving: None,
            samples_per_frame: &[],
            lost: None,
            max_lost: MAX_LOST,
            until: Until::Shortest,
            block_bytes: BLOCK_BYTES,
        }
    }
}

/// M time-interleaved converters, which write their samples in turn into one capture, and the channel that
/// each of them is. Sample k, counted from 0, comes from converter k mod M; M samples in a row are a frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TimeInterleaving {
    /// The channel, from 0, of each converter.
    channels: Vec<usize>,
}

impl TimeInterleaving {
    /// Converter j is channel j: for captures of which nothing else is known.
    pub fn in_order(converters: usize) -> Self {
        Self { channels: (0..converters).collect() }
    }

    /// The converters in the order in which they sample. Channel i takes sample k at the time
    /// k M - `delays[i]`, so converter 0 is the channel with the largest delay. Channels of equal delay stay
    /// in their order.
    pub fn by_delay(delays: &[f64]) -> Self {
        let mut channels: Vec<usize> = (0..delays.len()).collect();
        channels.sort_by(|&a, &b| delays[b].total_cmp(&delays[a]));
        Self { channels }
    }

    /// M.
    pub fn converters(&self) -> usize {
        self.channels.len()
    }

    /// The channel, from 0, of each converter.
    pub fn channels(&self) -> &[usize] {
        &self.channels
    }

    /// Puts the samples of whole frames into the order of the channels.
    pub(super) fn reorder<T: Sample>(&self, samples: &mut [T]) {
        if self.channels.is_sorted() {
            return;
        }
        let mut turns = vec![T::default(); self.converters()];
        for frame in samples.chunks_exact_mut(self.converters()) {
            turns.copy_from_slice(frame);
            self.channels.iter().zip(&turns).for_each(|(&channel, sample)| frame[channel] = *sample);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_converter_is_the_one_with_the_largest_delay() {
        assert_eq!(TimeInterleaving::by_delay(&[3.1, 1.9, 1.0, 0.0]), TimeInterleaving::in_order(4));
        assert_eq!(TimeInterleaving::by_delay(&[0.0, 1.0, 2.5]).channels(), [2, 1, 0]);
        assert_eq!(TimeInterleaving::by_delay(&[0.5, 1.0, 0.5]).channels(), [1, 0, 2]);
    }

    #[test]
    fn whole_frames_come_into_the_order_of_the_channels() {
        let turns = TimeInterleaving::by_delay(&[0.0, 2.0, 1.0]);
        // Two frames; converters are the channels 1, 2 and 0.
        let mut samples = [1.0f32, 2.0, 0.0, 1.5, 2.5, 0.5];
        turns.reorder(&mut samples);
        assert_eq!(samples, [0.0, 1.0, 2.0, 0.5, 1.5, 2.5]);
        TimeInterleaving::in_order(3).reorder(&mut samples);
        assert_eq!(samples, [0.0, 1.0, 2.0, 0.5, 1.5, 2.5]);
    }
}
