//! What calls give back: named numbers, and reports of the library as Python objects: what `--json` of the
//! command line prints, with the same names.

use crate::errors::refused;
use hybank::design;
use hybank::figures;
use hybank::verify::{self, BoundedBanks};
use numpy::PyArray1;
use pyo3::prelude::*;

/// A `hybank.Record` with the fields of a report. Numbers that are not finite are None.
pub(crate) fn record(py: Python<'_>, report: &impl serde::Serialize) -> PyResult<Py<PyAny>> {
    let text = serde_json::to_string(report).map_err(refused)?;
    Ok(py.import("hybank._results")?.call_method1("record", (text,))?.unbind())
}

/// The same of a report that may not be there.
pub(crate) fn any(py: Python<'_>, report: Option<&impl serde::Serialize>) -> PyResult<Option<Py<PyAny>>> {
    report.map(|report| record(py, report)).transpose()
}

/// The worst-case error gamma with its bounds, in normalised time; None where a bound is not known.
#[pyclass(frozen, get_all, module = "hybank")]
#[derive(FromPyObject)]
pub(crate) struct Gamma {
    /// Norm computed from the coefficients.
    pub(crate) norm: Option<f64>,
    /// An upper bound of the true norm.
    pub(crate) upper: Option<f64>,
    /// A lower bound for all banks of this method and size.
    pub(crate) lower: Option<f64>,
    /// A lower bound for all banks.
    pub(crate) noncausal: Option<f64>,
    /// An upper bound over all errors that the spec allows for.
    pub(crate) worst_case: Option<f64>,
    /// The same while the taps follow the delays; None for a bank whose taps do not.
    pub(crate) tracked: Option<f64>,
}

#[pymethods]
impl Gamma {
    fn __repr__(&self) -> String {
        let [norm, upper, lower, noncausal] = [self.norm, self.upper, self.lower, self.noncausal].map(known);
        format!("Gamma(norm={norm}, upper={upper}, lower={lower}, noncausal={noncausal})")
    }
}

/// As Python writes it.
fn known(bound: Option<f64>) -> String {
    bound.map_or_else(|| "None".to_owned(), |value| format!("{value:?}"))
}

/// A bank in the user's terms: ratios in decibels, frequencies in hertz.
#[pyclass(frozen, get_all, module = "hybank")]
#[derive(FromPyObject)]
pub(crate) struct Figures {
    /// The band of the figures: low and high end.
    band: (f64, f64),
    /// Signal-to-noise ratio with all parts that the spec states.
    snr: f64,
    /// Its parts: from the signal, from the converters' noise, from uncertain delays; None without.
    snr_signal: f64,
    snr_noise: Option<f64>,
    snr_delays: Option<f64>,
    /// With 16-bit converters; None where the spec states noise.
    snr_16_bits: Option<f64>,
    /// The largest image of a tone in the band and the frequency of the tone; None where a tone is lost.
    image: Option<f64>,
    image_frequency: Option<f64>,
    /// The largest error of gain and phase of a tone, relative to it, and the frequency of the tone.
    gain_error: Option<f64>,
    gain_error_frequency: Option<f64>,
    /// The simple ways, the best one first: name, channel (from 1) and signal-to-noise ratio.
    simple: Vec<(String, Option<usize>, f64)>,
    /// The gain over the best of them, for the same converters.
    gain_over_simple: Option<f64>,
    /// gamma for inputs of any spectrum; None for a spec without signal.
    any_input: Option<f64>,
}

impl From<figures::Figures> for Figures {
    fn from(figures: figures::Figures) -> Self {
        let simple = |way: &figures::SimpleFigure| (way.way.name().to_owned(), way.channel, way.snr_db.0);
        Self {
            band: (figures.band.low_hertz.0, figures.band.high_hertz.0),
            snr: figures.snr.total_db.0,
            snr_signal: figures.snr.signal_db.0,
            snr_noise: figures.snr.noise_db.map(|db| db.0),
            snr_delays: figures.snr.delays_db.map(|db| db.0),
            snr_16_bits: figures.snr_16_bits_db.map(|db| db.0),
            image: figures.image.map(|image| image.db.0),
            image_frequency: figures.image.map(|image| image.hertz.0),
            gain_error: figures.gain_error.map(|error| error.db.0),
            gain_error_frequency: figures.gain_error.map(|error| error.hertz.0),
            simple: figures.simple.iter().map(simple).collect(),
            gain_over_simple: figures.gain_over_simple().map(|db| db.0),
            any_input: figures.any_input,
        }
    }
}

#[pymethods]
impl Figures {
    fn __repr__(&self) -> String {
        let [image, gain_error] = [self.image, self.gain_error].map(known);
        format!("Figures(snr={:?}, image={image}, gain_error={gain_error})", self.snr)
    }
}

/// What happened while a bank was run on an array.
#[pyclass(frozen, get_all, module = "hybank")]
#[derive(FromPyObject)]
pub(crate) struct FuseReport {
    /// `direct`, `overlap-save`, `parallel-form` or `dense`.
    pub(crate) algorithm: String,
    /// Number type of the sums: `f32` or `f64`.
    pub(crate) numbers: String,
    /// Instruction set of the kernels.
    pub(crate) isa: String,
    /// Output samples dropped at the beginning.
    pub(crate) latency_dropped: usize,
    /// Output samples that saturated.
    pub(crate) clipped: u64,
    /// Input samples that were NaN or infinite and became 0.
    pub(crate) replaced: u64,
    /// Times that the state of a recursion was not finite and became 0.
    pub(crate) state_resets: u64,
    /// Missing samples, and the gaps (channel from 1, first frame, length); None unless gaps were filled.
    pub(crate) missing: Option<u64>,
    pub(crate) gaps: Option<Vec<(usize, u64, u64)>>,
    /// True where a missing sample affects the output; None unless gaps were filled.
    pub(crate) mask: Option<Py<PyArray1<bool>>>,
    /// What was known of the delays, a record per measurement; None unless they were followed.
    pub(crate) track: Option<Py<PyAny>>,
}

#[pymethods]
impl FuseReport {
    fn __repr__(&self) -> String {
        format!(
            "FuseReport(algorithm='{}', numbers='{}', isa='{}', latency_dropped={}, clipped={}, replaced={})",
            self.algorithm, self.numbers, self.isa, self.latency_dropped, self.clipped, self.replaced
        )
    }
}

/// Proven bounds of gamma.
#[pyclass(frozen, get_all, module = "hybank")]
#[derive(FromPyObject)]
pub(crate) struct Verified {
    /// No bank of the class `lower_banks` has a smaller gamma.
    lower: f64,
    /// `any`, `causal` or `fir_of_this_length`.
    lower_banks: String,
    /// Gamma of this bank is at most this.
    upper: f64,
    /// Gamma of this bank is at least this.
    attained: f64,
    /// No bank has a smaller gamma.
    noncausal: f64,
    /// Order of the certificate.
    states: usize,
    /// The file has a digest, and it matches; None for a bank in memory.
    digest: Option<bool>,
    /// The certificate came with the bank; otherwise it was found now.
    certificate_in_bank: bool,
}

impl Verified {
    pub(crate) fn new(verified: verify::Verified, digest: Option<bool>, certificate_in_bank: bool) -> Self {
        let verify::Verified { lower, lower_banks, upper, attained, noncausal, states } = verified;
        let lower_banks = match lower_banks {
            BoundedBanks::Any => "any",
            BoundedBanks::Causal => "causal",
            BoundedBanks::FirOfThisLength => "fir_of_this_length",
        }
        .to_owned();
        Self { lower, lower_banks, upper, attained, noncausal, states, digest, certificate_in_bank }
    }
}

#[pymethods]
impl Verified {
    fn __repr__(&self) -> String {
        format!(
            "Verified(lower={:?}, upper={:?}, lower_banks='{}')",
            self.lower, self.upper, self.lower_banks
        )
    }
}

/// The error of a bank with given delays.
#[pyclass(frozen, get_all, module = "hybank")]
#[derive(FromPyObject)]
pub(crate) struct Analysis {
    /// The worst-case gain, in normalised time.
    pub(crate) gamma: f64,
    /// Frequency of the worst case, modulo the slow rate.
    pub(crate) peak_hertz: f64,
    /// No bank has a smaller gamma with these front ends and delays; None where that is not known.
    pub(crate) noncausal: Option<f64>,
    /// Rms of the error for white noise of unit density at the analog input.
    pub(crate) rms_error: f64,
    /// Rms of the output noise for independent noise of unit rms on all slow samples.
    pub(crate) noise_gain: f64,
    /// Rms of the output noise for the noise of the converters in the spec.
    pub(crate) output_noise: f64,
    /// gamma of zero output and of plain interleaving, and the rms of the reference.
    pub(crate) scale: Option<Py<PyAny>>,
    /// A proven upper bound of gamma; None unless asked for, as all below.
    pub(crate) certified: Option<Py<PyAny>>,
    /// The worst case over the box of errors, proven from both sides.
    pub(crate) worst_case: Option<Py<PyAny>>,
    /// The derivatives of gamma with respect to the delays.
    pub(crate) sensitivity: Option<Py<PyAny>>,
    /// What jitter adds to gamma at most.
    pub(crate) jitter: Option<Py<PyAny>>,
    /// gamma along the delays of the box.
    pub(crate) sweep: Option<Py<PyAny>>,
}

impl From<design::Analysis> for Analysis {
    fn from(analysis: design::Analysis) -> Self {
        let design::Analysis { gamma, peak_hertz, noncausal, mean } = analysis;
        let design::MeanAnalysis { rms_error, noise_gain, output_noise } = mean;
        Self {
            gamma,
            peak_hertz: peak_hertz.0,
            noncausal,
            rms_error,
            noise_gain,
            output_noise,
            scale: None,
            certified: None,
            worst_case: None,
            sensitivity: None,
            jitter: None,
            sweep: None,
        }
    }
}

#[pymethods]
impl Analysis {
    fn __repr__(&self) -> String {
        format!(
            "Analysis(gamma={:?}, peak_hertz={:?}, noncausal={}, rms_error={:?}, noise_gain={:?}, output_noise={:?})",
            self.gamma,
            self.peak_hertz,
            known(self.noncausal),
            self.rms_error,
            self.noise_gain,
            self.output_noise
        )
    }
}

/// What virtual converters capture.
#[pyclass(frozen, get_all, module = "hybank")]
#[derive(FromPyObject)]
pub(crate) struct Capture {
    /// Slow samples, (N, T); complex for a complex signal.
    pub(crate) channels: Py<PyAny>,
    /// Samples of the ideal fast converter, M T of them, in line with the output of `Bank.fuse`.
    pub(crate) target: Py<PyAny>,
    /// Samples of each converter that were clipped at full scale.
    pub(crate) clipped: Vec<usize>,
}
