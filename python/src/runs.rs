//! How a stream filters its frames: by streams of the runtime, or by a run that fills gaps.

use crate::errors::refused;
use crate::formats::Format;
use crate::running::{Outputs, Running};
use hybank::bank::Bank;
use hybank::pipeline::{DroppedLatency, GapPolicy, PipelineError, Settings};
use hybank::runtime::{self, Algorithm, Output, PcmFrames, PcmOutput, Plan, STATE_COUNTS, StateError};
use pyo3::prelude::*;

/// The runs of a stream, which the end of its `with` block closes.
pub(crate) struct State {
    pub(crate) runs: Runs,
    pub(crate) closed: bool,
}

/// How frames are filtered.
pub(crate) enum Runs {
    /// By one stream for real samples, by two for the parts of complex ones.
    Streams { streams: Vec<runtime::Stream>, clipped: u64 },
    /// With gaps that are filled.
    Running(Box<Running>),
}

impl State {
    pub(crate) fn process(&mut self, parts: &[Vec<PcmFrames<'_>>], room: &mut PcmOutput<'_>) -> PyResult<()> {
        self.check_open()?;
        let Runs::Streams { streams, clipped } = &mut self.runs else { return Ok(()) };
        for (i, (stream, part)) in streams.iter_mut().zip(parts).enumerate() {
            if parts.len() > 1 {
                room.select(i);
            }
            stream.run(&part.as_slice(), room).map_err(refused)?;
        }
        *clipped += room.clipped;
        Ok(())
    }

    pub(crate) fn flush(&mut self, room: &mut PcmOutput<'_>) -> PyResult<()> {
        self.check_open()?;
        let Runs::Streams { streams, clipped } = &mut self.runs else { return Ok(()) };
        let is_complex = streams.len() > 1;
        for (part, stream) in streams.iter_mut().enumerate() {
            if is_complex {
                room.select(part);
            }
            stream.flush(room).map_err(refused)?;
        }
        *clipped += room.clipped;
        Ok(())
    }

    /// A step of a stream that fills gaps: its output samples.
    pub(crate) fn step(
        &mut self,
        step: impl FnOnce(&mut Running) -> Result<(), PipelineError>,
    ) -> PyResult<Vec<u8>> {
        self.check_open()?;
        let Runs::Running(running) = &mut self.runs else { return Ok(Vec::new()) };
        running.outputs = Outputs::default();
        step(running).map_err(refused)?;
        Ok(std::mem::take(&mut running.outputs.samples))
    }

    fn check_open(&self) -> PyResult<()> {
        if self.closed {
            return Err(refused("the stream was closed at the end of its with block; make another one"));
        }
        Ok(())
    }
}

impl Runs {
    pub(crate) fn new(
        bank: &Bank,
        plan: &Plan,
        format: Format,
        algorithm: Algorithm,
        gaps: Option<GapPolicy>,
    ) -> PyResult<Self> {
        if gaps.is_none() {
            let streams = vec![runtime::Stream::new(plan); 1 + usize::from(format.complex)];
            return Ok(Self::Streams { streams, clipped: 0 });
        }
        let settings = Settings { dropped: DroppedLatency::Nothing, gaps, ..Settings::default() };
        let running = Running::new(bank, format, algorithm, settings)?;
        Ok(Self::Running(Box::new(running)))
    }

    /// The count of saturated samples, then the state of each part, all of one length.
    pub(crate) fn bytes(&self) -> PyResult<Vec<u8>> {
        let Self::Streams { streams, clipped } = self else { return Err(stateless()) };
        let mut bytes = clipped.to_le_bytes().to_vec();
        streams.iter().for_each(|stream| stream.save(&mut bytes));
        Ok(bytes)
    }

    pub(crate) fn resume(&mut self, bytes: &[u8]) -> PyResult<()> {
        let Self::Streams { streams, clipped } = self else { return Err(stateless()) };
        let parts = parts(streams.len(), bytes).ok_or(StateError::NotAState);
        let (count, states) = parts.map_err(refused)?;
        let mut resumed = streams.clone();
        let mut pairs = resumed.iter_mut().zip(states);
        pairs.try_for_each(|(stream, state)| stream.resume(state)).map_err(refused)?;
        (*streams, *clipped) = (resumed, count);
        Ok(())
    }

    pub(crate) fn agrees(&self, bytes: &[u8]) -> bool {
        let Self::Streams { streams, .. } = self else { return false };
        let same = |(stream, state): (&runtime::Stream, &[u8])| {
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

fn stateless() -> PyErr {
    refused("a stream that fills gaps cannot be copied, pickled or resumed; begin another one")
}
