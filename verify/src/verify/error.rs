//! Errors of verification.

use super::{MAX_ANALOG_STATES, MAX_STATES};
use crate::analog::AnalogError;

/// The file states something that is not proven, or the bank cannot be checked.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum VerifyError {
    /// The file carries no spec, so the front ends are unknown.
    #[error(
        "spec: it is null, so the front ends are unknown and nothing can be proven; design the bank with its spec"
    )]
    NoSpec,
    /// A filter of the spec is not a valid front end.
    #[error("{place}: {source}")]
    FrontEnd {
        /// Key in the file.
        place: String,
        /// What is wrong with it.
        source: AnalogError,
    },
    /// The error system is too large.
    #[error(
        "the error system has {states} states, at most {MAX_STATES} are proven; bring latency and delays closer together, or \
         use fewer taps"
    )]
    TooLarge {
        /// Its states.
        states: usize,
    },
    /// A sample is older than the newest one by more than can be counted.
    #[error(
        "the delays and the latency lie {periods:e} slow periods apart, more than is counted exactly; bring them closer \
         together"
    )]
    TooLate {
        /// Whole slow periods between the newest sample and the oldest one.
        periods: f64,
    },
    /// Too many distinct filters.
    #[error(
        "spec: the distinct filters have {states} states together and a slow period {samples} samples; at most \
         {MAX_ANALOG_STATES} states, fewer with many samples, are proven; give channels that have the same filter the same text"
    )]
    TooManyFilters {
        /// States of all distinct filters.
        states: usize,
        /// M + N.
        samples: usize,
    },
    /// The file carries no certificate.
    #[error(
        "proof.upper: the file carries no proof of the upper end: design the bank with one, or search for one"
    )]
    NoCertificate,
    /// The certificate belongs to another system.
    #[error(
        "proof.upper.factor: it has {found} rows, but the error system of this bank has {states} states: the file was altered"
    )]
    CertificateSize {
        /// Rows given.
        found: usize,
        /// Rows needed.
        states: usize,
    },
    /// The certificate does not prove its gamma.
    #[error(
        "proof.upper: the certificate does not prove that these coefficients keep gamma = {gamma}: a coefficient, the spec, \
         the gamma or the certificate was altered; design the bank again"
    )]
    NotProven {
        /// The certificate's gamma.
        gamma: f64,
    },
    /// The certificate is valid, but its interval is too wide.
    #[error(
        "proof.upper: it proves a norm of {attained} to {upper} only, too wide for a statement; design the bank again"
    )]
    TooWide {
        /// Proven from below.
        attained: f64,
        /// Proven from above.
        upper: f64,
    },
    /// A stated number contradicts the proven bound or claims more than it.
    #[error(
        "{place}: the file states {stated}, but {relation} {proven} is proven; the file was altered, design the bank again"
    )]
    Disproved {
        /// Key in the file.
        place: &'static str,
        /// The number in the file.
        stated: f64,
        /// The relation of the proven number to the true one.
        relation: &'static str,
        /// The proven number.
        proven: f64,
    },
    /// The stated worst case is not proven.
    #[error(
        "gamma.worst_case: it is not proven that the errors of spec.uncertainty keep gamma within {stated}: a coefficient, the \
         spec or the number was altered; design the bank again"
    )]
    WorstCase {
        /// The number in the file.
        stated: f64,
    },
    /// A box of errors that does not fit the bank.
    #[error("the box of errors cannot be judged: {rule}")]
    ErrorBox {
        /// What is wrong with it, and the rule.
        rule: String,
    },
    /// A witness proves nothing.
    #[error("{place}: this witness proves nothing; the file was altered, design the bank again")]
    Void {
        /// Key in the file.
        place: &'static str,
    },
}
