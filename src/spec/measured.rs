//! Filters that a spec gives by a measurement.

use super::FilterSpec;
use crate::units::{Decibels, Seconds};

/// What is known of a front end: the file of a measurement, and the size of the model.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredFilter {
    /// The file, as the spec names it: relative to the folder of the spec.
    pub path: String,
    /// What the file is.
    pub measurement: Measurement,
    /// Poles of the model.
    pub order: usize,
    /// A delay of the measurement that is not of the filter: a cable's, for example.
    pub deembed: Seconds,
}

/// The kinds of files.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Measurement {
    /// Touchstone; the scattering parameter, if it is named.
    Touchstone(Option<String>),
    /// Comma-separated frequency, decibels and degrees.
    Response,
}

/// The model of a measurement.
#[derive(Debug, Clone, PartialEq)]
pub struct FilterModel {
    /// In rad/s.
    pub filter: FilterSpec,
    /// The largest |model - measurement| over the largest gain, e, as 20 log10(1 + e).
    pub error: Decibels,
}

/// Makes models of measurements; the text of an error is shown at the filter.
pub type FilterModels<'a> = dyn Fn(&MeasuredFilter) -> Result<FilterModel, String> + 'a;

/// For texts that have no folder.
pub(crate) fn no_models(_: &MeasuredFilter) -> Result<FilterModel, String> {
    Err("a measured filter is read where the spec is a file; give the fitted filter instead".to_owned())
}
