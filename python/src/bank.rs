//! `hybank.Bank` and `hybank.load`.

use crate::arrays::framed;
use crate::background;
use crate::errors::{choose, file_error, refused};
use crate::fuse::{self, Request};
use crate::results::{Figures, Gamma};
use crate::sources;
use crate::stream::Stream;
use hybank::bank::{self, StateSpace, SynthesisFilters};
use hybank::design;
use hybank::files::AtomicFile;
use hybank::interchange::{Format as Exported, export};
use numpy::{Element, PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Most states of a realisation as dense matrices: 128 MiB.
const MOST_DENSE_STATES: usize = 4096;

/// Most frequencies of a response, which take a minute.
const MOST_FREQUENCIES: usize = 10_000_000;

/// Reads a bank file.
#[pyfunction]
pub(crate) fn load(path: PathBuf) -> PyResult<Bank> {
    let text = sources::read(&path)?;
    sources::parse_bank(&text, &path.display().to_string()).map(Bank::from)
}

/// A one-dimensional array of doubles.
type Array<'py> = Bound<'py, PyArray1<f64>>;

/// Synthesis filters with the data to run and verify them.
#[pyclass(frozen, module = "hybank")]
pub(crate) struct Bank {
    pub(crate) bank: Arc<bank::Bank>,
}

impl From<bank::Bank> for Bank {
    fn from(bank: bank::Bank) -> Self {
        Self { bank: Arc::new(bank) }
    }
}

/// `a`, `b`, `c` and `d`.
type Matrices<'py> = (
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
);

#[pymethods]
impl Bank {
    /// The bank of a file's text.
    #[staticmethod]
    fn from_json(text: &str) -> PyResult<Self> {
        sources::parse_bank(text, "bank").map(Self::from)
    }

    /// The text of the bank file. All numbers read back to the same bits.
    fn to_json(&self) -> PyResult<String> {
        self.bank.to_json().map_err(refused)
    }

    /// Writes the bank file, which appears when it is whole.
    #[pyo3(signature = (path, *, overwrite = true))]
    fn save(&self, path: PathBuf, overwrite: bool) -> PyResult<()> {
        write_file(&path, self.to_json()?.as_bytes(), overwrite)
    }

    /// Writes the bank for another tool: `c99`, `csv`, `npz`, `mat`, `coe` or `mem`. `name` is the prefix of
    /// C identifiers, and `input_bits` are those of the samples from which integer code subtracts offsets.
    #[pyo3(signature = (path, *, format, name = "bank", input_bits = None, overwrite = true))]
    fn export(
        &self,
        path: PathBuf,
        format: &str,
        name: &str,
        input_bits: Option<u32>,
        overwrite: bool,
    ) -> PyResult<()> {
        let bytes =
            export(&self.bank, choose("format", format, &FORMATS)?, name, input_bits).map_err(refused)?;
        write_file(&path, &bytes, overwrite)
    }

    /// The number of converters.
    #[getter]
    fn channels(&self) -> usize {
        self.bank.channel_count()
    }

    /// Samples of each converter per frame: 1, unless converters have rates of their own.
    #[getter]
    fn samples(&self) -> Vec<usize> {
        self.bank.samples.clone()
    }

    /// M, fast samples per frame.
    #[getter]
    fn ratio(&self) -> usize {
        self.bank.ratio
    }

    /// The latency in fast samples.
    #[getter]
    fn latency(&self) -> usize {
        self.bank.latency
    }

    /// The fast period in seconds.
    #[getter]
    fn fast_period(&self) -> f64 {
        self.bank.fast_period.0
    }

    /// The design method.
    #[getter]
    fn method(&self) -> &'static str {
        self.bank.method.name()
    }

    /// True if the bank carries a proof of its gamma.
    #[getter]
    fn proven(&self) -> bool {
        self.bank.proof.as_ref().is_some_and(|proof| proof.upper.is_some())
    }

    /// The spec with all defaults filled in, as TOML; None for a bank made elsewhere.
    #[getter]
    fn spec(&self) -> PyResult<Option<String>> {
        self.bank.spec.as_ref().map(|spec| spec.to_toml().map_err(refused)).transpose()
    }

    /// The worst-case error with its bounds.
    #[getter]
    fn gamma(&self) -> Gamma {
        let bank::Gamma { norm, upper, lower, noncausal, worst_case, tracked } = self.bank.gamma;
        Gamma { norm, upper, lower, noncausal, worst_case, tracked }
    }

    /// The delay of each channel in seconds.
    #[getter]
    fn delays<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        read_only(PyArray1::from_iter(py, self.bank.delays.iter().map(|delay| delay.0)))
    }

    /// The gain of each converter.
    #[getter]
    fn gains<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        read_only(PyArray1::from_slice(py, &self.bank.gains))
    }

    /// The offset of each converter.
    #[getter]
    fn offsets<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        read_only(PyArray1::from_slice(py, &self.bank.offsets))
    }

    /// Taps at the fast rate, (N, L), a row for each sample of a frame; None for a recursive bank.
    #[getter]
    fn taps<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        let SynthesisFilters::Fir(taps) = &self.bank.filters else { return Ok(None) };
        let longest = taps.iter().map(Vec::len).max().unwrap_or(0);
        let padded = |f: &Vec<f64>| f.iter().copied().chain(std::iter::repeat(0.0)).take(longest).collect();
        matrix(py, taps.iter().map(padded).collect(), longest).map(Some)
    }

    /// The matrices (a, b, c, d) of the bank per slow period: N inputs, M outputs.
    #[getter]
    fn ss<'py>(&self, py: Python<'py>) -> PyResult<Matrices<'py>> {
        let StateSpace { a, b, c, d } = self.block()?;
        let (states, channels) = (a.len(), self.bank.frame_samples());
        Ok((
            matrix(py, a, states)?,
            matrix(py, b, channels)?,
            matrix(py, c, states)?,
            matrix(py, d, channels)?,
        ))
    }

    /// The largest gain of the error system at `n` frequencies from 0 to half the slow rate: (hertz, gain).
    #[pyo3(signature = (n = 512))]
    fn error_response<'py>(&self, py: Python<'py>, n: i64) -> PyResult<(Array<'py>, Array<'py>)> {
        let count = usize::try_from(n)
            .ok()
            .filter(|&count| count <= MOST_FREQUENCIES)
            .ok_or_else(|| refused(format!("n: {n} frequencies; give 0 to {MOST_FREQUENCIES}")))?;
        let bank = Arc::clone(&self.bank);
        let points = background::run(py, None, move |_| design::error_response(&bank, count))?;
        let points = points.map_err(refused)?;
        let (hertz, gain): (Vec<f64>, Vec<f64>) =
            points.into_iter().map(|(hertz, gain)| (hertz.0, gain)).unzip();
        Ok((PyArray1::from_vec(py, hertz), PyArray1::from_vec(py, gain)))
    }

    /// Signal-to-noise ratio, largest image and error of gain, and what the simple ways would give.
    fn figures(&self, py: Python<'_>) -> PyResult<Figures> {
        let bank = Arc::clone(&self.bank);
        let figures = background::run(py, None, move |_| hybank::figures::Figures::new(&bank))?;
        figures.map(Figures::from).map_err(refused)
    }

    /// Draws the error by frequency with matplotlib.
    #[pyo3(signature = (ax = None))]
    fn plot<'py>(slf: &Bound<'py, Self>, ax: Option<Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("hybank._show")?.call_method1("plot", (slf, ax))
    }

    /// Fuses a whole signal; the output lines up with the time axis of the input.
    #[pyo3(
        signature = (
            x, *, axis = -1, dtype = None, threads = 1, gaps = None, algorithm = "auto", keep_latency = false,
            full_output = false
        ),
        text_signature = "($self, x, *, axis=-1, dtype=None, threads=1, gaps=None, algorithm='auto', keep_latency=False, full_output=False)"
    )]
    #[allow(clippy::too_many_arguments, reason = "keywords of a Python function")]
    fn fuse<'py>(
        &self,
        x: &Bound<'py, PyAny>,
        axis: isize,
        dtype: Option<Bound<'py, PyAny>>,
        threads: i64,
        gaps: Option<&str>,
        algorithm: &str,
        keep_latency: bool,
        full_output: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (frames, shape) = framed(x, &self.bank.layout(), axis, false)?;
        let request = Request::new(threads, gaps, algorithm, keep_latency)?;
        let (y, report) = fuse::fuse(&self.bank, &frames, shape, dtype.as_ref(), &request)?;
        if full_output { Ok((y, report).into_pyobject(x.py())?.into_any()) } else { Ok(y) }
    }

    /// A causal stream through the bank.
    ///
    /// `state`, that of another stream of the same bank, dtype and algorithm, makes it go on from there.
    #[pyo3(
        signature = (*, axis = -1, dtype = None, algorithm = "auto", state = None),
        text_signature = "($self, *, axis=-1, dtype=None, algorithm='auto', state=None)"
    )]
    fn stream(
        &self,
        axis: isize,
        dtype: Option<Bound<'_, PyAny>>,
        algorithm: &str,
        state: Option<&[u8]>,
    ) -> PyResult<Stream> {
        Stream::new(&self.bank, axis, dtype.as_ref(), algorithm)?.resumed(state)
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Self>().is_ok_and(|other| other.get().bank == self.bank)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
        Ok((slf.get_type().getattr("from_json")?, (slf.get().to_json()?,)))
    }

    fn __repr__(&self) -> String {
        let Self { bank } = self;
        let upper = bank.gamma.upper.map_or_else(|| "unknown".to_owned(), |upper| format!("{upper:.6}"));
        format!(
            "<hybank.Bank {}: {} channels, ratio {}, latency {}, gamma {upper}>",
            bank.method.name(),
            bank.channel_count(),
            bank.ratio,
            bank.latency
        )
    }

    fn _repr_html_<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("hybank._show")?.call_method1("html", (slf,))
    }

    fn __copy__<'py>(slf: &Bound<'py, Self>) -> Bound<'py, Self> {
        slf.clone()
    }

    fn __deepcopy__<'py>(slf: &Bound<'py, Self>, _memo: &Bound<'py, PyDict>) -> Bound<'py, Self> {
        slf.clone()
    }
}

impl Bank {
    /// The bank as a state space, if it is not too large for dense matrices.
    fn block(&self) -> PyResult<StateSpace> {
        let SynthesisFilters::Fir(taps) = &self.bank.filters else {
            let filters = design::filters::lifted(&self.bank.filters, self.bank.ratio).map_err(refused)?;
            return Ok(design::filters::to_block(&filters));
        };
        let lags = taps.iter().map(|f| f.len().div_ceil(self.bank.ratio)).max().unwrap_or(1);
        let states = lags.saturating_sub(1).saturating_mul(taps.len());
        if states > MOST_DENSE_STATES {
            return Err(refused(format!(
                "ss would have {states} states, and dense matrices of at most {MOST_DENSE_STATES} are made; use taps"
            )));
        }
        let filters = design::filters::lifted(&self.bank.filters, self.bank.ratio).map_err(refused)?;
        Ok(design::filters::to_block(&filters))
    }
}

/// Writes a file, which appears when it is whole.
fn write_file(path: &Path, bytes: &[u8], overwrite: bool) -> PyResult<()> {
    let mut file = AtomicFile::create(path, overwrite).map_err(file_error)?;
    file.write_all(bytes)?;
    file.commit().map_err(file_error)
}

/// The formats by name.
const FORMATS: [(&str, Exported); 6] = [
    ("c99", Exported::C99),
    ("csv", Exported::Csv),
    ("npz", Exported::Npz),
    ("mat", Exported::Mat),
    ("coe", Exported::Coe),
    ("mem", Exported::Mem),
];

/// Rows of `columns` numbers as a read-only array; a matrix without rows keeps its columns.
fn matrix(py: Python<'_>, rows: Vec<Vec<f64>>, columns: usize) -> PyResult<Bound<'_, PyArray2<f64>>> {
    let count = rows.len();
    let flat: Vec<f64> = rows.into_iter().flatten().collect();
    read_only(PyArray1::from_vec(py, flat).reshape([count, columns])?)
}

fn read_only<'py, T: Element, D: numpy::ndarray::Dimension>(
    array: Bound<'py, numpy::PyArray<T, D>>,
) -> PyResult<Bound<'py, numpy::PyArray<T, D>>> {
    let flags = PyDict::new(array.py());
    flags.set_item("write", false)?;
    array.call_method("setflags", (), Some(&flags))?;
    Ok(array)
}
