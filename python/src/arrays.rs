//! Arrays as inputs of a bank, without a copy.

use crate::errors::{HybankError, refused};
use crate::formats::{Format, Number};
use crate::samples::Samples;
use bytemuck::NoUninit;
use hybank::memory::available_memory;
use hybank::runtime::{Input, Interleaved, Isa, PcmFormat, PcmFrames, Sample, SampleLayout};
use numpy::ndarray::Axis;
use numpy::{
    Complex32, Complex64, Element, PyArrayDescrMethods, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn,
    PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::exceptions::PyMemoryError;
use pyo3::prelude::*;
use pyo3::types::{PyList, PyTuple};

/// Lists of doubles that a computation on samples holds at once, about: the samples, those of each channel,
/// transforms and spectra.
const WORK: usize = 8;

/// What an array of samples must look like.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Shape {
    /// The axis of time, as NumPy counts: 0 or -2, 1 or -1.
    pub(crate) axis: isize,
    /// N.
    pub(crate) channels: usize,
}

/// How samples lie in memory.
#[derive(Debug, Clone, Copy)]
struct Layout {
    channels: usize,
    frames: usize,
    order: Order,
}

/// The order of samples in memory.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Order {
    /// Frame after frame.
    Frames,
    /// Channel after channel.
    Channels,
    /// Each channel without gaps, but gaps between them: a slice along time. The axis of channels.
    Slices { axis: usize },
}

/// An array that is read while the interpreter lock is released.
pub(crate) struct Held<'py> {
    numbers: Numbers<'py>,
    layout: Layout,
    pub(crate) format: Format,
}

enum Numbers<'py> {
    F32(PyReadonlyArrayDyn<'py, f32>),
    F64(PyReadonlyArrayDyn<'py, f64>),
    I8(PyReadonlyArrayDyn<'py, i8>),
    U8(PyReadonlyArrayDyn<'py, u8>),
    I16(PyReadonlyArrayDyn<'py, i16>),
    I32(PyReadonlyArrayDyn<'py, i32>),
}

impl<'py> Held<'py> {
    /// Holds `x`: any array whose samples lie frame after frame or channel after channel is read where it
    /// is, also a slice along time of the latter. Others (slices with steps, foreign byte orders, float16,
    /// lists) are copied first.
    pub(crate) fn new(x: &Bound<'py, PyAny>, shape: Shape) -> PyResult<Self> {
        let Ok(array) = x.cast_exact::<PyUntypedArray>() else {
            return Self::new(&plain(x)?, shape);
        };
        let [channels, frames] = shape.of(array)?;
        let (by_rows, by_columns) = (array.is_c_contiguous(), array.is_fortran_contiguous());
        if !array.is_aligned() {
            return Self::new(&x.call_method0("copy")?, shape);
        }
        if !(by_rows || by_columns) {
            return Self::slice(array, shape);
        }
        let order = if by_rows == shape.time_first() { Order::Frames } else { Order::Channels };
        let layout = Layout { channels, frames, order };
        // Complex numbers as pairs of floats: a view along the axis that varies fastest.
        let pairs = |name: &str| {
            let rows = if by_rows { x.clone() } else { x.getattr("T")? };
            rows.call_method1("view", (name,))
        };
        let complex = |numbers: Numbers<'py>| {
            let format = Format { number: numbers.number(), complex: true };
            Self { numbers, layout, format }
        };
        if let Some(numbers) = Numbers::of(x)? {
            let format = Format { number: numbers.number(), complex: false };
            return Ok(Self { numbers, layout, format });
        }
        if x.cast::<PyArrayDyn<Complex32>>().is_ok() {
            return Ok(complex(Numbers::F32(readonly(pairs("f4")?.cast()?)?)));
        }
        if x.cast::<PyArrayDyn<Complex64>>().is_ok() {
            return Ok(complex(Numbers::F64(readonly(pairs("f8")?.cast()?)?)));
        }
        Self::converted(array, shape)
    }

    /// An array with gaps.
    fn slice(array: &Bound<'py, PyUntypedArray>, shape: Shape) -> PyResult<Self> {
        let [channels, frames] = shape.of(array)?;
        let axis = usize::from(shape.time_first());
        let is_slice = array.ndim() == 2 && array.strides()[1 - axis] == array.dtype().itemsize() as isize;
        if let (true, Some(numbers)) = (is_slice, Numbers::of(array)?) {
            let format = Format { number: numbers.number(), complex: false };
            return Ok(Self {
                numbers,
                layout: Layout { channels, frames, order: Order::Slices { axis } },
                format,
            });
        }
        Self::new(&array.call_method0("copy")?, shape)
    }

    /// From another byte order, or from floats of half precision.
    fn converted(array: &Bound<'py, PyUntypedArray>, shape: Shape) -> PyResult<Self> {
        let dtype = array.getattr("dtype")?;
        if !dtype.getattr("isnative")?.extract::<bool>()? {
            let native = dtype.call_method1("newbyteorder", ("=",))?;
            return Self::new(&array.call_method1("astype", (native,))?, shape);
        }
        if dtype.getattr("char")?.eq("e")? {
            return Self::new(&array.call_method1("astype", ("f4",))?, shape);
        }
        Err(HybankError::new_err(format!(
            "samples of {dtype} cannot be read; convert them to float32, float64, int16, int32, int8, uint8, complex64 or \
             complex128"
        )))
    }

    /// T.
    pub(crate) fn frames(&self) -> usize {
        self.layout.frames
    }

    /// The samples, or the real and the imaginary parts of complex ones.
    pub(crate) fn parts(&self) -> PyResult<Vec<Samples<'_>>> {
        (0..1 + usize::from(self.format.complex)).map(|part| self.part(part)).collect()
    }

    /// The samples, or one part of complex ones.
    fn part(&self, part: usize) -> PyResult<Samples<'_>> {
        let layout = self.layout;
        let (format, part) = (self.format.number.format(), self.format.complex.then_some(part));
        let (is_real, is_interleaved) = (!self.format.complex, layout.order == Order::Frames);
        Ok(match &self.numbers {
            Numbers::F32(array) if is_real && is_interleaved => {
                Samples::Interleaved32(layout.interleaved(array)?)
            }
            Numbers::F64(array) if is_real && is_interleaved => {
                Samples::Interleaved64(layout.interleaved(array)?)
            }
            Numbers::F32(array) => Samples::Pcm(layout.pcm(array, format, part)?),
            Numbers::F64(array) => Samples::Pcm(layout.pcm(array, format, part)?),
            Numbers::I8(array) => Samples::Pcm(layout.pcm(array, format, part)?),
            Numbers::U8(array) => Samples::Pcm(layout.pcm(array, format, part)?),
            Numbers::I16(array) => Samples::Pcm(layout.pcm(array, format, part)?),
            Numbers::I32(array) => Samples::Pcm(layout.pcm(array, format, part)?),
        })
    }

    /// Frame after frame as doubles: the samples, or the real (0) or imaginary (1) parts of complex ones.
    ///
    /// Raises `MemoryError` if there is no memory for [`WORK`] such lists.
    pub(crate) fn doubles(&self, part: usize) -> PyResult<Vec<f64>> {
        let count = self.layout.frames.saturating_mul(self.layout.channels);
        let bytes = count.saturating_mul(WORK * size_of::<f64>());
        if available_memory().is_some_and(|memory| bytes as f64 > memory) {
            let text =
                format!("{count} samples need about {:.0} GB of memory; give fewer", bytes as f64 / 1e9);
            return Err(PyMemoryError::new_err(text));
        }
        let mut frames = vec![0.0; count];
        self.part(part)?.load(Isa::detect(), 0, &mut frames);
        Ok(frames)
    }

    /// Lowest and highest value of a sample of integers; `None` for floats.
    pub(crate) fn rails(&self) -> Option<(f64, f64)> {
        let format = self.format.number.format();
        (!format.is_float()).then(|| (-1.0, 1.0 - 2f64.powi(1 - 8 * format.bytes() as i32)))
    }
}

impl Shape {
    fn time_first(self) -> bool {
        matches!(self.axis, 0 | -2)
    }

    /// Refuses an axis that is none.
    pub(crate) fn check(self) -> PyResult<()> {
        if (-2..2).contains(&self.axis) {
            return Ok(());
        }
        Err(HybankError::new_err(format!("axis {} is not the axis of time; give 0 or 1", self.axis)))
    }

    /// N and T of an array.
    fn of(self, array: &Bound<'_, PyUntypedArray>) -> PyResult<[usize; 2]> {
        let (sizes, wanted) = (array.shape(), self.channels);
        self.check()?;
        let [channels, frames] = match *sizes {
            [frames] => [1, frames],
            [frames, channels] if self.time_first() => [channels, frames],
            [channels, frames] => [channels, frames],
            _ => {
                return Err(HybankError::new_err(format!(
                    "an array of {} dimensions is no signal; give one of shape (N, T), or (T, N) with axis=0",
                    sizes.len()
                )));
            }
        };
        if channels == wanted {
            return Ok([channels, frames]);
        }
        let remedy = match (frames == wanted, self.time_first()) {
            (true, true) => "; leave axis=0 out if the rows are channels",
            (true, false) => "; give axis=0 if the columns are channels",
            (false, _) => "",
        };
        Err(HybankError::new_err(format!(
            "the samples {sizes:?} have {channels} channels (time along axis {}) instead of {wanted}{remedy}",
            self.axis
        )))
    }
}

impl Layout {
    /// Each channel.
    fn rows<'a, S: Element>(&self, array: &'a PyReadonlyArrayDyn<'_, S>) -> PyResult<Vec<&'a [S]>> {
        let Self { channels, order, .. } = *self;
        let Order::Slices { axis } = order else {
            let numbers = slice(array)?;
            // Of complex samples twice as many numbers as frames.
            let row = numbers.len() / channels.max(1);
            return Ok((0..channels).map(|i| &numbers[i * row..(i + 1) * row]).collect());
        };
        let row = |i| array.as_array().index_axis_move(Axis(axis), i).to_slice();
        (0..channels).map(|i| row(i).ok_or_else(|| refused("a channel has gaps"))).collect()
    }

    fn interleaved<'a, S: Element + Sample>(
        &self,
        array: &'a PyReadonlyArrayDyn<'_, S>,
    ) -> PyResult<Interleaved<'a, S>> {
        Interleaved::new(slice(array)?, self.channels).map_err(refused)
    }

    fn pcm<'a, S: Element + NoUninit>(
        &self,
        array: &'a PyReadonlyArrayDyn<'_, S>,
        format: PcmFormat,
        part: Option<usize>,
    ) -> PyResult<Vec<PcmFrames<'a>>> {
        let frames = |numbers, channels| {
            let (layout, bytes) = (SampleLayout::packed(format), bytemuck::cast_slice(numbers));
            match part {
                None => PcmFrames { layout, channels, bytes },
                Some(part) => PcmFrames { layout, channels: 2 * channels, bytes }.part(part),
            }
        };
        if self.order == Order::Frames {
            return Ok(vec![frames(slice(array)?, self.channels)]);
        }
        Ok(self.rows(array)?.into_iter().map(|row| frames(row, 1)).collect())
    }
}

impl<'py> Numbers<'py> {
    /// Of a real array; `None` for another number type.
    fn of(x: &Bound<'py, PyAny>) -> PyResult<Option<Self>> {
        if let Ok(array) = x.cast::<PyArrayDyn<f32>>() {
            return Ok(Some(Self::F32(readonly(array)?)));
        }
        if let Ok(array) = x.cast::<PyArrayDyn<f64>>() {
            return Ok(Some(Self::F64(readonly(array)?)));
        }
        if let Ok(array) = x.cast::<PyArrayDyn<i16>>() {
            return Ok(Some(Self::I16(readonly(array)?)));
        }
        if let Ok(array) = x.cast::<PyArrayDyn<i32>>() {
            return Ok(Some(Self::I32(readonly(array)?)));
        }
        if let Ok(array) = x.cast::<PyArrayDyn<i8>>() {
            return Ok(Some(Self::I8(readonly(array)?)));
        }
        if let Ok(array) = x.cast::<PyArrayDyn<u8>>() {
            return Ok(Some(Self::U8(readonly(array)?)));
        }
        Ok(None)
    }

    fn number(&self) -> Number {
        match self {
            Self::F32(_) => Number::F32,
            Self::F64(_) => Number::F64,
            Self::I8(_) => Number::I8,
            Self::U8(_) => Number::U8,
            Self::I16(_) => Number::I16,
            Self::I32(_) => Number::I32,
        }
    }
}

/// The array of a list, of an object of another package, or of a subclass.
fn plain<'py>(x: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let numpy = x.py().import("numpy")?;
    if numpy.getattr("ma")?.call_method1("is_masked", (x,))?.extract()? {
        return Err(HybankError::new_err(
            "samples are masked; x.filled(np.nan) marks them as missing, x.data takes them as they are",
        ));
    }
    let array = numpy.call_method1("asarray", (x,))?;
    // Numbers of a list are no samples of a converter.
    let is_list = x.is_instance_of::<PyList>() || x.is_instance_of::<PyTuple>();
    match is_list && array.getattr("dtype")?.getattr("kind")?.eq("i")? {
        true => array.call_method1("astype", ("f8",)),
        false => Ok(array),
    }
}

fn readonly<'py, T: Element>(array: &Bound<'py, PyArrayDyn<T>>) -> PyResult<PyReadonlyArrayDyn<'py, T>> {
    array.try_readonly().map_err(refused)
}

fn slice<'a, S: Element>(array: &'a PyReadonlyArrayDyn<'_, S>) -> PyResult<&'a [S]> {
    array.as_slice().map_err(refused)
}
