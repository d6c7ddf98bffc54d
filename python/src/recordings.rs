//! `hybank.Recording`: frames of a WAV or SigMF file from any place, for workers that read spans of it.

use crate::errors::{file_error, io_error, no_others, refused};
use crate::formats::Format;
use hybank::files::FileError;
use hybank::io::wav::WavReader;
use hybank::io::{SigmfMeta, StreamHeader, is_sigmf, sigmf_files};
use hybank::runtime::{Input, Isa, PcmFrames, Precision, Sample};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// A recording whose frames are read from any place.
#[pyclass(frozen, module = "hybank")]
pub(crate) struct Recording {
    /// As it was given.
    path: PathBuf,
    /// The file of the samples.
    data: PathBuf,
    /// Where they begin.
    offset: u64,
    header: StreamHeader,
    /// T.
    #[pyo3(get)]
    frames: u64,
}

#[pymethods]
impl Recording {
    /// Reads the header of a WAV file, or the metadata of a SigMF recording.
    #[new]
    #[pyo3(signature = (path, **unknown), text_signature = "(path)")]
    fn new(path: PathBuf, unknown: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        no_others("Recording", "path", unknown)?;
        if is_sigmf(&path) { Self::sigmf(&path) } else { Self::wav(path) }
    }

    /// Channels of a frame.
    #[getter]
    fn channels(&self) -> usize {
        self.header.channels
    }

    /// Frames per second; None if the file does not say.
    #[getter]
    fn rate(&self) -> Option<f64> {
        self.header.rate
    }

    /// The type of the arrays that `read` returns: floats that hold all digits of the samples.
    #[getter]
    fn dtype(&self) -> &'static str {
        Format::floats(self.header.layout.format, self.header.is_complex).name()
    }

    #[doc = include_str!("docs/Recording.read.rst")]
    fn read<'py>(&self, py: Python<'py>, first: u64, count: usize) -> PyResult<Bound<'py, PyAny>> {
        let first = first.min(self.frames);
        let count = self.frames.saturating_sub(first).min(count as u64) as usize;
        let bytes = py.detach(|| self.bytes(first, count))?;
        match Precision::of(self.header.layout.format) {
            Precision::Single => self.array::<f32>(py, &bytes),
            Precision::Double => self.array::<f64>(py, &bytes),
        }
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> (Bound<'py, PyAny>, (PathBuf,)) {
        (slf.get_type().into_any(), (slf.get().path.clone(),))
    }

    fn __repr__(&self) -> String {
        let Self { path, frames, .. } = self;
        format!("<hybank.Recording {}: {frames} frames of {} channels>", path.display(), self.channels())
    }
}

impl Recording {
    fn wav(path: PathBuf) -> PyResult<Self> {
        let name = path.display().to_string();
        let file = File::open(&path).map_err(|error| system(&path, error))?;
        let size = file.metadata()?.len();
        let reader = WavReader::new(file, &name).map_err(refused)?;
        let wav = reader.header();
        let bytes = wav.data_bytes.unwrap_or(u64::MAX).min(size.saturating_sub(wav.data_offset));
        let real = StreamHeader::real(wav.layout, wav.channels);
        let header = StreamHeader { rate: Some(wav.rate.into()), ..real };
        let frames = bytes / header.frame_bytes() as u64;
        Ok(Self { data: path.clone(), path, offset: wav.data_offset, header, frames })
    }

    fn sigmf(path: &Path) -> PyResult<Self> {
        let [meta_path, data] = sigmf_files(path);
        let name = meta_path.display().to_string();
        let meta = SigmfMeta::read(&meta_path).map_err(io_error)?;
        if lost(&meta) {
            return Err(refused(format!(
                "{name}: frames were lost (core:global_index jumps); fuse the recording with `hybank fuse`, which fills them"
            )));
        }
        let header = meta.stream_header(&name).map_err(refused)?;
        let size =
            File::open(&data).and_then(|file| file.metadata()).map_err(|error| system(&data, error))?;
        let frames = size.len() / header.frame_bytes() as u64;
        Ok(Self { path: path.to_owned(), data, offset: 0, header, frames })
    }

    fn bytes(&self, first: u64, count: usize) -> PyResult<Vec<u8>> {
        let frame = self.header.frame_bytes();
        let mut bytes = vec![0; count * frame];
        let mut file = File::open(&self.data).map_err(|error| system(&self.data, error))?;
        file.seek(SeekFrom::Start(self.offset + first * frame as u64))?;
        file.read_exact(&mut bytes).map_err(|error| system(&self.data, error))?;
        Ok(bytes)
    }

    fn array<'py, T: Sample + numpy::Element>(
        &self,
        py: Python<'py>,
        bytes: &[u8],
    ) -> PyResult<Bound<'py, PyAny>> {
        let columns = self.header.columns();
        let frames = [PcmFrames { layout: self.header.layout, channels: columns, bytes }];
        let count = frames[0].frames();
        let mut numbers = vec![T::default(); count * columns];
        py.detach(|| (&frames.as_slice() as &dyn Input).load(Isa::detect(), 0, &mut numbers));
        let array: Bound<'py, PyArray2<T>> = PyArray1::from_vec(py, numbers).reshape([count, columns])?;
        if self.header.is_complex {
            array.call_method1("view", (self.dtype(),))
        } else {
            Ok(array.into_any())
        }
    }
}

/// Frames between the captures are missing.
fn lost(meta: &SigmfMeta) -> bool {
    let mut leads = meta
        .captures
        .iter()
        .filter_map(|capture| capture.global_index.map(|index| index.wrapping_sub(capture.sample_start)));
    let first = leads.next();
    leads.any(|lead| Some(lead) != first)
}

/// A refusal of the system, as Python has it.
fn system(path: &Path, error: std::io::Error) -> PyErr {
    file_error(FileError::system(&path.display().to_string(), "read it")(error))
}
