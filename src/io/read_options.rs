//! Settings of the reading of several inputs.

use super::live_lost::LiveLost;
use super::timestamps::MAX_LOST;
use super::{Coding, LostSamples, StallWatch, TimeInterleaving};

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
#[derive(Debug, Clone, Copy)]
pub struct ReadOptions<'a> {
    /// Coding of all inputs except [those that state it](super::is_self_describing).
    pub coding: Coding,
    /// Channels of each raw input.
    pub channels: usize,
    /// The only channel to read of each input, from 0.
    pub only: Option<usize>,
    /// The time-interleaved converters of the only input, which has one channel then. Its frames are those
    /// of an input of M channels, at an M-th of its rate.
    pub interleaving: Option<&'a TimeInterleaving>,
    /// The lost samples, if a file lists them.
    pub lost: Option<&'a LostSamples>,
    /// Lost samples that become known during the run.
    pub live_lost: Option<&'a LiveLost>,
    /// Maximum number of lost frames of one input, by default [`MAX_LOST`]. Without a limit a wrong number
    /// would lead to endless output.
    pub max_lost: u64,
    /// Which input decides where the reading ends.
    pub until: Until,
    /// The most bytes of an input that are read at a time; less if there are many inputs.
    pub block_bytes: usize,
    /// Who is to know of inputs that are waited for.
    pub stalls: Option<&'a StallWatch>,
}

impl ReadOptions<'_> {
    /// Files with headers, nothing lost.
    pub fn files() -> Self {
        Self {
            coding: Coding::Wav,
            channels: 1,
            only: None,
            interleaving: None,
            lost: None,
            live_lost: None,
            max_lost: MAX_LOST,
            until: Until::Shortest,
            block_bytes: BLOCK_BYTES,
            stalls: None,
        }
    }
}
