//! `hybank.Stream`: a causal stream, block by block.

use crate::arrays::{ArrayShape, Held, framed};
use crate::bank::Bank as PyBank;
use crate::errors::{no_others, refused};
use crate::formats::{ArrayFormat, full_scale};
use crate::fuse::{gap, marks, parse_algorithm, plan};
use crate::outputs::NewArray;
use crate::running::Running;
use hybank::bank::Bank;
use hybank::captures::Converters;
use hybank::io::{Decoder, StatedScale};
use hybank::pipeline::{GapEstimator, Pipeline};
use hybank::quantity::FullScale;
use hybank::runtime::Plan;
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyTuple};
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
    shape: ArrayShape,
    format: ArrayFormat,
    gaps: Option<Arc<dyn GapEstimator>>,
    running: Mutex<Running>,
    /// What reads the samples; made by the first of them.
    decoders: Mutex<Vec<Decoder>>,
}

/// How a pickle makes a stream: a function and its arguments.
type Pickled<'py> = (
    Bound<'py, PyAny>,
    (Bound<'py, PyBank>, isize, &'static str, String, Bound<'py, PyBytes>, bool, Option<String>),
);

impl Stream {
    pub(crate) fn new(
        bank: &Arc<Bank>,
        axis: isize,
        dtype: Option<&Bound<'_, PyAny>>,
        algorithm: &str,
        gaps: Option<Arc<dyn GapEstimator>>,
    ) -> PyResult<Self> {
        let format = dtype.map_or(Ok(ArrayFormat::F32), ArrayFormat::of_dtype)?;
        let scale = Converters::from(bank.as_ref()).scale(None);
        let shape = ArrayShape { axis, channels: bank.frame_samples(), scale };
        shape.check()?;
        let asked = parse_algorithm(algorithm)?.without_added_latency();
        let plan = plan(bank, format, asked)?;
        let running = Mutex::new(Running::new(bank, &plan, format, gaps.clone()));
        let (bank, asked, decoders) = (Arc::clone(bank), algorithm.to_owned(), Mutex::default());
        Ok(Self { bank, asked, plan, shape, format, gaps, running, decoders })
    }

    /// The same stream for samples of this full scale, if one is given.
    pub(crate) fn scaled(self, given: Option<FullScale>) -> Self {
        let scale = StatedScale { given, ..self.shape.scale };
        Self { shape: self.shape.scaled(scale), ..self }
    }

    /// The same stream at the place of a state, if one is given.
    pub(crate) fn resumed(self, state: Option<&[u8]>) -> PyResult<Self> {
        if let Some(bytes) = state {
            self.check_stateful()?;
            self.lock().pipeline.resume(bytes).map_err(refused)?;
        }
        Ok(self)
    }

    /// To be called without the interpreter lock: the thread that holds the run may wait for that lock.
    fn lock(&self) -> MutexGuard<'_, Running> {
        self.running.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The decoders of arrays like this one.
    fn decoders(&self, held: &Held<'_>) -> PyResult<MutexGuard<'_, Vec<Decoder>>> {
        let mut decoders = self.decoders.lock().unwrap_or_else(PoisonError::into_inner);
        if decoders.len() != held.decoders()?.len() {
            *decoders = held.decoders()?;
        }
        Ok(decoders)
    }

    fn read<T: Send>(&self, py: Python<'_>, of: impl FnOnce(&Pipeline<'static>) -> T + Send) -> T {
        py.detach(|| of(&self.lock().pipeline))
    }
}

#[pymethods]
impl Stream {
    #[doc = include_str!("docs/Stream.process.rst")]
    #[pyo3(signature = (x, **unknown), text_signature = "($self, x)")]
    fn process<'py>(
        &self,
        x: &Bound<'py, PyAny>,
        unknown: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        no_others("Stream.process", "x", unknown)?;
        let (frames, shape) = framed(x, &self.bank.layout(), self.shape.axis, true)?;
        let held = Held::new(&frames, shape.scaled(self.shape.scale))?;
        self.check_parts(held.format)?;
        let mut array = NewArray::new(x.py(), held.frames() * self.plan.ratio(), self.format)?;
        let samples = held.samples(&mut self.decoders(&held)?)?;
        let (parts, room) = (samples.parts(), array.bytes()?);
        let samples = x.py().detach(|| self.lock().push(&parts, room))?;
        array.finish_first(samples)
    }

    #[doc = include_str!("docs/Stream.flush.rst")]
    fn flush<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let waiting = self.gaps.as_ref().map_or(0, |gaps| gaps.reach());
        let most = (waiting + self.plan.flush_frames()) * self.plan.ratio();
        let mut array = NewArray::new(py, most, self.format)?;
        let room = array.bytes()?;
        let samples = py.detach(|| self.lock().drain(room))?;
        array.finish_first(samples)
    }

    #[doc = include_str!("docs/Stream.reset.rst")]
    fn reset(&self, py: Python<'_>) {
        py.detach(|| {
            let mut running = self.lock();
            let new = Running::new(&self.bank, &self.plan, self.format, self.gaps.clone());
            *running = Running { is_closed: running.is_closed, ..new };
        });
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
        self.read(py, Pipeline::position)
    }

    /// Numbers of the input that were NaN or infinite and became 0.
    #[getter]
    fn replaced(&self, py: Python<'_>) -> u64 {
        self.read(py, Pipeline::replaced)
    }

    /// Output samples that saturated.
    #[getter]
    fn clipped(&self, py: Python<'_>) -> u64 {
        self.read(py, Pipeline::clipped)
    }

    /// Times that the state of a recursion was not finite and became 0.
    #[getter]
    fn state_resets(&self, py: Python<'_>) -> u64 {
        self.read(py, Pipeline::state_resets)
    }

    /// The gaps so far as (channel from 1, first sample, length, SNR in dB there): those that have ended,
    /// then those that go on. None unless missing samples are estimated.
    #[getter]
    fn gaps(&self, py: Python<'_>) -> Option<Vec<(usize, u64, u64, f64)>> {
        self.gaps.as_ref()?;
        Some(self.read(py, |pipeline| {
            let gaps = pipeline.gaps().iter().copied().chain(pipeline.open_gaps());
            gaps.map(|one| gap(&one)).collect()
        }))
    }

    /// For each output of the last call 0 if no missing sample affects it, else its predicted SNR in dB,
    /// from 1 to 255. None unless missing samples are estimated.
    #[getter]
    fn mask(&self, py: Python<'_>) -> Option<Py<PyArray1<u8>>> {
        self.gaps.as_ref()?;
        let mask = py.detach(|| self.lock().mask.clone());
        Some(marks(py, &mask))
    }

    /// The state as bytes: `bank.stream(state=..)` goes on from there with the same bits, in any process. A
    /// stream can be pickled and copied too, with its bank.
    #[getter]
    fn state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        self.check_stateful()?;
        Ok(PyBytes::new(py, &self.read(py, Pipeline::state)))
    }

    #[doc = include_str!("docs/Stream.agrees.rst")]
    fn agrees(&self, py: Python<'_>, state: &[u8]) -> bool {
        self.gaps.is_none() && self.read(py, |pipeline| pipeline.agrees(state))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Pickled<'py>> {
        let (py, own) = (slf.py(), slf.get());
        let state = own.state(py)?;
        let closed = py.detach(|| own.lock().is_closed);
        let bank = PyBank { bank: Arc::clone(&own.bank) }.into_pyobject(py)?;
        let scale = own.shape.scale.given.map(|scale| scale.to_string());
        let arguments = (bank, own.shape.axis, own.format.name(), own.asked.clone(), state, closed, scale);
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
        scale: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let stream = Self::new(&bank.bank, axis, Some(dtype), algorithm, None)?;
        let stream = stream.scaled(full_scale(scale)?).resumed(Some(state))?;
        stream.lock().is_closed = closed;
        Ok(stream)
    }

    fn __enter__<'py>(slf: &Bound<'py, Self>) -> Bound<'py, Self> {
        slf.clone()
    }

    #[pyo3(signature = (*_exception))]
    fn __exit__(&self, py: Python<'_>, _exception: &Bound<'_, PyTuple>) {
        py.detach(|| self.lock().is_closed = true);
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
    fn check_stateful(&self) -> PyResult<()> {
        match &self.gaps {
            Some(_) => Err(refused(
                "a stream that estimates missing samples cannot be copied, pickled or resumed; begin another one",
            )),
            None => Ok(()),
        }
    }

    fn check_parts(&self, given: ArrayFormat) -> PyResult<()> {
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
