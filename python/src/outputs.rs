//! New arrays and files for outputs.

use crate::arrays::{ArrayShape, Held};
use crate::errors::{file_error, refused};
use crate::formats::ArrayFormat;
use hybank::files::AtomicFile;
use hybank::runtime::{FrameSink, FrameSource, Isa, PcmOutput, Sample};
use numpy::{PyArray1, PyArrayMethods, PyReadwriteArray1};
use pyo3::prelude::*;
use pyo3::types::PySlice;
use std::io::Write;
use std::path::Path;

/// Bytes for which there is always memory. More are asked of NumPy by name, which raises `MemoryError` and
/// takes a little longer.
const SURE: usize = 1 << 18;

/// A new array of output samples that is being written.
pub(crate) struct NewArray<'py> {
    /// Of one axis, in the byte order of this machine.
    bytes: PyReadwriteArray1<'py, u8>,
    format: ArrayFormat,
}

impl<'py> NewArray<'py> {
    /// Zeros.
    pub(crate) fn new(py: Python<'py>, samples: usize, format: ArrayFormat) -> PyResult<Self> {
        Ok(Self { bytes: zeros(py, samples.saturating_mul(format.bytes()))?, format })
    }

    /// Room for the bytes of the samples.
    pub(crate) fn bytes(&mut self) -> PyResult<&mut [u8]> {
        self.bytes.as_slice_mut().map_err(refused)
    }

    /// Room for the samples; for the parts of complex ones once one of them is selected.
    pub(crate) fn room(&mut self) -> PyResult<PcmOutput<'_>> {
        Ok(PcmOutput::packed(self.format.number, self.bytes()?))
    }

    /// The array.
    pub(crate) fn finish(self) -> PyResult<Bound<'py, PyAny>> {
        self.bytes.as_any().call_method1("view", (self.format.name(),))
    }

    /// The array, cut after so many samples.
    pub(crate) fn finish_first(self, samples: usize) -> PyResult<Bound<'py, PyAny>> {
        let py = self.bytes.py();
        self.finish()?.get_item(PySlice::new(py, 0, samples as isize, 1))
    }
}

/// Real samples in another number type, as outputs are converted, and how many saturated.
#[pyfunction]
pub(crate) fn encode<'py>(
    y: &Bound<'py, PyAny>,
    dtype: &Bound<'py, PyAny>,
) -> PyResult<(Bound<'py, PyAny>, u64)> {
    let held = Held::new(y, ArrayShape::MONO)?;
    let mut array = NewArray::new(y.py(), held.frames(), ArrayFormat::of_dtype(dtype)?)?;
    let samples = held.samples(&mut held.decoders()?)?;
    let (parts, mut room) = (samples.parts(), array.room()?);
    let (frames, is_single) = (held.frames(), held.format == ArrayFormat::F32);
    let clipped = y.py().detach(|| {
        if is_single {
            convert::<f32>(&*parts[0], frames, &mut room);
        } else {
            convert::<f64>(&*parts[0], frames, &mut room);
        }
        room.clipped
    });
    Ok((array.finish()?, clipped))
}

fn convert<T: Sample>(samples: &dyn FrameSource, frames: usize, room: &mut dyn FrameSink) {
    let mut numbers = vec![T::default(); frames];
    samples.load(Isa::detect(), 0, &mut numbers);
    room.store(Isa::detect(), 0, &numbers);
}

fn zeros(py: Python<'_>, bytes: usize) -> PyResult<PyReadwriteArray1<'_, u8>> {
    if bytes <= SURE {
        return PyArray1::zeros(py, bytes, false).try_readwrite().map_err(refused);
    }
    let zeros = py.import("numpy")?.call_method1("zeros", (bytes, "u1"))?;
    zeros.cast_into::<PyArray1<u8>>()?.try_readwrite().map_err(refused)
}

/// Writes a file, which appears when it is whole.
pub(crate) fn write_file(path: &Path, bytes: &[u8], overwrite: bool) -> PyResult<()> {
    begin_file(path, bytes, overwrite)?.commit().map_err(file_error)
}

/// A file that is whole but has no name yet.
pub(crate) fn begin_file(path: &Path, bytes: &[u8], overwrite: bool) -> PyResult<AtomicFile> {
    let mut file = AtomicFile::create(path, overwrite).map_err(file_error)?;
    file.write_all(bytes)?;
    Ok(file)
}
