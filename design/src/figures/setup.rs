//! What the words about figures need to know of a bank.

use hybank_core::bank::{Bank, SynthesisFilters};
use hybank_core::spec::{Method, Spec};

/// How a bank was designed, and for what.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Setup {
    /// Of the design.
    pub method: Method,
    /// Whether the filters are recursive, so that taps do not limit them.
    pub is_recursive: bool,
    /// The ratio M of the rates.
    pub ratio: usize,
    /// The number of channels.
    pub channels: usize,
    /// Whether the spec has uncertain cut-offs, which the signal-to-noise ratio does not count.
    pub has_uncertain_cutoffs: bool,
}

impl Setup {
    pub(super) fn new(bank: &Bank, spec: &Spec) -> Self {
        let channels = spec.channels.len();
        let cutoffs = spec.uncertainty.as_ref().map(|table| table.cutoffs(channels));
        Self {
            method: bank.method,
            is_recursive: matches!(bank.filters, SynthesisFilters::StateSpace(_)),
            ratio: bank.ratio,
            channels,
            has_uncertain_cutoffs: cutoffs.is_some_and(|shares| shares.into_iter().any(|share| share > 0.0)),
        }
    }
}
