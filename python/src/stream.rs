//! `hybank.Stream`: a causal stream, block by block.

use crate::arrays::{Held, Shape, framed};
use crate::bank::Bank as PyBank;
use crate::errors::refused;
use crate::formats::{Format, Number};
use crate::fuse::{parse_algorithm, plan};
use crate::outputs::NewArray;
use crate::samples::{Room, Samples};
use hybank::bank::Bank;
use hybank::pipeline::Settings;
use hybank::runtime::{self, Output, Plan, ProcessError, STATE_COUNTS, StateError};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyTuple};
use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A stream through a bank: blocks of frames in, M samples per frame out, late by the latency.
///
/// Threads may share a stream; their blocks come one after another.
#[pyclass(frozen, module = "hybank")]
pub(crate) struct Stream {
    bank: Arc<Bank>,
    /// As it was asked for.
    asked: String,
    plan: Plan,
    shape: Shape,
    format: Format,
    state: Mutex<State>,
}

/// How a pickle makes a stream: a function and its arguments.
type Reduced<'py> =
    (Bound<'py, PyAny>, (Bound<'py, PyBank>, isize, &'static str, String, Bound<'py, PyBytes>, bool));

#[derive(Clone)]
struct State {
    /// One for real samples, two for the parts of complex ones.
    streams: Vec<runtime::Stream>,
    clipped: u64,
    closed: bool,
}

impl Stream {
    pub(crate) fn new(
        bank: &Arc<Bank>,
        axis: isize,
        dtype: Option<&Bound<'_, PyAny>>,
        algorithm: &str,
    ) -> PyResult<Self> {
        let default = Format { number: Number::F32, complex: false };
        let format = dtype.map_or(Ok(default), Format::of_dtype)?;
        let shape = Shape { axis, channels: bank.frame_samples() };
        shape.check()?;
        let algorithm_asked = parse_algorithm(algorithm)?.without_added_latency();
        let plan = plan(bank, format, algorithm_asked, Settings::default())?;
        let streams = vec![runtime::Stream::new(&plan); 1 + usize::from(format.complex)];
        let state = Mutex::new(State { streams, clipped: 0, closed: false });
        Ok(Self { bank: Arc::clone(bank), asked: algorithm.to_owned(), plan, shape, format, state })
    }

    /// The same stream at the place of a state, if one is given.
    pub(crate) fn resumed(self, state: Option<&[u8]>) -> PyResult<Self> {
        if let Some(bytes) = state {
            let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
            state.resume(bytes).map_err(refused)?;
        }
        Ok(self)
    }

    /// To be called without the interpreter lock: the thread that holds the state may wait for that lock.
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn read<T: Send>(&self, py: Python<'_>, of: impl FnOnce(&State) -> T + Send) -> T {
        py.detach(|| of(&self.lock()))
    }
}

#[pymethods]
impl Stream {
    /// Filters a block of frames; M output samples for each of them.
    fn process<'py>(&self, x: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let (frames, shape) = framed(x, &self.bank.layout(), self.shape.axis, true)?;
        let held = Held::new(&frames, shape)?;
        self.check_parts(held.format)?;
        let mut array = NewArray::new(x.py(), held.frames() * self.plan.ratio(), self.format)?;
        let (parts, mut room) = (held.parts()?, array.room()?);
        x.py().detach(|| self.lock().process(&parts, &mut room)).map_err(refused)?;
        array.finish()
    }

    /// The last samples, by zeros for input: as many frames of them as the latency has.
    fn flush<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let mut array = NewArray::new(py, self.plan.flush_frames() * self.plan.ratio(), self.format)?;
        let mut room = array.room()?;
        py.detach(|| self.lock().flush(&mut room)).map_err(refused)?;
        array.finish()
    }

    /// Back to the beginning.
    fn reset(&self, py: Python<'_>) {
        py.detach(|| self.lock().reset());
    }

    /// N, the samples of a frame.
    #[getter]
    fn channels(&self) -> usize {
        self.plan.channels()
    }

    /// M.
    #[getter]
    fn ratio(&self) -> usize {
        self.plan.ratio()
    }

    /// Output samples by which the stream is late.
    #[getter]
    fn latency(&self) -> usize {
        self.plan.latency()
    }

    /// Frames after which an input is forgotten; None for a recursion, which never forgets.
    #[getter]
    fn memory(&self) -> Option<usize> {
        self.plan.history()
    }

    /// Frames by which the stream is processed: a second stream that begins a multiple of so many frames
    /// later, with `memory` frames before that, has the same bits.
    #[getter]
    fn alignment(&self) -> usize {
        self.plan.alignment()
    }

    /// The name of the algorithm.
    #[getter]
    fn algorithm(&self) -> &'static str {
        self.plan.algorithm()
    }

    /// Frames since the beginning.
    #[getter]
    fn position(&self, py: Python<'_>) -> u64 {
        self.read(py, |state| state.streams[0].position())
    }

    /// Numbers of the input that were NaN or infinite and became 0.
    #[getter]
    fn replaced(&self, py: Python<'_>) -> u64 {
        self.read(py, |state| state.streams.iter().map(runtime::Stream::replaced).sum())
    }

    /// Output samples that saturated.
    #[getter]
    fn clipped(&self, py: Python<'_>) -> u64 {
        self.read(py, |state| state.clipped)
    }

    /// Times that the state of a recursion was not finite and became 0.
    #[getter]
    fn state_resets(&self, py: Python<'_>) -> u64 {
        self.read(py, |state| state.streams.iter().map(runtime::Stream::state_resets).sum())
    }

    /// The state as bytes: `bank.stream(state=..)` goes on from there with the same bits, in any process. A
    /// stream can be pickled too, with its bank.
    #[getter]
    fn state<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.read(py, State::bytes))
    }

    /// True if from here on this stream and one that goes on from `state` give the same bits to the same
    /// input. Counts and positions may differ.
    fn agrees(&self, py: Python<'_>, state: &[u8]) -> bool {
        self.read(py, |own| own.agrees(state))
    }

    /// A second stream at the same place.
    fn __copy__(&self, py: Python<'_>) -> Self {
        let state = Mutex::new(self.read(py, State::clone));
        let Self { bank, asked, plan, shape, format, .. } = self;
        Self {
            bank: Arc::clone(bank),
            asked: asked.clone(),
            plan: plan.clone(),
            shape: *shape,
            format: *format,
            state,
        }
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Reduced<'py>> {
        let py = slf.py();
        let Self { bank, asked, shape, format, .. } = slf.get();
        let (state, closed) = slf.get().read(py, |state| (state.bytes(), state.closed));
        let bank = PyBank { bank: Arc::clone(bank) }.into_pyobject(py)?;
        let arguments = (bank, shape.axis, format.name(), asked.clone(), PyBytes::new(py, &state), closed);
        Ok((slf.get_type().getattr("_of")?, arguments))
    }

    /// The stream of a pickle.
    #[staticmethod]
    fn _of(
        bank: &PyBank,
        axis: isize,
        dtype: &Bound<'_, PyAny>,
        algorithm: &str,
        state: &[u8],
        closed: bool,
    ) -> PyResult<Self> {
        let stream = Self::new(&bank.bank, axis, Some(dtype), algorithm)?.resumed(Some(state))?;
        stream.state.lock().unwrap_or_else(PoisonError::into_inner).closed = closed;
        Ok(stream)
    }

    fn __enter__<'py>(slf: &Bound<'py, Self>) -> Bound<'py, Self> {
        slf.clone()
    }

    #[pyo3(signature = (*_exception))]
    fn __exit__(&self, py: Python<'_>, _exception: &Bound<'_, PyTuple>) {
        py.detach(|| self.lock().closed = true);
    }

    fn __repr__(&self) -> String {
        let memory = self.memory().map_or_else(|| "None".to_owned(), |frames| frames.to_string());
        format!(
            "<hybank.Stream {}: {} channels, ratio {}, latency {}, memory {memory}>",
            self.algorithm(),
            self.channels(),
            self.ratio(),
            self.latency()
        )
    }
}

impl Stream {
    fn check_parts(&self, given: Format) -> PyResult<()> {
        match (given.complex, self.format.complex) {
            (true, false) => Err(refused(
                "the samples are complex, the stream is real; make it with bank.stream(dtype=\"c8\") or \"c16\"",
            )),
            (false, true) => Err(refused(
                "the samples are real, the stream is complex; make it with bank.stream(dtype=\"f4\") or \"f8\"",
            )),
            _ => Ok(()),
        }
    }
}

impl State {
    fn process(&mut self, parts: &[Samples<'_>], room: &mut Room<'_>) -> Result<(), StreamError> {
        self.check_open()?;
        for (i, (stream, part)) in self.streams.iter_mut().zip(parts).enumerate() {
            if parts.len() > 1 {
                room.select(i);
            }
            stream.run(part, room)?;
        }
        self.clipped += room.clipped();
        Ok(())
    }

    fn flush(&mut self, room: &mut Room<'_>) -> Result<(), StreamError> {
        self.check_open()?;
        let is_complex = self.streams.len() > 1;
        for (part, stream) in self.streams.iter_mut().enumerate() {
            if is_complex {
                room.select(part);
            }
            stream.flush(room)?;
        }
        self.clipped += room.clipped();
        Ok(())
    }

    fn reset(&mut self) {
        self.streams.iter_mut().for_each(runtime::Stream::reset);
        self.clipped = 0;
    }

    /// The count of saturated samples, then the state of each part, all of one length.
    fn bytes(&self) -> Vec<u8> {
        let mut bytes = self.clipped.to_le_bytes().to_vec();
        self.streams.iter().for_each(|stream| stream.save(&mut bytes));
        bytes
    }

    fn parts<'a>(&self, bytes: &'a [u8]) -> Option<(u64, Vec<&'a [u8]>)> {
        let (clipped, states) = bytes.split_first_chunk()?;
        let parts = self.streams.len();
        let is_whole = !states.is_empty() && states.len() % parts == 0;
        is_whole.then(|| (u64::from_le_bytes(*clipped), states.chunks_exact(states.len() / parts).collect()))
    }

    fn resume(&mut self, bytes: &[u8]) -> Result<(), StateError> {
        let (clipped, states) = self.parts(bytes).ok_or(StateError::NotAState)?;
        let mut streams = self.streams.clone();
        streams.iter_mut().zip(states).try_for_each(|(stream, state)| stream.resume(state))?;
        (self.streams, self.clipped) = (streams, clipped);
        Ok(())
    }

    fn agrees(&self, bytes: &[u8]) -> bool {
        let same = |(stream, state): (&runtime::Stream, &[u8])| {
            stream.state().get(STATE_COUNTS..) == state.get(STATE_COUNTS..)
        };
        self.parts(bytes).is_some_and(|(_, states)| self.streams.iter().zip(states).all(same))
    }

    fn check_open(&self) -> Result<(), StreamError> {
        if self.closed { Err(StreamError::Closed) } else { Ok(()) }
    }
}

/// Why a stream takes no samples.
enum StreamError {
    Closed,
    Process(ProcessError),
}

impl From<ProcessError> for StreamError {
    fn from(error: ProcessError) -> Self {
        Self::Process(error)
    }
}

impl fmt::Display for StreamError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Closed => {
                f.write_str("the stream was closed at the end of its with block; make another one")
            }
            Self::Process(error) => error.fmt(f),
        }
    }
}
