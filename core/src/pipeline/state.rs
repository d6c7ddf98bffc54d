//! The state of a pipeline as bytes: the count of saturated samples, then the state of each part, all of one
//! length.

use super::Pipeline;
use crate::runtime::{STATE_COUNTS, StateError, Stream};

impl Pipeline<'_> {
    /// The state as bytes, from which [`Pipeline::resume`] goes on, in any process. Gaps that are filled are
    /// not part of it.
    pub fn state(&self) -> Vec<u8> {
        let mut bytes = self.clipped.to_le_bytes().to_vec();
        self.fusion.streams().iter().for_each(|stream| stream.save(&mut bytes));
        bytes
    }

    /// Goes on from a state: the same frames give the same bits and counts.
    ///
    /// # Errors
    /// [`StateError`] if the bytes are not a state of the same plan and as many parts; the pipeline is as
    /// before then.
    pub fn resume(&mut self, bytes: &[u8]) -> Result<(), StateError> {
        let mut streams = self.fusion.streams().to_vec();
        let (clipped, states) = parts(streams.len(), bytes).ok_or(StateError::NotAState)?;
        streams.iter_mut().zip(states).try_for_each(|(stream, state)| stream.resume(state))?;
        self.fusion.set_streams(streams);
        self.clipped = clipped;
        Ok(())
    }

    /// Whether the next frames give the same outputs as from a state, whatever was counted before.
    pub fn agrees(&self, bytes: &[u8]) -> bool {
        let streams = self.fusion.streams();
        let same = |(stream, state): (&Stream, &[u8])| {
            stream.state().get(STATE_COUNTS..) == state.get(STATE_COUNTS..)
        };
        parts(streams.len(), bytes).is_some_and(|(_, states)| streams.iter().zip(states).all(same))
    }
}

/// The count and the states in the bytes of a state of so many parts.
fn parts(count: usize, bytes: &[u8]) -> Option<(u64, Vec<&[u8]>)> {
    let (clipped, states) = bytes.split_first_chunk()?;
    let is_whole = !states.is_empty() && states.len() % count == 0;
    is_whole.then(|| (u64::from_le_bytes(*clipped), states.chunks_exact(states.len() / count).collect()))
}
