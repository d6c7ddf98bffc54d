//! `hybank.Recording`: frames of a WAV or SigMF file from any place, for workers that read spans of it.

use crate::errors::{io_error, no_others};
use crate::formats::ArrayFormat;
use hybank::io::FrameFile;
use hybank::runtime::{Precision, Sample};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;

/// A recording whose frames are read from any place.
#[pyclass(frozen, module = "hybank")]
pub(crate) struct Recording {
    /// As it was given.
    path: PathBuf,
    file: FrameFile,
}

#[pymethods]
impl Recording {
    /// Reads the header of a WAV file, or the metadata of a SigMF recording.
    #[new]
    #[pyo3(signature = (path, **unknown), text_signature = "(path)")]
    fn new(path: PathBuf, unknown: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        no_others("Recording", "path", unknown)?;
        let file = FrameFile::open(&path).map_err(io_error)?;
        Ok(Self { path, file })
    }

    /// T.
    #[getter]
    fn frames(&self) -> u64 {
        self.file.frames()
    }

    /// Channels of a frame.
    #[getter]
    fn channels(&self) -> usize {
        self.file.header().channels
    }

    /// Frames per second; None if the file does not say.
    #[getter]
    fn rate(&self) -> Option<f64> {
        self.file.header().rate
    }

    /// The type of the arrays that `read` returns: floats that hold all digits of the samples.
    #[getter]
    fn dtype(&self) -> &'static str {
        let header = self.file.header();
        ArrayFormat::floats(header.layout.format, header.is_complex).name()
    }

    #[doc = include_str!("docs/Recording.read.rst")]
    fn read<'py>(&self, py: Python<'py>, first: u64, count: usize) -> PyResult<Bound<'py, PyAny>> {
        match Precision::of(self.file.header().layout.format) {
            Precision::Single => self.array::<f32>(py, first, count),
            Precision::Double => self.array::<f64>(py, first, count),
        }
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> (Bound<'py, PyAny>, (PathBuf,)) {
        (slf.get_type().into_any(), (slf.get().path.clone(),))
    }

    fn __repr__(&self) -> String {
        let (path, frames) = (self.path.display(), self.frames());
        format!("<hybank.Recording {path}: {frames} frames of {} channels>", self.channels())
    }
}

impl Recording {
    fn array<'py, T: Sample + numpy::Element>(
        &self,
        py: Python<'py>,
        first: u64,
        count: usize,
    ) -> PyResult<Bound<'py, PyAny>> {
        let header = self.file.header();
        let columns = header.columns();
        let numbers = py.detach(|| self.file.read::<T>(first, count)).map_err(io_error)?;
        let count = numbers.len() / columns;
        let array: Bound<'py, PyArray2<T>> = PyArray1::from_vec(py, numbers).reshape([count, columns])?;
        if header.is_complex { array.call_method1("view", (self.dtype(),)) } else { Ok(array.into_any()) }
    }
}
