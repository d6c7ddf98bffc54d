//! Arrays as inputs of a bank, without a copy.

use crate::errors::{capture_error, refused, warn};
use crate::formats::ArrayFormat;
use hybank::bank::FrameLayout;
use hybank::captures::Captures;
use hybank::io::{DecodeError, DecodedFrames, Decoder, StatedScale, StreamHeader};
use hybank::runtime::{FrameSource, PcmFrames, SampleLayout, SideBySide};
use numpy::ndarray::Axis;
use numpy::{
    Element, PyArray1, PyArray2, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArray,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PySlice, PyTuple};

/// What an array of samples must look like.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ArrayShape {
    /// The axis of time, as NumPy counts: 0 or -2, 1 or -1.
    pub(crate) axis: isize,
    /// N.
    pub(crate) channels: usize,
    /// What is stated of their full scale.
    pub(crate) scale: StatedScale,
}

/// How samples lie in memory.
#[derive(Debug, Clone, Copy)]
struct ArrayLayout {
    channels: usize,
    frames: usize,
    order: Order,
}

/// The order of samples in memory.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Order {
    /// Frame after frame.
    Frames,
    /// Channel after channel, each without gaps; between them there may be some, as in a slice along time.
    Channels,
}

/// An array that is read while the interpreter lock is released.
pub(crate) struct Held<'py> {
    /// Along the axis that varies fastest.
    bytes: PyReadonlyArrayDyn<'py, u8>,
    layout: ArrayLayout,
    scale: StatedScale,
    pub(crate) format: ArrayFormat,
}

/// Samples as they lie in an array, or as numbers where their full scale is another.
pub(crate) enum Samples<'a> {
    Stored(Vec<PcmFrames<'a>>, ArrayFormat),
    Decoded(Vec<DecodedFrames>),
}

impl Samples<'_> {
    /// The samples, or the real and the imaginary parts of complex ones.
    pub(crate) fn parts(&self) -> Vec<Box<dyn FrameSource + '_>> {
        match self {
            Self::Stored(frames, ArrayFormat { complex: false, .. }) => {
                vec![Box::new(SideBySide::new(&frames[..]))]
            }
            Self::Stored(frames, _) => {
                let part = |part| frames.iter().map(|frames| frames.part(part)).collect::<Vec<_>>();
                vec![Box::new(SideBySide::new(part(0))), Box::new(SideBySide::new(part(1)))]
            }
            Self::Decoded(all) => {
                let real = all.iter().map(|one| one.frames().real).collect::<Vec<_>>();
                let imaginary: Vec<_> = all.iter().filter_map(|one| one.frames().imaginary).collect();
                let parts = [real, imaginary].into_iter().filter(|part| !part.is_empty());
                parts.map(|part| Box::new(SideBySide::new(part)) as Box<dyn FrameSource>).collect()
            }
        }
    }
}

impl<'py> Held<'py> {
    /// Holds `x`: any array whose samples lie frame after frame or channel after channel is read where it
    /// is, also a slice along time of the latter. Others (slices with steps, foreign byte orders,
    /// lists) are copied first.
    pub(crate) fn new(x: &Bound<'py, PyAny>, shape: ArrayShape) -> PyResult<Self> {
        let Ok(array) = x.cast_exact::<PyUntypedArray>() else {
            return Self::new(&plain(x)?, shape);
        };
        let [channels, frames] = shape.of(array)?;
        let Ok(format) = ArrayFormat::of_dtype(array.dtype().as_any()) else {
            return Self::converted(array, shape);
        };
        let (by_rows, by_columns) = (array.is_c_contiguous(), array.is_fortran_contiguous());
        let time = usize::from(!shape.time_first());
        let is_slice = array.ndim() == 2 && array.strides()[time] == format.bytes() as isize;
        let (order, is_turned) = match (by_rows, by_columns) {
            _ if !array.is_aligned() => return Self::new(&x.call_method0("copy")?, shape),
            (true, _) if shape.time_first() || channels == 1 => (Order::Frames, false),
            (true, _) => (Order::Channels, false),
            (_, true) if shape.time_first() => (Order::Channels, true),
            (_, true) => (Order::Frames, true),
            _ if is_slice => (Order::Channels, shape.time_first()),
            _ => return Self::new(&x.call_method0("copy")?, shape),
        };
        let rows = if is_turned { x.getattr("T")? } else { x.clone() };
        let bytes = rows.call_method1("view", ("u1",))?;
        let bytes = bytes.cast::<PyArrayDyn<u8>>()?.try_readonly().map_err(refused)?;
        Ok(Self { bytes, layout: ArrayLayout { channels, frames, order }, scale: shape.scale, format })
    }

    /// From another byte order.
    fn converted(array: &Bound<'py, PyUntypedArray>, shape: ArrayShape) -> PyResult<Self> {
        let dtype = array.getattr("dtype")?;
        if !dtype.getattr("isnative")?.extract::<bool>()? {
            let native = dtype.call_method1("newbyteorder", ("=",))?;
            return Self::new(&array.call_method1("astype", (native,))?, shape);
        }
        if dtype.getattr("kind")?.eq("b")? {
            return Err(refused(
                "samples of bool are true or false, no numbers; convert what they mean to floats",
            ));
        }
        Err(refused(format!(
            "samples of {dtype} cannot be read; convert them to floats (f2, f4, f8), integers (i1 to i8, u1 to u4) or \
             complex numbers (c8, c16)"
        )))
    }

    pub(crate) fn py(&self) -> Python<'py> {
        self.bytes.py()
    }

    /// T.
    pub(crate) fn frames(&self) -> usize {
        self.layout.frames
    }

    /// What reads the samples, of each recording, as numbers.
    pub(crate) fn decoders(&self) -> PyResult<Vec<Decoder>> {
        let decoder = |frames: &PcmFrames<'_>| Decoder::new(frames, self.format.complex, self.scale);
        self.recordings()?.iter().map(decoder).collect::<Result<_, _>>().map_err(decode_error)
    }

    /// The samples of full scale 1. What is odd about them the decoders know.
    pub(crate) fn samples(&self, decoders: &mut [Decoder]) -> PyResult<Samples<'_>> {
        let stored = self.recordings()?;
        let layout = SampleLayout::packed(self.format.number);
        let mut each = decoders.iter_mut().zip(&stored);
        if self.scale.changes(&StreamHeader::real(layout, 1)) {
            let decoded = each.map(|(decoder, stored)| decoder.decode(stored)).collect::<Result<_, _>>();
            return Ok(Samples::Decoded(decoded.map_err(decode_error)?));
        }
        each.try_for_each(|(decoder, stored)| decoder.judge(stored)).map_err(decode_error)?;
        Ok(Samples::Stored(stored, self.format))
    }

    /// The first samples as numbers, at most so many frames.
    pub(crate) fn first(&self, most: usize) -> PyResult<Vec<DecodedFrames>> {
        let stored = self.recordings()?;
        let mut decoders = self.decoders()?;
        let each = decoders.iter_mut().zip(&stored);
        let decode =
            |(decoder, frames): (&mut Decoder, &PcmFrames<'_>)| decoder.decode(&frames.range(0..most));
        each.map(decode).collect::<Result<_, _>>().map_err(decode_error)
    }

    /// The samples as a recorder has them; the parts of complex ones take turns.
    fn recordings(&self) -> PyResult<Vec<PcmFrames<'_>>> {
        let Self {
            layout: ArrayLayout { channels, order, .. }, format: ArrayFormat { number, complex }, ..
        } = *self;
        let layout = SampleLayout::packed(number);
        let parts = 1 + usize::from(complex);
        let frames = |bytes, channels| PcmFrames { layout, channels: parts * channels, bytes };
        if order == Order::Frames {
            return Ok(vec![frames(self.bytes.as_slice().map_err(refused)?, channels)]);
        }
        let row = |i| {
            let bytes = self.bytes.as_array().index_axis_move(Axis(0), i).to_slice();
            bytes.map(|bytes| frames(bytes, 1)).ok_or_else(|| refused("a channel has gaps"))
        };
        (0..channels).map(row).collect()
    }

    /// The samples as numbers, each channel by itself.
    pub(crate) fn captures(&self) -> PyResult<Captures> {
        let mut decoders = self.decoders()?;
        let decode = |(decoder, frames): (&mut Decoder, &PcmFrames<'_>)| decoder.decode(frames);
        let decoded = decoders.iter_mut().zip(&self.recordings()?).map(decode).collect::<Result<Vec<_>, _>>();
        let decoded = decoded.map_err(decode_error)?;
        odd_of(&decoders).iter().try_for_each(|text| warn(self.py(), text))?;
        Captures::of_frames(&decoded).map_err(capture_error)
    }
}

/// What is odd about samples.
pub(crate) fn odd_of(decoders: &[Decoder]) -> Vec<String> {
    let name = |k: usize| match decoders.len() {
        1 => "the samples".to_owned(),
        _ => format!("channel {}", k + 1),
    };
    let of_one = |(k, decoder): (usize, &Decoder)| {
        decoder.faults().map(|fault| format!("{}: {fault}", name(k))).collect::<Vec<_>>()
    };
    decoders.iter().enumerate().flat_map(of_one).collect()
}

fn decode_error(error: DecodeError) -> PyErr {
    match error {
        DecodeError::Memory(error) => capture_error(error.into()),
        other => refused(other),
    }
}

impl ArrayShape {
    /// Of one channel, nothing of whose full scale is stated.
    pub(crate) const MONO: Self =
        Self { axis: -1, channels: 1, scale: StatedScale { given: None, of_spec: None, bits: None } };

    /// The same with what is stated of the full scale.
    pub(crate) fn scaled(self, scale: StatedScale) -> Self {
        Self { scale, ..self }
    }

    fn time_first(self) -> bool {
        matches!(self.axis, 0 | -2)
    }

    /// Refuses an axis that is none.
    pub(crate) fn check(self) -> PyResult<()> {
        if (-2..2).contains(&self.axis) {
            return Ok(());
        }
        Err(refused(format!("axis {} is not the axis of time; give 0 or 1", self.axis)))
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
                return Err(refused(format!(
                    "an array of {} dimensions is no signal; give one of shape (N, T), or (T, N) with axis=0",
                    sizes.len()
                )));
            }
        };
        if channels == wanted {
            return Ok([channels, frames]);
        }
        let remedy = match (sizes, frames == wanted, self.time_first()) {
            ([_], ..) => format!(
                "; give a row for each channel; fuse and calibrate take one recording in which the converters take turns \
                 with interleaved={wanted}"
            ),
            (_, true, true) => "; leave axis=0 out if the rows are channels".into(),
            (_, true, false) => "; give axis=0 if the columns are channels".into(),
            (_, false, _) => String::new(),
        };
        Err(refused(format!(
            "the samples {sizes:?} have {channels} channels (time along axis {}) instead of {wanted}{remedy}",
            self.axis
        )))
    }
}

/// The frames of `x` and their shape. Converters with rates of their own may come as a list of signals, each
/// of its own length; then the frames are put together, as many as the shortest has. `is_whole` refuses what
/// is beyond.
pub(crate) fn framed<'py>(
    x: &Bound<'py, PyAny>,
    layout: &FrameLayout,
    axis: isize,
    is_whole: bool,
) -> PyResult<(Bound<'py, PyAny>, ArrayShape)> {
    let shape = ArrayShape { axis, channels: layout.count(), ..ArrayShape::MONO };
    let converters = layout.samples();
    let given: Vec<Bound<'py, PyAny>> = match (x.cast::<PyList>(), x.cast::<PyTuple>()) {
        _ if layout.is_plain() => return Ok((x.clone(), shape)),
        (Ok(list), _) => list.iter().collect(),
        (_, Ok(tuple)) => tuple.iter().collect(),
        _ => return Ok((x.clone(), shape)),
    };
    if given.len() != converters.len() {
        return Err(refused(format!(
            "{} signals for {} converters with rates of their own; give a list with one for each",
            given.len(),
            converters.len()
        )));
    }
    let numpy = x.py().import("numpy")?;
    let arrays =
        given.iter().map(|one| numpy.call_method1("asarray", (one,))).collect::<PyResult<Vec<_>>>()?;
    let length = |one: &Bound<'py, PyAny>| -> PyResult<usize> {
        match one.getattr("shape")?.extract::<Vec<usize>>()?[..] {
            [length] => Ok(length),
            _ => Err(refused("each signal of a list is an array of one dimension")),
        }
    };
    let lengths = arrays.iter().map(length).collect::<PyResult<Vec<_>>>()?;
    let frames = lengths.iter().zip(converters).map(|(length, samples)| length / samples).min().unwrap_or(0);
    if is_whole && lengths.iter().zip(converters).any(|(length, samples)| *length != frames * samples) {
        return Err(refused(format!(
            "signals of {lengths:?} samples are no whole frames, which hold {converters:?}; keep the rest for the next block"
        )));
    }
    let mut rows = Vec::new();
    for (array, samples) in arrays.iter().zip(converters) {
        if !array.getattr("dtype")?.eq(arrays[0].getattr("dtype")?)? {
            return Err(refused("the signals of a list have different types; convert them to one"));
        }
        let part = array.get_item(PySlice::new(x.py(), 0, (frames * samples) as isize, 1))?;
        rows.push(part.call_method1("reshape", (frames, *samples))?);
    }
    let all = numpy.call_method1("concatenate", (PyList::new(x.py(), rows)?, 1))?;
    Ok((all, ArrayShape { axis: 0, ..shape }))
}

/// The array of a list, of an object of another package, or of a subclass.
fn plain<'py>(x: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let numpy = x.py().import("numpy")?;
    if numpy.getattr("ma")?.call_method1("is_masked", (x,))?.extract()? {
        return Err(refused(
            "samples are masked; x.filled(np.nan) marks them as missing, x.data takes them as they are",
        ));
    }
    numpy.call_method1("asarray", (x,))
}

/// Rows of `columns` numbers as a read-only array; a matrix without rows keeps its columns.
pub(crate) fn matrix(
    py: Python<'_>,
    rows: Vec<Vec<f64>>,
    columns: usize,
) -> PyResult<Bound<'_, PyArray2<f64>>> {
    let count = rows.len();
    let flat: Vec<f64> = rows.into_iter().flatten().collect();
    read_only(PyArray1::from_vec(py, flat).reshape([count, columns])?)
}

pub(crate) fn read_only<'py, T: Element, D: numpy::ndarray::Dimension>(
    array: Bound<'py, numpy::PyArray<T, D>>,
) -> PyResult<Bound<'py, numpy::PyArray<T, D>>> {
    let flags = PyDict::new(array.py());
    flags.set_item("write", false)?;
    array.call_method("setflags", (), Some(&flags))?;
    Ok(array)
}
