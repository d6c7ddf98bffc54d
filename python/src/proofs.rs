//! `hybank.verify` and `hybank.analyze`.

use crate::background;
use crate::bank::Bank;
use crate::errors::{refused, refused_in};
use crate::results::{FiguresReport, of_report};
use crate::sources;
use crate::values::{shares, times};
use hybank::bank::{self, check_digest};
use hybank::design::uncertainty::{BoxStudy, BoxWidths, ReferenceChannel};
use hybank::design::{self, DesignError};
use hybank::figures::KeyFigures;
use hybank::spec::ErrorBox;
use hybank::units::Seconds;
use hybank::verify as checker;
use pyo3::prelude::*;
use std::sync::Arc;

/// Proves the gamma of a bank, from a path or a bank in memory.
#[pyfunction]
pub(crate) fn verify<'py>(bank: &Bound<'py, PyAny>, search: bool) -> PyResult<Bound<'py, PyAny>> {
    let given = Given::new(bank)?;
    let certificate_in_file = given.bank.proof.is_some();
    let (bank_in, search) = (Arc::clone(&given.bank), search && !certificate_in_file);
    let verified = background::run(bank.py(), None, move |_| proven(&bank_in, search))?;
    let verified = verified.map_err(|error| refused_in(&given.name, error))?;
    let bank_in = &given.bank;
    let report = ProvenBounds {
        verified,
        digest: given.digest,
        certificate_in_file,
        worst_case: bank_in.gamma.worst_case,
    };
    of_report(bank.py(), "Verified", &report)
}

/// Proven bounds, and where the proof is from.
#[derive(serde::Serialize)]
struct ProvenBounds {
    #[serde(flatten)]
    verified: checker::Verified,
    digest: Option<bool>,
    certificate_in_file: bool,
    worst_case: Option<f64>,
}

fn proven(bank: &bank::Bank, search: bool) -> Result<checker::Verified, String> {
    if search {
        design::prove(bank).map(|(_, verified)| verified).map_err(|error| error.to_string())
    } else {
        checker::verify(bank).map_err(|error| error.to_string())
    }
}

/// The error of a bank, with the delays of its spec or with others, and over boxes of errors.
#[pyfunction]
pub(crate) fn analyze<'py>(
    bank: &Bound<'py, PyAny>,
    delay_error: Option<&Bound<'py, PyAny>>,
    delay_box: Option<&Bound<'py, PyAny>>,
    gain_box: Option<&Bound<'py, PyAny>>,
    cutoff_box: Option<&Bound<'py, PyAny>>,
    reference: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let py = bank.py();
    let given = Given::new(bank)?;
    let widths = BoxWidths {
        delay_box: times("delay_box", delay_box)?,
        gain_box: shares("gain_box", gain_box)?,
        cutoff_box: shares("cutoff_box", cutoff_box)?,
        reference: reference.map(reference_channel).transpose()?,
    };
    let own = times("delay_error", delay_error)?;
    let own: Vec<Seconds> = own.iter().map(|error| error.in_seconds(given.bank.fast_period)).collect();
    let errors = widths.error_box(&given.bank).map_err(refused)?;
    if errors.is_some() && !own.is_empty() {
        return Err(refused("delay_error: boxes lie around the bank's own delays; leave it out"));
    }
    let bank_in = Arc::clone(&given.bank);
    let found = background::run(py, None, move |_| Studied::new(&bank_in, &own, errors.as_ref()))?;
    of_report(py, "Analysis", &found.map_err(|error| refused_in(&given.name, error))?)
}

/// A channel from 1, or "none".
fn reference_channel(given: &Bound<'_, PyAny>) -> PyResult<ReferenceChannel> {
    match given.extract::<usize>() {
        Ok(channel) => Ok(ReferenceChannel::Channel(channel)),
        Err(_) if given.extract::<String>().is_ok_and(|text| text == "none") => Ok(ReferenceChannel::None),
        Err(_) => Err(refused("reference: give a channel, counted from 1, or \"none\"")),
    }
}

/// All that is known of the errors of a bank.
#[derive(serde::Serialize)]
struct Studied {
    #[serde(flatten)]
    analysis: design::Analysis,
    scale: design::GammaScale,
    figures: FiguresReport,
    with_errors: Option<KeyFigures>,
    worst_case: Option<BoxStudy>,
}

impl Studied {
    fn new(
        bank: &bank::Bank,
        delay_errors: &[Seconds],
        errors: Option<&ErrorBox>,
    ) -> Result<Self, DesignError> {
        let point = design::delay_point(bank, delay_errors)?;
        let with_errors = (!delay_errors.is_empty()).then(|| KeyFigures::new(&bank.with_errors(&point)));
        Ok(Self {
            analysis: design::analyze(bank, delay_errors)?,
            scale: design::GammaScale::new(bank, delay_errors)?,
            figures: FiguresReport::new(bank)?,
            with_errors: with_errors.transpose()?,
            worst_case: errors.map(|errors| BoxStudy::new(bank, errors)).transpose()?,
        })
    }
}

/// A bank, from a path or from memory.
struct Given {
    bank: Arc<bank::Bank>,
    name: String,
    /// The file has a digest, which matches; `None` from memory.
    digest: Option<bool>,
}

impl Given {
    fn new(given: &Bound<'_, PyAny>) -> PyResult<Self> {
        if let Ok(bank) = given.cast::<Bank>() {
            return Ok(Self {
                bank: Arc::clone(&bank.get().bank),
                name: "the bank".to_owned(),
                digest: None,
            });
        }
        let Some(path) = sources::path(given) else {
            return Err(refused("a bank is given as a hybank.Bank or as the path of its file"));
        };
        let (text, name) = (sources::read(&path)?, path.display().to_string());
        let bank = bank::Bank::from_json(&text, &name).map_err(refused)?;
        let digest = Some(check_digest(&text, &name).map_err(refused)?);
        Ok(Self { bank: Arc::new(bank), name, digest })
    }
}
