//! A gap.

/// A run of missing samples of one channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct Gap {
    /// The channel, from 1.
    pub channel: usize,
    /// Frame of its first sample, from 0.
    pub first: u64,
    /// Samples that are missing.
    pub length: u64,
}
