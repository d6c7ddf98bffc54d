//! The number types of samples in arrays.

use crate::errors::refused;
use hybank::quantity::{self, FullScale};
use hybank::runtime::{PcmFormat, Precision};
use numpy::{PyArrayDescr, PyArrayDescrMethods};
use pyo3::prelude::*;

/// A number type of samples in the byte order of this machine, and whether two of them are a complex sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct ArrayFormat {
    pub(crate) number: PcmFormat,
    pub(crate) complex: bool,
}

/// The formats by the names that NumPy has for them.
const FORMATS: [(&str, ArrayFormat); 12] = [
    ("f4", ArrayFormat::F32),
    ("f8", ArrayFormat::native(PcmFormat::F64Le, false)),
    ("i1", ArrayFormat::native(PcmFormat::S8, false)),
    ("u1", ArrayFormat::native(PcmFormat::U8, false)),
    ("i2", ArrayFormat::native(PcmFormat::S16Le, false)),
    ("i4", ArrayFormat::native(PcmFormat::S32Le, false)),
    ("i8", ArrayFormat::native(PcmFormat::S64Le, false)),
    ("u2", ArrayFormat::native(PcmFormat::U16Le, false)),
    ("u4", ArrayFormat::native(PcmFormat::U32Le, false)),
    ("f2", ArrayFormat::native(PcmFormat::F16Le, false)),
    ("c8", ArrayFormat::native(PcmFormat::F32Le, true)),
    ("c16", ArrayFormat::native(PcmFormat::F64Le, true)),
];

/// The full scale of converters that `full_scale=` means: a number, or codes such as "12bits".
pub(crate) fn full_scale(given: Option<&Bound<'_, PyAny>>) -> PyResult<Option<FullScale>> {
    let Some(given) = given else { return Ok(None) };
    let scale = quantity::full_scale(&given.str()?.to_cow()?);
    scale.map(Some).map_err(|error| refused(format!("full_scale: {error}")))
}

impl ArrayFormat {
    /// Real samples in f32.
    pub(crate) const F32: Self = Self::native(PcmFormat::F32Le, false);

    const fn native(number: PcmFormat, complex: bool) -> Self {
        Self { number: number.native(), complex }
    }

    /// The floats that hold all digits of such numbers.
    pub(crate) fn floats(number: PcmFormat, complex: bool) -> Self {
        match Precision::of(number) {
            Precision::Single => Self::native(PcmFormat::F32Le, complex),
            Precision::Double => Self::native(PcmFormat::F64Le, complex),
        }
    }

    /// The format of an output: what `dtype` asks for, else the floats that hold the digits of the input.
    pub(crate) fn of_output(input: Self, dtype: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let Some(dtype) = dtype else { return Ok(Self::floats(input.number, input.complex)) };
        let asked = Self::of_dtype(dtype)?;
        match (input.complex, asked.complex) {
            (false, true) => Err(refused(
                "dtype: the samples are real, and so is the output; give a real dtype, or convert the samples",
            )),
            (true, _) if !asked.number.is_float() => {
                Err(refused("dtype: complex samples are floats; choose c8 or c16"))
            }
            // f4 of complex samples means c8.
            (complex, _) => Ok(Self { complex, ..asked }),
        }
    }

    /// Bytes of a sample.
    pub(crate) fn bytes(self) -> usize {
        self.number.bytes() * (1 + usize::from(self.complex))
    }

    /// The name that NumPy knows.
    pub(crate) fn name(self) -> &'static str {
        FORMATS.iter().find(|(_, format)| *format == self).map_or("c16", |(name, _)| name)
    }

    /// What a dtype, or the name of one, stands for.
    pub(crate) fn of_dtype(asked: &Bound<'_, PyAny>) -> PyResult<Self> {
        let descr = PyArrayDescr::new(asked.py(), asked)?;
        let name = format!("{}{}", descr.kind() as char, descr.itemsize());
        let known = FORMATS.iter().find(|(known, _)| *known == name);
        let known = known.filter(|_| descr.is_native_byteorder() != Some(false));
        known.map(|(_, format)| *format).ok_or_else(|| {
            refused(format!(
                "dtype {descr} is not one of f2 f4 f8 i1 i2 i4 i8 u1 u2 u4 c8 c16 in the byte order of this machine; choose one"
            ))
        })
    }
}
