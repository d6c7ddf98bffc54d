//! The number types of samples in arrays.

use crate::errors::refused;
use hybank::runtime::{PcmFormat, Precision};
use numpy::{PyArrayDescr, PyArrayDescrMethods, dtype};
use pyo3::prelude::*;

/// A number type of real samples, or of the parts of complex ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Number {
    F32,
    F64,
    I8,
    U8,
    I16,
    I32,
}

/// A number type of samples, and whether two of them are a complex sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Format {
    pub(crate) number: Number,
    pub(crate) complex: bool,
}

impl Number {
    /// As it lies in memory.
    pub(crate) fn format(self) -> PcmFormat {
        let big = cfg!(target_endian = "big");
        match self {
            Self::F32 => {
                if big {
                    PcmFormat::F32Be
                } else {
                    PcmFormat::F32Le
                }
            }
            Self::F64 => {
                if big {
                    PcmFormat::F64Be
                } else {
                    PcmFormat::F64Le
                }
            }
            Self::I8 => PcmFormat::S8,
            Self::U8 => PcmFormat::U8,
            Self::I16 => {
                if big {
                    PcmFormat::S16Be
                } else {
                    PcmFormat::S16Le
                }
            }
            Self::I32 => {
                if big {
                    PcmFormat::S32Be
                } else {
                    PcmFormat::S32Le
                }
            }
        }
    }

    /// Outputs with more digits than f32 need sums in f64.
    pub(crate) fn precision(self) -> Precision {
        match self {
            Self::F64 | Self::I32 => Precision::Double,
            Self::F32 | Self::I8 | Self::U8 | Self::I16 => Precision::Single,
        }
    }

    /// The floats that hold all digits of such inputs.
    fn float(self) -> Self {
        if self.precision() == Precision::Double { Self::F64 } else { Self::F32 }
    }
}

impl Format {
    /// The format of an output: what `dtype` asks for, else the floats that hold the digits of the input.
    pub(crate) fn of_output(input: Self, dtype: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let Some(dtype) = dtype else { return Ok(Self { number: input.number.float(), ..input }) };
        let asked = Self::of_dtype(dtype)?;
        match (input.complex, asked.complex) {
            (false, true) => Err(refused(
                "dtype: the samples are real, and so is the output; give a real dtype, or convert the samples",
            )),
            // f4 of complex samples means c8.
            (complex, _) => Self { complex, ..asked }.checked(),
        }
    }

    /// Bytes of a sample.
    pub(crate) fn bytes(self) -> usize {
        self.number.format().bytes() * (1 + usize::from(self.complex))
    }

    /// The name that NumPy knows.
    pub(crate) fn name(self) -> &'static str {
        match (self.number, self.complex) {
            (Number::F32, false) => "f4",
            (Number::F64, false) => "f8",
            (Number::F32, true) => "c8",
            (_, true) => "c16",
            (Number::I8, false) => "i1",
            (Number::U8, false) => "u1",
            (Number::I16, false) => "i2",
            (Number::I32, false) => "i4",
        }
    }

    /// What a dtype, or the name of one, stands for.
    pub(crate) fn of_dtype(asked: &Bound<'_, PyAny>) -> PyResult<Self> {
        let py = asked.py();
        let descr = PyArrayDescr::new(py, asked)?;
        let is = |other: Bound<'_, PyArrayDescr>| descr.is_equiv_to(&other);
        let number = match () {
            () if is(dtype::<f32>(py)) => Number::F32,
            () if is(dtype::<f64>(py)) => Number::F64,
            () if is(dtype::<i8>(py)) => Number::I8,
            () if is(dtype::<u8>(py)) => Number::U8,
            () if is(dtype::<i16>(py)) => Number::I16,
            () if is(dtype::<i32>(py)) => Number::I32,
            () if is(dtype::<numpy::Complex32>(py)) => {
                return Ok(Self { number: Number::F32, complex: true });
            }
            () if is(dtype::<numpy::Complex64>(py)) => {
                return Ok(Self { number: Number::F64, complex: true });
            }
            () => {
                return Err(refused(format!(
                    "dtype {descr} is not one of f4 f8 i1 u1 i2 i4 c8 c16 in the byte order of this machine; choose one"
                )));
            }
        };
        Ok(Self { number, complex: false })
    }

    fn checked(self) -> PyResult<Self> {
        if self.complex && !self.number.format().is_float() {
            return Err(refused("dtype: complex samples are floats; choose c8 or c16"));
        }
        Ok(self)
    }
}
