//! `hybank.verify` and `hybank.analyze`.

use crate::background;
use crate::bank::Bank;
use crate::errors::{refused, refused_in};
use crate::results::{Analysis, Verified};
use crate::sources;
use hybank::bank::{self, check_digest};
use hybank::design;
use hybank::units::Seconds;
use hybank::verify as checker;
use pyo3::prelude::*;
use std::sync::Arc;

/// Proves the gammas of a bank, from a path or a bank in memory.
#[pyfunction]
#[pyo3(signature = (bank, *, search = false))]
pub(crate) fn verify(bank: &Bound<'_, PyAny>, search: bool) -> PyResult<Verified> {
    let given = Given::new(bank)?;
    let certificate_in_bank = given.bank.proof.as_ref().is_some_and(|proof| proof.upper.is_some());
    let (bank_in, search) = (Arc::clone(&given.bank), search && !certificate_in_bank);
    let verified = background::run(bank.py(), None, move |_| proven(&bank_in, search))?;
    let verified = verified.map_err(|error| refused_in(&given.name, error))?;
    Ok(Verified::new(verified, given.digest, certificate_in_bank))
}

fn proven(bank: &bank::Bank, search: bool) -> Result<checker::Verified, String> {
    if search {
        design::prove(bank).map(|(_, verified)| verified).map_err(|error| error.to_string())
    } else {
        checker::verify(bank).map_err(|error| error.to_string())
    }
}

/// The error of a bank, with the delays of its spec or with others.
#[pyfunction]
#[pyo3(signature = (bank, *, delay_error = None))]
pub(crate) fn analyze(bank: &Bound<'_, PyAny>, delay_error: Option<Vec<f64>>) -> PyResult<Analysis> {
    let given = Given::new(bank)?;
    let errors: Vec<Seconds> = delay_error.unwrap_or_default().into_iter().map(Seconds).collect();
    if errors.iter().any(|error| !error.0.is_finite()) {
        return Err(refused("delay_error: errors of delays are finite numbers, in seconds"));
    }
    let bank_in = Arc::clone(&given.bank);
    let analysis = background::run(bank.py(), None, move |_| design::analyze(&bank_in, &errors))?;
    analysis.map(Analysis::from).map_err(|error| refused_in(&given.name, error))
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
