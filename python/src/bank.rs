//! `hybank.Bank` and `hybank.load`.

use crate::arrays::{framed, matrix, read_only};
use crate::background;
use crate::errors::{choose, refused};
use crate::formats;
use crate::fuse::{self, FuseRequest, parse_algorithm};
use crate::hardware::{self, CircuitKeywords};
use crate::outputs::write_file;
use crate::pictures;
use crate::responses::{self, DoubleRows, Doubles, Matrices};
use crate::results::{FiguresReport, of_report, record};
use crate::sources;
use crate::stream::Stream;
use hybank::bank::{self, SynthesisFilters};
use hybank::captures::Converters;
use hybank::design;
use hybank::interchange::{Format as Exported, export};
use numpy::{Complex64, PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;
use std::sync::Arc;

/// The bank of a file.
#[pyfunction]
pub(crate) fn load(path: PathBuf) -> PyResult<Bank> {
    let text = sources::read(&path)?;
    sources::parse_bank(&text, &path.display().to_string()).map(Bank::from)
}

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

#[pymethods]
impl Bank {
    #[doc = include_str!("docs/Bank.from_json.rst")]
    #[staticmethod]
    fn from_json(text: &str) -> PyResult<Self> {
        sources::parse_bank(text, "bank").map(Self::from)
    }

    #[doc = include_str!("docs/Bank.to_json.rst")]
    fn to_json(&self) -> PyResult<String> {
        self.bank.to_json().map_err(refused)
    }

    #[doc = include_str!("docs/Bank.save.rst")]
    #[pyo3(signature = (path, *, overwrite = true))]
    fn save(&self, path: PathBuf, overwrite: bool) -> PyResult<()> {
        write_file(&path, self.to_json()?.as_bytes(), overwrite)
    }

    #[doc = include_str!("docs/Bank.export.rst")]
    #[pyo3(
        signature = (
            path, *, format, name = "bank", input_bits = None, output_bits = None, accumulator = None,
            clocks_per_frame = None, frames_per_clock = None, pipeline = None, loadable = false,
            testbench = None, random_frames = None, overwrite = true
        )
    )]
    #[allow(clippy::too_many_arguments, reason = "keywords of a Python function")]
    fn export(
        slf: &Bound<'_, Self>,
        path: PathBuf,
        format: &str,
        name: &str,
        input_bits: Option<u32>,
        output_bits: Option<u32>,
        accumulator: Option<u32>,
        clocks_per_frame: Option<u32>,
        frames_per_clock: Option<u32>,
        pipeline: Option<u32>,
        loadable: bool,
        testbench: Option<PathBuf>,
        random_frames: Option<u32>,
        overwrite: bool,
    ) -> PyResult<Option<Py<PyAny>>> {
        let format = choose("format", format, &FORMATS)?;
        let keywords = CircuitKeywords {
            output_bits,
            accumulator,
            clocks_per_frame,
            frames_per_clock,
            pipeline,
            loadable,
            testbench,
            random_frames,
        };
        if format == Exported::Verilog {
            let circuit = keywords.write(&slf.get().bank, &path, name, input_bits, overwrite)?;
            return record(slf.py(), &circuit).map(Some);
        }
        if format == Exported::Mem && loadable && keywords.testbench.is_none() {
            write_file(&path, keywords.load(&slf.get().bank, input_bits)?.as_bytes(), overwrite)?;
            return Ok(None);
        }
        keywords.check_none()?;
        let bytes = export(&slf.get().bank, format, name, input_bits).map_err(refused)?;
        write_file(&path, &bytes, overwrite)?;
        Ok(None)
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

    /// The fast rate in hertz.
    #[getter]
    fn fast_rate(&self) -> f64 {
        1.0 / self.bank.fast_period.0
    }

    /// Rms of the output noise for independent noise of unit rms on all slow samples.
    #[getter]
    fn noise_gain(&self) -> PyResult<f64> {
        design::noise_gain(&self.bank).map_err(refused)
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
        self.bank.proof.is_some()
    }

    /// The spec as it was asked, with all defaults filled in, as TOML; None for a bank made elsewhere.
    #[getter]
    fn spec(&self) -> PyResult<Option<String>> {
        self.bank.spec.as_ref().map(|spec| spec.to_toml().map_err(refused)).transpose()
    }

    /// The worst-case error with its bounds.
    #[getter]
    fn gamma<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        of_report(py, "Gamma", &self.bank.gamma)
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
        responses::state_space(py, &self.bank)
    }

    #[doc = include_str!("docs/Bank.error_response.rst")]
    #[pyo3(signature = (n = 512))]
    fn error_response<'py>(&self, py: Python<'py>, n: i64) -> PyResult<(Doubles<'py>, Doubles<'py>)> {
        responses::error_response(py, &self.bank, n)
    }

    #[doc = include_str!("docs/Bank.frequency_response.rst")]
    #[pyo3(signature = (n = 512))]
    fn frequency_response<'py>(
        &self,
        py: Python<'py>,
        n: i64,
    ) -> PyResult<(Doubles<'py>, DoubleRows<'py, Complex64>)> {
        responses::frequency_response(py, &self.bank, n)
    }

    #[doc = include_str!("docs/Bank.front_end_gains.rst")]
    #[pyo3(signature = (n = 512))]
    fn front_end_gains<'py>(&self, py: Python<'py>, n: i64) -> PyResult<(Doubles<'py>, DoubleRows<'py>)> {
        responses::front_end_gains(py, &self.bank, n)
    }

    #[doc = include_str!("docs/Bank.figures.rst")]
    fn figures<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let bank = Arc::clone(&self.bank);
        let found = background::run(py, None, move |_| FiguresReport::new(&bank))?;
        of_report(py, "Figures", &found.map_err(refused)?)
    }

    #[doc = include_str!("docs/Bank.pictures.rst")]
    fn pictures<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        pictures::pictures(py, &self.bank)
    }

    #[doc = include_str!("docs/Bank.plot.rst")]
    #[pyo3(signature = (ax = None, picture = "error"))]
    fn plot<'py>(
        slf: &Bound<'py, Self>,
        ax: Option<Bound<'py, PyAny>>,
        picture: &str,
    ) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("hybank._show")?.call_method1("plot", (slf, ax, picture))
    }

    #[doc = include_str!("docs/Bank.report.rst")]
    #[pyo3(
        signature = (path, captures = None, *, axis = -1, overwrite = true, full_scale = None),
        text_signature = "($self, path, captures=None, *, axis=-1, overwrite=True, full_scale=None)"
    )]
    fn report(
        slf: &Bound<'_, Self>,
        path: PathBuf,
        captures: Option<&Bound<'_, PyAny>>,
        axis: isize,
        overwrite: bool,
        full_scale: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let page = pictures::page(slf, captures, axis, full_scale, &path)?;
        write_file(&path, page.as_bytes(), overwrite)
    }

    #[doc = include_str!("docs/Bank.fuse.rst")]
    #[pyo3(
        signature = (
            x, *, axis = -1, dtype = None, threads = 1, gaps = false, algorithm = "auto", keep_latency = false,
            interleaved = None, rate = None, full_output = false, full_scale = None
        ),
        text_signature = "($self, x, *, axis=-1, dtype=None, threads=1, gaps=False, algorithm='auto', keep_latency=False, interleaved=None, rate=None, full_output=False, full_scale=None)"
    )]
    #[allow(clippy::too_many_arguments, reason = "keywords of a Python function")]
    fn fuse<'py>(
        slf: &Bound<'py, Self>,
        x: &Bound<'py, PyAny>,
        axis: isize,
        dtype: Option<Bound<'py, PyAny>>,
        threads: i64,
        gaps: bool,
        algorithm: &str,
        keep_latency: bool,
        interleaved: Option<usize>,
        rate: Option<f64>,
        full_output: bool,
        full_scale: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = x.py();
        if interleaved.is_some() || sources::is_foreign(x)? {
            let keywords = PyDict::new(py);
            keywords.set_item("axis", axis)?;
            keywords.set_item("dtype", dtype)?;
            keywords.set_item("threads", threads)?;
            keywords.set_item("gaps", gaps)?;
            keywords.set_item("algorithm", algorithm)?;
            keywords.set_item("keep_latency", keep_latency)?;
            keywords.set_item("rate", rate)?;
            keywords.set_item("full_output", full_output)?;
            keywords.set_item("full_scale", full_scale)?;
            return py.import("hybank._inputs")?.call_method("fuse", (slf, x, interleaved), Some(&keywords));
        }
        let bank = &slf.get().bank;
        let (frames, shape) = framed(x, &bank.layout(), axis, false)?;
        let shape = shape.scaled(Converters::from(&**bank).scale(formats::full_scale(full_scale)?));
        let request = FuseRequest {
            workers: fuse::workers(threads)?,
            gaps: fuse::gaps(py, bank, gaps)?,
            algorithm: parse_algorithm(algorithm)?,
            keep_latency,
            is_reported: full_output,
        };
        let fused = fuse::fuse(bank, &frames, shape, dtype.as_ref(), &request)?;
        if !full_output {
            return Ok(fused.y);
        }
        let report = fused.report(py, rate.unwrap_or(1.0 / bank.fast_period.0))?;
        Ok((fused.y, report).into_pyobject(py)?.into_any())
    }

    #[doc = include_str!("docs/Bank.fuse_as_hardware.rst")]
    #[pyo3(
        signature = (x, *, accumulator = 64, axis = -1, keep_latency = false),
        text_signature = "($self, x, *, accumulator=64, axis=-1, keep_latency=False)"
    )]
    fn fuse_as_hardware<'py>(
        slf: &Bound<'py, Self>,
        x: &Bound<'py, PyAny>,
        accumulator: u32,
        axis: isize,
        keep_latency: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        let bank = &slf.get().bank;
        let (frames, shape) = framed(x, &bank.layout(), axis, false)?;
        hardware::fuse(bank, &frames, shape, accumulator, keep_latency)
    }

    #[doc = include_str!("docs/Bank.stream.rst")]
    #[pyo3(
        signature = (*, axis = -1, dtype = None, algorithm = "auto", state = None, gaps = false, full_scale = None),
        text_signature = "($self, *, axis=-1, dtype=None, algorithm='auto', state=None, gaps=False, full_scale=None)"
    )]
    fn stream(
        slf: &Bound<'_, Self>,
        axis: isize,
        dtype: Option<Bound<'_, PyAny>>,
        algorithm: &str,
        state: Option<&[u8]>,
        gaps: bool,
        full_scale: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Stream> {
        let bank = &slf.get().bank;
        Stream::new(bank, axis, dtype.as_ref(), algorithm, fuse::gaps(slf.py(), bank, gaps)?)?
            .scaled(formats::full_scale(full_scale)?)
            .resumed(state)
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

/// The formats by name.
const FORMATS: [(&str, Exported); 7] = [
    ("c", Exported::C99),
    ("csv", Exported::Csv),
    ("mat", Exported::Mat),
    ("coe", Exported::Coe),
    ("mem", Exported::Mem),
    ("sos", Exported::Sos),
    ("verilog", Exported::Verilog),
];
