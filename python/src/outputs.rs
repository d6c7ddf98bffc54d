//! New arrays for outputs.

use crate::arrays::{Held, Shape};
use crate::errors::refused;
use crate::formats::{Format, Number};
use crate::samples::{Room, Samples};
use hybank::runtime::{Input, Isa, Output, PcmOutput, Sample};
use numpy::{Element, PyArray1, PyArrayMethods, PyReadwriteArray1};
use pyo3::prelude::*;

/// Numbers for which there is always memory. More are asked of NumPy by name, which raises `MemoryError` and
/// takes a little longer.
const SURE: usize = 1 << 16;

/// A new array of output samples that is being written.
pub(crate) struct NewArray<'py> {
    numbers: Numbers<'py>,
    format: Format,
}

enum Numbers<'py> {
    F32(PyReadwriteArray1<'py, f32>),
    F64(PyReadwriteArray1<'py, f64>),
    I8(PyReadwriteArray1<'py, i8>),
    U8(PyReadwriteArray1<'py, u8>),
    I16(PyReadwriteArray1<'py, i16>),
    I32(PyReadwriteArray1<'py, i32>),
}

impl<'py> NewArray<'py> {
    /// Zeros.
    pub(crate) fn new(py: Python<'py>, samples: usize, format: Format) -> PyResult<Self> {
        let len = if format.complex { 2 * samples } else { samples };
        let numbers = match format.number {
            Number::F32 => Numbers::F32(zeros(py, len)?),
            Number::F64 => Numbers::F64(zeros(py, len)?),
            Number::I8 => Numbers::I8(zeros(py, len)?),
            Number::U8 => Numbers::U8(zeros(py, len)?),
            Number::I16 => Numbers::I16(zeros(py, len)?),
            Number::I32 => Numbers::I32(zeros(py, len)?),
        };
        Ok(Self { numbers, format })
    }

    /// Room for the samples; for the parts of complex ones once one of them is selected.
    pub(crate) fn room(&mut self) -> PyResult<Room<'_>> {
        let Format { number, complex } = self.format;
        let bytes: &mut [u8] = match &mut self.numbers {
            Numbers::F32(array) => {
                let room = array.as_slice_mut().map_err(refused)?;
                if !complex {
                    return Ok(Room::F32(room));
                }
                bytemuck::cast_slice_mut(room)
            }
            Numbers::F64(array) => {
                let room = array.as_slice_mut().map_err(refused)?;
                if !complex {
                    return Ok(Room::F64(room));
                }
                bytemuck::cast_slice_mut(room)
            }
            Numbers::I8(array) => bytemuck::cast_slice_mut(array.as_slice_mut().map_err(refused)?),
            Numbers::U8(array) => array.as_slice_mut().map_err(refused)?,
            Numbers::I16(array) => bytemuck::cast_slice_mut(array.as_slice_mut().map_err(refused)?),
            Numbers::I32(array) => bytemuck::cast_slice_mut(array.as_slice_mut().map_err(refused)?),
        };
        Ok(Room::Pcm(PcmOutput::packed(number.format(), bytes)))
    }

    /// The array.
    pub(crate) fn finish(self) -> PyResult<Bound<'py, PyAny>> {
        let name = match self.format {
            Format { number: Number::F32, complex: true } => Some("c8"),
            Format { number: Number::F64, complex: true } => Some("c16"),
            _ => None,
        };
        let array = match self.numbers {
            Numbers::F32(array) => array.as_any().clone(),
            Numbers::F64(array) => array.as_any().clone(),
            Numbers::I8(array) => array.as_any().clone(),
            Numbers::U8(array) => array.as_any().clone(),
            Numbers::I16(array) => array.as_any().clone(),
            Numbers::I32(array) => array.as_any().clone(),
        };
        match name {
            Some(name) => array.call_method1("view", (name,)),
            None => Ok(array),
        }
    }
}

/// Real samples in another number type, as outputs are converted, and how many saturated.
#[pyfunction]
pub(crate) fn encode<'py>(
    y: &Bound<'py, PyAny>,
    dtype: &Bound<'py, PyAny>,
) -> PyResult<(Bound<'py, PyAny>, u64)> {
    let held = Held::new(y, Shape { axis: -1, channels: 1 })?;
    let mut array = NewArray::new(y.py(), held.frames(), Format::of_dtype(dtype)?)?;
    let (parts, mut room) = (held.parts()?, array.room()?);
    let (frames, is_single) = (held.frames(), held.format.number == Number::F32);
    let clipped = y.py().detach(|| {
        if is_single {
            convert::<f32>(&parts[0], frames, &mut room);
        } else {
            convert::<f64>(&parts[0], frames, &mut room);
        }
        room.clipped()
    });
    Ok((array.finish()?, clipped))
}

fn convert<T: Sample>(samples: &Samples<'_>, frames: usize, room: &mut Room<'_>) {
    let mut numbers = vec![T::default(); frames];
    samples.load(Isa::detect(), 0, &mut numbers);
    room.store(Isa::detect(), 0, &numbers);
}

fn zeros<T: Element>(py: Python<'_>, len: usize) -> PyResult<PyReadwriteArray1<'_, T>> {
    if len <= SURE {
        return PyArray1::zeros(py, len, false).try_readwrite().map_err(refused);
    }
    let zeros = py.import("numpy")?.call_method1("zeros", (len, T::get_dtype(py)))?;
    zeros.cast_into::<PyArray1<T>>()?.try_readwrite().map_err(refused)
}
