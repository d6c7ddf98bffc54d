//! How a stream filters its frames: by streams of the runtime, or by a run that fills gaps or follows
//! delays.

use crate::errors::refused;
use crate::formats::Format;
use crate::running::{Extras, Outputs, Running, Tracks};
use crate::samples::{Room, Samples};
use hybank::bank::Bank;
use hybank::pipeline::{DroppedLatency, PipelineError};
use hybank::runtime::{self, Algorithm, Output, PcmFrames, Plan, ProcessError, STATE_COUNTS, StateError};
use pyo3::prelude::*;
use std::fmt;

/// The runs of a stream, which the end of its `with` block closes.
pub(crate) struct State {
    pub(crate) runs: Runs,
    pub(crate) closed: bool,
}

/// How frames are filtered.
pub(crate) enum Runs {
    /// By one stream for real samples, by two for the parts of complex ones.
    Streams { streams: Vec<runtime::Stream>, clipped: u64 },
    /// With gaps that are filled, or filters that follow the delays.
    Running { running: Box<Running>, mask: Vec<u8> },
}

impl State {
    pub(crate) fn process(&mut self, parts: &[Samples<'_>], room: &mut Room<'_>) -> Result<(), StreamError> {
        self.check_open()?;
        let Runs::Streams { streams, clipped } = &mut self.runs else { return Ok(()) };
        for (i, (stream, part)) in streams.iter_mut().zip(parts).enumerate() {
            if parts.len() > 1 {
                room.select(i);
            }
            stream.run(part, room)?;
        }
        *clipped += room.clipped();
        Ok(())
    }

    pub(crate) fn flush(&mut self, room: &mut Room<'_>) -> Result<(), StreamError> {
        self.check_open()?;
        let Runs::Streams { streams, clipped } = &mut self.runs else { return Ok(()) };
        let is_complex = streams.len() > 1;
        for (part, stream) in streams.iter_mut().enumerate() {
            if is_complex {
                room.select(part);
            }
            stream.flush(room)?;
        }
        *clipped += room.clipped();
        Ok(())
    }

    /// Of a stream that fills gaps or follows delays.
    pub(crate) fn push(
        &mut self,
        recordings: &[PcmFrames<'_>],
        frames: usize,
    ) -> Result<Outputs, StreamError> {
        self.run(|running| running.push(recordings, frames))
    }

    pub(crate) fn drain(&mut self) -> Result<Outputs, StreamError> {
        self.run(Running::drain)
    }

    fn run(
        &mut self,
        step: impl FnOnce(&mut Running) -> Result<(), PipelineError>,
    ) -> Result<Outputs, StreamError> {
        self.check_open()?;
        let Runs::Running { running, mask } = &mut self.runs else {
            return Ok(Outputs { samples: Vec::new(), mask: Vec::new() });
        };
        step(running)?;
        let mut outputs = running.take();
        *mask = std::mem::take(&mut outputs.mask);
        Ok(outputs)
    }

    fn check_open(&self) -> Result<(), StreamError> {
        if self.closed { Err(StreamError::Closed) } else { Ok(()) }
    }
}

impl Runs {
    pub(crate) fn new(
        bank: &Bank,
        plan: &Plan,
        format: Format,
        algorithm: Algorithm,
        extras: &Extras,
    ) -> PyResult<Self> {
        if !extras.is_any() {
            let streams = vec![runtime::Stream::new(plan); 1 + usize::from(format.complex)];
            return Ok(Self::Streams { streams, clipped: 0 });
        }
        let running = Running::new(bank, format, algorithm, extras, DroppedLatency::Nothing)?;
        Ok(Self::Running { running: Box::new(running), mask: Vec::new() })
    }

    pub(crate) fn tracks(&self) -> Option<Tracks> {
        if let Self::Running { running, .. } = self { Some(running.tracks()) } else { None }
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
    refused(
        "a stream that fills gaps or follows delays cannot be copied, pickled or resumed; begin another one",
    )
}

/// Why a stream takes no samples.
pub(crate) enum StreamError {
    Closed,
    Process(ProcessError),
    Run(PipelineError),
}

impl From<ProcessError> for StreamError {
    fn from(error: ProcessError) -> Self {
        Self::Process(error)
    }
}

impl From<PipelineError> for StreamError {
    fn from(error: PipelineError) -> Self {
        Self::Run(error)
    }
}

impl fmt::Display for StreamError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Closed => {
                f.write_str("the stream was closed at the end of its with block; make another one")
            }
            Self::Process(error) => error.fmt(f),
            Self::Run(error) => error.fmt(f),
        }
    }
}
