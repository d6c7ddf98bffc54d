//! Errors of a bank.

use crate::messages::{Number, Quoted};
use crate::spec::{Refusal, SpecError, SpecProblem, WordLengths};

use super::{FORMAT, VERSION};

/// A bank that was refused.
pub type BankError = Refusal<BankProblem>;

/// The rule that a bank breaks, with the offending value and the remedy.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BankProblem {
    /// The text is not JSON.
    #[error("{}; is this a bank written by `hybank design`, and is it whole?", Quoted(.message))]
    Syntax {
        /// The parser's words, with line and column.
        message: String,
    },
    /// The JSON is not a bank.
    #[error(
        "the file says format \"{}\", a bank says \"{FORMAT}\"; give a file written by `hybank design`",
        Quoted(.found)
    )]
    Format {
        /// What the file says.
        found: String,
    },
    /// A bank of another version of the format.
    #[error(
        "the bank has version {found}, this program reads version {VERSION}; design it again, or update the program"
    )]
    Version {
        /// What the file says.
        found: usize,
    },
    /// The text is not a digest.
    #[error("\"{}\" is no digest, which is sha256: with 64 hexadecimal digits; leave it out", Quoted(.found))]
    Digest {
        /// What the file says.
        found: String,
    },
    /// The digest does not match the content.
    #[error(
        "it is not the digest of this content: something in the file was altered; take the original, or design the bank again"
    )]
    Altered,
    /// A key, a type or a number that is wrong in itself.
    #[error(transparent)]
    Value(#[from] SpecProblem),
    /// A NaN or an infinity.
    #[error("{value} is not a finite number and has no JSON; the design that made it has failed")]
    NotFinite {
        /// The offending value.
        value: f64,
    },
    /// A list of the wrong length.
    #[error("{found} {unit}, but there must be {expected}: {rule}")]
    Length {
        /// Entries found.
        found: usize,
        /// Entries expected.
        expected: usize,
        /// What is counted.
        unit: &'static str,
        /// Why, and what to do.
        rule: &'static str,
    },
    /// A tap that differs from the integer in the file.
    #[error(
        "the tap {tap:e} is not {integer} times {step:e}, as fixed_point says; take the original, or leave fixed_point out"
    )]
    NotTheInteger {
        /// The tap.
        tap: f64,
        /// The integer.
        integer: i64,
        /// 2^-fraction_bits.
        step: f64,
    },
    /// The word lengths of the integer taps differ from those in the spec.
    #[error(
        "the bank's integers have {bank}, its spec asks for {spec}; design the bank again, or set spec to null"
    )]
    WordsDiffer {
        /// In the bank.
        bank: WordLengths,
        /// In the spec.
        spec: WordLengths,
    },
    /// Taps where the method has none, or the reverse.
    #[error("a bank of the method {method} holds {expected} and no {found}; change one or the other")]
    Filters {
        /// Name of the method.
        method: &'static str,
        /// "taps" or "state_space".
        expected: &'static str,
        /// The other one.
        found: &'static str,
    },
    /// The bank and its spec contain different numbers.
    #[error(
        "the bank says {}, its spec says {}; they must agree, design the bank again or set spec to null",
        Number(*.bank), Number(*.spec)
    )]
    SpecDiffers {
        /// The bank's number.
        bank: f64,
        /// The spec's number.
        spec: f64,
    },
}

impl From<SpecError> for BankError {
    fn from(error: SpecError) -> Self {
        error.map(BankProblem::Value)
    }
}
