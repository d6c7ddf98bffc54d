//! The worst case over a box of errors: a proven bound, and the largest norm found.

use super::box_plant::BoxPlant;
use super::search::{BoxSearch, WorstErrors};
use crate::design::filters::FilterResponse;
use crate::design::limits::Stop;
use crate::design::{DesignError, Problem, prove};
use crate::lti::peak::Peak;
use hybank_core::bank::Bank;
use hybank_core::spec::{ErrorBox, ErrorPoint};
use hybank_core::units::{Hertz, RadiansPerSlowPeriod, Seconds};

/// The worst case over a box (h = 1).
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct BoxStudy {
    /// The box.
    pub errors: ErrorBox<Seconds>,
    /// No errors in the box make the norm larger; proven.
    pub upper: f64,
    /// The norm at `point` is at least this; proven where it is above rounding.
    pub attained: f64,
    /// The worst errors that a search found.
    pub point: ErrorPoint<Seconds>,
    /// The frequency of the worst case, modulo the slow rate.
    pub peak_hertz: Hertz,
}

impl BoxStudy {
    /// Of `bank` over `errors`.
    ///
    /// # Errors
    /// As [`crate::design::analyze`]; [`DesignError::Verify`] for a box that does not fit the bank;
    /// [`DesignError::NotCertified`] if no certificate of a norm was found.
    pub fn new(bank: &Bank, errors: &ErrorBox) -> Result<Self, DesignError> {
        let h = bank.fast_period;
        let upper = prove::worst_case(bank, errors, &Stop::default())?;
        let (point, peak) = worst_errors(bank, errors)?;
        let attained = prove::proven_gain(&bank.with_errors(&point), peak.frequency)?;
        Ok(Self {
            errors: errors.in_seconds(h),
            upper,
            attained: attained.unwrap_or(peak.gain).min(upper),
            point: point.in_seconds(h),
            peak_hertz: RadiansPerSlowPeriod(peak.frequency).in_hertz(bank.slow_period()),
        })
    }
}

/// The errors of the box with the largest norm found, and that.
fn worst_errors(bank: &Bank, errors: &ErrorBox) -> Result<(ErrorPoint, Peak), DesignError> {
    let filters = FilterResponse::new(&bank.filters, bank.ratio)?;
    let plant = BoxPlant::new(&Problem::of_bank(bank)?, errors)?;
    let search = BoxSearch::new(plant, filters.lags(), &filters.resonances())?;
    let WorstErrors { combination, peak } = search.worst(&bank.filters)?;
    Ok((search.plant.point(&combination), peak))
}
